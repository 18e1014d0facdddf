"""Gains from pulses of few samples: how far these leave them open, and silence where they do not."""

from __future__ import annotations

import re
import warnings

import modfun as mf
import numpy as np
import pytest

PLANT = mf.tf([1.0, 0, 0], [1, 1.2, 6000])
FINE = 50


def struck(intervals: int, seed: int, noise: float = 0.02) -> mf.Record:
    """A half-sine of so many intervals of 1 ms that begins between two samples; the plant is exact."""
    rng = np.random.default_rng(seed)
    t = 0.001 / FINE * np.arange(4000 * FINE + 1)
    force = np.sin(np.pi * np.clip((t - 0.2 - 0.001 * rng.random()) / (0.001 * intervals), 0, 1))
    a = PLANT.simulate(u=force, dt=0.001 / FINE, intersample="foh")[::FINE]
    return mf.Record(y=a + noise * a.std() * rng.standard_normal(a.size), u=force[::FINE], dt=0.001)


def fitted(rec: mf.Record) -> tuple[mf.Fit, str]:
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=2))
    return fit, " ".join(str(one.message) for one in seen)


@pytest.mark.parametrize("seed", range(4))
def test_the_gain_is_off_by_what_is_said_at_most(seed: int) -> None:
    fit, said = fitted(struck(6, seed))
    found = re.search(r"The pulse of u lasts about \d samples.*may be ([\d.]+) % off", said)
    assert found is not None
    assert abs(fit["b0"] - 1) < float(found[1]) / 100 + 3 * fit.bse[fit.param_names.index("b0")]
    assert abs(fit["a2"] - 6000) < 4 * fit.bse[fit.param_names.index("a2")]


def test_a_pulse_of_many_samples_or_a_sweep_is_no_short_pulse() -> None:
    assert "pulse" not in fitted(struck(60, 0))[1]
    rec = mf.simulate(PLANT, input="sin(t + 20*t**2)", duration=4.0, intervals=4000, nsr=0.02, seed=1)
    assert "pulse" not in fitted(rec)[1]
