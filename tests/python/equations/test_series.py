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
    with pytest.warns(mf.ModfunWarning, match="an input that is not in the record"):
        wrong = mf.fit(steady, MODEL)
    assert np.max(np.abs(wrong.params / TRUTH - 1)) > 2e-3


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


MOTION = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
DERIVATIVES = {"Za": -0.8, "Ma": -4.5, "Mq": -1.2, "Zd": -0.1, "Md": -5.0}
VANE, GYRO = mf.tf([2, 30], [1, 40]), mf.tf([1], [0.15, 1])


def test_sensors_of_a_state_space_multiply_its_responses() -> None:
    scaled = mf.StateSpace(
        [["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], [["V", 0], [0, 1], ["V*Za/9.81", 0]],
        [[0], [0], ["V*Zd/9.81"]], states=["alpha", "q"], inputs=["de"], outputs=["w", "q", "nz"],
    )  # fmt: skip
    values = {**DERIVATIVES, "V": 60.0}
    sensors = {"w": VANE, "q": mf.tf([3, 400], [1, 28, 400]), "nz": mf.tf([0.5], [0.01, 0.3, 1])}
    seen = mf.through(scaled, sensor=sensors)
    omega = np.array([0.1, 1.0, 3.0, 20.0])
    plant, measured = (m.model(values).frequency_response(omega).response[:, 0] for m in (scaled, seen))
    known = np.array([sensor(1j * omega) for sensor in sensors.values()])
    np.testing.assert_allclose(measured, known * plant, rtol=1e-9)
    assert seen.outputs == scaled.outputs
    assert seen.states == ("alpha", "q_true", "w_1", "q", "q_2", "nz", "nz_2")


@pytest.mark.statistics
def test_a_sensor_of_one_output_costs_no_bias_and_reaches_the_bound() -> None:
    """30 records: means within four standard errors, scatter 0.6 to 1.5 (false alarm 1 in 1,000)."""
    seen = mf.through(MOTION, sensor={"q": GYRO})
    assert seen.states == ("alpha", "q_true", "q")
    de = mf.signals.multistep("de", [3, 2, 1, 1], unit=0.4, dt=0.02, amplitude=0.03, duration=8.0)
    truth = np.array(list(DERIVATIVES.values()))
    errors, blind = [], []
    for seed in range(30):
        rec = mf.simulate(seen.model(DERIVATIVES), input=de, nsr=0.05, seed=seed, outputs=["alpha", "q"])
        fit = mf.fit(rec, seen)
        assert fit.param_names == tuple(DERIVATIVES)
        errors.append(fit.params - truth)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            blind.append((mf.fit(rec, MOTION).params - truth) / fit.bse)
    bound = mf.crlb(seen, rec, params=DERIVATIVES, nsr=0.05, trend="constant").sd
    mean, scatter = np.mean(errors, axis=0) / bound, np.std(errors, axis=0, ddof=1) / bound
    assert np.all(np.abs(mean) < 4 / np.sqrt(30)), mean
    assert np.all((scatter > 0.6) & (scatter < 1.5)), scatter
    assert np.max(np.abs(np.mean(blind, axis=0))) > 30


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: mf.through(MOTION, sensor=GYRO), "takes sensors by output"),
        (lambda: mf.through(MOTION, sensor={"q": GYRO}, actuator=SERVO), "actuators go through the record"),
        (lambda: mf.through(MOTION, sensor={"r": GYRO}), "sensor= names 'r'"),
        (lambda: mf.through(MOTION, sensor={"q": mf.tf([1], [1, 1], delay=0.1)}), "has a delay"),
        (lambda: mf.through(MOTION, sensor={"q": mf.tf([1], [1, -1])}), "must be stable"),
        (lambda: mf.through(record(PLANT), sensor={"y": LAG}), "give a StateSpace"),
    ],
)
def test_sensors_that_do_not_fit(call: Any, says: str) -> None:
    with pytest.raises(mf.SpecError, match=says):
        call()
