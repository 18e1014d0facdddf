"""Statistics of residual lines, one line of formula at a time."""

from __future__ import annotations

import numpy as np

__all__ = ["autocorrelation", "distance", "ljung_box", "power_in_order", "sharpest", "unforeseen"]


def autocorrelation(records, lags):
    """Real part of the autocorrelation within records at lags 1, 2, …, over the power of all."""
    power = sum(abs(one) ** 2 for e in records for one in e)
    return [
        sum((e[m + k] * np.conj(e[m])).real for e in records for m in range(len(e) - k)) / power
        for k in range(1, lags + 1)
    ]


def ljung_box(records, lags):
    """2n(n + 1) sum r(k)^2/n(k): circular complex lines, n(k) pairs at distance k."""
    n = sum(len(e) for e in records)
    pairs = [sum(len(e) - k for e in records) for k in range(1, lags + 1)]
    r = autocorrelation(records, lags)
    return 2 * n * (n + 1) * sum(value**2 / count for value, count in zip(r, pairs, strict=True))


def power_in_order(records):
    """Power of all lines by the share of their band that is below them."""
    placed = [((m + 1) / len(e), k, abs(one) ** 2) for k, e in enumerate(records) for m, one in enumerate(e)]
    return np.array([power for _, _, power in sorted(placed)])


def distance(records):
    """Largest distance of the cumulated power's share from that of the lines."""
    power = power_in_order(records)
    n = power.size
    return max(abs(power[:k].sum() / power.sum() - k / n) for k in range(1, n))


def sharpest(values):
    """Largest of |x0 - 4 x1 + 6 x2 - 4 x3 + x4| over their mean."""
    size = abs(np.convolve(values, [1, -4, 6, -4, 1], "valid"))
    return size.max() / size.mean()


def unforeseen(values):
    """Rms of x4 less the cubic through x0 to x3 over that about the mean."""
    at = np.arange(4)
    left = [
        x[4] - np.polyval(np.polyfit(at, x[:4], 3), 4)
        for x in np.lib.stride_tricks.sliding_window_view(values, 5)
    ]
    return np.sqrt(np.mean(np.square(left))) / values.std()
