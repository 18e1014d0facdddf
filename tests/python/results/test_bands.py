"""Intervals of predicted responses and samples: coverage, agreement of kinds of models, what is refused."""

import warnings
from collections.abc import Callable
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.results.bands import both
from scipy.signal import lfilter

SYSTEM, TWO = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
GRID: dict[str, Any] = {"duration": 10.0, "intervals": 256}
CLEAN = mf.simulate(SYSTEM, input="sin(t**2/5)", initial_state=[0.5, 1.0], **GRID)
OTHER = mf.simulate(SYSTEM, input="sign(sin(1.3*t))", intersample="zoh", initial_state=[-0.3, 1.0], **GRID)


def white(rng: np.random.Generator, shape: Any) -> Any:
    return rng.standard_normal(shape)


def red(rng: np.random.Generator, shape: Any) -> Any:
    return lfilter([np.sqrt(0.75)], [1, -0.5], rng.standard_normal((*shape[:-1], shape[-1] + 100)))[..., 100:]


def noisy(clean: mf.Record, noise: Callable[..., Any], rng: np.random.Generator, nsr: float) -> mf.Record:
    size = nsr * clean.y.std(axis=1, keepdims=True)
    return clean._like(y=clean.y + size * noise(rng, clean.y.shape))


def coverage(
    clean: mf.Record, other: mf.Record, model: Any, noise: Callable[..., Any], count: int, nsr: float = 0.1
) -> Any:
    """Mean over samples and records for (own, other) record and (confidence, prediction)."""
    held = np.zeros((2, 2))
    for seed in range(count):
        rng = np.random.default_rng([5, seed])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fit = mf.Estimator(model)(noisy(clean, noise, rng, nsr))
        for k, truth in enumerate((clean, other)):
            rec = fit.records[0] if k == 0 else noisy(other, noise, rng, nsr)
            bands = both(fit, rec).values()
            for j, (band, target) in enumerate(
                zip(bands, (truth, noisy(truth, noise, rng, nsr)), strict=True)
            ):
                held[k, j] += np.mean((band.lower < target.y) & (target.y < band.upper)) / count
    return held


@pytest.mark.statistics
@pytest.mark.parametrize("noise", [white, red])
def test_coverage_of_a_transfer_function(noise: Any) -> None:
    """60 records: a mean is known to 1.3 % (responses) and 0.3 % (samples); 2 false alarms in 1,000."""
    held = coverage(CLEAN, OTHER, TWO, noise, 60)
    assert np.all(np.abs(held[:, 0] - 0.95) < 0.043)
    assert np.all(np.abs(held[:, 1] - 0.95) < 0.012)


@pytest.mark.statistics
def test_coverage_of_a_state_space_and_of_an_equation() -> None:
    """30 records: a mean is known to 1.5 %; 1 false alarm in 1,000."""
    short = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
    values = {"Za": -1.2, "Ma": -4.0, "Mq": -1.6, "Zd": -0.1, "Md": -6.0}
    flown = mf.simulate(
        short.model(values), input="0.02*(sign(sin(0.9*t)) + sign(sin(1.7*t + 1)))", duration=15.0,
        intervals=300, intersample="zoh", initial_state=[0.02, -0.01],
    )  # fmt: skip
    held = coverage(flown, flown, short, white, 30, 0.05)
    assert np.all(np.abs(held - 0.95) < 0.05)
    duffing = mf.Equation("y'' + d*y' + k*y + c*y**3 = b*u")
    moved = mf.simulate(
        duffing.model({"d": 0.3, "k": 1.0, "c": 0.5, "b": 1.0}), input="2*sin(1.1*t)+1.5*sin(2.3*t+1)",
        duration=20.0, intervals=300, initial_state=[0.5, 0.0],
    )  # fmt: skip
    held = coverage(moved, moved, duffing, white, 30, 0.05)
    assert np.all(np.abs(held - 0.95) < 0.05)


def test_the_same_model_in_three_ways_has_the_same_errors() -> None:
    rec = noisy(CLEAN, white, np.random.default_rng(3), 0.1)
    written = mf.Equation("y'' + a*y' + k*y = b*u")
    states = mf.StateSpace(
        [[0, 1], ["-k", "-a"]], [[0], ["b"]], [[1, 0]], states=["x", "v"], inputs=["u"], outputs=["y"]
    )
    options: dict[str, Any] = {"harmonics": 20, "trend": None, "cov_type": "nonrobust"}
    found = [
        mf.fit(rec, model, **options).predict(interval="confidence").se for model in (TWO, written, states)
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=0.05)
    np.testing.assert_allclose(found[2], found[0], rtol=0.05)


def test_a_given_start_has_no_error() -> None:
    rec = noisy(CLEAN, white, np.random.default_rng(3), 0.1)
    fit = mf.fit(rec, TWO, trend=None)
    free = fit.predict(interval="confidence")
    given = fit.predict(initial_state=[0.5, 1.0], interval="confidence")
    assert given.se[0, 0] < 1e-9
    assert free.se[0, 0] > 0.01
    assert given.y[0, 0] == pytest.approx(0.5)
    wide = fit.predict(interval="prediction", level=0.99)
    np.testing.assert_allclose(wide.se, np.hypot(free.se, fit.errors().std()), rtol=0.03)
    assert np.all(wide.upper - wide.lower > 2.5 * 2 * free.se)


def test_the_plot_has_both_bands() -> None:
    rec = noisy(CLEAN, white, np.random.default_rng(3), 0.1)
    upper, lower = mf.fit(rec, TWO).plot_response()
    assert [len(one.collections) for one in (upper, lower)] == [1, 1]


def test_what_is_refused() -> None:
    fit = mf.fit(noisy(CLEAN, white, np.random.default_rng(3), 0.1), TWO)
    with pytest.raises(mf.SpecError, match="predict: interval='both' is unknown"):
        fit.predict(interval="both")
    with pytest.raises(mf.SpecError, match=r"predict: level=0.05 is the part of the intervals"):
        fit.predict(interval="confidence", level=0.05)
    with pytest.raises(mf.SpecError, match=r"predict: level=0.9 belongs to an interval; give interval="):
        fit.predict(level=0.9)


def test_it_prints_as_one_line_per_output() -> None:
    fit = mf.fit(noisy(CLEAN, white, np.random.default_rng(3), 0.1), TWO)
    found = fit.predict(interval="confidence", level=0.9)
    half = np.median(found.upper - found.lower) / 2
    assert repr(found) == (
        f"{fit.outputs[0]}: {found.y.size} samples from {found.y.min():.4g} to {found.y.max():.4g}, "
        f"90 % confidence interval within ±{half:.3g} (median)"
    )
