"""Residuals of few samples in time: records that disagree, and a part of the motion that is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
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
from .initial_state import begins_in_zero, from_zero, slopes
from .regression import trend_columns

__all__ = ["durbin_watson", "in_samples", "serial"]

UNLIKELY, RARE = 0.01, 0.002  # p-values of the test over all outputs below which it speaks, and warns
MOST = 400  # samples that count; of more, lines tell as much
NEAR_POLE, SAME = 1e-9, 1e-9  # how near to its poles a slope is taken; columns that are made of others
EXACT = 1e-5  # of an output: residuals that are no noise

Part = list[tuple[F64, F64]]  # residuals of each record, and their slopes (unknown, sample)


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
        parts = [_of_output(fit, i) for i in range(len(fit.outputs))]
        if _is_exact(fit, parts):
            return None
        if apart := _disagreeing(fit, parts):
            return apart
        tests = [durbin_watson([e for e, _ in part], _common(part, fit.params.size)) for part in parts]
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
        f"motion that is slower than the samples. {_first(fit, least)}; fit.plot_response() shows where it "
        "is missed.",
        sure=p[least] < RARE,
    )


def _first(fit: Any, i: int) -> str:
    """What to try: an offset of the output first where one step to it leaves residuals as of white noise."""
    term = "a further term or hidden signal, such as a second compartment"
    if fit.trend is None and fit.layout.compiled.is_linear:
        part = _of_output(fit, i, "constant")
        _, p = durbin_watson([e for e, _ in part], _common(part, fit.params.size))
        if p > UNLIKELY:
            name = fit.outputs[i]
            return (
                f'First try an offset of {name}, trend="constant", as of a baseline of the measurement, '
                f"which would leave nothing of that (p = {p:.2g}), and then {term}: the lower BIC decides"
            )
    return f"First try {term}"


def _is_exact(fit: Any, parts: Sequence[Part]) -> bool:
    """Whether residuals are so small a part of an output that errors of integrations may be what they are."""
    for own, level in zip(parts, np.mean(fit.noise_levels, axis=0), strict=True):
        size = max([float(np.max(np.abs(rec.y))) for rec in fit.records])
        off = float(np.sqrt(np.mean(np.concatenate([e for e, _ in own]) ** 2))) * level
        if off < EXACT * (1.0 if fit.options.noise == "log-normal" else size):
            return True
    return False


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
    e, rest = np.concatenate(residual), _beyond(columns)
    squares = np.zeros((e.size, e.size))
    at = 0
    for own in residual:
        step = np.diff(np.eye(own.size), axis=0)
        squares[at : at + own.size, at : at + own.size] = step.T @ step
        at += own.size
    # Parameters that other outputs decide, too, leave more of the noise than the columns of this one would.
    own, within = rest.T @ e, rest.T @ squares @ rest
    found = float(own @ within @ own / (own @ own))
    return found, _below(np.asarray(np.linalg.eigvalsh(within), float) - found)


def _below(weights: F64) -> float:
    """Probability that a sum of squares of normal numbers with these weights is below zero."""
    low, high = weights.min(initial=0.0), weights.max(initial=0.0)
    if low >= 0 or high <= 0:
        return float(low < 0)
    # The slope of the cumulant function grows from -inf to inf between these, and is zero at one point.
    from scipy.optimize import brentq
    from scipy.special import ndtr

    ends = (1 - NEAR_POLE) / (2 * low), (1 - NEAR_POLE) / (2 * high)
    at = float(brentq(lambda x: np.sum(weights / (1 - 2 * x * weights)), *ends, xtol=1e-14))
    cumulant = -0.5 * float(np.sum(np.log1p(-2 * at * weights)))
    curvature = 2 * float(np.sum((weights / (1 - 2 * at * weights)) ** 2))
    w, v = np.sign(at) * sqrt(max(-2 * cumulant, 0.0)), at * sqrt(curvature)
    if abs(w) < 1e-4:  # at the mean, where the formula is 0/0
        return 0.5
    return float(ndtr(w + log(v / w) / w))


def _of_output(fit: Any, i: int, trend: str | None = None) -> Part:
    """Residuals of an output of each record where samples count, and their slopes, in units of the noise.

    `trend`: of the output, whose slopes are wanted, too.
    """
    parts = []
    p, logs = fit.params.size, fit.options.noise == "log-normal"
    zero = fit.options.initial_state == "zero"
    for rec, level in zip(fit.records, fit.noise_levels, strict=True):
        simulated, start = fit.simulate(rec, "zero" if zero else None)
        if begins_in_zero(fit):
            simulated, start = from_zero(fit, rec)[0], replace(start, trend=np.zeros(0))
        each = slopes(fit, rec, start)[:, i]
        if zero:
            each = np.delete(each, np.s_[p : p + start.state.size], axis=0)
        trend = fit.trend if begins_in_zero(fit) else trend
        each = np.vstack([each, trend_columns(rec.t, trend)])
        weights = sample_weights(rec.mask, rec.sigma, rec.y.shape)[i]
        counts = (weights > 0) & (not logs or (simulated[i] > 0) & (rec.y[i] > 0))
        model, y, weights = simulated[i, counts], rec.y[i, counts], weights[counts] / level[i]
        off, over = (np.log(y / model), weights / model) if logs else (y - model, weights)
        parts.append((off * weights, each[:, counts] * over))
    return parts


def _common(parts: Part, p: int) -> F64:
    """Slopes (unknown, sample) of all records: to parameters, and to the initial state and trend of each."""
    first = np.concatenate([each[:p] for _, each in parts], axis=1)
    return np.concatenate([first, _apart([(e, each[p:]) for e, each in parts])])


def _apart(parts: Part) -> F64:
    """The same where each record has unknowns of its own."""
    found = np.zeros((sum([len(each) for _, each in parts]), sum([e.size for e, _ in parts])))
    row = at = 0
    for _, each in parts:
        found[row : row + len(each), at : at + each.shape[1]] = each
        row, at = row + len(each), at + each.shape[1]
    return found


def _disagreeing(fit: Estimates, parts: Sequence[Part]) -> Doubt | None:
    """That records have parameters of their own, as subjects have: an F test of one step to these."""
    from scipy.special import fdtrc

    p, records = fit.params.size, range(len(fit.records or ()))
    if len(records) < 2 or not p:
        return None
    rows = [(np.concatenate([e for e, _ in each]), each) for each in zip(*parts, strict=True)]
    own = [(e, np.concatenate([columns for _, columns in each], axis=1)) for e, each in rows]
    e = np.concatenate([one for one, _ in own])
    (together, few), (alone, many) = (_left(e, columns) for columns in (_common(own, p), _apart(own)))
    freedom = e.size - many
    if freedom < 1 or many == few:
        return None
    chance = float(fdtrc(many - few, freedom, (together - alone) / (many - few) / (alone / freedom)))
    if not chance < UNLIKELY:
        return None
    steps = np.array([np.linalg.lstsq(columns.T, one, rcond=None)[0][:p] for one, columns in own])
    at = int(np.argmax(np.ptp(steps, axis=0) / np.maximum(fit.bse, 1e-300)))
    low, high = int(np.argmin(steps[:, at])), int(np.argmax(steps[:, at]))
    values = fit.params[at] + steps[:, at]
    return Doubt(
        f"The records disagree on the parameters (p = {chance:.2g}): {fit.param_names[at]} is about "
        f"{values[low]:.3g} in record {low} and {values[high]:.3g} in record {high}, as of different "
        "subjects or conditions. Standard errors count the noise alone, not what differs between records. "
        "First fit each by itself, mf.fit_many(records, model) with the same options, and compare.",
        sure=chance < RARE,
    )


def _left(e: F64, columns: F64) -> tuple[float, int]:
    """Sum of squares that least squares on the columns leaves, and how many of these differ."""
    rest = _beyond(columns)
    return float(np.sum((rest.T @ e) ** 2)), e.size - rest.shape[1]


def _beyond(columns: F64) -> F64:
    """Orthonormal directions (sample, …) that least squares on the columns leaves alone."""
    size = np.linalg.norm(columns, axis=1)
    every, singular, _ = np.linalg.svd((columns[size > 0] / size[size > 0, None]).T)
    return np.asarray(every[:, int(np.sum(singular > SAME)) :])
