"""Residuals of a response that follow each other from sample to sample: a part of the motion is missing."""

from __future__ import annotations

from math import log, sqrt
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..base.names import listed
from ..errors import ModfunError
from ..records.mask import sample_weights
from .doubts import Doubt
from .estimates import Estimates
from .initial_state import slopes

__all__ = ["durbin_watson", "in_samples", "serial"]

UNLIKELY, RARE = 0.01, 0.002  # p-values of the test over all outputs below which it speaks, and warns
MOST = 400  # samples that count; of more, lines tell as much
BISECTIONS = 200


def in_samples(fit: Estimates) -> bool:
    """Whether residuals of a fit are judged in time: of few uneven samples, that led it by their response.

    Their lines are few, and what sums take uneven steps for looks like terms and inputs that are missing.
    """
    records = fit.records or ()
    few = sum([rec.t.size for rec in records]) <= MOST and all([rec.dt is None for rec in records])
    return bool(getattr(fit, "by_response", False) and records and few and fit.usable)


@kept
def serial(fit: Estimates) -> Doubt | None:
    """That residuals of a fit by its response resemble those of the samples before them.

    With a dozen samples no other test has power: lines are few, and no high band shows the noise.
    """
    try:
        tests = [durbin_watson(*_of_output(fit, i)) for i in range(len(fit.outputs))]
    except (ModfunError, np.linalg.LinAlgError):
        return None
    p = [len(tests) * own for _, own in tests]
    told = [i for i in range(len(tests)) if p[i] < UNLIKELY]
    if not told:
        return None
    least = min(told, key=lambda i: p[i])
    return Doubt(
        f"The residuals of {listed([fit.outputs[i] for i in told])} follow each other from sample to sample "
        f"(Durbin-Watson {tests[least][0]:.2g}, p = {p[least]:.2g}): the response misses a part of the "
        "motion that is slower than the samples. First try a further term or hidden signal, such as a second "
        "compartment; fit.plot_response() shows where it is missed.",
        sure=p[least] < RARE,
    )


def durbin_watson(residual: list[F64], columns: F64) -> tuple[float, float]:
    """Squares of differences of neighbours over squares of residuals; how likely so small a one is.

    The probability is that in white noise, given what least squares on the columns takes from it
    (Lugannani-Rice's saddlepoint of a quadratic form).

    Parameters
    ----------
    residual : list of (sample,) arrays
        Of each record, in units of the noise.
    columns : (unknown, sample) array
        What the residuals of all records were fitted by.

    References
    ----------
    J. Durbin, G. S. Watson, Testing for serial correlation in least squares regression II, Biometrika 38,
    1951; R. Lugannani, S. Rice, Saddle point approximation for the distribution of the sum of independent
    random variables, Adv. Appl. Probab. 12, 1980.
    """
    e, size = np.concatenate(residual), np.linalg.norm(columns, axis=1)
    x = columns[size > 0] / size[size > 0, None]
    left, singular, _ = np.linalg.svd(x.T, full_matrices=True)
    rest = left[:, int(np.sum(singular > 1e-9)) :]  # what least squares leaves
    squares = np.zeros((e.size, e.size))
    at = 0
    for own in residual:
        step = np.diff(np.eye(own.size), axis=0)
        squares[at : at + own.size, at : at + own.size] = step.T @ step
        at += own.size
    found = float(e @ squares @ e / (e @ e))
    return found, _below(np.linalg.eigvalsh(rest.T @ squares @ rest) - found)


def _below(weights: F64) -> float:
    """Probability that a sum of squares of normal numbers with these weights is below zero."""
    low, high = weights.min(initial=0.0), weights.max(initial=0.0)
    if low >= 0 or high <= 0:
        return float(low < 0)
    # The slope of the cumulant function grows from -inf to inf between these, and is zero at one point.
    begin, end = 1 / (2 * low), 1 / (2 * high)
    for _ in range(BISECTIONS):
        at = (begin + end) / 2
        begin, end = (at, end) if np.sum(weights / (1 - 2 * at * weights)) < 0 else (begin, at)
    from scipy.special import ndtr

    cumulant = -0.5 * float(np.sum(np.log1p(-2 * at * weights)))
    curvature = 2 * float(np.sum((weights / (1 - 2 * at * weights)) ** 2))
    w, v = np.sign(at) * sqrt(max(-2 * cumulant, 0.0)), at * sqrt(curvature)
    if abs(w) < 1e-4:  # at the mean, where the formula is 0/0
        return 0.5
    return float(ndtr(w + log(v / w) / w))


def _of_output(fit: Any, i: int) -> tuple[list[F64], F64]:
    """Residuals of an output of each record where samples count, and slopes of all, in units of the noise."""
    residual, parts = [], []
    p, logs = fit.params.size, fit.options.noise == "log-normal"
    for rec, level in zip(fit.records, fit.noise_levels, strict=True):
        simulated, start = fit.simulate(rec)
        each = slopes(fit, rec, start)[:, i]
        if fit.options.initial_state != "unknown":
            each = np.delete(each, np.s_[p : p + start.state.size], axis=0)
        weights = sample_weights(rec.mask, rec.sigma, rec.y.shape)[i]
        counts = weights > 0
        model, y, weights = simulated[i, counts], rec.y[i, counts], weights[counts] / level[i]
        if logs:
            keep = (model > 0) & (y > 0)
            counts = np.flatnonzero(counts)[keep]
            model, y, weights = model[keep], y[keep], weights[keep] / model[keep]
            residual.append(np.log(y / model) * weights * model)
        else:
            residual.append((y - model) * weights)
        parts.append(each[:, counts] * weights)
    columns = np.zeros((p + sum([len(own) - p for own in parts]), sum([own.size for own in residual])))
    row, at = p, 0
    for own in parts:  # initial states and trends are those of one record
        end = at + own.shape[1]
        columns[:p, at:end] = own[:p]
        columns[row : row + len(own) - p, at:end] = own[p:]
        row, at = row + len(own) - p, end
    return residual, columns
