"""How well a model explains a record: scores, free responses and tests of the residual lines.

Pure functions of arrays; `Fit` calls them. Arrays are (channel, time) or, for lines, over the
harmonic index m.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._core import simulate, simulate_uneven
from ..errors import DataError
from ..systems.polynomials import companion, time_unit

__all__ = [
    "Regression",
    "Whiteness",
    "colour_of_lines",
    "correlation_of_lines",
    "cumulated_power",
    "fit_percent",
    "free_response",
    "r2",
    "regress",
    "signal_to_error",
    "theil",
    "trend_columns",
]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]


# Scores of one output ---------------------------------------------------------------------------


def _pair(y: F64, simulated: F64) -> tuple[F64, F64]:
    y, simulated = np.asarray(y, float), np.asarray(simulated, float)
    if y.shape != simulated.shape or y.ndim != 1 or y.size < 2:
        raise DataError(
            f"Scoring needs two series of equal length (2 samples at least), got shapes {y.shape} and "
            f"{simulated.shape}; give one output at a time, measured and simulated on the same samples."
        )
    return y, simulated


def _rms(v: F64) -> float:
    peak = float(np.max(np.abs(v)))
    return peak * float(np.sqrt(np.mean((v / peak) ** 2))) if peak > 0 else 0.0


def signal_to_error(y: F64, simulated: F64) -> float:
    """Signal-to-error ratio in dB, 20 log10(RMS(y - mean y) / RMS(y - simulated)).

    The RMS of the signal is taken about its mean: an angle that stands at 20 degrees would flatter the
    ratio (report, section 4.7, takes it about zero). 16 dB is a very good fit; above 30 dB the eye
    sees no difference.

    Parameters
    ----------
    y, simulated : (time,) arrays
        Measured and simulated output.

    Returns
    -------
    float
        dB; inf for a perfect simulation, -inf or nan for an output that does not move.
    """
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(20 * np.log10(np.divide(_rms(y - y.mean()), _rms(y - simulated))))


def fit_percent(y: F64, simulated: F64) -> float:
    """100 (1 - RMS(y - simulated) / RMS(y - mean y)): 100 is perfect, 0 no better than the mean."""
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(100 * (1 - np.divide(_rms(y - simulated), _rms(y - y.mean()))))


def r2(y: F64, simulated: F64) -> float:
    """Coefficient of determination, 1 - mean square error / variance of y."""
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(1 - np.divide(_rms(y - simulated), _rms(y - y.mean())) ** 2)


def theil(y: F64, simulated: F64) -> float:
    """Theil's inequality coefficient, RMS(y - simulated) / (RMS(y) + RMS(simulated)): 0 perfect, 1 worst.

    Flight-test practice takes values below .25 to .3 for a good model.
    """
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.divide(_rms(y - simulated), _rms(y) + _rms(simulated)))


# Initial state and trend ------------------------------------------------------------------------


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
    rows = np.empty((n, t.size))
    even = bool(np.ptp(step) <= 1e-9 * step.mean())
    dt = float(t[-1] - t[0]) / step.size
    nothing, into, through = np.zeros((1, t.size)), np.zeros((n, 1)), np.zeros((1, 1))
    pick = np.eye(n)[:1]
    for i, start in enumerate(np.eye(n)):
        system = a, into, pick, through, start, nothing
        if even:
            rows[i] = simulate(*system, dt, "zoh", None)[0]
        else:
            rows[i] = simulate_uneven(*system, [True], t)[0]
    return rows / rate ** np.arange(n)[:, None]


def trend_columns(t: F64, trend: str | None) -> F64:
    """Offset (and slope) of an output: rows 1 and (t - t[0])/T, as many as the trend has."""
    time = (t - t[0]) / (t[-1] - t[0])
    return np.vstack([np.ones_like(time), time])[: {None: 0, "constant": 1, "linear": 2}[trend]]


@dataclass(frozen=True)
class Regression:
    """Linear least squares by QR: coefficients, their covariance, and the fitted series."""

    coefficients: F64
    covariance: F64
    fitted: F64


def regress(y: F64, columns: F64, weight: F64) -> Regression:
    """Least squares of a series (time,) on the rows of `columns` (k, time), rows scaled to unit norm.

    `weight` is 1/standard deviation of each sample up to a factor, 0 where it does not count. Columns that
    the samples cannot tell apart get the smallest coefficients that explain them; the covariance takes the
    remainder as white.
    """
    k = columns.shape[0]
    if k == 0:
        return Regression(np.zeros(0), np.zeros((0, 0)), np.zeros_like(y))
    if not np.all(np.isfinite(columns)):
        raise DataError(
            "The free response of the model overflows within this record: a mode is too unstable for a "
            f"simulation over all {y.size} samples; predict a shorter piece with rec.window(start, stop)."
        )
    scale = np.array([_rms(row) * np.sqrt(y.size) for row in columns * weight])
    scale[scale == 0] = 1.0
    q, s, rotation = np.linalg.svd((columns * weight / scale[:, None]).T, full_matrices=False)
    keep = s > s[0] * 1e-12
    inverse = rotation.T[:, keep] / s[keep]
    coefficients = inverse @ (q[:, keep].T @ (y * weight))
    fitted = (columns / scale[:, None]).T @ coefficients
    rest = float(np.sum((weight * (y - fitted)) ** 2))
    rest /= max(int(np.count_nonzero(weight)) - int(keep.sum()), 1)
    covariance = rest * (inverse @ inverse.T) / np.outer(scale, scale)
    return Regression(coefficients / scale, covariance, fitted)


# Residual lines ---------------------------------------------------------------------------------


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
    power = sum(float(np.sum(np.abs(e) ** 2)) for e in residuals)
    if lags < 1 or power == 0:
        return Whiteness(np.nan, np.nan, count), np.zeros(0)
    r = np.array(
        [sum(float(np.sum((e[k:] * e[:-k].conj()).real)) for e in residuals) for k in range(1, lags + 1)]
    )
    r /= power
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
    share = np.concatenate([np.linspace(0, 1, e.size + 1)[1:] for e in residuals])
    order = np.argsort(share, kind="stable")
    power: F64 = np.concatenate([np.abs(e) ** 2 for e in residuals])[order]
    return power
