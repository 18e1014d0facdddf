"""Uneven samples: what sums over them have more than integrals is no error of the estimates."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun._core import simulate_uneven

TRUE = np.array([1.6, 4.0, 4.0])
MODEL = mf.TransferFunction(poles=2, zeros=0)


def steps_of(kind, n, h, rng):
    """Sampling steps of a data historian, of a jittered clock with pauses, and of random instants."""
    if kind == "whole seconds":
        return h * rng.integers(1, 11, n) / 5.5
    if kind == "pauses":
        steps = h * (1 + 0.2 * rng.uniform(-1, 1, n))
        steps[[n // 4, n // 2, 3 * n // 4]] *= 8
        return steps
    return rng.exponential(h, n) + 0.02 * h


def record(kind, word, h, seed, nsr=0.02, n=300):
    """A system at rest under levels, or straight lines between knots, of 5 to 19 samples."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0], np.cumsum(steps_of(kind, n, h, rng))])
    knots = np.unique(np.append(np.cumsum(rng.integers(5, 20, n)).clip(0, n), [0, n]))
    levels = rng.normal(size=knots.size)
    levels[0] = 0.0
    at = np.searchsorted(knots, np.arange(n + 1), side="right") - 1
    u = levels[at] if word == "zoh" else np.interp(t, t[knots], levels)
    a, b = np.array([[0.0, 1.0], [-4.0, -1.6]]), np.array([[0.0], [4.0]])
    c, d = np.array([[1.0, 0.0]]), np.zeros((1, 1))
    y = simulate_uneven(a, b, c, d, np.zeros(2), u[None], [word == "zoh"], t).ravel()
    return mf.Record(y=y + nsr * y.std() * rng.normal(size=y.size), u=u, t=t, intersample=word)


@pytest.mark.parametrize(
    ("kind", "word", "h"),
    [("whole seconds", "zoh", 0.4), ("pauses", "foh", 0.1), ("pauses", "zoh", 0.1), ("random", "zoh", 0.2)],
)
def test_intervals_of_uneven_records_hold_the_true_values(kind, word, h):
    inside = []
    for seed in range(8):
        fit = mf.fit(record(kind, word, h, seed), MODEL)
        low, high = np.asarray(fit.conf_int()).T
        inside.append((low <= TRUE) & (high >= TRUE))
    assert np.mean(inside) > 0.8  # of 60 seeds 0.90 to 1.00


def test_without_noise_the_estimate_is_exact():
    fit = mf.fit(record("pauses", "zoh", 0.1, 1, nsr=0.0), MODEL)
    np.testing.assert_allclose(fit.params, TRUE, rtol=1e-5)


def test_an_integrator_and_a_direct_input_are_fitted_too():
    rng = np.random.default_rng(5)
    t = np.concatenate([[0.0], np.cumsum(steps_of("random", 300, 0.1, rng))])
    u = np.repeat(rng.normal(size=31), 10)[:301]
    one = np.ones((1, 1))
    y = simulate_uneven(-one, one, one, 0.5 * one, np.zeros(1), u[None], [True], t).ravel()
    noise = 0.01 * y.std() * rng.normal(size=y.size)
    fit = mf.fit(mf.Record(y=y + noise, u=u, t=t, intersample="zoh"), mf.TransferFunction(poles=1, zeros=1))
    assert np.all(np.abs(fit.params - [1.0, 0.5, 1.5]) < 4 * fit.bse)
    y = simulate_uneven(0 * one, one, one, 0 * one, np.zeros(1), u[None], [True], t).ravel()
    noise = 0.01 * y.std() * rng.normal(size=y.size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mf.fit(
            mf.Record(y=y + noise, u=u, t=t, intersample="zoh"), mf.TransferFunction(poles=1, zeros=0)
        )
    assert np.all(np.abs(fit.params - [0.0, 1.0]) < 4 * fit.bse)


def test_levels_of_uneven_records_change_nothing():
    rec = record("pauses", "zoh", 0.4, 3)
    first, far = mf.fit(rec, MODEL), mf.fit(rec.assign(y=rec["y"] + 1e4, u=rec["u"] - 1e3), MODEL)
    np.testing.assert_allclose(far.params, first.params, rtol=0, atol=0.01 * first.bse.min())
