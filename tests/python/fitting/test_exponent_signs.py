"""Exponents whose other sign makes the same equations are positive, and the other one is named."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

HILL = "y' = b + V*u**n/(K**n + u**n) - d*y"
TRUE = {"b": 0.2, "V": 3.0, "n": 2.4, "K": 1.2, "d": 0.8}


@pytest.fixture(scope="module")
def records():
    rec = mf.simulate(
        mf.Equation(HILL).model(TRUE),
        input="1 + 0.9*sin(0.3*t)",
        duration=40.0,
        intervals=400,
        nsr=0.0,
        initial_state=[1.0],
    )
    size = 0.02 * np.std(rec["y"])
    return [
        rec.assign(y=rec["y"] + size * np.random.default_rng(seed).standard_normal(401)) for seed in (0, 1, 2)
    ]


def test_of_two_signs_the_positive_exponent_is_returned_and_the_other_named(records):
    for rec in records:  # all three had been the mirror
        fit = mf.fit(rec, mf.Equation(HILL))
        assert fit["n"] == pytest.approx(2.4, abs=0.1)
        assert fit["V"] == pytest.approx(3.0, abs=0.1)
        assert f"With b = {fit['b'] + fit['V']:.4g}, V = {-fit['V']:.4g}, n = {-fit['n']:.4g}" in fit.check()


def test_a_bound_chooses_the_other_sign_and_silences_the_remark(records):
    fit = mf.fit(records[0], mf.Equation(HILL, params={"n": mf.Free(max=0)}))
    assert fit["n"] == pytest.approx(-2.4, abs=0.1)
    assert "the other sign of n" not in fit.check()


def test_identifiable_names_the_other_sign():
    found = mf.Equation(HILL).identifiable()
    assert found
    assert "n: its other sign makes the same equations with other values of b and V" in str(found)
    assert "sign" not in str(mf.Equation("y' = V*u**n/(K**n + u**n) - d*y").identifiable())  # b = 0 tells


def test_the_mirror_image_of_a_pendulum_is_turned_upright():
    """With L = -0.5 and o = 3.24 the equation is the same, and one of eight records ended there."""
    t = np.arange(0, 12, 0.02)
    y = solve_ivp(
        lambda t, x: [x[1], -0.15 * x[1] - 9.81 / 0.5 * np.sin(x[0])], (0, 12), [2.8, 0], t_eval=t, rtol=1e-9
    ).y[0]
    noise = 0.02 * y.std() * np.random.default_rng(6).standard_normal(t.size)
    model = mf.Equation("th'' + d*th' + g/L*sin(th - o) = 0", outputs=["th"], params={"g": 9.81})
    fit = mf.fit(mf.Record(y=0.1 + y + noise, t=t, outputs=["th"], units={"th": "rad"}), model)
    assert np.all(np.abs(fit.params - [0.15, 0.5, 0.1]) < 4 * fit.bse)
