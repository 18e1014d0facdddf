"""Known actuators and sensors: exact without noise, the bound, where their states are unknown, refusals."""

from __future__ import annotations

import warnings
from typing import Any

import modfun as mf
import numpy as np
import pytest

PLANT = mf.tf([5], [1, 3, 8])
TRUTH = np.array([3.0, 8.0, 5.0])
MODEL = mf.TransferFunction(poles=2, zeros=0)
SERVO = mf.tf([400], [1, 28, 400])
LAG = mf.tf([1], [0.1, 1])


def record(system: Any, nsr: float = 0.0, seed: int = 0, **words: Any) -> mf.Record:
    told = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 400, "intersample": "smooth"}
    return mf.simulate(system, nsr=nsr, seed=seed, **(told | words))


@pytest.mark.parametrize(
    ("system", "told"),
    [(SERVO * PLANT, {"actuator": SERVO}), (LAG * PLANT, {"sensor": LAG}),
     (SERVO * PLANT * LAG, {"actuator": {"u": SERVO}, "sensor": LAG})],
    ids=["actuator", "sensor", "both"],
)  # fmt: skip
def test_exact_without_noise(system: mf.LTI, told: dict[str, Any]) -> None:
    fit = mf.fit(mf.through(record(system), **told), MODEL)
    np.testing.assert_allclose(fit.params, TRUTH, rtol=1e-4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        blind = mf.fit(record(system), MODEL)
    assert np.max(np.abs(blind.params / TRUTH - 1)) > 0.1


def test_states_of_the_filters_are_unknown_at_first() -> None:
    """A record cut out of a longer one begins with servo and plant in motion."""
    slow = mf.tf([1], [0.3, 1])
    rec = record(slow * PLANT, duration=14.0, intervals=560).window(4.5, 14.0)
    fit = mf.fit(mf.through(rec, actuator=slow), MODEL)
    np.testing.assert_allclose(fit.params, TRUTH, rtol=1e-3)
    steady = mf.through(rec, actuator=slow, settle=0.0)
    assert steady.intervals == rec.intervals
    assert np.max(np.abs(mf.fit(steady, MODEL).params / TRUTH - 1)) > 2e-3


def test_steady_before_a_step_nothing_is_cut() -> None:
    u = 0.7 + np.where(np.arange(401) >= 40, 1.0, 0.0)
    rec = record(SERVO * PLANT, input=u - 0.7, intersample="zoh")
    rec = rec.assign(u=u, y=rec.y[0] + 0.7 * 5 / 8)
    seen = mf.through(rec, actuator=SERVO)
    assert seen.intervals == rec.intervals
    np.testing.assert_allclose(seen.u[0, :40], 0.7, rtol=1e-12)
    assert seen.intersample == ("smooth",)
    fit = mf.fit(seen, MODEL)
    np.testing.assert_allclose(fit.params, TRUTH, rtol=2e-3)


@pytest.mark.statistics
def test_scatter_and_bias_beside_the_bound() -> None:
    """200 records: scatter over the bound 0.82 to 1.18, bias below 0.25 sd (false alarm 1 in 1,000)."""
    clean = record(SERVO * PLANT)
    sigma = 0.05 * float(np.sqrt(np.mean(clean.y**2)))
    known = mf.through(clean, actuator=SERVO)
    bound = mf.crlb(PLANT, mf.through(clean, actuator=SERVO, settle=0.0), sigma=sigma, trend="constant")
    rng = np.random.default_rng(7)
    found = []
    for _ in range(200):
        noise = sigma * rng.standard_normal(clean.t.size)[-known.t.size :]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found.append(mf.fit(known.assign(y=known.y[0] + noise), MODEL).params)
    off = (np.mean(found, axis=0) - TRUTH) / bound.sd
    ratio = np.std(found, axis=0, ddof=1) / bound.sd
    assert np.all((ratio > 0.82) & (ratio < 1.18)), ratio
    assert np.all(np.abs(off) < 0.25), off


@pytest.mark.parametrize(
    ("told", "error", "said"),
    [
        ({"actuator": {"x": SERVO}}, mf.errors.SpecError, "names 'x'"),
        ({"sensor": mf.tf([1], [1, 0])}, mf.errors.SpecError, "must be stable"),
        ({"sensor": 2.0}, mf.errors.SpecError, "one input and one output"),
        ({"sensor": mf.tf([1], [1, 1])}, mf.errors.DataError, "take 9 s to settle"),
    ],
)
def test_what_is_refused(told: dict[str, Any], error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        mf.through(record(PLANT), **told)
    uneven = mf.Record(np.arange(9.0), np.arange(9.0), t=np.arange(9.0) ** 1.1)
    with pytest.raises(mf.errors.DataError, match="uneven"):
        mf.through(uneven, sensor=LAG)
