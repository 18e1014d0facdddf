"""Noise levels of several records are learnt with the parameters, but none at the cost of the others."""

import warnings

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp

T = np.arange(0, 40, 0.05)
STARTS = ([1.0, 0.0], [-1.0, 0.2], [0.1, 0.0])


def records(seed):
    """Three motions of a forced pendulum with a cubic spring, with 10 % white noise."""

    def rate(t, x):
        return [x[1], 0.5 * np.cos(1.2 * t) - 0.3 * x[1] + x[0] - x[0] ** 3]

    draw = np.random.default_rng(seed)
    found = []
    for start in STARTS:
        y = solve_ivp(rate, (0, T[-1]), start, t_eval=T, rtol=1e-9, atol=1e-11, method="LSODA").y[0]
        found.append(mf.Record(y=y + 0.1 * y.std() * draw.standard_normal(T.size), t=T))
    return found


def test_no_level_runs_to_nothing_while_others_rise():
    """A lag that is not there fitted one record with a tenth of its noise, and was advised."""
    three = records(5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit = mf.fit(three, mf.Equation("y'' + d*y' + a*y + b*y**3 = g*cos(1.2*t)", outputs=["y"]))
    z = "(y + lag*y')"
    lagged = mf.Equation(f"{z}'' + d*{z}' + a*{z} + b*{z}**3 = g*cos(1.2*t)", outputs=["y"])
    other = fit.again(fit.records, lagged, fit.options.replace(band=fit.band))
    assert np.all(other.levels > other.seen / 3)
    assert other.bic > fit.bic
