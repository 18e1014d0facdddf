"""Frequency responses of loops whose sweep reaches frequencies at the end of the record only."""

import warnings

import modfun as mf
import numpy as np
import pytest

DT, SAMPLES = 1e-3, 6000
PLANT = mf.tf([50], [1, 20])


def loop(seed, rest, closed=True):
    """A speed loop with a sweep of 1 to 120 Hz on its input, and rest before and after it."""
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) * DT
    span = SAMPLES * DT - 2 * rest
    at = np.clip(t - rest, 0, span)
    phase = 2 * np.pi * span / np.log(120) * (np.exp(at / span * np.log(120)) - 1)
    sweep = 1.5 * np.sin(phase) * ((t >= rest) & (t <= rest + span))
    keep, noise = np.exp(-20 * DT), 0.3 * rng.standard_normal(SAMPLES)
    u, y, x = np.empty(SAMPLES), np.empty(SAMPLES), 0.0
    for k in range(SAMPLES):
        y[k] = x + noise[k]
        u[k] = sweep[k] - 0.1 * y[k] * closed
        x = keep * x + 2.5 * (1 - keep) * u[k]
    return mf.Record(y=y, u=u, dt=DT, intersample="zoh")


@pytest.mark.parametrize("method", ["lrm", "lpm"])
@pytest.mark.parametrize("seed", range(3))
def test_lines_on_which_a_loop_leaves_noise_alone_are_nan(seed, method):
    """They were up to 80 times the gain, with standard errors of 2 %."""
    with pytest.warns(mf.ModfunWarning, match="noise that a loop feeds back"):
        found = mf.frf(loop(seed, 0.0), band=700.0, method=method)
    off = np.abs(found.response[0, 0] - np.polyval([50], 0) / (1j * found.omega + 20))
    known = np.isfinite(off)
    assert not np.any(known[found.omega > 600])
    assert np.mean(known[(found.omega > 20) & (found.omega < 400)]) == 1.0
    assert np.all(off[known] < 6 * found.radius()[0, 0][known])


def test_with_rest_all_gains_are_kept():
    for seed in range(3):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = mf.frf(loop(seed, 0.75), band=700.0)
        assert np.all(np.isfinite(found.response))


def test_without_the_loop_gains_near_the_ends_are_kept_with_large_errors():
    for seed in range(3):
        with pytest.warns(mf.ModfunWarning, match="let the record rest before and after the sweep"):
            found = mf.frf(loop(seed, 0.0, closed=False), band=700.0)
        assert np.all(np.isfinite(found.response))
