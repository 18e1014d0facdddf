"""Free responses and trends of an output, and their least squares against what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._core import simulate, simulate_uneven
from ..base.arrays import F64
from ..base.words import TRENDS
from ..errors import DataError
from ..systems.polynomials import companion, time_unit

__all__ = ["Regression", "free_response", "regress", "rms", "trend_columns"]

BOUNDLESS = 1e100  # growth of a free response, beyond which squares overflow
MADE = 1e-13  # of its size: what of a column is left that those before it do not have, and is rounding


def rms(v: F64) -> Any:
    """Root mean square over the last axis, whatever the size of the numbers."""
    peak = np.abs(v).max(axis=-1, keepdims=True)
    part = v / np.where(peak > 0, peak, 1.0)
    return peak[..., 0] * np.sqrt(np.mean(part * part, axis=-1))


def free_response(den: F64, t: F64) -> F64:
    """Free responses of den(p) y = 0 to unit initial values of y, y', ..., y^(n-1).

    Parameters
    ----------
    den : (n + 1,) array
        Denominator in descending powers, monic.
    t : (time,) array
        Instants in seconds; the state is that at t[0]. Uneven steps are allowed.

    Returns
    -------
    (n, time) array
        Row i is the output for y^(i) = 1 and all other derivatives 0 at t[0]. Entries overflow to inf
        where an unstable mode grows beyond all numbers.
    """
    den = np.asarray(den, float)
    n = den.size - 1
    if n == 0:
        return np.zeros((0, t.size))
    # Derivatives in units of the fastest rate: a companion matrix of entries near one.
    rate = time_unit(den, 1.0 / float(t[-1] - t[0]))
    a = companion(den, rate)
    step = np.diff(t)
    even = bool(np.ptp(step) <= 1e-9 * step.mean())
    dt = float(t[-1] - t[0]) / step.size
    # The first row of exp(At) is the first column of exp(Aᵀt): all states of one motion.
    none = np.zeros((n, 0))
    system = np.ascontiguousarray(a.T), none, np.eye(n), none, np.eye(n)[0], np.zeros((0, t.size))
    rows = simulate(*system, dt, "zoh", None) if even else simulate_uneven(*system, [], t)
    return rows / rate ** np.arange(n)[:, None]


def trend_columns(t: F64, trend: str | None) -> F64:
    """Offset (and slope) of an output: rows 1 and (t - t[0])/T, as many as the trend has."""
    time = (t - t[0]) / (t[-1] - t[0])
    return np.vstack([np.ones_like(time), time])[: TRENDS.index(trend)]


@dataclass(frozen=True)
class Regression:
    """Linear least squares by QR: coefficients, their covariance, and the fitted series."""

    coefficients: F64
    covariance: F64
    fitted: F64


def regress(y: F64, columns: F64, weight: F64) -> Regression:
    """Least squares of a series (time,) on the rows of `columns` (k, time), rows scaled to unit norm.

    `weight` is 1/standard deviation of each sample up to a factor, 0 where it does not count. A column that
    is made of those before it has the coefficient 0, with the error nan. Columns that the samples can hardly
    tell apart get the smallest coefficients that explain them; the covariance takes the remainder as white.
    """
    k = columns.shape[0]
    if k == 0:
        return Regression(np.zeros(0), np.zeros((0, 0)), np.zeros_like(y))
    if not np.all(np.abs(columns) < BOUNDLESS):
        raise DataError(
            "The free response of the model overflows within this record: a mode is too unstable for a "
            f"simulation over all {y.size} samples; predict a shorter piece with rec.window(start, stop)."
        )
    rows = np.vstack([columns, y]) * weight
    scale = rms(rows[:k]) * np.sqrt(y.size)
    scale[scale == 0] = 1.0
    rows[:k] /= scale[:, None]
    # R of the columns and the series behind them is all that their least squares need.
    r: F64 = np.asarray(np.linalg.qr(rows.T, mode="r"))
    diagonal = r.diagonal()[:k]
    own = np.zeros(k, dtype=bool)
    own[: diagonal.size] = np.abs(diagonal) > MADE
    left, s, rotation = np.linalg.svd(r[:, :k][:, own], full_matrices=False)
    keep = s > s.max(initial=0.0) * 1e-12
    inverse = rotation.T[:, keep] / s[keep]
    part = left[:, keep].T @ r[:, k]
    coefficients = np.zeros(k)
    coefficients[own] = inverse @ part
    fitted = (coefficients / scale) @ columns
    left_over = r[:, k] - left[:, keep] @ part
    rest = float(left_over @ left_over) / max(int(np.count_nonzero(weight)) - int(keep.sum()), 1)
    covariance = np.full((k, k), np.nan)
    covariance[np.ix_(own, own)] = rest * (inverse @ inverse.T)
    covariance /= np.outer(scale, scale)
    return Regression(coefficients / scale, covariance, fitted)
