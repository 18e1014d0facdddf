"""Records of an unstable plant under a sampled controller that feeds the noise of its sensor back."""

from __future__ import annotations

from functools import cache
from typing import Any

import modfun as mf
import numpy as np
from scipy.signal import cont2discrete, lfilter, tf2ss

PLANT = mf.tf([5.0], [1.0, 0.5, -2.0])
TRUTH = np.array([0.5, -2.0, 5.0])
MODEL = mf.TransferFunction(poles=2, zeros=0)
DT, INTERVALS = 0.1, 200


def command() -> np.ndarray:
    """Steps to 1 or -1 each 0.4 s."""
    held = round(0.4 / DT)
    levels = np.random.default_rng(99).choice([-1.0, 1.0], INTERVALS // held + 2)
    return np.repeat(levels, held)[: INTERVALS + 1]


def flown(
    noise: float,
    seed: int,
    feedback: bool = True,
    pole: float = 0.0,
    truth: np.ndarray = TRUTH,
    gains: tuple[float, float] = (1.5, 0.7),
) -> tuple[np.ndarray, np.ndarray]:
    """Measured output and input of a plant b0/(s² + a1 s + a2), truth = (a1, a2, b0), noise white or AR(1).

    Without feedback of the noise the controller sees the output itself.
    """
    (step, kick), r = _plant(*truth.tolist()), command()
    white = np.random.default_rng(seed).standard_normal(INTERVALS + 201)
    e = noise * lfilter([np.sqrt(1 - pole**2)], [1, -pole], white)[200:]
    x, y, u = np.zeros(2), np.zeros(INTERVALS + 1), np.zeros(INTERVALS + 1)
    rate = last = seen = 0.0
    for k in range(INTERVALS + 1):
        y[k] = x[0] + e[k]
        if k:  # one sample late: `gains` times y and its rate, the latter behind a lag of 0.05 s
            rate = 0.05 / 0.15 * rate + gains[1] / 0.15 * (seen - last)
            last = seen
        u[k] = r[k] - (gains[0] * seen + rate if k else 0.0)
        seen = y[k] if feedback else x[0]
        x = step @ x + kick * u[k]
    return y, u


def record(noise: float, seed: int, **words: Any) -> mf.Record:
    y, u = flown(noise, seed, **words)
    return mf.Record(y=y, u=u, dt=DT, intersample="zoh", keep={"r": command()})


def closed(
    poly: tuple[Any, Any],
    gains: tuple[float, float, float],
    r: np.ndarray,
    dt: float,
    share: float,
    seed: int,
) -> mf.Record:
    """Any plant, held, under gains of the error, of its integral and of the measured rate, a sample late.

    `share`: noise of the sensor over the response.
    """
    a, b, c, _ = tf2ss(*poly)
    step, kick = cont2discrete((a, b, c, np.zeros((1, 1))), dt)[:2]

    def flown(level: float) -> tuple[np.ndarray, np.ndarray]:
        e = level * np.random.default_rng(seed).standard_normal(r.size)
        x, y, u = np.zeros(len(a)), np.zeros(r.size), np.zeros(r.size)
        total = rate = last = seen = 0.0
        for k in range(r.size):
            y[k] = (c @ x)[0] + e[k]
            total += gains[1] * (r[k] - seen) * dt
            rate, last = 0.5 * rate - 0.5 * (seen - last) / dt, seen
            u[k] = gains[0] * (r[k] - seen) + total + gains[2] * rate
            seen = y[k]
            x = step @ x + kick[:, 0] * u[k]
        return y, u

    y, u = flown(share * float(flown(0.0)[0].std()))
    return mf.Record(y=y, u=u, dt=dt, intersample="zoh", keep={"r": r})


@cache
def _plant(a1: float, a2: float, b0: float) -> tuple[np.ndarray, np.ndarray]:
    """State after a sample from states 1, 0 and 0, 1, and under an input of 1."""
    system = mf.ss([[0.0, 1.0], [-a2, -a1]], [[0.0], [b0]], np.eye(2))
    words = {"dt": DT, "intersample": "zoh"}
    free = [system.simulate(u=[0.0, 0.0], initial_state=x, **words)[:, 1] for x in np.eye(2)]
    return np.array(free).T, np.asarray(system.simulate(u=[1.0, 1.0], **words)[:, 1])


CLEAN, CLEAN_INPUT = flown(0.0, 0)
LEVEL = 0.3 * float(CLEAN.std())
