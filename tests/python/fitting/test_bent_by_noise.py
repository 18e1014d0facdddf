"""Parameters inside functions, a*sin(k*y), with wide bounds: false minima, where noise bends the terms."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

FREE = {"d": 0.8, "a": 4.0, "k": 1.3, "b": 3.0}


def swing(seed, nsr, shape=np.sin):
    """A driven oscillator whose spring is a sine; k times the noise of 20 % is 0.6."""
    t = np.linspace(0, 20, 601)

    def u(s):
        return np.sin(0.07 * s**2) + 0.5 * np.sin(0.7 * s)

    def rates(s, x):
        return [x[1], -0.8 * x[1] - 4.0 * shape(1.3 * x[0]) + 3.0 * u(s)]

    y = solve_ivp(rates, (0, 20), [0, 0], t_eval=t, rtol=1e-9, atol=1e-9).y[0]
    noise = nsr * y.std() * np.random.default_rng(seed).normal(size=t.size)
    return mf.Record(y=y + noise, u=u(t), t=t)


@pytest.mark.parametrize("most", [20.0, 50.0])
@pytest.mark.parametrize("nsr", [0.01, 0.05, 0.1])
def test_wide_bounds_do_not_lead_to_a_term_that_noise_explains(most, nsr):
    """k = 15 to 50 has less than a tenth of the cost that 1.3 has, and was returned without a word."""
    model = mf.Equation("y'' + d*y' + a*sin(k*y) = b*u", params={"k": mf.Free(min=0, max=most)})
    for seed in range(4):
        fit = mf.fit(swing(seed, nsr), model)
        assert fit.success
        assert abs(fit["k"] - 1.3) < 5 * fit.bse["k"]
        assert fit.bend < 0.5


def test_a_false_minimum_that_is_all_there_is_is_warned_of():
    model = mf.Equation("y'' + d*y' + a*sin(k*y) = b*u", params={"k": mf.Free(min=15, max=60)})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", mf.ModfunWarning)
        fit = mf.fit(swing(0, 0.1), model)
    assert fit.bend > 0.5
    assert str(caught[0].message).startswith("fit: The noise of the outputs moves the terms with k inside")
    assert "First try closer bounds, params={'k': mf.Free(start, min=..., max=...)}" in str(caught[0].message)


def test_a_relay_that_noise_switches_is_no_false_minimum():
    """tanh is steep for the noise at any k that fits: the best of such ends is returned, as before."""
    model = mf.Equation("y'' + d*y' + a*tanh(k*y) = b*u", params={"k": mf.Free(min=0, max=50)})
    fit = mf.fit(swing(1, 0.05, np.tanh), model)
    assert all(abs(fit[name] - value) < 4 * fit.bse[name] for name, value in FREE.items())


def test_the_bend_is_what_the_formula_says():
    """Of sin(ky): tan(kσ/2), σ the level that weighed the lines, times the sizes of sin(ky) over cos(ky)."""
    model = mf.Equation("y'' + d*y' + a*sin(k*y) = b*u", params={"k": mf.Free(1.3, min=0.5, max=3)})
    fit = mf.fit(swing(2, 0.1), model)
    sizes = [np.linalg.norm(f(fit["k"] * swing(2, 0.1).y)) for f in (np.sin, np.cos)]
    tangent = np.tan(fit["k"] * fit.levels[0, 0] / 2)
    assert fit.bend == pytest.approx(tangent * sizes[0] / sizes[1], rel=1e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a sine is no cubic
        assert mf.fit(swing(2, 0.1), mf.Equation("y'' + d*y' + a*y + c*y**3 = b*u")).bend == 0.0
