"""Outputs that stand still: stored with a dead band, or frozen for a while."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from .mask import runs

__all__ = ["FROZEN", "dead_band", "frozen"]

REPEATED = 0.3  # of the samples, at least
CHANGES = 10  # at least
LEAST = 0.5  # of the median change: noise and motion go beyond the dead band, rarely far
FROZEN = 5  # equal samples, at least, of a channel that
RARELY = 0.005  # of the other samples repeat the one before
GRID = 0.02  # of the least change: how near changes are to its multiples where values are rounded


def dead_band(values: F64) -> float:
    """The least change of a channel that stands still in between; 0.0 where it is none.

    Rounded values change by multiples of one step, slow sensors by any amount.
    """
    repeated = np.count_nonzero(values[1:] == values[:-1])
    if repeated < REPEATED * (values.size - 1) or values.size - 1 - repeated < CHANGES:
        return 0.0
    change = np.abs(np.diff(values))
    moved = change[change > 0]
    least = float(moved.min())
    multiples = moved / least
    rounded = np.abs(multiples - np.rint(multiples)).max() < GRID
    return 0.0 if rounded or least < LEAST * np.median(moved) else least


def frozen(values: F64) -> tuple[int, int] | None:
    """First of equal samples, and their number, where others hardly ever are equal; None without.

    Rest at the beginning or the end of a record is no such thing.
    """
    same = values[1:] == values[:-1]
    if not same.any():
        return None
    starts, lengths = runs(same)
    rest = (starts > 0) & (starts + lengths < same.size)
    if not rest.any():
        return None
    at = int(np.argmax(np.where(rest, lengths, 0)))
    others = int(lengths.sum() - lengths[at]) / same.size
    return (int(starts[at]), int(lengths[at]) + 1) if lengths[at] + 1 >= FROZEN and others < RARELY else None
