"""Channels recorded late or early, and sensors that feel a rate: score tests of linear equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.student import student_p
from ..records.record import Record
from .estimates import Estimates
from .linear_lines import Linear, columns_of, linear_of, straight, testable, with_levers

__all__ = [
    "SEEN",
    "Lever",
    "Moved",
    "Shift",
    "each_moved",
    "earlier_by",
    "likeliest_lever",
    "likeliest_shift",
]

SEEN = 0.02  # p-value below which a shift is told, where it explains more than its parameter costs
ASKED = 0.02  # p-value in white noise below which the noise's colour is looked at
BESIDE = 4  # lines on either side over which the power of residuals is smoothed
TOLD = 1e-6  # part of a column's square that parameters leave of it, below which no record tells the change
ROUNDING = 1e-13


@dataclass(frozen=True)
class Shift:
    """The channel whose shift in time explains most of the residuals.

    Attributes
    ----------
    channel : str
    late : float
        By how much it was recorded late beside the others, s; negative: early.
    error : float
        Standard error of that, in noise whose level changes over the band.
    p_value : float
        Of a t test, times the number of channels.
    """

    channel: str
    late: float
    error: float
    p_value: float


@dataclass(frozen=True)
class Lever:
    """The output that, with a part of another one's derivative in it, explains most of the residuals.

    Attributes
    ----------
    output, rate : str
        The output shows length*rate' besides what the model says.
    length, error : float
        Its size and the standard error of that.
    p_value : float
        Of a t test, times the number of pairs.
    """

    output: str
    rate: str
    length: float
    error: float
    p_value: float


@dataclass(frozen=True)
class Moved:
    """What the time of a channel does to the estimates.

    Attributes
    ----------
    channel : str
    late, error : float
        By how much it seems to be recorded late beside the others, s, and the standard error of that.
    slopes : ndarray, shape (p,)
        By how much each right estimate is larger than the fitted one for each second that it is late.
    """

    channel: str
    late: float
    error: float
    slopes: F64


@dataclass(frozen=True)
class _Change:
    """The likeliest change of the equations, by its number, with its size, standard error and p-value."""

    number: int
    size: float
    error: float
    p_value: float


def likeliest_shift(fit: Estimates, channel: str = "") -> Shift | None:
    """The likeliest channel of a linear fit to be late or early, or how late one is; None if none is tested.

    With P(s) Y + Q(s) U = 0 the equations and Σ the noise of the outputs, Σ^(-1/2) P^(-1) (P Y + Q U) are
    whitened residuals. A channel that was recorded τ late stands in the equations times exp(s τ). Residuals
    are regressed on their derivatives to τ, beside those to parameters and what transients and ends of the
    record add, one channel at a time. For derivatives outputs stand without their residuals, which are noise.
    """
    channels = [*fit.outputs, *fit.inputs]
    if len(channels) < 2 or not (testable(fit) and straight(fit)):
        return None
    model = linear_of(fit)
    if model is None:
        return None
    asked = [k for k, name in enumerate(channels) if channel in ("", name)]
    if len(asked) == len(channels) == 2 and fit.inputs:
        asked = [1]  # the output's shift is the input's
    one = _tested(fit, model, asked, exact=True) if channel else _likeliest(fit, model, asked)
    return Shift(channels[one.number], one.size, one.error, one.p_value) if one else None


def each_moved(fit: Estimates) -> list[Moved]:
    """What the time of each channel that the record tells does to the estimates, to first order.

    Estimates follow a shift as regressions of its column on those of the parameters say.
    """
    channels = [*fit.outputs, *fit.inputs]
    model = linear_of(fit) if len(channels) > 1 and testable(fit) and straight(fit) else None
    made = _columns(fit, model, exact=True) if model else None
    if made is None:
        return []
    used, sizes = made.used, made.sizes
    slopes = np.asarray(np.linalg.solve(made.gram[:used, :used], made.gram[:used, used:-1]), np.float64)
    slopes *= sizes[used:-1] / sizes[:used, None]
    found = []
    for k, channel in enumerate(channels):
        if made.squares[k] > TOLD:
            by, scale = made.along[k] / made.squares[k], sizes[-1] / sizes[used + k]
            variance = (made.rest - by * made.along[k]) / made.df / made.squares[k]
            error = scale * np.sqrt(max(variance, 0.0))
            found.append(Moved(channel, float(by * scale), float(error), slopes[:, k]))
    return found


def likeliest_lever(fit: Estimates, pairs: Sequence[tuple[str, str]]) -> Lever | None:
    """The likeliest of pairs of an output and a rate; None if none is tested.

    An accelerometer that is away from the centre of gravity shows its lever times the angular acceleration
    besides what the model says. The test is that of shifts with the columns of these.
    """
    if not (pairs and testable(fit) and straight(fit)):
        return None
    model = linear_of(fit)
    if model is None:
        return None
    at = [(fit.outputs.index(y), fit.outputs.index(rate)) for y, rate in pairs]
    one = _likeliest(fit, with_levers(fit, model, at), range(len(at)))
    return Lever(*pairs[one.number], one.size, one.error, one.p_value) if one else None


def _likeliest(fit: Estimates, model: Linear, asked: Sequence[int]) -> _Change | None:
    """The likeliest of the changes asked for, exactly where a first look finds any likely."""
    found = _tested(fit, model, asked, exact=False)
    if found is None or found.p_value >= ASKED:
        return found
    return _tested(fit, model, asked, exact=True)


@dataclass(frozen=True)
class _Columns:
    """Columns of parameters, changes and residuals, each of length 1, and what the first leave of the rest.

    `used`: parameters; `squares`: what these leave of each change, `along`: of its product with the
    residuals, and `rest`: of these; `df`: degrees of freedom beside one change.
    """

    columns: F64
    sizes: F64
    used: int
    gram: F64
    squares: F64
    along: F64
    rest: float
    df: int
    lines: list[int]


def _columns(fit: Estimates, model: Linear, exact: bool) -> _Columns | None:
    """The columns of all records; None where residuals are none, or too few.

    `exact`: with corners of inputs and the colour of the noise, which a first look omits.
    """
    parts = [part for k in range(len(fit.lines)) if (part := columns_of(fit, model, k, exact)) is not None]
    columns = np.concatenate(parts, axis=1) if len(parts) == len(fit.lines) else np.zeros((1, 1))
    sizes = np.sqrt(np.einsum("pn,pn->p", columns, columns))
    used = fit.params.size
    ends = sum(fit.layout.orders) + len(fit.layout.orders) * (1 + (fit.trend == "linear"))
    df = columns.shape[1] - ends * len(parts) - used - 1
    if not 0 < sizes[-1] < np.inf or df < 1:
        return None
    sizes[sizes == 0] = 1.0
    columns /= sizes[:, None]
    gram = columns @ columns.T
    gram[range(used), range(used)] += ROUNDING  # of a parameter without effect
    beside = gram[used:, used:] - gram[used:, :used] @ np.linalg.solve(gram[:used, :used], gram[:used, used:])
    lines = [part.shape[1] // (2 * len(fit.outputs)) for part in parts]
    squares, along, rest = np.diag(beside)[:-1], beside[:-1, -1], float(beside[-1, -1])
    return _Columns(columns, sizes, used, gram, squares, along, rest, df, lines)


def _tested(fit: Estimates, model: Linear, asked: Sequence[int], *, exact: bool) -> _Change | None:
    """The regression for these changes."""
    made = _columns(fit, model, exact)
    if made is None:
        return None
    used, squares, along, df = made.used, made.squares, made.along, made.df
    told = squares > TOLD
    told[[k for k in range(told.size) if k not in asked]] = False
    if not told.any():
        return None
    gains = np.where(told, along**2 / np.where(told, squares, 1.0), 0.0)
    at = int(np.argmax(gains))
    by = along[at] / squares[at]
    variance = max(made.rest - gains[at], 0.0) / df / squares[at]
    if exact:
        q = np.linalg.qr(made.columns[:used].T)[0]
        column, e = (x - q @ (q.T @ x) for x in (made.columns[used + at], made.columns[-1]))
        local = _smooth(e - by * column, made.lines, len(fit.outputs)) * e.size / df
        variance = max(variance, float(column**2 @ local) / squares[at] ** 2)
    if not variance > 0:
        return None
    error, scale = float(np.sqrt(variance)), float(made.sizes[-1] / made.sizes[used + at])
    p = float(student_p(by / error, df)) * int(told.sum())
    return _Change(at, float(by) * scale, error * scale, min(p, 1.0))


def _smooth(e: F64, lines: Sequence[int], outputs: int) -> F64:
    """Mean square of residuals near each line, in the places of `columns_of`."""
    found, start = [], 0
    for count in lines:
        stop = start + 2 * outputs * count
        power = np.mean(e[start:stop].reshape(2, outputs, count) ** 2, axis=0)
        sums = np.concatenate([np.zeros((outputs, 1)), np.cumsum(power, axis=1)], axis=1)
        at = np.arange(count)
        first, last = np.maximum(at - BESIDE, 0), np.minimum(at + BESIDE + 1, count)
        mean = (sums[:, last] - sums[:, first]) / (last - first)
        found.append(np.tile(mean.ravel(), 2))
        start = stop
    return np.concatenate(found)


def earlier_by(
    records: tuple[Record, ...], name: str, late: float, *, whole: bool
) -> tuple[str, tuple[Record, ...]]:
    """Records with a channel at its own time, in words and made so.

    Straight lines between samples would take from the noise, by which levels are seen. Beyond the ends the
    last sample stays: cubes that go on multiply its noise.
    """
    from scipy.interpolate import CubicSpline

    at = f"rec.t {'+' if late > 0 else '-'} {abs(late):.4g}"
    if whole:
        moved = [np.interp(rec.t + late, rec.t, rec[name]) for rec in records]
        words = f"rec.assign({name}=np.interp({at}, rec.t, rec[{name!r}]))"
    else:
        moved = [CubicSpline(rec.t, rec[name])(np.clip(rec.t + late, rec.t[0], rec.t[-1])) for rec in records]
        spline = f"scipy.interpolate.CubicSpline(rec.t, rec[{name!r}])"
        words = f"rec.assign({name}={spline}(np.clip({at}, rec.t[0], rec.t[-1])))"
    rows: list[dict[str, Any]] = [{name: row} for row in moved]
    return words, tuple([rec.assign(**row) for rec, row in zip(records, rows, strict=True)])
