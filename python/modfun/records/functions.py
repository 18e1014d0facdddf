"""Inputs known as functions of time: their samples, and samples of which sums are the integrals."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import coefficients, quadrature_weights
from ..base.arrays import C128, F64
from ..errors import ModfunWarning
from ..signals.sources import Source, evaluate

__all__ = [
    "Held", "drives", "functions_of", "integrals", "is_function", "known", "sampled", "samples_of", "shown",
    "summable", "texts_of", "warn_of_others",
]  # fmt: skip

PARTS = 16  # of a sampling interval, at first: twice as many until integrals stand
MOST_PARTS = 1 << 19  # of a record
SETTLED = 1e-8  # of the largest line
HELD = 1e-9  # of a step: a time that is a sample's by rounding
HALVED = 48  # times a part is halved around a jump
STEEP = 3.0  # times the steps beside it: one that may be a jump
SHOWN = 40  # characters of a text
OTHER = 0.2  # of the rms of samples: what a function may differ from them, as they may be measured

Row = Any  # samples, or text or a function of t


def functions_of(u: Any) -> list[Row] | None:
    """Inputs row by row where one of them is text or a function of t; None where all are samples."""
    if isinstance(u, Mapping):
        rows = list(u.values())
    elif isinstance(u, list | tuple):
        rows = list(u)
    else:
        rows = [u]
    return rows if any(is_function(row) for row in rows) else None


def is_function(row: Row) -> bool:
    """Whether an input is given as text or a function of t."""
    if not isinstance(row, str):
        return callable(row)
    try:
        float(row)
    except ValueError:
        return True
    return False  # a number that somebody forgot to convert


def sampled(row: Row, t: F64) -> Any:
    """Samples of an input at these times, of text or a function as `evaluate` has them."""
    return evaluate(row, t) if is_function(row) else row


def known(rec: Any) -> list[Source | None]:
    """The function of each input, None of those that are known by their samples alone."""
    return [
        rec._functions.get(name) if kind == "smooth" else None
        for name, kind in zip(rec.inputs, rec.intersample, strict=True)
    ]


def drives(rec: Any, start: float) -> list[Source]:
    """Inputs for a simulation whose time is zero at `start`: functions where they are known, else samples."""
    return [
        row if source is None else _Later(source, start)
        for source, row in zip(known(rec), rec.u, strict=True)
    ]


class _Later:
    """A function of the time since a start."""

    def __init__(self, source: Source, start: float) -> None:
        self.source, self.start = source, start

    def __call__(self, t: F64) -> F64:
        return evaluate(self.source, np.asarray(t) + self.start)


class Held:
    """Samples that are held, as a function."""

    def __init__(self, samples: F64, start: float, dt: float) -> None:
        self.samples, self.start, self.dt = samples, start, dt

    def __call__(self, t: F64) -> F64:
        at = np.floor((np.asarray(t) - self.start) / self.dt + HELD).astype(int)
        return np.asarray(self.samples[np.clip(at, 0, self.samples.size - 1)])


def summable(source: Source, t: F64, dt: float, rule: str) -> F64:
    """Samples of a function whose sums over the record are its integrals, on all lines below the last.

    What sums of its own samples have too much, at the ends and by what sampling folds, is taken out.
    """
    count, values = t.size - 1, evaluate(source, t)
    top = (count - 1) // 2
    sums = coefficients(values[None], top, [rule], [0.0], 0, None)[0]
    wanted = integrals(source, float(t[0]), dt, count, top)
    return values + samples_of(wanted - sums, count, rule)


def samples_of(lines: C128, intervals: int, rule: str) -> F64:
    """Samples (…, time) whose sums by a rule are these lines (…, line), from line 0 on."""
    period = np.fft.irfft(lines * intervals, intervals)
    weights = quadrature_weights(rule, intervals, None)
    found = np.concatenate([period, period[..., :1]], axis=-1)
    ends = weights[0] + weights[-1]
    return np.asarray(found / np.concatenate([[ends], weights[1:-1], [ends]]))


def integrals(source: Source, start: float, dt: float, intervals: int, top: int) -> C128:
    """Fourier coefficients 0 … `top` of a function over so many sampling intervals from a start, in s."""
    try:
        return _kept(source, start, dt, intervals, top)  # type: ignore[arg-type]
    except TypeError:  # a function that cannot be a key
        return _integrals(source, start, dt, intervals, top)


def _integrals(source: Source, start: float, dt: float, intervals: int, top: int) -> C128:
    parts, found = PARTS, None
    while True:
        values = _levelled(source, start, dt / parts, intervals * parts)
        lines: C128 = coefficients(values[None], top, ["gregory"], [0.0], 0, None)[0]
        size = float(np.max(np.abs(lines)))
        if found is not None and float(np.max(np.abs(lines - found))) <= SETTLED * size:
            return lines
        if 2 * parts * intervals > MOST_PARTS:
            return lines
        parts, found = 2 * parts, lines


_kept = lru_cache(256)(_integrals)


def _levelled(source: Source, start: float, step: float, count: int) -> F64:
    """Samples of a function such that their sum is its integral also where it jumps between two of them."""
    t = start + step * np.arange(count + 1.0)
    values = evaluate(source, t)
    size = np.abs(np.diff(values))
    beside = np.pad(size, 1)
    at: NDArray[np.intp] = np.flatnonzero(size > STEEP * np.maximum(beside[:-2], beside[2:]))
    if not at.size:
        return values
    low, high, left, right = t[at], t[at + 1], values[at], values[at + 1]
    for _ in range(HALVED):
        middle = 0.5 * (low + high)
        centre = evaluate(source, middle)
        first = np.abs(centre - left) >= np.abs(right - centre)
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        left, right = np.where(first, left, centre), np.where(first, centre, right)
    jump = right - left
    own = np.abs(jump) > 0.5 * size[at]
    at, jump, part = at[own], jump[own], (high[own] - t[at[own]]) / step
    values = values.copy()
    np.add.at(values, at + (part > 0.5), jump * (0.5 - part))
    return values


def shown(source: Source) -> str:
    """A function in print."""
    if not isinstance(source, str):
        return f"{getattr(source, '__name__', type(source).__name__)}(t)"
    return source if len(source) <= SHOWN else f"{source[: SHOWN - 3]}..."


def texts_of(rec: Any, what: str, *, text: bool = True) -> dict[str, str]:
    """Inputs that are known at all times, as text, and a warning of those that are not kept.

    `text`: whether text is kept; functions of Python never are.
    """
    found = {name: source for name, source in rec.functions.items() if text and isinstance(source, str)}
    if lost := [name for name in rec.functions if name not in found]:
        warnings.warn(
            f"{what}: {lost[0]} = {shown(rec.functions[lost[0]])} is written as samples; to use the function "
            f"again, assign it after reading, rec.assign({lost[0]}=...)",
            ModfunWarning,
            stacklevel=5 if text else 4,
        )
    return found


def warn_of_others(rec: Any, functions: Mapping[str, Source], u: F64) -> None:
    """Warn of functions whose samples `u` differ from those of the inputs that they replace."""
    for name in rec.inputs:
        if name not in functions:
            continue
        k = rec.inputs.index(name)
        off, size = (float(np.sqrt(np.mean(row**2))) for row in (u[k] - rec.u[k], rec.u[k]))
        if off > OTHER * size:
            warnings.warn(
                f"assign({name}={functions[name]!r}): the samples that it replaces differ from it by "
                f"{off:.3g} (rms), and are {size:.3g} themselves; look at its numbers, and whether its time "
                f"is that of the record, which begins at t = {rec.t[0]:g} s",
                ModfunWarning,
                stacklevel=3,
            )
