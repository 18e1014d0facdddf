"""Inputs and known functions as a polynomial in each sampling interval, for integration in the core."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from .integration import Function, Signal

__all__ = ["pieces", "refined"]

F64 = NDArray[np.float64]
TERMS = 10  # coefficients of a piece: functions are interpolated at so many Chebyshev nodes
NODES = 0.5 - 0.5 * np.cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS)
LOOKS = np.array([0.02, 0.21, 0.47, 0.74, 0.98])  # of an interval: where interpolation is looked at
CLOSE = 1e-9  # of the largest value times the interval: an interpolation further off is halved
SMALLEST = 2.0**-40  # of an interval: what still jumps there is taken as a straight line
MOST = (200_000, 10)  # pieces of a function, and so many an interval
RESTARTS = 8  # multiples of a delay at which a derivative of the response, of rising order, may jump


def pieces(drives: Sequence[Signal | Function], grid: F64) -> F64:
    """Coefficients (drive, interval, power), descending in the time since the interval began.

    The grid holds every instant at which samples begin a piece or functions jump (`refined`).
    """
    found = np.empty((len(drives), grid.size - 1, TERMS))
    for k, drive in enumerate(drives):
        found[k] = _sampled(drive, grid) if isinstance(drive, Signal) else _interpolated(drive, grid)
    return found


def refined(grid: F64, drives: Sequence[Signal | Function], delays: Sequence[float]) -> F64:
    """The grid with the instants at which a piece begins.

    These are where delayed samples stand, the first multiples of the delays of states, since the constant
    past ends with a kink, a delay after each sample of a held input, which is a kink of the past, and points
    that close in on jumps and kinks of functions.

    Raises
    ------
    DataError
        A function jumps or bends without end.
    """
    late = [one.knots + one.delay for one in drives if isinstance(one, Signal) and one.delay]
    late += [grid[0] + delay * np.arange(1.0, RESTARTS + 1) for delay in delays]
    jumping = [one for one in drives if isinstance(one, Signal) and one.pieces.shape[1] == 1]
    late += [one.knots + one.delay + delay for one in jumping for delay in delays]
    near = 1e-9 * float(np.min(np.diff(grid)))
    if late:
        new = np.sort(np.concatenate(late))
        new = new[(new > grid[0] + near) & (new < grid[-1] - near)]
        place = np.searchsorted(grid, new)
        new = new[np.minimum(new - grid[place - 1], grid[place] - new) > near]
        grid = np.sort(np.concatenate([grid, new[np.diff(new, prepend=-np.inf) > near]]))
    for drive in drives:
        if isinstance(drive, Function):
            grid = np.sort(np.concatenate([grid, *_halved(drive, grid)]))
    return grid


def _halved(drive: Function, grid: F64) -> list[F64]:
    """Midpoints that make a function a polynomial in each interval."""
    begins, steps = grid[:-1], np.diff(grid)
    whole, found, count = steps, [], 0
    largest = 0.0
    while begins.size:
        _, off, values = _fitted(drive, begins, steps)
        largest = largest or float(np.abs(values).max())
        # What is off for a short time moves little; a derivative of it may move much.
        share = np.ones_like(steps) if drive.order else steps / whole
        coarse = (off * share > CLOSE * largest) & (steps > SMALLEST * whole)
        begins, steps, whole = begins[coarse], steps[coarse] / 2, whole[coarse]
        middle = begins + steps
        found.append(middle)
        count += middle.size
        if count > MOST[0] + MOST[1] * grid.size:
            raise DataError(
                f"simulating: an input or a known function still jumps or bends after {count} cuts "
                f"between the samples, the last near t = {middle[0]:.6g} s; give samples of it, or a "
                "function that is smooth but for single jumps"
            )
        begins, steps, whole = np.concatenate([begins, middle]), np.tile(steps, 2), np.tile(whole, 2)
    return found


def _sampled(drive: Signal, grid: F64) -> F64:
    """Pieces of samples, each counted from where the interval begins."""
    knots, own = drive.knots, drive.pieces
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


def _fitted(drive: Function, begins: F64, steps: F64) -> tuple[F64, F64, F64]:
    """Polynomials in the part of an interval, how far they are off where looked at, and values."""
    places = np.concatenate([NODES, LOOKS])
    instants = begins[:, None] + steps[:, None] * places - drive.delay
    values = drive.at(instants.ravel()).reshape(-1, places.size)
    rows = np.linalg.solve(np.vander(NODES), values[:, :TERMS].T).T
    off: F64 = np.abs(rows @ np.vander(LOOKS, TERMS).T - values[:, TERMS:]).max(axis=1)
    return np.asarray(rows, dtype=np.float64), off, values


def _interpolated(drive: Function, grid: F64) -> F64:
    """Pieces of a function of time, derivatives of it included."""
    step = np.diff(grid)
    rows, off, values = _fitted(drive, grid[:-1], step)
    jumps = off > 0.01 * np.abs(values).max(axis=1)
    rows[jumps] = 0.0
    rows[jumps, -2:] = np.column_stack([values[:, -1] - values[:, TERMS], values[:, TERMS]])[jumps]
    rows = rows / step[:, None] ** np.arange(TERMS - 1, -1, -1)
    for _ in range(drive.order):
        rows = np.hstack([np.zeros((len(rows), 1)), rows[:, :-1] * np.arange(TERMS - 1, 0, -1)])
    return rows
