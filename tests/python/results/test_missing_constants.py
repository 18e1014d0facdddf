"""What fits of equations say where gravity, trim or an offset has no constant."""

import modfun as mf
import numpy as np
import pytest
from flights import TRUTH, flown, warned

WITHOUT = mf.Equation(
    ["alpha' = Za*alpha + q + Zd*de", "q' = Ma*alpha + Mq*q + Md*de"], outputs=["alpha", "q"], inputs=["de"]
)
SINGLE = mf.Equation("y'' + a1*y' + a2*y = b0*u")
CURE = 'Fit with trend="constant", or write a constant into the equation.'


def trimmed(seed, constants, **words):
    """A record that begins at the rest to which constants in both equations lead."""
    a = [[TRUTH["Za"], 1], [TRUTH["Ma"], TRUTH["Mq"]]]
    rest = tuple(-np.linalg.solve(a, constants))
    return flown(seed, trim=rest, forces=lambda t, rng: np.outer(constants, np.ones(t.size)), **words)


@pytest.mark.parametrize("constants", [(0.002, 0.0), (0.01, 0.0), (0.05, 0.1), (0.16, 0.0)])
def test_gravity_that_equations_lack_is_named_and_its_cure_works(constants):
    """Derivatives within 4.5 errors with the cure, one set of five in 20,000; fit and check agree."""
    for seed in range(20):
        rec = trimmed(seed, constants)
        fit, text = warned(rec, WITHOUT)
        assert CURE in text
        assert any(text.removeprefix("fit: ") == one for one in fit.check())
        cured, silent = warned(rec, WITHOUT, trend="constant")
        assert silent == ""
        assert all(abs(cured[name] - value) < 4.5 * cured.bse[name] for name, value in TRUTH.items())


def test_an_offset_of_one_output_is_named():
    for seed in range(20):
        rec = mf.simulate(
            mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=20, intervals=512, nsr=0.05,
            initial_state=[0.6, -2], seed=seed,
        )  # fmt: skip
        text = warned(rec.assign(y=rec["y"] + 0.1), SINGLE)[1]
        assert CURE in text
        assert "the residuals from 0." in text


def test_equations_that_need_no_constant_are_not_warned_of():
    """A rate of 6 % would be seen in 50 records with 95 %."""
    for seed in range(50):
        assert warned(flown(400 + seed), WITHOUT)[1] == ""


def test_a_gust_is_no_constant():
    for seed in range(20):
        text = warned(flown(seed, gust=0.01), WITHOUT)[1]
        assert CURE not in text
