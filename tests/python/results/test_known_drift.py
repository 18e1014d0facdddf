"""Drifts in records that begin at rest, and starts at rest that end a search."""

from __future__ import annotations

import warnings

import heater
import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter

TWO = mf.TransferFunction(poles=2, zeros=0)


def warned(record: mf.Record, model: mf.TransferFunction, **told: str) -> tuple[mf.Fit, str]:
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        fit = mf.fit(record, model, **told)
    return fit, " ".join(str(one.message) for one in found)


def test_a_drift_beside_a_start_at_rest_is_named() -> None:
    """The gain was 9 standard errors off in silence; what is advised is within three."""
    for seed in range(10):
        record = heater.heated(0.01, 0.04, seed)
        _, text = warned(record, heater.MODEL, initial_state="rest")
        assert "The outputs drift beside their response" in text
        assert "First try trend=\"linear\" beside initial_state='rest'" in text
        fit, text = warned(record, heater.MODEL, initial_state="rest", trend="linear")
        assert not text
        gain = fit.derived(K="b0/a1").rows[0]
        assert abs(gain["value"] - 2.0) < 3 * gain["bse"]


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_slow_noise_is_no_drift(pole: float) -> None:
    """BIC bars a drift in one of 2,000 records without; so did 360, with AR(0.9) of any seed."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        clean = mf.simulate(
            mf.tf([5], [1, 3, 8]),
            input=lambda t: (t >= 2) * 1.0,
            duration=10.0,
            intervals=300,
            intersample="zoh",
        )
        noise = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.standard_normal(801))[500:]
        _, text = warned(clean.assign(y=clean.y[0] + 0.02 * noise), TWO, initial_state="rest")
        assert "drift" not in text


def test_a_search_that_does_not_end_names_the_start_at_rest() -> None:
    """Of one step in 20 % noise an unknown start leaves the gain open: maxiter does not help."""
    named = 0
    for seed in range(12):
        record = heater.heated(0.2, 0.0, seed)
        fit, text = warned(record, heater.MODEL)
        if fit.success:
            continue
        named += 'First try initial_state="rest", with which the search ends' in text
        other, _ = warned(record, heater.MODEL, initial_state="rest")
        assert other.success
        assert abs(other["b0"] / other["a1"] - 2.0) < 0.1
    assert named >= 4


def test_steps_of_differences_make_no_mode_grow() -> None:
    """The error of a superfluous pole is as large as itself: the response of one step beyond overflowed."""
    rng = np.random.default_rng(5)
    u = np.repeat(rng.choice([-1.0, 1.0], 51), 20)[:1000]
    y = mf.tf([2, 6], [1, 2, 26]).simulate(u=u, dt=0.01, intersample="zoh")
    record = mf.Record(y=y + 0.01 * y.std() * rng.standard_normal(1000), u=u, dt=0.01)
    fit, _ = warned(record, mf.TransferFunction(poles=3, zeros=2))
    assert fit.success
    assert not any("failed" in text for text in fit.check())
    assert repr(fit).startswith("Fit(u -> y, ml, ok")
