"""Records that begin in a known state: whether the data agree, and what the knowledge would gain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ModfunError
from .cures import on_band

if TYPE_CHECKING:
    from ..records.record import Record
    from .estimates import Estimates

__all__ = ["contradicted_p", "gain_of_rest"]

QUIET = 4  # samples with steady inputs before which a record is not taken to begin at rest
LEAST_GAIN = 1.2  # of a standard error
AGREES = 0.05  # p-value


def contradicted_p(fit: Estimates) -> float:
    """Probability that a record which begins as the fit was told would misfit it so much more than from anywhere.

    An F test of the initial states: the cost with what is known against the cost with free states.
    """
    if not math.isfinite(fit.free_cost):
        return 1.0
    from scipy.special import fdtrc

    states = sum(fit.layout.orders) * len(fit.lines)
    left = fit.df_resid - states
    if left < 1 or fit.free_cost <= 0:
        return 1.0
    ratio = (fit.cost - fit.free_cost) / states / (fit.free_cost / left)
    return float(fdtrc(states, left, max(ratio, 0.0)))


def gain_of_rest(fit: Estimates) -> str | None:
    """That the records plainly begin at rest, where saying so would pay."""
    options = fit.options
    asks = options.initial_state == "unknown" and options.plain_noise and options.method in ("ml", "awls")
    if not (asks and fit.again and fit.records and fit.layout.rational and fit.layout.plain):
        return None
    if not options.extended or not all(map(_begins_quiet, fit.records)):
        return None
    try:
        other = fit.again(fit.records, fit.structure, on_band(fit, fit.band).replace(initial_state="rest"))
    except ModfunError:
        return None
    p = contradicted_p(other)
    if not (other.success and p > AGREES):
        return None
    gains = np.sqrt(np.diag(fit.cov_nonrobust) / np.diag(other.cov_nonrobust))
    if not np.max(gains) >= LEAST_GAIN:
        return None
    return (
        f'The inputs begin steady, and the output agrees with a start at rest (p = {p:.2g}): initial_state="rest" '
        f"makes the standard errors {np.min(gains):.2g} to {np.max(gains):.2g} times smaller."
    )


def _begins_quiet(rec: Record) -> bool:
    """Whether a record's inputs stand for its first samples."""
    moving = np.any(rec.u != rec.u[:, :1], axis=0)
    return rec.dt is not None and rec.mask is None and rec.sigma is None and int(np.argmax(moving)) >= QUIET
