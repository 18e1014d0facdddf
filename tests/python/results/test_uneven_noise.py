"""Noise that changes over a record: its test, its errors, and what is said of it."""

import warnings
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.base.gamma_regression import smooth_level
from modfun.results.uneven_noise import uneven
from scipy.signal import lfilter

SYSTEM, TWO = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
CLEAN = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=256)
TRUTH = np.array([3.0, 8.0, 5.0])
STEP = np.where(CLEAN.t > 6.0, 4.0, 1.0)


def fits(count: int, level: Any = 1.0, pole: float = 0.0) -> list[mf.Fit]:
    made = []
    for seed in range(count):
        drawn = np.random.default_rng([21, seed]).standard_normal(CLEAN.t.size + 300)
        noise = level * lfilter([np.sqrt(1 - pole**2)], [1, -pole], drawn)[300:]
        noise *= 0.1 * np.sqrt(np.mean(CLEAN.y**2) / np.mean(np.square(level)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            made.append(mf.Estimator(TWO)(CLEAN.assign(y=CLEAN["y"] + noise)))
    return made


def covered(made: list[mf.Fit]) -> Any:
    limits = np.array([fit.conf_int() for fit in made])
    return np.mean((limits[:, :, 0] < TRUTH) & (limits[:, :, 1] > TRUTH), axis=0)


def test_a_smooth_level_is_found_from_squares() -> None:
    x = np.linspace(0.0, 1.0, 2000)
    truth = np.exp(1.5 * np.sin(4 * x))
    squares = truth * np.random.default_rng(2).chisquare(1, x.size)
    np.testing.assert_allclose(smooth_level(squares, x, 1.0)[:1950], truth[:1950], rtol=0.35)
    gaps = np.where(x > 0.5, 1.0, 0.0)
    wild = np.where(x > 0.5, squares, 1e9)
    assert smooth_level(wild, x, gaps)[-1] == pytest.approx(truth[-1], rel=0.5)
    np.testing.assert_array_equal(smooth_level(np.zeros(5), np.arange(5.0), 1.0), np.zeros(5))


@pytest.mark.statistics
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_even_noise_of_any_colour_is_left_alone(pole: float) -> None:
    """200 records: at most 8 of a test at 0.01, which a level of 0.01 exceeds in 1 of 5,000."""
    made = fits(200, pole=pole)
    assert sum(fit._uneven is not None for fit in made) <= 8
    assert all(fit._uneven is not None or np.array_equal(fit.cov_params(), fit.cov_spectral) for fit in made)


@pytest.mark.statistics
@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_intervals_hold_where_the_noise_changes(pole: float) -> None:
    """200 records: coverage of 0.93 to 0.98 is known to 1.8 %; below 0.885 in 1 of 1,000."""
    made = fits(200, STEP, pole)
    assert sum(fit._uneven is not None for fit in made) >= 196
    assert np.all(covered(made) > 0.885)
    stationary = [np.sqrt(np.diag(fit.cov_spectral)) for fit in made]
    assert np.mean([np.median(fit.bse / own) for fit, own in zip(made, stationary, strict=True)]) > 1.1


def test_errors_are_those_of_the_samples() -> None:
    """Where the level is known: the scatter of estimates, which is known to 5 % from 200 records."""
    made = fits(200, STEP)
    scatter = np.std([fit.params for fit in made], axis=0)
    np.testing.assert_allclose(np.median([fit.bse for fit in made], axis=0), scatter, rtol=0.2)


def test_the_check_says_it_and_files_keep_it(tmp_path: Any) -> None:
    fit = fits(1, STEP)[0]
    said = str(fit.check())
    assert "The noise of y changes over the record: its level in time varies by a factor of" in said
    assert "The standard errors allow for it; Record(sigma=...)" in said
    classical = mf.fit(fit.records[0], TWO, cov_type="nonrobust")  # type: ignore[index]
    assert "The standard errors do not allow for it" in str(classical.check())
    np.testing.assert_array_equal(classical.cov_params(), classical.cov_nonrobust)
    fit.save(tmp_path / "fit.json")
    np.testing.assert_array_equal(mf.load(tmp_path / "fit.json").bse, fit.bse)
    np.testing.assert_array_equal(fit.without_samples().bse, fit.bse)
    assert "changes over the record" not in str(fits(1)[0].check())


def test_masks_given_levels_and_short_records_are_not_asked() -> None:
    rec = CLEAN.assign(y=CLEAN["y"] + 0.05 * STEP * np.random.default_rng(3).standard_normal(CLEAN.t.size))
    assert uneven(mf.fit(rec.weigh(sigma=STEP), TWO)) is None
    assert uneven(mf.Estimator(TWO)(rec.window(0.0, 2.0))) is None
    two = mf.fit([rec.window(0.0, 5.5), rec.window(5.6, 10.0)], TWO, trend=None)
    found = uneven(two)
    assert found is not None
    assert [len(own) for own in found.level] == list(two.intervals)
