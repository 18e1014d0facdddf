"""Tests of the residual lines of a fit: neighbours uncorrelated, one level over the band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    residuals : sequence of (line,) complex arrays, one a record
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
    shortest = min(e.size for e in residuals)
    lags = min(10, shortest // 4) if lags is None else min(lags, shortest - 1)
    power = sum(float(np.vdot(e, e).real) for e in residuals)
    if lags < 1 or power == 0:
        return Whiteness(np.nan, np.nan, count), np.zeros(0)
    r = np.sum([np.correlate(e, e, "full")[e.size : e.size + lags].real for e in residuals], axis=0)
    r = r / power
    # Re of a product of independent circular lines has variance 1/2 in units of their power, and the mean
    # square of the sum of n powers is n(n + 1): n + 2 is for real numbers.
    pairs = [sum(max(e.size - k, 0) for e in residuals) for k in range(1, lags + 1)]
    q = 2 * count * (count + 1) * float(np.sum(r**2 / np.array(pairs)))
    return Whiteness(q, float(chdtrc(lags, q)), count), r


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

    longest = max(residuals, key=len)
    count = sum(e.size for e in residuals)
    if longest.size < 6 or not np.any(longest):
        return Whiteness(np.nan, np.nan, count), np.nan
    pooled = _pooled(residuals)
    cumulated = np.cumsum(pooled) / pooled.sum()
    distance = float(np.max(np.abs(cumulated[:-1] - np.arange(1, count) / count)))
    half = count // 2
    with np.errstate(divide="ignore"):
        ratio = float(np.sqrt(np.divide(pooled[:half].mean(), pooled[half:].mean())))
    return Whiteness(distance, float(kolmogorov(distance * np.sqrt(count - 1))), count), ratio


def cumulated_power(residuals: Sequence[C128]) -> tuple[F64, F64]:
    """Power of the lines cumulated over the band of all records together, both from 0 to 1, (line,)."""
    pooled = _pooled(residuals)
    total = float(pooled.sum()) or 1.0
    return np.arange(1, pooled.size + 1) / pooled.size, np.cumsum(pooled) / total


def _pooled(residuals: Sequence[C128]) -> F64:
    """Power of the lines of all records, in the order of their place in their band."""
    if len(residuals) == 1:
        return np.asarray(residuals[0].real ** 2 + residuals[0].imag ** 2)
    share = np.concatenate([np.linspace(0, 1, e.size + 1)[1:] for e in residuals])
    order = np.argsort(share, kind="stable")
    power: F64 = np.concatenate([np.abs(e) ** 2 for e in residuals])[order]
    return power
