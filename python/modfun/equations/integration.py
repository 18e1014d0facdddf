"""Integration of x' = f(t, x, v) by SciPy to the samples: inputs given or sampled, states of the past."""

from __future__ import annotations

import warnings
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import integrate as core_integrate
from ..errors import DataError, SpecError
from ..signals.sources import Source, evaluate, function, is_samples
from ..systems.propagate import spline, too_steep

__all__ = ["Function", "History", "Signal", "integrate", "integrate_pieces", "signal"]

F64 = NDArray[np.float64]
CORE = (200_000, 50)  # the core may take so many steps and so many a sample; then the system is stiff
STEPS = (3000, 6)  # the explicit method may take so many and so many a sample; then the system is stiff
STIFF_STEPS = (6000, 6)  # the implicit method may take so many; beyond, there is nothing to be had
AHEAD = 64  # parts of the time, or 8 samples, that a step may go at most: none shall pass over a pulse
RESTARTS = 8  # multiples of a delay at which a derivative of the response, of rising order, may jump


# Inputs -------------------------------------------------------------------------------------------


class Signal:
    """An input, or a derivative of one, at any time: pieces of polynomials, or a function.

    Parameters
    ----------
    knots : sequence of float
        Where pieces begin; the last one ends the last piece.
    pieces : sequence of sequence of float
        Coefficients in descending powers of the time since the piece began.
    before : float
        Value before the first knot.
    breaks : sequence of float
        Where it jumps or bends.
    delay : float
        So much later does all of it happen, s.
    """

    def __init__(
        self,
        knots: Sequence[float],
        pieces: Sequence[Sequence[float]],
        before: float,
        breaks: Sequence[float],
        delay: float,
    ) -> None:
        self.knots, self.pieces, self.before, self.delay = knots, pieces, before, delay
        self.breaks = [b + delay for b in breaks]

    @classmethod
    def of(cls, values: F64, grid: F64) -> Signal:
        """The cubic spline through samples."""
        rows = spline(grid, values).c.T
        return cls(grid.tolist(), rows.tolist(), float(values[0]), [], 0.0)

    def __call__(self, t: float, inside: float) -> float:
        """Value at t, of the piece in which `inside` lies: on a break the two sides differ."""
        k = bisect_right(self.knots, inside - self.delay) - 1
        if k < 0:
            return self.before
        k = min(k, len(self.pieces) - 1)
        s, value = t - self.delay - self.knots[k], 0.0
        for c in self.pieces[k]:
            value = value * s + c
        return value


class Function:
    """An input given as text or as a function of t, or a derivative of it by central differences."""

    breaks: tuple[float, ...] = ()

    def __init__(self, source: Source, step: float, order: int, delay: float) -> None:
        self.at, self.order, self.delay = function(source), order, delay
        points = np.arange(-4.0, 5.0)
        right = np.zeros(points.size)
        right[order] = float(np.prod(np.arange(1.0, order + 1)))
        self.points = points * step / 8
        self.weights = np.linalg.solve(np.vander(points, increasing=True).T, right) / (step / 8) ** order

    def __call__(self, t: float, inside: float) -> float:
        if not self.order:
            return float(self.at(np.array([t - self.delay]))[0])
        return float(self.weights @ self.at(t - self.delay + self.points))


