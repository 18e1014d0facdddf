"""A drift in records that begin in a known state, which a constant trend leaves in the gains."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..records.mask import sample_weights
from ..records.record import Record
from .cures import WORTH, again, on_band
from .diagnosis import growth
from .estimates import Estimates
from .further import basis_of

__all__ = ["drifting", "linearised"]

PART = 0.3  # of a standard error: steps of differences
PAST = 4  # samples from which the noise of the next is foretold


@kept
def drifting(fit: Estimates) -> tuple[Estimates, float] | None:
    """The fit with a drift and by how much BIC falls, where the start is known and the samples want one."""
    told = fit.options.initial_state
    known = isinstance(told, str) and told in ("rest", "zero")
    if not (known and fit.layout.rational and fit.trend == "constant" and fit.again and fit.records):
        return None
    if growth(fit) > 0:  # whose response may overflow
        return None
    fall = max(_fall(fit, rec) for rec in fit.records)
    if not fall > WORTH:
        return None
    other = again(fit, fit.records, fit.structure, on_band(fit, fit.band).replace(trend="linear"))
    return (other, fall) if other is not None and other.success else None


def _beside(fit: Any, k: int, step: float) -> Any:
    """The fit with a parameter moved by at most a step, and not to where a mode begins to grow.

    Errors of superfluous poles are as large as these.
    """
    decays = not growth(fit) > 0
    while True:
        params = fit.params.copy()
        params[k] += step
        moved = replace(fit, params=params)
        if not (decays and growth(moved) > 0):
            return moved
        step /= 4


def _fall(fit: Any, rec: Record) -> float:
    """By how much a drift of an output lowers BIC of its samples, beside all that the parameters can do.

    The noise of a sample follows from that of those before it, so that slow noise is no drift.
    """
    from scipy.signal import lfilter

    weights = sample_weights(rec.mask, rec.sigma, rec.y.shape)
    left, slopes = linearised(fit, rec)
    ramp = (rec.t - rec.t[0]) / rec.duration
    falls = [0.0]
    for i, weight in enumerate(weights):
        rows = np.array([left[i], *slopes[:, i], np.ones_like(ramp), ramp]) * weight
        noise = rows[0] - _fitted(rows[1:], rows[0])
        before = np.array([noise[PAST - k : noise.size - k] for k in range(1, PAST + 1)])
        told = np.linalg.lstsq(before.T, noise[PAST:], rcond=None)[0]
        if told.sum() < 0:  # which says that slow noise is weak, as residuals that were fitted seem by chance
            told[:] = 0.0
        white = lfilter([1.0, *-told], [1.0], rows, axis=1)[:, PAST:]
        squares = [
            np.sum((white[0] - _fitted(columns, white[0])) ** 2) for columns in (white[1:-1], white[1:])
        ]
        count = white.shape[1]
        falls.append(float(count * np.log(squares[0] / squares[1]) - np.log(count)))
    return max(falls)


def linearised(fit: Any, rec: Record) -> tuple[F64, F64]:
    """What the response leaves of a record, (output, time), and its slopes; 0 of parameters on bounds."""
    here = fit.simulate(rec)[0]
    slopes = np.zeros((fit.params.size, *here.shape))
    for k, step in enumerate(PART * Estimates.cov_params(fit).diagonal() ** 0.5):
        if step > 0:
            beside = _beside(fit, k, step)
            slopes[k] = (beside.simulate(rec)[0] - here) / (beside.params[k] - fit.params[k])
    return rec.y - here, slopes


def _fitted(columns: F64, values: F64) -> F64:
    basis = basis_of(columns)  # of those that are not 0, as of parameters of other outputs
    return np.asarray(basis @ (basis.T @ values))
