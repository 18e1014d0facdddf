"""Smooth inputs made such that sums over their samples are integrals, wherever their slope jumps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..base.corners import TAPS, corners
from ..base.samples import frozen
from .batches import Batch
from .functions import known, summable
from .record import Record

__all__ = ["driving", "without_corners"]


def without_corners(u: F64, kinds: Sequence[str]) -> F64:
    """Inputs (…, channel, time) in even steps, smooth ones made so; the same array where there is no corner.

    The sum over samples of a signal whose slope jumps at one of them is off by 1/12 of the jump over a step,
    and by down to −1/24 between two: as of the position of an actuator that follows a command through a lag.
    """
    found = u
    for channel, kind in enumerate(kinds):
        if kind != "smooth":
            continue
        for place in np.ndindex(u.shape[:-2]) if u.ndim > 2 else ((),):
            row = u[(*place, channel)]
            bent = corners(np.ascontiguousarray(row))
            if bent is not None:
                if found is u:
                    found = u.copy()
                np.add.at(found[(*place, channel)], bent.at[:, None] + TAPS, bent.taps)
    return found


def driving(rec: Batch | Record, rule: str = "gregory") -> F64:
    """The inputs of a record (channel, time), or of a batch (record, channel, time), as fits sum them.

    Of an input that is a known function, samples of which sums by the rule are its integrals.
    """
    if rec.dt is None:
        return rec.u
    if isinstance(rec, Batch):
        return without_corners(rec.u, rec.intersample)
    if not rec.functions:
        return _smooth(rec)
    sources = known(rec)
    kinds = [kind if source is None else "" for kind, source in zip(rec.intersample, sources, strict=True)]
    u = without_corners(rec.u, kinds).copy()
    for row, source in zip(u, sources, strict=True):
        if source is not None:
            row[:] = summable(source, rec.t, rec.dt, rule)
    return u


@kept
def _smooth(rec: Record) -> F64:
    """The inputs of a record in even steps, known by samples."""
    found = without_corners(rec.u, rec.intersample)
    return found if found is rec.u else frozen(found)
