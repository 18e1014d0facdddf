"""Noise that goes with the reading of a sensor: its test, its errors, and the weights that are advised."""

from __future__ import annotations

import re
import warnings
from typing import Any

import modfun as mf
import numpy as np
import pytest

TWO, TRUTH = mf.TransferFunction(poles=2, zeros=0), np.array([0.2, 1.0, 1.0])
CLEAN: Any = mf.simulate(
    mf.tf([1], [1, 0.2, 1]), input="sin(t**2/5)", duration=30.0, intervals=512, initial_state=[0.5, 0]
)
RMS = np.sqrt(np.mean(CLEAN.y**2))
LEVEL = 0.05 * (0.3 * RMS + np.abs(CLEAN.y[0]))


def many(count: int, level: Any) -> mf.Batch:
    noise = level * np.random.default_rng(11).standard_normal((count, 1, CLEAN.t.size))
    return mf.Batch(y=CLEAN.y + noise, u=CLEAN.u, dt=CLEAN.dt, intersample=CLEAN.intersample)


@pytest.mark.statistics
def test_intervals_hold_where_noise_goes_with_the_reading() -> None:
    """100 records of a light mode: 0.87, 0.96 and 0.84 before; 0.92 is below 0.84 in 1 of 200."""
    fits = mf.fit_many(many(100, LEVEL), TWO, progress=False)
    limits = fits.conf_int()
    assert fits.changing.mean() > 0.98
    assert np.all(np.mean((limits[..., 0] < TRUTH) & (limits[..., 1] > TRUTH), axis=0) > 0.84)


@pytest.mark.statistics
def test_even_noise_of_a_light_mode_is_left_alone() -> None:
    """200 records: at most 8 of a test at 0.01, which a level of 0.01 exceeds in 1 of 5,000."""
    assert mf.fit_many(many(200, 0.1 * RMS), TWO, progress=False).changing.sum() <= 8


def test_the_level_and_the_weights_are_in_the_check() -> None:
    rec = many(1, LEVEL)[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        fit = mf.fit(rec, TWO)
        said = str(fit.check())
    assert "its level goes with the size of y and varies by a factor of" in said
    assert "The standard errors allow for it" in said
    found = re.search(r"rec\.weigh\(sigma=(.*)\)\.", said)
    assert found is not None
    sigma = eval(found[1], {"np": np, "fit": fit, "rec": rec})
    np.testing.assert_allclose(sigma[0], LEVEL, rtol=0.5)
    weighted = mf.fit(rec.weigh(sigma=sigma), TWO)
    assert np.all(weighted.bse < fit.bse)


def test_noise_that_changes_in_time_is_still_told_by_time() -> None:
    step = np.where(CLEAN.t > 18.0, 4.0, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        said = str(mf.fit(many(1, 0.03 * RMS * step)[0], TWO).check())
    assert "changes over the record: its level in time" in said
