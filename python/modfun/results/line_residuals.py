"""Residuals of transfer functions in time, made of lines: many records at once, without a simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .._core import coefficients
from ..base.arrays import C128, F64
from ..models.layout import Layout
from ..records.corners import without_corners

__all__ = ["line_residuals"]


def line_residuals(
    layout: Layout, params: F64, output: int, y: F64, u: F64, rule: str, intersample: Sequence[str],
    intervals: int, lines: tuple[int, int], omega0: float,
) -> F64:  # fmt: skip
    """Residuals of one output in time, (record, interval), made of all lines but line 0.

    What the ends of a record add is fitted on the lines of the fit. What held inputs fold into a line stays
    in it: a simulation has none of that.

    Parameters
    ----------
    layout : Layout
        Without free delays where there are several records.
    params : ndarray, shape (record, p)
    output : int
    y : ndarray, shape (record, time)
        That output.
    u : ndarray, shape (record or 1, input, time)
    rule : str
        Quadrature of smooth signals.
    intersample : sequence of str
        Of the inputs.
    intervals : int
        The last ones of the records, which were fitted.
    lines : (int, int)
    omega0 : float
        rad/s.
    """
    start, top = y.shape[1] - 1 - intervals, (intervals - 1) // 2
    s: Any = 1j * omega0 * np.arange(1, top + 1)
    dt = 2 * np.pi / (omega0 * intervals)
    late = [delay / dt for delay in layout.delays(params[0], output)]
    rules = [rule if kind == "smooth" else kind for kind in intersample]
    of_y = _lines(y, top, [rule], [0.0], start)
    u = without_corners(u, intersample)
    of_u = _lines(u.reshape(-1, u.shape[2]), top, rules, late, start).reshape(*u.shape[:2], top)
    with np.errstate(all="ignore"):
        found = [layout.polynomials(own, output) for own in params]
        over = 1 / _values(np.array([den for den, _ in found]), s)
        tops = [_values(np.array(num), s) for num in zip(*(nums for _, nums in found), strict=True)]
        left = of_y - sum(num * of_u[:, k] for k, num in enumerate(tops)) * over
        powers = np.arange(layout.orders[output])
        ends = (s / abs(s[-1])) ** powers[:, None] * over[:, None]
        used = slice(max(lines[0], 1) - 1, lines[1])
        rows = np.concatenate([ends[..., used].real, ends[..., used].imag], axis=2)
        side = np.concatenate([left[:, used].real, left[:, used].imag], axis=1)
        square = rows @ rows.swapaxes(1, 2)  # powers of s up to 1: a condition that squares may have
        c = _solved(square, (rows @ side[..., None])[..., 0])
        left = left - (c[:, None] @ ends)[:, 0]
    whole = np.zeros((len(y), intervals // 2 + 1), complex)
    whole[:, 1 : top + 1] = left
    return np.asarray(np.fft.irfft(whole, intervals) * intervals)


def _solved(square: F64, side: F64) -> F64:
    """Solutions of systems (record, k, k), whose columns are brought to one size; nan where there is none."""
    size = np.sqrt(np.diagonal(square, axis1=1, axis2=2))
    scaled = square / (size[:, :, None] * size[:, None, :])
    try:
        found = np.linalg.solve(scaled, (side / size)[..., None])[..., 0]
    except np.linalg.LinAlgError:
        found = np.full(side.shape, np.nan)
    return np.asarray(found / size)


def _lines(rows: F64, top: int, rules: Sequence[str], late: Sequence[float], start: int) -> C128:
    """Fourier coefficients of rows (row, time) from line 1 on; rules and delays repeat."""
    if not len(rows):
        return np.zeros((0, top), complex)
    times = len(rows) // len(rules)
    words = ([*rules] * times, [*late] * times)
    return coefficients(np.ascontiguousarray(rows), top, *words, start, None)[:, 1:]


def _values(polynomials: F64, s: C128) -> C128:
    """Polynomials (record, coefficient) at s, (record, line)."""
    found: C128 = np.zeros((len(polynomials), s.size), complex)
    for c in polynomials.T:
        found = found * s + c[:, None]
    return found
