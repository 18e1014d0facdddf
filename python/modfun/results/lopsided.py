"""Intervals by the likelihood, where a parameter is known so badly that standard errors say too little."""

from __future__ import annotations

from math import log, sqrt
from typing import Any

import numpy as np

from ..equations.equation import Equation
from .cures import again, bic_beside, on_band
from .doubts import Doubt
from .estimates import Estimates
from .refits import lengthy

__all__ = ["lopsided"]

# Standard errors over estimates beyond which the likelihood is looked at. Of Bergman's model without its
# hidden signal they are 0.2 to 0.6: intervals of 95 % from standard errors held SG in 17 of 25 records,
# those of the likelihood in 21.
UNCERTAIN = 0.2
FARTHER = 0.25  # of a half-width: nearer ends are the same
TRIES, NEAR = 5, 0.15  # fits for an end, and how near to it they come
MOST, CLOSER = 2.5, 0.7  # steps in parts of the last one: the longest, and where there was no fit


def lopsided(fit: Estimates) -> Doubt | None:
    """That an interval from a standard error ends elsewhere than the likelihood does.

    For `check()` alone, since each end takes some three fits: of equations from which a hidden signal was
    eliminated, whose weights and signals change with the parameters.
    """
    layout: Any = fit.layout
    if layout.rational or not isinstance(fit.structure, Equation) or not fit.success or fit.at_bound:
        return None
    if not layout.compiled.hidden or layout.formulas.words["linear"] or lengthy(fit):
        return None
    if fit.options.method != "ml" or fit.again is None or not fit.records or fit.params.size < 2:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.nan_to_num(np.asarray(fit.bse / np.abs(fit.params)), posinf=0.0)
    for k in np.argsort(-relative).tolist():
        if not relative[k] > UNCERTAIN:
            break
        low, high = np.asarray(fit.conf_int())[k].tolist()
        ends = [_end(fit, k, (high - low) / 2, sign) for sign in (-1.0, 1.0)]
        if None in ends:  # no fits so far away
            continue
        if max(abs(ends[0] - low), abs(ends[1] - high)) > FARTHER * (high - low) / 2:
            return _told(fit, k, ends, (low, high), float(relative[k]))
    return None


def _told(fit: Estimates, k: int, ends: Any, standard: tuple[float, float], relative: float) -> Doubt:
    """Both intervals of a parameter in words."""
    layout: Any = fit.layout
    name, hidden = fit.param_names[k], " or ".join(layout.compiled.hidden)
    here, there = (f"{low:.3g} to {high:.3g}" for low, high in (ends, standard))
    return Doubt(
        f"{name} is known to {100 * relative:.2g} % only, and so far from the estimate the likelihood has "
        f"another shape than standard errors assume: its interval of 95 % is {here} by the likelihood, and "
        f"{there} by the standard error. The other parameters may be as far off. First take a record that "
        f"moves more, measure {hidden}, or hold what is known by a number in params=."
    )


def _end(fit: Estimates, k: int, half: float, sign: float) -> float | None:
    """Where -2 log likelihood has risen by as much as at the end of an interval of 95 %; None: not found."""
    from scipy.special import stdtrit

    least = _rise_at(fit, float(stdtrit(fit.df_resid, 0.975)))
    step = half
    for _ in range(TRIES):
        part = _root(fit, k, float(fit.params[k]) + sign * step, least)
        if part is None:  # no fit there
            step *= CLOSER
        elif abs(part - 1) < NEAR:
            return float(fit.params[k]) + sign * step / part
        else:
            step *= min(MOST, 1 / max(part, 1 / MOST))
    return None


def _rise_at(fit: Estimates, t: float) -> float:
    """The rise of -2 log likelihood at so many standard errors where it is a parabola's logarithm."""
    return (fit.df_resid + fit.params.size) * log(1 + t**2 / fit.df_resid)


def _root(fit: Estimates, k: int, value: float, least: float) -> float | None:
    """The root of the rise with a parameter held there, over that at the end of the interval."""
    structure: Any = fit.structure
    held = structure._like(params=dict(structure.params) | {fit.param_names[k]: value})
    other = again(fit, fit.records, held, on_band(fit, fit.band), near=True)
    if other is None or not other.success:
        return None
    rows = fit.df_resid + fit.params.size
    rise = bic_beside(other, fit) - fit.bic + (fit.params.size - other.params.size) * log(rows)
    return sqrt(max(rise, 0.0) / least)
