"""Cures that stood beside better ones: zeros up to the number of poles, and a drift that poles follow."""

import warnings

import modfun as mf
import numpy as np


def warned(rec: mf.Record) -> str:
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    return "\n".join(str(one.message) for one in found)


def test_an_accelerometer_without_zeros_names_two():
    for seed in range(3):
        rec = mf.simulate(
            mf.tf([2, 0, 0], [1, 1.6, 80]), input="3*sin(1.2*t**1.7)", duration=12, intervals=1200,
            nsr=0.03, initial_state=[0.02, 0], seed=seed, outputs="a", inputs="F",
        )  # fmt: skip
        assert "First try more zeros, zeros=2" in warned(rec)


def test_a_drift_of_a_plate_comes_before_poles():
    t = np.arange(0, 3600, 2.0)
    heater = np.repeat(np.random.default_rng(3).choice([0.0, 20.0, 40.0], 19), 100)[: t.size]
    made, states = np.empty(t.size), np.array([5.0, 2.0])
    for k, power in enumerate(heater):  # steps far shorter than the time constants
        made[k] = states[1]
        for _ in range(4):
            states += 0.5 * np.array([0.004 * power - states[0] / 400, (states[0] - states[1]) / 60])
    for seed in range(5):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(t.size)
        y = np.round((made + 22 + 3 * t / 3600 + noise) / 0.25) * 0.25
        rec = mf.Record(y, heater, dt=2.0, outputs="T", inputs="P", intersample="zoh")
        assert 'First try trend="linear"' in warned(rec)
