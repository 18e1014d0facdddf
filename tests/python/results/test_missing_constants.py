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


POWERS = {"u**3": lambda u: u**3, "u**2": np.square, "u*abs(u)": lambda u: u * abs(u), "sin(u)": np.sin}


def about_a_point(seed: int, text: str, *, point: float, mean: float) -> mf.Record:
    """y' + 0.8 y = 2 g(u + point), with u recorded as deviations from that point, and y from its mean."""
    rng, t = np.random.default_rng(seed), 0.05 * np.arange(1001)
    u = np.sin(2 * np.pi * np.outer(t, np.geomspace(0.02, 0.6, 9)) + rng.uniform(0, 6.28, 9)).sum(1) / 3
    clean = mf.tf([2.0], [1, 0.8]).simulate(u=POWERS[text](u + point), dt=0.05, intersample="smooth")
    y = clean + 0.03 * clean.std() * rng.standard_normal(t.size)
    return mf.Record(y=y - mean * clean.mean(), u=u, dt=0.05, intersample="smooth")


@pytest.mark.parametrize("text", POWERS)
def test_an_input_about_an_operating_point_is_named_beside_an_output_about_its_mean(text):
    """A constant alone, a term in u or in y'' and u' was named in all of these."""
    equation = mf.Equation(f"y' = -a*y + b*{text}")
    for seed in range(4):
        said = warned(about_a_point(seed, text, point=0.6, mean=1.0), equation)[1]
        assert "Write (u - c) for u in the equation" in said
        assert 'and fit with trend="constant" beside it: c = -0.' in said
        shifted = mf.Equation(f"y' = -a*y + b*{text.replace('u', '(u - c)')}", params={"c": mf.Free(0)})
        fit, silent = warned(about_a_point(seed, text, point=0.6, mean=1.0), shifted, trend="constant")
        assert silent == ""
        assert abs(fit["c"] + 0.6) < 4.5 * fit.bse["c"]
        assert warned(about_a_point(seed, text, point=0.0, mean=0.0), equation)[1] == ""
