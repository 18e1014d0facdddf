"""Fits of equations from which a hidden signal is eliminated try no neighbours that amplify noise as well."""

import warnings
from dataclasses import replace

import modfun as mf
import numpy as np
import pytest
from modfun.equations.symbolic.smoothing import smoothed
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from modfun.results.check import check, warnings_of
from scipy.signal import savgol_coeffs, savgol_filter

TANKS = mf.Equation(
    ["h1' = b*v - c1*sqrt(h1)", "h2' = c1*sqrt(h1) - c2*sqrt(h2)"],
    outputs=["h2"], inputs=["v"], hidden=["h1"],
)  # fmt: skip
TRUTH = {"b": 0.213, "c1": 0.514, "c2": 0.514}


def levels(dt):
    """The pump, held for 20 s, and the lower level over 600 s, by Runge-Kutta steps of 0.05 s."""
    t = np.arange(0, 600.01, dt)
    held = np.random.default_rng(5).uniform(5.5, 9.5, 31)
    v = held[np.minimum((t + 1e-9) // 20, 30).astype(int)]
    b, c1, c2 = TRUTH.values()
    h, step = np.empty(t.size), 0.05

    def rates(x, u):
        out = c1 * np.sqrt(x[0])
        return np.array([b * u - out, out - c2 * np.sqrt(x[1])])

    x = np.array([12.0, 10.0])
    for k in range(t.size):
        h[k] = x[1]
        for _ in range(round(dt / step)):
            k1 = rates(x, v[k])
            x = x + step * rates(x + step / 2 * k1, v[k])
    return v, h


@pytest.mark.parametrize("seed", [6, 7])
def test_two_tanks_of_which_one_is_measured_make_few_fits(seed):
    """They made some sixty, in minutes, though none of them is better off."""
    v, h = levels(0.5)
    rec = mf.Record(
        y={"h2": h + 0.05 * np.random.default_rng(seed).standard_normal(h.size)}, u={"v": v}, dt=0.5
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(rec, TANKS)
    made = []

    def again(*given, **told):
        made.append(given)
        return fit.again(*given, **told)

    fresh = replace(fit, again=again)
    warnings_of(fresh)
    assert len(made) <= 2
    check(fresh, "it")
    assert len(made) <= 8


@pytest.mark.parametrize("order", [0, 1, 3])
def test_smoothed_derivatives_are_those_of_savitzky_and_golay(order):
    t = 0.5 * np.arange(400)
    values = np.sin(t / 9) + 0.01 * np.random.default_rng(1).standard_normal(t.size)
    found = smoothed(values, t, order)
    own = smoothed(values, t, order, gain=True)[0]
    fits = [
        window
        for window in range(7, 101, 2)
        if np.allclose(found, savgol_filter(values, window, 5, deriv=order, delta=0.5), rtol=1e-6, atol=1e-9)
    ]
    assert len(fits) == 1
    assert np.isclose(own, savgol_coeffs(fits[0], 5, deriv=order, delta=0.5)[fits[0] // 2], atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_two_tanks_of_which_one_is_measured_are_led_to_their_response(seed):
    """Of ten records intervals of b and c2 held the truth in five, in silence."""
    v, h = levels(2.0)
    noise = 0.05 * np.random.default_rng(seed).standard_normal(h.size)
    rec = mf.Record(y={"h2": h + noise}, u={"v": v}, dt=2.0)
    sums = fit_quietly((rec,), TANKS, Options())
    assert sums.sigma < 1.5 * sums.high_band_sigma
    assert "First measure h1, or fit the response" in sums.remarks()[0]
    fit = mf.fit(rec, TANKS)
    assert fit.by_response
    # Three parameters: beyond 4 of their errors once in 5,000 records.
    assert all(
        abs(fit[name] - TRUTH[name]) < 4 * se for name, se in zip(fit.param_names, fit.bse, strict=True)
    )
