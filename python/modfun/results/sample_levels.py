"""Noise that uneven samples show beside their neighbours, and what a fit leaves of them in units of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..errors import ModfunError
from ..records.record import Record
from ..records.spectra import beside_neighbours, clipped_level

__all__ = ["beside_samples", "rounding_noise", "seen_noise", "slow_beside", "square_beside"]

LEAST = 16  # samples that show a level
LARGE = 3.0  # times the noise: residuals that leave doubt to no other cause than their being slow
SLOW = 0.8  # of the power of residuals on 3/2 of the fit's lines; filtered noise goes on beyond them
PART = 0.1  # of the scatter of an output
TINY = float(np.finfo(float).tiny)
FEWEST, MOST, LINES = 8, 4, 256  # lines that are looked at: so many at least, samples for each, and at most
NEAR = 1.2  # times the noise: lines that leave no more than this need no look at the response
CODED = 0.5  # of the samples have values of their own, at most: they are rounded to what the noise hides in


def beside_samples(fit: Any) -> bool:
    """Whether a fit is judged by noise seen beside neighbouring samples, of uneven steps and one weight."""
    records = fit.records or ()
    plain = fit.options.noise == "output" and fit.options.method in ("awls", "ml")
    if not plain or fit.process_levels is not None or not fit.usable:
        return False
    if not any([rec.dt is None for rec in records]) or any([rec.t.size < LEAST for rec in records]):
        return False
    return not any([rec.mask is not None or rec.sigma is not None for rec in records])


def seen_noise(fit: Any) -> tuple[str, F64, F64]:
    """Where noise is seen that a fit is judged by, in words; what is left of each output, and that noise."""
    found = _seen(fit) if beside_samples(fit) else None
    if found is None:
        return "of the unused high band", np.atleast_1d(fit.sigma), fit.high_band_levels
    seen, left = _compared(fit, found)
    return "seen beside neighbouring samples", *[np.sqrt(np.mean(own**2, axis=0)) for own in (left, seen)]


@kept
def square_beside(fit: Any) -> float:
    """Mean square of what a fit leaves in units of these levels; nan where they are not known.

    On the lines or in the samples, whichever is less: sums over samples that are far apart err, and
    simulations of sensitive systems leave their samples though estimates are right.
    """
    found = _seen(fit) if beside_samples(fit) else None
    if found is None:
        return float("nan")
    seen, left = _compared(fit, found)
    return float(np.mean((left / seen) ** 2))


@kept
def slow_beside(fit: Any) -> bool:
    """Whether what a response leaves of uneven samples is far more than noise, and most of it near the band.

    Noise that was low-pass filtered above the band looks like a level that is too low, but goes on beyond,
    and is seldom a large part of an output.
    """
    if not beside_samples(fit) or not square_beside(fit) > LARGE**2:
        return False
    within = every = largest = 0.0
    for rec, omega0, (_, last) in zip(fit.records, fit.omega0, fit.lines, strict=True):
        most, errors = rec.t.size // MOST, _errors(fit, rec)
        if errors is None or last > most:
            return False
        lines = np.arange(1, min(max(3 * last // 2, FEWEST), most, LINES) + 1)
        angles = omega0 * np.outer(rec.t - rec.t[0], lines)
        # Errors do not end as they begin.
        columns = [np.ones((rec.t.size, 1)), angles[:, :1], np.cos(angles), np.sin(angles)]
        q = np.linalg.qr(np.hstack(columns))[0]
        scale = np.max(np.abs(errors), axis=1, keepdims=True)
        largest = max(largest, *(errors.std(axis=1) / np.maximum(rec.y.std(axis=1), TINY)))
        within, every = within + np.sum((errors / scale @ q) ** 2), every + np.sum((errors / scale) ** 2)
    return bool(within > SLOW * every and largest > PART)


def _errors(fit: Any, rec: Record) -> F64 | None:
    """What the response leaves of a record; None where it has no numbers."""
    try:
        errors: F64 = fit.errors(rec)
    except ModfunError:
        return None
    return errors if np.isfinite(errors).all() else None


def _compared(fit: Any, found: tuple[F64, F64]) -> tuple[F64, F64]:
    """Levels of the noise, and of what is left on the lines or in the samples."""
    seen, left = found
    return seen, min(fit.noise_levels, left, key=lambda own: float(np.mean((own / seen) ** 2)))


@kept
def _seen(fit: Any) -> tuple[F64, F64] | None:
    """Levels of the noise and of what the fit's response leaves, (record, output); None where not told.

    The noise is that of the samples or of what is left of them, whichever shows less beside neighbours: kinks
    and fast motion are in either more than the noise is. Lines that leave hardly more than the noise of the
    samples need no simulation, which takes long for many samples: they stand for the response.
    """
    with np.errstate(all="ignore"):
        rows = [(beside_neighbours(rec.t, rec.y), rounding_noise(rec)) for rec in fit.records]
        levels = np.array([np.maximum(*own) for own in rows])
        if np.all(levels > 0) and not np.mean((fit.noise_levels / levels) ** 2) > NEAR**2:
            return levels, fit.noise_levels
        left = []
        for k, rec in enumerate(fit.records):
            errors = _errors(fit, rec)
            if errors is None:
                return None
            own = np.minimum(rows[k][0], beside_neighbours(rec.t, errors))
            levels[k] = np.maximum(own, rows[k][1])
            left.append(clipped_level(errors))
    return (levels, np.array(left)) if np.all(levels > 0) else None


def rounding_noise(rec: Record) -> F64:
    """Noise of the rounding of each output whose samples repeat."""
    found = []
    for row in rec.y:
        values = np.unique(row)
        coded = 1 < values.size < CODED * row.size
        found.append(float(np.diff(values).min()) / np.sqrt(12) if coded else 0.0)
    return np.array(found)
