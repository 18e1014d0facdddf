"""Functions of a user, importable by other processes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import modfun as mf
import numpy as np
from scipy.signal import lfilter

SYSTEM = mf.tf([5], [1, 3, 8])
TF2 = mf.TransferFunction(poles=2, zeros=0)
CLEAN = mf.simulate(SYSTEM, input="sin(t**2/5)", duration=10.0, intervals=128)
SIZE = float(np.sqrt(np.mean(CLEAN.y**2)))


def student(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    """The system of the report under Student's noise."""
    return mf.Record(y=CLEAN.y[0] + 0.1 * SIZE * rng.standard_t(cell["df"], 129), u=CLEAN.u, dt=CLEAN.dt)


def ragged(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    """Records of several lengths, sizes of input and steps; one in eight fails."""
    kind = int(rng.integers(8))
    if kind == 7:
        raise ValueError(f"no record for {cell['name']}")
    noise = 0.05 * SIZE * rng.standard_normal(129)
    rec = CLEAN.assign(y=lambda r: r["y"] + noise)
    if kind < 3:
        return rec.window(0.0, 7.0 + kind)
    if kind == 3:
        return mf.Record(y=2 * rec.y, u=2 * rec.u, dt=rec.dt)
    if kind == 4:
        return mf.Record(y=np.delete(rec.y[0], 40), u=np.delete(rec.u[0], 40), t=np.delete(rec.t, 40))
    return rec


def coloured(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
    """AR(1) with its pole at .9, unit standard deviation, stationary from the start."""
    white = rng.standard_normal(y.size + 200)
    return lfilter([np.sqrt(1 - 0.81)], [1, -0.9], white)[200:]


def white(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
    """What noise="white" draws in the first group of seed 3, the replicate taken from the address of rng."""
    replicate = int(rng.bit_generator.state["state"]["counter"][2])
    return mf._core.normals(3, "noise_y", 0, replicate, 0, y.size)


def twice(rng: np.random.Generator, y: np.ndarray, dt: float) -> np.ndarray:
    """Noise of twice the standard deviation that it should have."""
    return 2 * rng.standard_normal(y.size)


def by_hand(cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
    """The records of the built-in study of seed 3 at the cell's noise level."""
    return mf.Record(
        y=CLEAN.y[0] + cell["nsr"] * SIZE * white(rng, CLEAN.y[0], CLEAN.dt), u=CLEAN.u, dt=CLEAN.dt
    )


def start(rng: np.random.Generator) -> list[float]:
    """A random initial state."""
    return [rng.normal(), 0.5]


def least_squares(rec: mf.Record, rng: np.random.Generator) -> Any:
    """The report's one-shot estimate, eq. (19)."""
    r = mf.regressors(rec, TF2, harmonics=6)
    return np.linalg.lstsq(r.gamma, r.target, rcond=None)[0]


def peak(fit: Any, rec: mf.Record) -> float:
    """Largest error in time."""
    return float(np.max(np.abs(fit.errors(rec))))


def gain(fit: Any, rec: mf.Record) -> float:
    """Static gain, of a Fit or of an array."""
    theta = fit.params if isinstance(fit, mf.Fit) else np.asarray(fit)
    return float(theta[2] / theta[1])


def moody(fit: Any, rec: mf.Record) -> float:
    """Fails where the first sample is negative."""
    if rec.y[0, 0] < 0:
        raise ArithmeticError("a negative start")
    return float("nan") if rec.y[0, 0] < 0.05 else 1.0


@dataclass(frozen=True)
class Scaled:
    """A generator with a setting of its own."""

    size: float

    def __call__(self, cell: dict[str, Any], rng: np.random.Generator) -> mf.Record:
        return mf.Record(y=CLEAN.y[0] + self.size * rng.standard_normal(129), u=CLEAN.u, dt=CLEAN.dt)
