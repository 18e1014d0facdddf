"""Noise that changes over a record: a test, its level in time, and the errors that it makes."""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import F64
from ..base.gamma_regression import smooth_level
from ..errors import ModfunError
from .doubts import Doubt
from .estimates import Estimates
from .further import fitted_lines, stationary

__all__ = ["Uneven", "covariance", "of_time", "uneven"]

UNEVEN = 0.01  # p-value below which noise is taken to change
POWERS = 4  # polynomials of the test
SHORTEST = 64  # samples
ORDER = 8  # of the autoregression
LEAST = 0.1  # of a line that must be left of it


class Uneven(NamedTuple):
    """How the noise of an output changes over its records.

    Attributes
    ----------
    p_value : float
        Of the test that it does not.
    output : int
    errors : tuple of ndarray
        Residuals of each record, (time,), without its last sample.
    level : tuple of ndarray
        Smooth standard deviation of what is new in each, (time,).
    """

    p_value: float
    output: int
    errors: tuple[F64, ...]
    level: tuple[F64, ...]


def uneven(fit: Estimates) -> Uneven | None:
    """The output whose noise changes most plainly; None where residuals in time cannot tell.

    Squares of what an autoregression does not foresee of the residuals are regressed on polynomials of the
    time; their number times R² is chi-squared, whatever the tails of the noise (R. Koenker, J. Econometrics
    17, 1981).
    """
    records = fit.records or ()
    short = min(fit.intervals, default=0) < SHORTEST or any(rec.dt is None for rec in records)
    if (
        not records
        or short
        or not fit.usable
        or not stationary(fit)
        or fit.process_levels is not None
        or isfinite(fit.tail)
    ):
        return None
    try:
        with np.errstate(all="ignore"):
            errors = [
                (rec.y - fit.simulate(rec)[0])[:, rec.intervals - count : -1]
                for rec, count in zip(records, fit.intervals, strict=True)
            ]
    except (ModfunError, np.linalg.LinAlgError):  # a response that leaves the range of numbers
        return None
    if not all(np.all(np.isfinite(own)) and np.all(own.any(axis=1)) for own in errors):
        return None
    if any(
        np.any(np.ptp(own, axis=1) > 2 * np.ptp(rec.y, axis=1))
        for own, rec in zip(errors, records, strict=True)
    ):
        return None  # of a simulation that runs away
    found = [_of_output([own[i] for own in errors], i) for i in range(len(fit.outputs))]
    return min(found, key=lambda one: one.p_value)


def _of_output(errors: list[F64], output: int) -> Uneven:
    from scipy.special import chdtrc

    levels, statistic = [], 0.0
    size = max(float(np.abs(own).max()) for own in errors)  # squares of any unit stay numbers
    for own in [own / size for own in errors]:
        past = np.array([own[ORDER - lag : own.size - lag] for lag in range(1, ORDER + 1)]).T
        new = own[ORDER:] - past @ np.linalg.lstsq(past, own[ORDER:], rcond=None)[0]
        squares, time = np.append(np.zeros(ORDER), new**2), np.linspace(-1.0, 1.0, own.size)
        basis = np.linalg.qr(np.polynomial.chebyshev.chebvander(time[ORDER:], POWERS))[0][:, 1:]
        about = squares[ORDER:] - squares[ORDER:].mean()
        statistic += about.size * float(np.sum((basis.T @ about) ** 2) / (about @ about))
        levels.append(size * np.sqrt(smooth_level(squares, time, 1.0 * (time >= time[ORDER]))))
    p = float(chdtrc(POWERS * len(errors), statistic))
    return Uneven(p, output, tuple(errors), tuple(levels))


def covariance(fit: Estimates) -> F64 | None:
    """Covariance of the parameters where the noise of an output changes; None where it does not.

    The influence of the lines on an estimate is one of the samples, a filter k(t) with the error Σ k(t) e(t).
    With e(t) = σ(t) c(t), c of the spectrum s, the covariance is that of k σ filtered by s: with a constant σ
    the spectral one.
    """
    found = uneven(fit) if _allowed_for(fit) else None
    if found is None or found.p_value > UNEVEN:
        return None
    jacobian, deviations = fitted_lines(fit, 0)
    inverse = np.linalg.pinv(jacobian @ jacobian.T, hermitian=True)
    influence = inverse @ jacobian
    cov, at = np.zeros((fit.params.size, fit.params.size)), 0
    for (low, high), deviation, errors, level in zip(
        fit.lines, deviations, found.errors, found.level, strict=True
    ):
        count, lines = errors.size, high + 1 - low
        real, imag = (slice(at + k * lines, at + (k + 1) * lines) for k in range(2))
        at += 2 * lines
        influences = influence[: len(cov), real] - 1j * influence[: len(cov), imag]
        filters = _in_time(influences / deviation, low, count) * level
        fitted = _in_time((jacobian[:, real] - 1j * jacobian[:, imag]) * deviation, low, count)
        m = np.arange(count // 2 + 1)
        freedom = np.where((m == 0) | (2 * m == count), 1.0, 2.0)
        left = _left(np.linalg.svd(fitted.T, full_matrices=False)[0], level)
        power = np.abs(np.fft.rfft(errors / level)) ** 2 / count / np.maximum(left, LEAST)
        spectrum = smooth_level(power, np.log1p(m), freedom * np.where(left > LEAST, left, 0.0))
        waves = np.fft.rfft(filters) * np.sqrt(freedom * spectrum / count)
        cov += (waves.conj() @ waves.T).real
    return cov


def _allowed_for(fit: Estimates) -> bool:
    """Whether errors of such a fit can allow for noise that changes."""
    plain = len(fit.outputs) == 1 and fit.options.noise == "output" and fit.options.initial_state == "unknown"
    plain = plain and fit.layout.rational and fit.options.method in ("awls", "ml") and not fit.window_weights
    return plain and not (isfinite(fit.stability_cost) or fit.at_bound or fit.instrumented)


def of_time(fit: Estimates) -> Doubt | None:
    """That the noise changes over the record, and what the standard errors make of it."""
    found = uneven(fit)
    if found is None or found.p_value > UNEVEN:
        return None
    level = np.concatenate(found.level)
    allowed = (
        "The standard errors allow for it"
        if fit.cov_type == "spectral" and _allowed_for(fit)
        else "The standard errors do not allow for it"
    )
    return Doubt(
        f"The noise of {fit.outputs[found.output]} changes over the record: its level in time varies by a "
        f"factor of {level.max() / level.min():.2g} (p = {found.p_value:.2g}). {allowed}; "
        "Record(sigma=...) weights the samples by it, too.",
        sure=False,
    )


def _in_time(lines: Any, low: int, count: int) -> F64:
    """Sums of lines from `low` on, (k, line), as functions of time."""
    full = np.zeros((len(lines), count), complex)
    full[:, low : low + lines.shape[1]] = lines
    return np.asarray(np.fft.fft(full).real / count)


def _left(fitted: F64, level: F64) -> F64:
    """What is left of the power of each line when noise of a level in time loses what was fitted.

    Over that of white noise; `fitted` are orthonormal, (time, k).
    """
    times = fitted * level[:, None]
    over, under = (np.fft.rfft(own, axis=0) / np.sqrt(level.size) for own in (fitted / level[:, None], times))
    removed = 2 * np.sum(over * under.conj(), axis=1).real
    return np.asarray(1 - removed + np.sum((over @ (times.T @ times)) * over.conj(), axis=1).real)
