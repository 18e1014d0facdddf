"""One step of a heater, with noise and a drift."""

from __future__ import annotations

import modfun as mf
import numpy as np

MODEL = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=50))
GAIN = 2.0


def heated(noise: float, drift: float, seed: int) -> mf.Record:
    """A step of 10 % behind a minute; 120 s, 17.3 s late. Noise and drift are parts of 20 K."""
    t = np.arange(0, 900.0)
    y = 10 * GAIN * (1 - np.exp(-np.clip(t - 77.3, 0, None) / 120.0))
    y = y + 20 * (drift * t / t[-1] + noise * np.random.default_rng(seed).standard_normal(t.size))
    return mf.Record(y=y, u=10.0 * (t >= 60), dt=1.0, intersample="zoh")
