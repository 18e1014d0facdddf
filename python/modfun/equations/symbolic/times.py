"""Channels at other times: y(t - h) beside y(t), in formulas and in samples."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import sympy

from ...base.arrays import F64
from .compiled import time

__all__ = ["Times", "moved"]

ROUNDING = 1e-9  # of a sample


class Times:
    """Symbols of channels at other times.

    Parameters
    ----------
    still : iterable of Symbol
        What does not change with time.
    """

    def __init__(self, still: Iterable[sympy.Symbol]) -> None:
        self.still = frozenset(still)
        self.places: dict[sympy.Symbol, tuple[sympy.Symbol, sympy.Expr]] = {}

    def later(self, expr: sympy.Expr, by: sympy.Expr) -> sympy.Expr:
        """The expression at t - by, `by` a number of seconds."""
        return expr.xreplace({s: self._symbol(s, by) for s in expr.free_symbols - self.still})

    def _symbol(self, symbol: sympy.Symbol, by: sympy.Expr) -> sympy.Expr:
        if symbol == time:
            return time - by
        channel, late = self.places.get(symbol, (symbol, sympy.Integer(0)))
        late = late + by
        if late == 0:
            return channel
        found = sympy.Symbol(f"{channel.name} at t - {late}", real=True)
        self.places[found] = channel, late
        return found


def moved(row: F64, samples: float, straight: bool) -> F64:
    """A series so many samples later, beyond its ends that of the other end.

    Whole samples are exact; between them it is a cubic spline, or `straight`.
    """
    whole = round(samples)
    if abs(samples - whole) < ROUNDING * max(1.0, abs(samples)):
        return np.roll(row, whole)
    grid = np.arange(row.size, dtype=np.float64)
    at = np.minimum((grid - samples) % row.size, row.size - 1)
    if straight or not np.isfinite(row).all():
        return np.interp(at, grid, row)
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(grid, row)(at))
