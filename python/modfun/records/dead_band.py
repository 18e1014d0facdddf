"""Outputs of a data historian, which keep their value until it has changed by a dead band."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64

__all__ = ["dead_band"]

REPEATED = 0.3  # of the samples, at least
CHANGES = 10  # at least
LEAST = 0.5  # of the median change: noise and motion go beyond the dead band, rarely far
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
