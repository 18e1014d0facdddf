"""Tests of the residual lines of a fit: neighbours uncorrelated, one level over the band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np

from .._core import line_colour, line_correlation, pooled_power
from ..base.arrays import C128, F64

__all__ = ["Whiteness", "colour_of_lines", "correlation_of_lines", "cumulated_power"]


@dataclass(frozen=True)
class Whiteness:
    """A test of the residual lines: the statistic, its p-value (small: not as assumed), the numbers used."""

    statistic: float
    p_value: float
    count: int


def correlation_of_lines(residuals: Sequence[C128], lags: int | None = None) -> tuple[Whiteness, F64]:
    """Ljung-Box test over the harmonic index m: are neighbouring lines correlated?

    Lines of stationary noise are independent whatever its colour; correlated neighbours tell of
    something short in time (a gust, a step, a clipped piece) or of a transient not accounted for.

    Parameters
    ----------
    residuals : sequence of (line,) complex arrays, one per record
        Whitened residuals.
    lags : int, optional
        Highest lag; default min(10, a quarter of the lines).

    Returns
    -------
    test : Whiteness
    autocorrelation : (lags,) array
        Real part of the autocorrelation at lags 1, 2, ….
    """
    from scipy.special import chdtrc

    count = sum(e.size for e in residuals)
    found = line_correlation(list(residuals), lags)
    if found is None:
        return Whiteness(np.nan, np.nan, count), np.zeros(0)
    q, r = found
    return Whiteness(q, float(chdtrc(r.size, q)), count), r


def colour_of_lines(residuals: Sequence[C128]) -> tuple[Whiteness, float]:
    """Cumulative-periodogram test: is the level of the lines the same over the band?

    White output noise has whitened residuals of one level; noise that falls off with frequency, or a
    model that misses part of the band, has not (Kolmogorov-Smirnov distance of the cumulated power
    from a straight line).

    Returns
    -------
    test : Whiteness
    ratio : float
        RMS of the lines in the lower half of the band over that in the upper half.
    """
    from scipy.special import kolmogorov

    count = sum(e.size for e in residuals)
    found = line_colour(list(residuals))
    if found is None:
        return Whiteness(np.nan, np.nan, count), np.nan
    distance, ratio = found
    return Whiteness(distance, float(kolmogorov(distance * sqrt(count - 1))), count), ratio


def cumulated_power(residuals: Sequence[C128]) -> tuple[F64, F64]:
    """Power of the lines cumulated over the band of all records together, both from 0 to 1, (line,)."""
    pooled = pooled_power(list(residuals))
    total = float(pooled.sum()) or 1.0
    return np.arange(1, pooled.size + 1) / pooled.size, np.cumsum(pooled) / total
