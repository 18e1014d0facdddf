"""Step tests of heaters, with noise and a drift."""

from __future__ import annotations

import modfun as mf
import numpy as np

MODEL = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=50))
GAIN = 2.0
LAG = mf.tf([1.8], [390, 1])  # of a larger heater
INTEGRATOR = mf.tf([1.8 / 390], [390, 1, 0])


def heated(noise: float, drift: float, seed: int) -> mf.Record:
    """A step of 10 % behind a minute; 120 s, 17.3 s late. Noise and drift are parts of 20 K."""
    t = np.arange(0, 900.0)
    y = 10 * GAIN * (1 - np.exp(-np.clip(t - 77.3, 0, None) / 120.0))
    y = y + 20 * (drift * t / t[-1] + noise * np.random.default_rng(seed).standard_normal(t.size))
    return mf.Record(y=y, u=10.0 * (t >= 60), dt=1.0, intersample="zoh")


def bump_test(plant: mf.LTI, seed: int, *, drift: float = 0.0) -> mf.Record:
    """Three steps over two hours from 40 % and 85 degC on; noise of 0.3 degC, drift in degC per minute."""
    t = np.arange(0, 7200, 12.0)
    u = np.select([t < 600, t < 2700, t < 4800], [40.0, 50.0, 35.0], 45.0)
    y = 85 + plant.simulate(u=u - 40, dt=12.0, intersample="zoh") + drift * t / 60
    y = y + 0.3 * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y=y, u=u, dt=12.0, intersample="zoh")
