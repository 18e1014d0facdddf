"""Rows that a logger lost: a record whose times lie on a grid but for a few is made even, with a mask."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.between import FORMS, form_of
from ..base.samples import even_step
from .mask import Mask, runs

__all__ = ["at_rows", "completed"]

MOST = 0.2  # of the rows may be lost
LONGEST = 0.1  # of the rows may be lost in a row, as in a fit of masked samples
AROUND = 8  # samples on either side of a gap, at least, whose range tells where a signal may be
OUTSIDE = 0.5  # of the range around a gap: what a spline leaves it by, at most
ALIKE = 0.25  # of the usual step: what other steps between neighbouring rows differ from it, at most


def completed(fields: dict[str, Any]) -> dict[str, Any]:
    """The fields of a record with its lost rows: outputs masked there, inputs as they go between samples."""
    found = _rows(fields["t"]) if fields["dt"] is None else None
    if found is None:
        return {**fields, "_lost": None}
    return at_rows(fields, *found)


def at_rows(fields: dict[str, Any], rows: NDArray[np.intp], step: float) -> dict[str, Any]:
    """The fields of an even record that has the samples given at these rows, and no others of outputs."""
    count = int(rows[-1]) + 1
    lost = np.ones(count, dtype=np.bool_)
    lost[rows] = False
    y, u, mask, sigma, keep = (fields[name] for name in ("y", "u", "mask", "sigma", "_keep"))
    good: Mask = np.zeros((len(y), count), dtype=np.bool_)
    good[:, rows] = True if mask is None else mask
    return {
        **fields,
        "t": fields["t"][0] + step * np.arange(count),
        "dt": step,
        "y": _all(y, rows, lost, ["foh"] * len(y)),
        "u": _all(u, rows, lost, fields["intersample"]),
        "mask": good,
        "sigma": None if sigma is None else _all(sigma, rows, lost, ["foh"] * len(sigma)),
        "_keep": {
            name: _all(values[None], rows, lost, [FORMS[form_of(values, fields["t"])]])[0]
            for name, values in keep.items()
        },
        "_lost": lost,
    }


def _rows(times: F64) -> tuple[NDArray[np.intp], float] | None:
    """Rows of a grid on which the times lie, and its step; None where too many are missing, or none."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    alike = steps[np.abs(steps - usual) <= ALIKE * usual]
    if not alike.size:  # half of the steps are much shorter than the other half
        return None
    single = float(np.mean(alike))
    apart = np.rint(steps / single)
    longest, count = float(apart.max()) - 1, float(apart.sum()) + 1
    if apart.min() < 1 or not 1 <= longest <= LONGEST * count or count - times.size > MOST * count:
        return None
    rows = np.concatenate([[0.0], np.cumsum(apart)])
    step = even_step(times, rows)
    return None if step is None else (rows.astype(np.intp), step)


def _all(values: F64, rows: NDArray[np.intp], lost: Mask, words: Any) -> F64:
    """Values (channel, time) at every row."""
    found = np.empty((len(values), lost.size))
    every = np.arange(lost.size)
    for own, known, word in zip(found, values, words, strict=True):
        if word == "zoh":
            starts, lengths = runs(lost)
            own[rows] = known
            for first, length in zip(starts, lengths, strict=True):
                own[first : first + length] = own[first - 1]
        elif word == "foh" or known.size < 4:
            own[:] = np.interp(every, rows, known)
        else:
            own[:] = _smooth(rows, known, lost)
            own[rows] = known
    return found


def _smooth(rows: NDArray[np.intp], known: F64, lost: Mask) -> F64:
    """A spline through the known rows; where it leaves what stands around a gap, the curve that does not."""
    from scipy.interpolate import CubicSpline, PchipInterpolator

    every = np.arange(lost.size)
    found = np.asarray(CubicSpline(rows, known)(every))
    flat = None
    for first, length in zip(*runs(lost), strict=True):
        gap = slice(first, first + length)
        at, many = np.searchsorted(rows, first), max(length, AROUND)
        near = known[max(at - many, 0) : at + many]
        spread = OUTSIDE * np.ptp(near)
        if found[gap].max() > near.max() + spread or found[gap].min() < near.min() - spread:
            flat = PchipInterpolator(rows, known) if flat is None else flat
            found[gap] = flat(every[gap])
    return found