def signal(source: Source, grid: F64, kind: str, order: int, delay: float, name: str) -> Signal | Function:
    """The `order`-th derivative of an input, `delay` late, which does between samples what `kind` says.

    Before the samples an array holds its first value; text and functions are evaluated there.
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
        pieces = values[:, None]  # the last one is seen at the last sample only
        bends = np.diff(values[:-1]) != 0
    elif kind == "foh":
        pieces = slopes[:, None] if order else np.column_stack([slopes, values[:-1]])
        bends = np.abs(np.diff(slopes)) > 1e-12 * np.abs(slopes).max()
    else:
        smooth = spline(knots, values)
        pieces = (smooth.derivative(order) if order else smooth).c.T
        bends = np.zeros(slopes.size - 1, dtype=bool)
    breaks = knots[[0, *(np.flatnonzero(bends) + 1)]]
    before = 0.0 if order else float(values[0])
    return Signal(knots.tolist(), pieces.tolist(), before, breaks.tolist(), delay)


# States -------------------------------------------------------------------------------------------


class History:
    """The states so far, for delays: constant before the start."""

    def __init__(self, start: float, x0: F64) -> None:
        self.ends, self.x0 = [start], x0
        self.parts: list[Any] = []

    def add(self, end: float, part: Callable[[float], F64]) -> None:
        """Append a step."""
        self.ends.append(end)
        self.parts.append(part)

    def __call__(self, t: float) -> F64:
        """States, flat."""
        k = bisect_right(self.ends, t) - 1
        if k < 0 or not self.parts:
            return self.x0
        past: F64 = self.parts[min(k, len(self.parts) - 1)](t)
        return past


class _Stiff(Exception):
    """The explicit method takes too many steps."""


def integrate_pieces(
    tape: tuple[list[Any], list[int]], starts: F64, grid: F64, drives: F64, theta: F64, rtol: float
) -> F64 | None:
    """States (state, start, time) by the compiled core; None where the system is stiff.

    Parameters
    ----------
    tape : tuple
        Slopes as the core reads them.
    starts : ndarray, shape (state, start)
    grid : ndarray, shape (time,)
    drives : ndarray, shape (drive, interval, power)
        As from `pieces.pieces`.
    theta : ndarray, shape (parameter, start)
    rtol : float

    Raises
    ------
    DataError
        The states leave all bounds; the text says when.
    """
    from scipy.integrate import DOP853

    a, b, c, e5, e3 = map(np.ascontiguousarray, (DOP853.A, DOP853.B, DOP853.C, DOP853.E5, DOP853.E3))
    absolute = np.full(len(starts), rtol * 1e-3)
    first, own = np.ascontiguousarray(starts.T), np.ascontiguousarray(theta.T)
    most = CORE[0] + CORE[1] * grid.size
    x = starts[:, :, None]
    for _ in range(3):
        found, left = core_integrate(tape, grid, drives, first, own, rtol, absolute, most, (a, b, c, e5, e3))
        if left is not None:
            raise _outside(left, float(grid[0]))
        if found is None:
            return None
        x = np.ascontiguousarray(found.transpose(2, 1, 0))
        finer = _finer(absolute, rtol, np.abs(x).max(axis=(1, 2)))
        if finer is None:
            break
        absolute = finer
    return x


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


def integrate(
    rate: Callable[[float, F64, float, History | None], F64],
    x0: F64,
    grid: F64,
    *,
    breaks: Sequence[float] = (),
    delays: Sequence[float] = (),
    driven: bool = True,
    stiff: bool = False,
    rtol: float = 1e-9,
) -> F64:
    """States at the samples.

    Parameters
    ----------
    rate : callable
        ``rate(t, x, inside, history)`` returns x', flat; `inside` is a time within the piece of the inputs
        that holds.
    x0 : ndarray, shape (states,)
        At grid[0].
    grid : ndarray, shape (time,)
    breaks : sequence of float
        Where inputs jump or bend.
    delays : sequence of float
        Of states; the history before grid[0] is x0.
    driven : bool
        Whether anything comes from outside that a long step could pass over.
    stiff : bool
        Whether an explicit method need not be tried.
    rtol : float
        Relative error of a step.

    Returns
    -------
    ndarray, shape (states, time)

    Raises
    ------
    DataError
        The states leave all bounds; the text says when.
    """
    if not x0.size:
        return np.empty((0, grid.size))
    shift = [k * d for d in delays for k in range(1, RESTARTS + 1)]
    ends = _ends(grid, [*breaks, *(grid[0] + s for s in shift)])
    span = float(grid[-1] - grid[0])
    longest = max(span / AHEAD, 8 * float(np.max(np.diff(grid)))) if driven else np.inf
    longest = min([longest, *delays])
    absolute = np.full(x0.size, rtol * 1e-3)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # what LSODA says in Fortran's words is said in ours
        for _ in range(3):
            try:
                x = _march(rate, x0, grid, ends, longest, rtol, absolute, bool(delays), not stiff)
            except _Stiff:
                x = _march(rate, x0, grid, ends, longest, rtol, absolute, bool(delays), False)
            finer = _finer(absolute, rtol, np.abs(x).max(axis=1))
            if finer is None:
                break
            absolute = finer
    return x


def _ends(grid: F64, breaks: Sequence[float]) -> list[float]:
    """Ends of the smooth pieces between the first and the last sample."""
    near = 1e-9 * float(np.min(np.diff(grid)))
    found: list[float] = []
    for b in sorted(breaks):
        k = int(np.argmin(np.abs(grid - b)))
        b = float(grid[k]) if abs(grid[k] - b) <= near else b
        if grid[0] < b < grid[-1] and (not found or b > found[-1] + near):
            found.append(b)
    return [*found, float(grid[-1])]


def _march(
    rate: Callable[[float, F64, float, History | None], F64],
    x0: F64,
    grid: F64,
    ends: list[float],
    longest: float,
    rtol: float,
    absolute: F64,
    delayed: bool,
    explicit: bool,
) -> F64:
    from scipy.integrate import DOP853, LSODA

    out = np.empty((x0.size, grid.size))
    out[:, 0] = x0
    history = History(float(grid[0]), x0) if delayed else None
    piece = [float(grid[0]), ends[0]]

    def f(t: float, x: F64) -> F64:
        a, b = piece
        inside = min(max(t, a + 1e-9 * (b - a)), b - 1e-9 * (b - a))
        return rate(t, x, inside, history)

    if not np.all(np.isfinite(f(piece[0], x0))):
        raise _outside(piece[0], piece[0])
    limit = STEPS if explicit else STIFF_STEPS
    most = limit[0] + limit[1] * grid.size
    words: dict[str, Any] = {"rtol": rtol, "atol": absolute, "max_step": longest}
    solver: Any = None
    done, steps = 1, 0
    for end in ends:
        if solver is not None:
            piece[0] = solver.t
        piece[1] = end
        if solver is None or not explicit:
            x = x0 if solver is None else solver.y
            solver = (DOP853 if explicit else LSODA)(f, piece[0], x, end, **words)
        else:  # the same steps go on, from the other side of the break
            solver.t_bound, solver.status, solver.f = end, "running", f(solver.t, solver.y)
        while solver.status == "running":
            solver.step()
            steps += 1
            if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
                raise _outside(solver.t, np.nan)
            if steps > most and explicit:
                raise _Stiff
            if steps > most:
                raise DataError(
                    f"simulating: {steps} steps lead no further than t = {solver.t:.6g} s, where the states "
                    f"are as large as {np.abs(solver.y).max():.3g} and change ever faster; take other "
                    "parameters, or a shorter piece"
                )
            last = done
            while last < grid.size and grid[last] <= solver.t:
                last += 1
            if delayed or last > done + 1 or (last == done + 1 and grid[done] < solver.t):
                part = solver.dense_output()
                if history is not None:
                    history.add(solver.t, part)
                out[:, done:last] = part(grid[done:last])
            elif last > done:
                out[:, done] = solver.y
            done = last
    return out
