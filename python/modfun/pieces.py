"""Inputs and known functions as a polynomial in each sampling interval, for integration in the core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .integration import Function, Signal

__all__ = ["pieces"]

F64 = NDArray[np.float64]
TERMS = 10  # coefficients of a piece: functions are interpolated at so many Chebyshev nodes
LOOKS = np.array([0.02, 0.21, 0.47, 0.74, 0.98])  # of an interval: where interpolation is looked at
CLOSE = 1e-9  # of the largest value: an interpolation further off has met a jump or a kink


def pieces(drives: Sequence[Signal | Function], grid: F64) -> F64 | None:
    """Coefficients (drive, interval, power), descending in the time since the interval began.

    None where a drive is no smooth function within the intervals.
    """
    found = np.empty((len(drives), grid.size - 1, TERMS))
    for k, drive in enumerate(drives):
        rows = _sampled(drive, grid) if isinstance(drive, Signal) else _interpolated(drive, grid)
        if rows is None:
            return None
        found[k] = rows
    return found


def _sampled(drive: Signal, grid: F64) -> F64 | None:
    """Pieces of samples, where a delay leaves them on the intervals."""
    knots, own = np.asarray(drive.knots), np.asarray(drive.pieces)
    begins = grid[:-1] - drive.delay
    near = 1e-9 * float(np.min(np.diff(grid)))
    place = np.searchsorted(knots, begins + near, side="right") - 1
    known = place >= 0
    if drive.delay and not np.all(np.abs(knots[np.maximum(place, 0)] - begins)[known] <= near):
        return None
    rows = np.zeros((grid.size - 1, TERMS))
    rows[known, TERMS - own.shape[1] :] = own[place[known]]
    rows[~known, -1] = drive.before
    return rows


def _interpolated(drive: Function, grid: F64) -> F64 | None:
    """Pieces of a function of time, derivatives of it included."""
    step = np.diff(grid)[:, None]
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS)
    places = np.concatenate([nodes, LOOKS])
    instants = grid[:-1, None] + step * places - drive.delay
    values = drive.at(instants.ravel()).reshape(-1, places.size)
    rows = np.linalg.solve(np.vander(nodes), values[:, :TERMS].T).T
    off = rows @ np.vander(LOOKS, TERMS).T - values[:, TERMS:]
    if np.abs(off).max() > CLOSE * np.abs(values).max():
        return None
    rows = rows / step ** np.arange(TERMS - 1, -1, -1)
    for _ in range(drive.order):
        rows = np.hstack([np.zeros((len(rows), 1)), rows[:, :-1] * np.arange(TERMS - 1, 0, -1)])
    return np.asarray(rows, dtype=np.float64)
