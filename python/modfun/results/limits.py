"""Inputs that an actuator does not follow beyond a limit: the record holds the command."""

from __future__ import annotations

import numpy as np

from ..base.cached import kept
from ..records.record import Record
from .cures import CLOSE, ENOUGH, STRONG, again, best_cure, bic_beside, likely_cure, on_band
from .diagnosis import level_p
from .doubts import Doubt, noise_free
from .estimates import Estimates
from .misfit import refuted, suspicious

__all__ = ["saturated"]

LEVELS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of the largest input, at which it is clipped first
FINE = 0.01  # of the largest input: how well the limit is sought


@kept
def saturated(fit: Estimates) -> Doubt | None:
    """That an input clipped at a limit explains all but the noise, much better than the input does."""
    if not fit.usable or fit.again is None or not fit.records or noise_free(fit) is not None:
        return None
    if any(rec.mask is not None for rec in fit.records):
        return None  # fits of which take seconds
    if not (suspicious(fit) if fit.layout.rational else refuted(fit)):
        return None
    before = bic_beside(fit, fit)
    for name in fit.inputs:
        if any(name in rec.functions for rec in fit.records):
            continue
        limit, after = _limit(fit, name)
        if not after < before - STRONG or not _settles(fit, name, limit, after):
            continue
        return Doubt(
            f"The system seems to follow {name} to {limit:.3g} only, and {name} goes to "
            f"{_largest(fit, name):.3g}, as a command of an actuator that saturates: clipped there it leaves "
            f"only the noise, and BIC falls from {before:.4g} to {after:.4g}. First record what the actuator "
            f"does, or, with gains as uncertain as the limit, fit with "
            f"rec.assign({name}=np.clip(rec[{name!r}], {-limit:.3g}, {limit:.3g}))."
        )
    return None


def _limited(rec: Record, name: str, limit: float) -> Record:
    """The record with an input that goes no further than a limit, to either side."""
    u, at = rec.u.copy(), rec.inputs.index(name)
    u[at] = np.clip(u[at], -limit, limit)
    return rec._like(u=u)


def _largest(fit: Estimates, name: str) -> float:
    return max(float(np.abs(rec[name]).max()) for rec in fit.records or ())


def _with_limit(fit: Estimates, name: str, limit: float) -> Estimates | None:
    changed = tuple([_limited(rec, name, limit) for rec in fit.records or ()])
    return again(fit, changed, fit.structure, on_band(fit, fit.band))


def _limit(fit: Estimates, name: str) -> tuple[float, float]:
    """The limit of the lowest BIC, and that."""
    from scipy.optimize import minimize_scalar

    largest = _largest(fit, name)

    def loss(part: float) -> float:
        other = _with_limit(fit, name, part * largest)
        return bic_beside(other, fit) if other is not None and other.success else np.inf

    first = [loss(part) for part in LEVELS]
    at = int(np.argmin(first))
    if not first[at] < bic_beside(fit, fit) - 0.5 * STRONG:
        return largest, np.inf
    edges = (0.5 * LEVELS[0], *LEVELS, 1.0)
    beside = edges[at], edges[at + 2]
    found = minimize_scalar(loss, bounds=beside, method="bounded", options={"xatol": FINE})
    part, after = min(((LEVELS[at], first[at]), (float(found.x), float(found.fun))), key=lambda pair: pair[1])
    return part * largest, after


def _settles(fit: Estimates, name: str, limit: float, after: float) -> bool:
    """Whether only noise is left with the limit, and no other change of the model explains as much."""
    other = _with_limit(fit, name, limit)
    if other is None or not level_p(other) > ENOUGH or refuted(other):
        return False
    if fit.layout.rational:
        cures = [best_cure(fit, i, name) for i in range(len(fit.outputs))]
    else:
        cures = [likely_cure(fit)]
    return all(cure is None or after < cure.after - CLOSE for cure in cures)
