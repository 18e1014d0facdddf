"""Standard errors and confidence intervals: roots of variances, probabilities, Student's t, in one place."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import SpecError
from .arrays import F64

__all__ = [
    "confidence",
    "normal_factor",
    "probability",
    "root",
    "student_factor",
    "student_interval",
    "student_p",
    "student_tail",
]

LEAST = 0.5  # of the level of an interval: what is less is meant as its complement


def root(variances: Any) -> F64:
    """Standard errors of variances; nan where rounding has left a variance below 0."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(variances))


def probability(what: str, level: Any) -> float:
    """A level between 0 and 1."""
    if isinstance(level, bool) or not isinstance(level, float | int | np.floating) or not 0 < level < 1:
        raise SpecError(f"{what}: level={level!r} must lie between 0 and 1, as 0.95")
    return float(level)


def confidence(what: str, level: Any) -> float:
    """The part of intervals that are to hold the truth."""
    level = probability(what, level)
    if level < LEAST:
        raise SpecError(
            f"{what}: level={level!r} is the part of the intervals that hold the truth, not the part that do "
            "not; for 95 % intervals give level=0.95"
        )
    return float(level)


def normal_factor(level: float) -> float:
    """Half-width of an interval in standard errors that are known."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + level / 2))


def student_factor(degrees: Any, level: float) -> F64:
    """Half-width of an interval in standard errors; nan without degrees of freedom."""
    from scipy.special import stdtrit  # scipy.stats takes seconds to load

    free = np.asarray(degrees, dtype=np.float64)
    return np.where(free > 0, stdtrit(np.where(free > 0, free, 1.0), 0.5 + level / 2), np.nan)


def student_p(t: F64 | float, degrees: Any) -> F64:
    """Probability of a ratio at least this large, either way, of an estimate whose true value is 0."""
    from scipy.special import stdtr

    free = np.asarray(degrees, dtype=np.float64)
    return np.where(free > 0, 2 * stdtr(np.where(free > 0, free, 1.0), -np.abs(t)), np.nan)


def student_tail(degrees: float, level: float) -> float:
    """Probability beyond one end of the interval where quantiles take the level of the noise as known."""
    from scipy.special import ndtr

    return float(ndtr(-student_factor(degrees, level)))


def student_interval(values: F64, errors: F64, degrees: Any, level: float) -> tuple[F64, F64]:
    """Lower and upper limits of estimates with these standard errors."""
    half = student_factor(degrees, level) * errors
    return values - half, values + half
