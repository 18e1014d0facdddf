"""Fits in noise with heavy tails: Student's t for the samples, scale and tail estimated with the rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.gamma_regression import smooth_level
from ..errors import FitError, ModfunError, SpecError
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.mask import sample_weights
from ..records.record import Record
from ..results.estimates import COVARIANCES
from ..results.priors import shares
from ..results.slopes import response_slopes
from ..results.uneven_noise import SHORTEST, level_in_time, unforeseen

__all__ = ["refuse_robust", "robust_fit"]

ROUNDS = 20
SETTLED = 0.02  # of a standard error: change of a parameter that ends the rounds
TAILS = (1.0, 60.0)  # degrees of freedom that are tried; beyond, noise is normal
SAME = 1e-9  # singular values below are rounding
GAIN = 3.0  # of log likelihood over normal noise, without which noise is taken as normal


def robust_fit(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_once: Callable[[tuple[Record, ...], Any, Options], Any],
) -> Any:
    """The fit with each sample weighted by what Student's t makes of its residual.

    Rounds of expectation and maximisation: a sample whose residual is e in units of the scale has the
    variance (ν + e²)/(ν + 1); the fit that follows counts it (`Record.sigma`). Equations, whose powers and
    products an error of one sample bends, are fitted to samples that are that much nearer to the response
    instead: the scores are the same (P. J. Huber, Robust Statistics, Wiley, 1981, section 7.8). Where the
    residuals are no heavier than normal ones, the plain fit is returned.

    Raises
    ------
    SpecError
        Options that do not go with weighted samples.
    FitError
        A fit whose response cannot be simulated beside its records.
    """
    refuse_robust(options)
    options, equations = options.replace(robust=False), not isinstance(structure, TransferFunction)
    fit = first = fit_once(records, structure, options)
    if not first.usable:
        return first
    asked = options.replace(robust=True)
    for _ in range(ROUNDS):
        responses = [_response(fit, own) for own in fit.records]
        errors = [_errors(y, rec) for y, rec in zip(responses, records, strict=True)]
        tail, gain, weights = student(errors)
        if gain < GAIN:
            return replace(first, options=asked, again=first.again)
        weighed = tuple(_weighed(rec, own) for rec, own in zip(records, weights, strict=True))
        taken = weighed
        if equations:
            taken = tuple(_nearer(*each, tail) for each in zip(records, responses, weights, strict=True))
        after = fit_once(taken, structure, options)
        if not after.usable:
            raise FitError(f"fit: robust=True: the fit with weighted samples failed ({after.message})")
        moved = np.fmax.reduce(np.abs(after.params - fit.params) / after.bse, initial=0.0)
        fit = after
        if moved < SETTLED:
            break
    # Weights count as known in the covariances; that they follow the residuals costs information.
    lost = _lost_nearer(tail, weights) if equations else _lost(fit, tail, weights, errors)
    _, told = shares(fit)
    wider = {name: told + lost * (getattr(fit, name) - told) for name in COVARIANCES}
    if not equations:
        wider["cov_spectral"] = _of_scores(fit, records, tail, errors, weights, wider)
    return replace(fit, options=asked, tail=tail, records=weighed if equations else fit.records, **wider)


def refuse_robust(options: Options) -> None:
    """Refuse options that do not go with weighted samples."""
    able = options.initial_state in ("unknown", "rest", "zero") and options.method in ("ml", "awls")
    if not able or options.reference:
        raise SpecError(
            'fit: robust=True weights samples, which goes with "ml" and "awls", an initial_state that is '
            'unknown, "rest" or "zero", and no reference=; leave the other option out'
        )


def _of_scores(
    fit: Any,
    records: Sequence[Record],
    tail: float,
    errors: Sequence[F64],
    weights: Sequence[F64],
    wider: dict[str, F64],
) -> F64:
    """Covariance where the scores of the samples have a colour, or a level that changes.

    To first order an estimate is off by H⁻¹ Σ J ψ over the samples, J the slopes of the response, those to
    initial state and trend among them, ψ = w z the score of an error z in units of the scale, H = Σ ψ' J Jᵀ.
    Scores of a smooth spectrum and a smooth level in time make other errors of it than independent ones of
    one distribution do, Eψ²/(Eψ')² (Σ J Jᵀ)⁻¹: by that, classical covariances grow. On weighted lines no
    spectrum shows, as the weights mix them.
    """
    p = fit.params.size
    if any([rec.dt is None or rec.mask is not None or rec.intervals < SHORTEST for rec in records]):
        return wider["cov_spectral"]
    try:
        each = [response_slopes(fit, rec, fit.simulate(rec)[1])[:2] for rec in fit.records]
    except (ModfunError, np.linalg.LinAlgError):
        return wider["cov_spectral"]
    # Initial states and trends are each record's own.
    counts = [len(columns) for _, columns in each]
    pieces, at = [], p
    for (moved, columns), own, count in zip(each, weights, counts, strict=True):
        rows = np.zeros((p + sum(counts), *own.shape))
        rows[:p], rows[at : at + count] = moved, columns
        pieces.append(rows)
        at += count
    joined = np.concatenate(pieces, axis=2)
    w = np.concatenate(weights, axis=1)
    square = np.maximum((tail + 1) / w - tail, 0.0)
    levels = np.sqrt(np.sum(np.concatenate(errors, axis=1) ** 2, axis=1) / np.sum(square, axis=1))
    joined /= levels[:, None]
    slope = w**2 * (tail - square) / (tail + 1)
    inverse, even = (_inverse(np.einsum("aot,ot,bot->ab", joined, own, joined)) for own in (slope, 0 * w + 1))
    coloured, white, at = np.zeros(p), np.diag(even)[:p] * np.mean(w**2 * square) / np.mean(slope) ** 2, 0
    for e, own in zip(errors, weights, strict=True):
        filters = np.einsum("ab,bot->aot", inverse[:p], joined[:, :, at : at + own.shape[1]])
        at += own.shape[1]
        for i, level in enumerate(levels):
            score = own[i] * e[i] / level
            run = level_in_time(unforeseen(score[None])[0])
            noise = score / run
            m = np.arange(noise.size // 2 + 1)
            freedom = np.where((m == 0) | (2 * m == noise.size), 1.0, 2.0)
            spectrum = smooth_level(np.abs(np.fft.rfft(noise)) ** 2 / noise.size, np.log1p(m), freedom)
            waves = np.abs(np.fft.rfft(filters[:, i] * run)) ** 2 * freedom * spectrum
            coloured += waves.sum(axis=1) / noise.size
    # What the fit takes of the noise on its lines, the scores lack.
    rows = len(fit.outputs) * sum(fit.rows)
    coloured *= rows / max(rows - len(joined), 1)
    more = np.sqrt(np.maximum(np.divide(coloured, white, out=np.ones(p), where=white > 0), 1.0))
    _, told = shares(fit)
    return np.asarray(np.outer(more, more) * (wider["cov_nonrobust"] - told) + told)


def _inverse(information: F64) -> F64:
    size = np.sqrt(np.abs(np.diag(information)))
    size[size == 0] = 1.0
    scale = np.outer(size, size)
    return np.asarray(np.linalg.pinv(information / scale, rcond=SAME, hermitian=True) / scale)


def _lost(fit: Any, tail: float, weights: Sequence[F64], errors: Sequence[F64]) -> float:
    """By how much variances are larger than those of known weights at the level of the lines.

    An M-estimate with the score psi(z) = w z of z = e/scale has the variance scale² E psi²/(E psi')² over the
    number of samples (P. J. Huber, Robust Statistics, Wiley, 1981, section 3.2), known weights count as
    level/E w; means over the samples stand for expectations. The level of the lines is no such mean: few
    lines see the large errors that the weights take from the estimate.
    """
    w = np.concatenate([own[np.isfinite(own)] for own in weights])
    square = np.maximum((tail + 1) / w - tail, 0.0)
    slope = float(np.mean(w**2 * (tail - square))) / (tail + 1)
    score, mean = float(np.mean(w**2 * square)), float(np.mean(w))
    over = []
    for i, level in enumerate(np.diag(fit.noise_cov)):
        e, own = (
            np.concatenate([each[i][np.isfinite(each[i])] for each in both]) for both in (errors, weights)
        )
        scale = float(np.sum(e**2) / np.sum((tail + 1) / own - tail))
        over.append(scale / level)
    return float(np.mean(over)) * score * mean / slope**2


def _lost_nearer(tail: float, weights: Sequence[F64]) -> float:
    """The same of samples that were moved: their scatter is that of the scores, whose mean slope is left."""
    w = np.concatenate([own[np.isfinite(own)] for own in weights])
    square = np.maximum((tail + 1) / w - tail, 0.0)
    return float(np.mean(tail * (tail - square) / (tail + square) ** 2)) ** -2


def _response(fit: Any, weighed: Record) -> F64:
    try:
        simulated: F64 = fit.simulate(weighed)[0]
    except ModfunError as error:
        raise FitError(f"fit: robust=True weighs samples by the simulation's errors, but {error}") from None
    return simulated


def _errors(response: F64, rec: Record) -> F64:
    """Simulation errors at the samples (output, time) over the record's own sigma; nan where masked."""
    own = sample_weights(rec.mask, rec.sigma, rec.y.shape)
    return np.where(own > 0, (rec.y - response) * own, np.nan)


def _nearer(rec: Record, response: F64, weights: F64, tail: float) -> Record:
    """The record with samples as near to the response as their scores are small."""
    part = np.where(np.isfinite(weights), weights * tail / (tail + 1), 1.0)
    return rec._like(y=response + part * (rec.y - response))


def _weighed(rec: Record, weights: F64) -> Record:
    own = np.ones_like(weights) if rec.sigma is None else rec.sigma
    return rec.weigh(sigma=own / np.sqrt(np.where(np.isfinite(weights), weights, 1.0)))


def student(errors: Sequence[F64]) -> tuple[float, float, list[F64]]:
    """Student's t for rows of errors, one tail for all and a scale for each row of each record.

    Returns
    -------
    tail : float
        Degrees of freedom ν.
    gain : float
        Log likelihood above that of normal noise.
    weights : list of ndarray
        (ν + 1)/(ν + e²) of each error e in units of its scale, mean about 1.
    """
    from scipy.optimize import minimize_scalar

    rows = [row[np.isfinite(row)] for each in errors for row in each]

    def loss(log_tail: float) -> float:
        return -sum(_likelihood(row, math.exp(log_tail))[0] for row in rows)

    found = minimize_scalar(loss, bounds=[math.log(edge) for edge in TAILS], method="bounded")
    tail = math.exp(float(found.x))
    normal = sum(-0.5 * row.size * (math.log(2 * math.pi * np.mean(row**2)) + 1) for row in rows)
    weights = []
    for each in errors:
        scales = np.array([_likelihood(row[np.isfinite(row)], tail)[1] for row in each])
        weights.append((tail + 1) / (tail + (each / scales[:, None]) ** 2))
    return tail, -float(found.fun) - normal, weights


def _likelihood(row: F64, tail: float) -> tuple[float, float]:
    """Largest log likelihood of errors under Student's t, and its scale."""
    scale = 1.4826 * float(np.median(np.abs(row))) or float(np.sqrt(np.mean(row**2)))
    for _ in range(200):
        square = (row / scale) ** 2
        better = scale * math.sqrt(float(np.mean((tail + 1) / (tail + square) * square)))
        done = abs(better / scale - 1) < 1e-8
        scale = better
        if done:
            break
    constant = math.lgamma((tail + 1) / 2) - math.lgamma(tail / 2) - 0.5 * math.log(tail * math.pi)
    log = np.log1p((row / scale) ** 2 / tail)
    return row.size * (constant - math.log(scale)) - (tail + 1) / 2 * float(np.sum(log)), scale
