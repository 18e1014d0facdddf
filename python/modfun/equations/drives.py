"""Inputs and known functions as a polynomial in each sampling interval, for integration in the core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .integration import Function, Signal

__all__ = ["pieces", "refined"]

F64 = NDArray[np.float64]
TERMS = 10  # coefficients of a piece: functions are interpolated at so many Chebyshev nodes
LOOKS = np.array([0.02, 0.21, 0.47, 0.74, 0.98])  # of an interval: where interpolation is looked at
CLOSE = 1e-9  # of the largest value: an interpolation further off has met a jump or a kink


def pieces(drives: Sequence[Signal | Function], grid: F64) -> F64 | None:
    """Coefficients (drive, interval, power), descending in the time since the interval began.

    The grid holds every instant at which samples begin a piece (`refined`). None where a function is not
    smooth within the intervals.
    """
    found = np.empty((len(drives), grid.size - 1, TERMS))
    for k, drive in enumerate(drives):
        rows = _sampled(drive, grid) if isinstance(drive, Signal) else _interpolated(drive, grid)
        if rows is None:
            return None
        found[k] = rows
    return found


def refined(grid: F64, drives: Sequence[Signal | Function]) -> F64:
    """The grid, and the instants at which delayed samples begin a piece."""
    late = [np.asarray(one.knots) + one.delay for one in drives if isinstance(one, Signal) and one.delay]
    if not late:
        return grid
    near = 1e-9 * float(np.min(np.diff(grid)))
    new = np.sort(np.concatenate(late))
    new = new[(new > grid[0] + near) & (new < grid[-1] - near)]
    place = np.searchsorted(grid, new)
    new = new[np.minimum(new - grid[place - 1], grid[place] - new) > near]
    return np.sort(np.concatenate([grid, new[np.diff(new, prepend=-np.inf) > near]]))


def _sampled(drive: Signal, grid: F64) -> F64:
    """Pieces of samples, each counted from where the interval begins."""
    knots, own = np.asarray(drive.knots), np.asarray(drive.pieces)
    begins = grid[:-1] - drive.delay
    near = 1e-9 * float(np.min(np.diff(knots)))
    place = np.searchsorted(knots, begins + near, side="right") - 1
    before, place = place < 0, np.clip(place, 0, len(own) - 1)
    rows = np.zeros((grid.size - 1, TERMS))
    rows[:, TERMS - own.shape[1] :] = own[place]
    since = begins - knots[place]
    since[np.abs(since) <= near] = 0.0
    for done in range(own.shape[1] - 1):  # p(s + since), by repeated division by s - since
        for k in range(TERMS - own.shape[1] + 1, TERMS - done):
            rows[:, k] += rows[:, k - 1] * since
    rows[before] = 0.0
    rows[before, -1] = drive.before
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
