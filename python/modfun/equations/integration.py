"""Inputs of equations at any time, and the equations integrated by the compiled core."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._core import integrate as core_integrate
from ..base.arrays import F64
from ..base.effort import Effort, spend
from ..errors import DataError, SpecError
from ..signals.sources import Source, evaluate, function, is_samples
from ..systems.propagate import spline, too_steep

__all__ = ["Function", "Signal", "integrate", "signal"]

MOST = (200_000, 50)  # the core may take so many steps, and so many a sample
ROUGH = 1e-6  # relative error of searches, of which many end beside a singular point
FEWER = 20_000  # steps that these take at most, beside those of the samples
FEW_STEPS = (100, 1, 4)  # the same where work is counted, and times as many where these are too few
STEP, OWN = 1e-7, 15  # work of an operation in a step, and operations that any step takes
WIDTH, WIDEST = 1e-6, 1e-5  # of a switch, in sizes of the states


# Inputs -------------------------------------------------------------------------------------------


class Signal:
    """An input, or a derivative of one, at any time: pieces of polynomials.

    Parameters
    ----------
    knots : ndarray, shape (piece + 1,) or (piece,)
        Where pieces begin; the last one goes on without end.
    pieces : ndarray, shape (piece, power)
        Coefficients in descending powers of the time since the piece began.
    before : float
        Value before the first knot.
    delay : float
        So much later does all of it happen, s.
    """

    def __init__(self, knots: F64, pieces: F64, before: float, delay: float) -> None:
        self.knots, self.pieces, self.before, self.delay = knots, pieces, before, delay

    @classmethod
    def of(cls, values: F64, grid: F64) -> Signal:
        """The cubic spline through samples."""
        curve = spline(grid, values)
        return cls(curve.x, curve.c.T, float(values[0]), 0.0)

    def __call__(self, t: F64) -> F64:
        """Values at instants; on a knot those of the piece that begins."""
        place = np.searchsorted(self.knots, t - self.delay, side="right") - 1
        own = np.clip(place, 0, len(self.pieces) - 1)
        since, value = t - self.delay - self.knots[own], np.zeros_like(t)
        for coefficients in self.pieces.T:
            value = value * since + coefficients[own]
        return np.where(place < 0, self.before, value)


class Function:
    """An input given as text or as a function of t, or a derivative of it by central differences."""

    def __init__(self, source: Source, step: float, order: int, delay: float) -> None:
        self.at, self.order, self.delay = function(source), order, delay
        points = np.arange(-4.0, 5.0)
        right = np.zeros(points.size)
        right[order] = float(np.prod(np.arange(1.0, order + 1)))
        self.points = points * step / 8
        self.weights = np.linalg.solve(np.vander(points, increasing=True).T, right) / (step / 8) ** order

    def __call__(self, t: F64) -> F64:
        """Values at instants."""
        if not self.order:
            return self.at(t - self.delay)
        around = (t - self.delay)[:, None] + self.points
        return self.at(around.ravel()).reshape(around.shape) @ self.weights


def signal(
    source: Source, grid: F64, kind: str, order: int, delay: float, name: str, steady: bool
) -> Signal | Function:
    """The `order`-th derivative of an input, `delay` late, which does between samples what `kind` says.

    Before the samples an array holds its first value, or is 0 where it was not `steady`; text and functions
    are evaluated there.
    """
    step = float(np.min(np.diff(grid)))
    if order > {"zoh": 0, "foh": 1, "smooth": 2}[kind] and (kind != "smooth" or is_samples(source)):
        raise SpecError(
            f"simulating: the derivative of order {order} of {name} stands in the equation, and {name} is "
            f"{kind!r} between its samples, which has none; declare it "
            + ("'smooth'" if kind != "smooth" else "as text or as a function of t")
        )
    if kind == "smooth" and not is_samples(source):
        return Function(source, step, order, delay)
    early = 0 if is_samples(source) else int(np.ceil(delay / step))
    knots = np.concatenate([grid[0] + step * np.arange(-early, 0.0), grid])
    values = evaluate(source, knots)
    with np.errstate(over="ignore"):
        slopes = np.diff(values) / np.diff(knots)
    if kind == "foh" and not np.all(np.isfinite(slopes)):
        raise too_steep(values, step)
    if kind == "zoh":
        moves = np.append(True, values[1:] != values[:-1])  # integrations begin anew at every knot
        moves[-1] = True  # seen at the last sample only
        knots, pieces = knots[moves], values[moves, None]
    elif kind == "foh":
        pieces = slopes[:, None] if order else np.column_stack([slopes, values[:-1]])
    else:
        smooth = spline(knots, values)
        knots = smooth.x
        pieces = (smooth.derivative(order) if order else smooth).c.T
    return Signal(knots, pieces, float(values[0]) if steady and not order else 0.0, delay)


# States -------------------------------------------------------------------------------------------


def integrate(
    tape: tuple[list[Any], list[int]],
    starts: F64,
    grid: F64,
    drives: F64,
    pasts: Sequence[tuple[int, float]],
    theta: F64,
    rtol: float,
    slides: bool = False,
) -> F64:
    """States (state, start, time).

    Parameters
    ----------
    tape : tuple
        Slopes as the core reads them.
    starts : ndarray, shape (state, start)
    grid : ndarray, shape (time,)
    drives : ndarray, shape (drive, interval, power)
        As from `pieces.pieces`.
    pasts : sequence of (int, float)
        States of the past: which, and how much earlier; before grid[0] they were as they start.
    theta : ndarray, shape (parameter, start)
    rtol : float
        Relative error of a step.
    slides : bool, default False
        Whether the tape takes widths of states, within which ramps stand for what jumps.

    Raises
    ------
    DataError
        The states leave all bounds; the text says when.
    """
    absolute = np.full(len(starts), rtol * 1e-3)
    width = np.full(len(starts) if slides else 0, WIDTH)
    first = np.ascontiguousarray(starts.T)
    most = (FEWER if rtol >= ROUGH else MOST[0]) + MOST[1] * grid.size
    x = starts[:, :, None]
    for _ in range(3):
        own = np.ascontiguousarray(np.hstack([theta.T, np.tile(width, (len(first), 1))]))
        found, left, largest = _counted(tape, grid, drives, list(pasts), first, own, rtol, absolute, most)
        if left is not None and largest is not None:
            raise DataError(
                f"simulating: {most} steps lead no further than t = {left:.6g} s, where the states are as "
                f"large as {largest:.3g} and change ever faster; take other parameters, or a shorter piece"
            )
        if left is not None or found is None:
            raise _outside(float(grid[0]) if left is None else left, float(grid[0]))
        x = np.ascontiguousarray(found.transpose(2, 1, 0))
        peak = np.abs(x).max(axis=(1, 2))
        finer = _finer(absolute, rtol, peak)
        wide = (width > WIDEST * peak[: width.size]) & (peak[: width.size] > 0)
        if finer is None and not wide.any():
            break
        absolute = absolute if finer is None else finer
        width = np.where(wide, WIDTH * peak[: width.size], width)
    return x


def _counted(
    tape: tuple[list[Any], list[int]], grid: F64, drives: F64, pasts: list[tuple[int, float]], first: F64,
    own: F64, rtol: float, absolute: F64, most: int,
) -> tuple[F64 | None, float | None, float | None]:  # fmt: skip
    """What the core finds in so many steps; where work is counted, in few first, as it tells no number."""
    allowed = FEW_STEPS[0] + FEW_STEPS[1] * grid.size if Effort.limited() else most
    while True:
        allowed = min(allowed, most)
        spend(STEP * (OWN + len(tape[0])) * allowed * len(first))
        found = core_integrate(tape, grid, drives, pasts, first, own, rtol, absolute, allowed)
        if allowed == most or found[1] is None or found[2] is None:
            return found
        allowed *= FEW_STEPS[2]


def _finer(absolute: F64, rtol: float, peak: F64) -> F64 | None:
    """Absolute errors that are small beside states of these sizes; None where they are already."""
    coarse = (peak > 0) & (absolute > rtol * peak)
    return np.where(coarse, rtol * 1e-3 * peak, absolute) if coarse.any() else None


def _outside(t: float, start: float) -> DataError:
    if t == start:
        return DataError(
            f"simulating: at t = {t:g} s the equation has no finite highest derivative (a division by zero, "
            "or the logarithm or root of a negative number); give another initial state"
        )
    return DataError(
        f"simulating: the response leaves all bounds at t = {t:.6g} s (finite escape, or a derivative that "
        "does not exist there); simulate a shorter time, or check the parameters and the initial state"
    )
