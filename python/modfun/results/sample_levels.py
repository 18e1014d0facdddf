"""Noise that uneven samples show beside their neighbours, and what a fit leaves of them in units of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..errors import ModfunError
from ..records.record import Record
from ..records.spectra import beside_neighbours, clipped_level

__all__ = ["beside_samples", "seen_noise", "slow_beside", "square_beside"]

LEAST = 16  # samples that show a level
LARGE = 3.0  # times the noise: residuals that leave doubt to no other cause than their being slow
SLOW = 0.7  # of the power of residuals on the lines of the fit, at least; filtered noise goes on beyond them
CODED = 0.5  # of the samples have values of their own, at most: they are rounded to what the noise hides in


def beside_samples(fit: Any) -> bool:
    """Whether a fit is judged by noise seen beside neighbouring samples: records of uneven steps, unweighted."""
    records = fit.records or ()
    plain = fit.options.noise == "output" and fit.options.method in ("awls", "ml")
    if not plain or fit.process_levels is not None or not fit.usable:
        return False
    if not any([rec.dt is None for rec in records]) or any([rec.t.size < LEAST for rec in records]):
        return False
    return not any([rec.mask is not None or rec.sigma is not None for rec in records])


def seen_noise(fit: Any) -> tuple[str, F64, F64]:
    """Where noise is seen that a fit is judged by, in words; what it leaves of each output, and that noise."""
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


def slow_beside(fit: Any) -> bool:
    """Whether what a response leaves of uneven samples is far more than noise, and most of it in the band.

    Noise that was low-pass filtered above the band looks like a level that is too low, but goes on beyond.
    """
    found = _seen(fit) if beside_samples(fit) else None
    if found is None or not square_beside(fit) > LARGE**2:
        return False
    seen, left = found
    parts = [2 * (hi - lo + 1) / n for n, (lo, hi) in zip(fit.intervals, fit.lines, strict=True)]
    within = np.sum((fit.noise_levels / seen) ** 2 * np.array(parts)[:, None])
    return bool(within > SLOW * np.sum((left / seen) ** 2))


def _compared(fit: Any, found: tuple[F64, F64]) -> tuple[F64, F64]:
    """Levels of the noise, and of what is left on the lines or in the samples."""
    seen, left = found
    return seen, min(fit.noise_levels, left, key=lambda own: float(np.mean((own / seen) ** 2)))


@kept
def _seen(fit: Any) -> tuple[F64, F64] | None:
    """Levels of the noise and of what the fit's response leaves, (record, output); None where not told.

    The noise is that of the samples or of what is left of them, whichever shows less beside neighbours: kinks
    and fast motion are in either more than the noise is.
    """
    seen, left = [], []
    with np.errstate(all="ignore"):
        for rec in fit.records:
            try:
                errors = fit.errors(rec)
            except ModfunError:
                return None
            if not np.isfinite(errors).all():
                return None
            both = beside_neighbours(rec.t, np.concatenate([rec.y, errors])).reshape(2, -1)
            seen.append(np.maximum(both.min(axis=0), _rounding(rec)))
            left.append(clipped_level(errors))
    levels = np.array(seen)
    return (levels, np.array(left)) if np.all(levels > 0) else None


def _rounding(rec: Record) -> F64:
    """Noise of the rounding of each output whose samples repeat."""
    found = []
    for row in rec.y:
        values = np.unique(row)
        coded = 1 < values.size < CODED * row.size
        found.append(float(np.diff(values).min()) / np.sqrt(12) if coded else 0.0)
    return np.array(found)
