"""Light modes in light gusts: noise that drives them is told from slow noise of the sensors."""

from __future__ import annotations

import warnings

import modfun as mf
import numpy as np
from scipy.signal import cont2discrete, lfilter

TWO = mf.TransferFunction(poles=2, zeros=0)
DRIVEN = 'noise="process"'  # the cure, which every message that names gusts holds
FINE = 10  # steps of the simulation a sample


def light(seed: int, omega: float, zeta: float, dt: float, count: int, gust: float, slow: float) -> mf.Record:
    """A doublet with a free decay, `gust` and `slow` noise of the sensor as parts of the response."""
    rng = np.random.default_rng(seed)
    k, begin, half = np.arange(count + 1), int(0.6 / omega / dt), int(1.6 / omega / dt)
    u = 1.0 * ((k >= begin) & (k < begin + half)) - 1.0 * ((k >= begin + half) & (k < begin + 2 * half))
    held = np.repeat(u, FINE)
    b, a, _ = cont2discrete(([omega**2], [1, 2 * zeta * omega, omega**2]), dt / FINE, method="zoh")
    clean = lfilter(b[0], a, held)[::FINE]
    driven = lfilter(b[0], a, rng.standard_normal(held.size))[::FINE]
    wander = lfilter([1], [1, -0.98], rng.standard_normal(count + 1))
    size = clean.std()
    y = clean + size * (gust * driven / driven.std() + slow * wander / wander.std())
    y += 0.03 * size * rng.standard_normal(y.size)
    return mf.Record(y=y, u=u, dt=dt, intersample="zoh")


def said(rec: mf.Record) -> str:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = mf.fit(rec, TWO)
        fit.check()
    return " ".join([str(one.message) for one in caught])


def test_a_structure_in_light_gusts_is_named() -> None:
    """What gusts make of a light mode looks like powers of the output and like a change, too."""
    records = [light(seed, 12.6, 0.02, 0.02, 500, 0.1, 0) for seed in range(12)]
    assert sum([DRIVEN in said(rec) for rec in records]) >= 11


def test_a_phugoid_in_gusts_is_named() -> None:
    records = [light(seed, 0.3, 0.05, 0.1, 1200, 0.1, 0) for seed in range(12)]
    assert sum([DRIVEN in said(rec) for rec in records]) >= 10


def test_white_noise_and_slow_noise_of_a_sensor_are_no_gusts() -> None:
    """Slow noise beside white noise, as of a sensor that drifts, was."""
    for seed in range(15):
        assert not said(light(seed, 0.3, 0.05, 0.1, 1200, 0, 0))
        assert DRIVEN not in said(light(seed, 0.3, 0.05, 0.1, 1200, 0, 0.04))


def test_of_short_records_most_say_that_gusts_may_be_the_cause() -> None:
    """One record of three periods seldom tells gusts from slow noise: 16 of 20 name them."""
    named = 0
    for seed in range(12):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(light(seed, 0.3, 0.05, 0.1, 600, 0.05, 0), TWO)
        named += DRIVEN in " ".join(fit.check())
    assert named >= 8
