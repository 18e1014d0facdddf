"""Loads that are not white, where a fit was told that white noise drives the system."""

import modfun as mf
import numpy as np
import pytest
from flights import warned

DT, SAMPLES = 0.02, 3000
PLANT = mf.tf([900], [1, 6, 225, 0])
TRUE = np.array([6.0, 225.0, 900.0])
SERVO = mf.TransferFunction(poles=3, zeros=0, params={"a3": 0.0})


def servo(seed, slowness):
    """The position of a servo under a load with a time constant, 0 for white noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-1, 1, SAMPLES // 30 + 1), 30)[:SAMPLES]
    white, load, w = rng.standard_normal(SAMPLES), np.empty(SAMPLES), 0.0
    keep = np.exp(-DT / slowness) if slowness else 0.0
    for k in range(SAMPLES):
        w = load[k] = keep * w + np.sqrt(1 - keep**2) * white[k]
    y = np.ravel(PLANT.simulate(u=u + 0.5 * load, dt=DT, intersample="zoh"))
    y = y + 0.01 * rng.standard_normal(SAMPLES)
    return mf.Record(y=y, u=u, dt=DT, intersample="zoh")


@pytest.mark.parametrize("seed", [0, 1, 3, 4])
def test_a_slow_load_is_named_with_its_cure(seed):
    rec = servo(seed, 0.5)
    fit, text = warned(rec, SERVO, noise="process")
    assert "the load is not white, or the model misses part of the band" in text
    assert not any("Spectral standard errors" in said for said in fit.check())
    cure = text.split("First try ")[1].split(", whose")[0]
    better = mf.fit(rec, SERVO, **eval(f"dict({cure})"))
    assert np.all(np.abs(better.params - TRUE) < 4 * better.bse)


@pytest.mark.parametrize("seed", [0, *range(2, 8)])
def test_a_white_load_is_not(seed):
    assert warned(servo(seed, 0.0), SERVO, noise="process")[1] == ""


def test_where_coloured_noise_finds_no_stable_system_either_no_cure_is_made_of_it():
    text = warned(servo(2, 0.5), SERVO, noise="process")[1]
    assert "the load is not white" in text
    assert "First take a record in which the input moves the system more" in text
