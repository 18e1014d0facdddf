"""Records that begin in a known state: whether the data agree, and what saying so would gain."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..models.free import Free
from ..records.periods import periods
from ..records.steady import QUIET, flat, standing
from .cures import DRIFT, again, amplified, furthest, on_band
from .diagnosis import growth
from .known_drift import drifting
from .rewritten import rewritten

if TYPE_CHECKING:
    from .estimates import Estimates

__all__ = [
    "contradicted_p",
    "far_apart",
    "from_rest",
    "gain_of_start",
    "hausman",
    "off_zero",
    "plainly_at_rest",
]

LEAST_GAIN = 1.2  # of a standard error
SAME = 0.95  # the same: errors that do not change
MOST_GAIN = 30.0  # the same: a start is worth up to ten times, and where it seems more a fit is of noise
FURTHEST = 4.0  # standard errors of the fit: estimates further away are of another minimum
AGREES = 0.05  # p-value
ABOUT = 4.0  # standard errors, or samples if more, of a delay either side of its estimate
OFF = 0.5  # of a channel's range: first samples that far from zero are levels of an operating point
LEAST_TOLD = 0.2  # of a variance that the past took away
MOST_LOST = 1.0  # of a variance, that the past may seem to add: 0.1 in one minimum, 4 to 4,000 in two


def off_zero(fit: Estimates) -> str:
    """Where channels begin, of a transfer function said to begin at zero with an output that does not."""
    told = fit.options.initial_state
    if not (isinstance(told, str) and told == "zero" and fit.layout.rational):
        return ""
    for rec in fit.records or ():
        off = [x for x in (*rec.inputs, *rec.outputs) if abs(rec[x][0]) > OFF * np.ptp(rec[x])]
        if any(name in rec.outputs for name in off):
            return " and ".join(f"{name} starts at {rec[name][0]:.4g}" for name in off)
    return ""


def contradicted_p(fit: Estimates) -> float:
    """Probability that a record which begins as the fit was told misfits so much more than from anywhere.

    An F test of the initial states: the cost with what is known against the cost with free states. Where the
    past stands before the records, Hausman's test of the estimates with and without it (J. A. Hausman,
    Econometrica 46, 1978; the covariance of their difference is the difference of their covariances), and an
    F test of the noise levels that both leave.
    """
    if fit.with_past:
        return _beside_free(fit)
    if not math.isfinite(fit.free_cost):
        return 1.0
    from scipy.special import fdtrc

    states = sum(fit.layout.orders) * len(fit.lines)
    left = fit.df_resid - states
    if left < 1 or fit.free_cost <= 0:
        return 1.0
    ratio = (fit.cost - fit.free_cost) / states / (fit.free_cost / left)
    return float(fdtrc(states, left, max(ratio, 0.0)))


def _beside_free(fit: Estimates) -> float:
    """As `contradicted_p`, of records that have a past."""
    if fit.again is None or fit.records is None:
        return 1.0
    options = on_band(fit, fit.band).replace(initial_state="unknown")
    # Without the past a slow step tells a long delay hardly from a pole: a search far away finds either.
    # From afar a search may end in the twin of the estimates, parameters that no record tells from them.
    other = again(fit, fit.records, _near(fit), options, near=True)
    if other is None or not other.usable or growth(other) > 0 >= growth(fit):
        return 1.0
    from scipy.special import fdtrc

    # Under one noise, that of the free fit: a false past raises the residuals, which an F test sees.
    ratio = float(np.mean((fit.noise_levels / other.noise_levels) ** 2))
    p_level = float(fdtrc(fit.df_resid, other.df_resid, ratio))
    # On a bound, or where its search did not end, a fit has the errors of other parameters that are held.
    if not other.success or set(other.at_bound) - set(fit.at_bound):
        return p_level
    p = far_apart(other, fit)
    return p_level if p is None else min(1.0, 2 * min(p_level, p))


def far_apart(free: Estimates, told: Estimates) -> float | None:
    """`hausman` of a fit with a free start and one that knows it, both under the noise of the free one."""
    ratio = max(float(np.mean((told.noise_levels / free.noise_levels) ** 2)), 1.0)
    return hausman(free, free.params - told.params, told.cov_nonrobust / ratio)


def hausman(free: Estimates, gap: F64, told: F64) -> float | None:
    """p-value of how far estimates with a free start are from ones that know it; None where it tells nothing.

    Parameters
    ----------
    free : Estimates
    gap : (parameter,) array
    told : (parameter, parameter) array
        Covariance of the estimates that know the start.
    """
    from scipy.special import fdtrc

    size = np.sqrt(np.diag(free.cov_nonrobust))
    inside = size > 0  # and not on a bound
    gap, size = gap[inside], size[inside]
    left = (free.cov_nonrobust - told)[np.ix_(inside, inside)]
    values, vectors = np.linalg.eigh(left / np.outer(size, size))
    if values[0] < -MOST_LOST:  # a fit that knows less has no smaller errors, but in another minimum
        return None
    seen = values > LEAST_TOLD  # of the variances: less is no more than their own scatter
    if not seen.any():
        return None
    squares = (vectors[:, seen].T @ (gap / size)) ** 2 / values[seen]
    return float(fdtrc(squares.size, free.df_resid, np.mean(squares)))


def gain_of_start(fit: Estimates, warnings: Callable[[Estimates], list[str]]) -> str | None:
    """That the records plainly begin at rest, or hold whole periods, where saying so would pay.

    Not where the fit that says so is in doubt: it has `warnings`, or estimates or errors of another minimum.
    """
    if not (_plain(fit) and fit.records):
        return None
    if all(standing(rec) >= QUIET for rec in fit.records):
        told, seen = "rest", "The inputs begin steady, and the output agrees with a start at rest"
    elif fit.layout.rational and fit.layout.plain and all(periods(rec) > 1 for rec in fit.records):
        told, seen = "periodic", "The inputs repeat, and the output agrees with a steady response"
    else:
        return None
    options = on_band(fit, fit.band).replace(initial_state=told)
    other = _from(fit, told)
    if other is None:
        return None
    beside, drift = "", drifting(other)
    if drift is not None:
        other, beside = drift[0], f", {DRIFT}"
    p = contradicted_p(other)
    if not (other.success and p > AGREES and furthest(other, fit)[3] < FURTHEST):
        return None
    gains = _gains(fit, other)
    if not (np.min(gains, initial=1.0) > SAME and LEAST_GAIN <= np.max(gains, initial=0.0) < MOST_GAIN):
        return None
    if warnings(other):
        return None
    text = (
        f'{seen} (p = {p:.2g}): initial_state="{told}"{beside} makes the standard errors '
        f"{max(np.min(gains), 1.0):.2g} to {np.max(gains):.2g} times smaller."
    )
    if told == "rest" and not beside and fit.layout.rational and fit.trend == "constant":
        # A drift within the noise is taken for gain: standard errors do not know of it.
        safe = again(fit, fit.records, _near(fit), options.replace(trend="linear"))
        if safe is not None and safe.success:
            gain = np.max(_gains(fit, safe), initial=1.0)
            text += f" Where the output may drift within the noise, add {DRIFT}: then up to {gain:.2g} times."
    return text


def from_rest(fit: Estimates) -> Estimates | None:
    """The fit that takes the records to begin at rest, where they plainly do; None of others."""
    return _from(fit, "rest") if plainly_at_rest(fit) else None


def plainly_at_rest(fit: Estimates) -> bool:
    """Whether inputs and outputs stand for a while at first, and a fit that knows it is to be had."""
    return _plain(fit) and all(map(flat, fit.records or ()))


def _plain(fit: Estimates) -> bool:
    """Whether a fit with a free initial state may have one beside it that knows it, at no great cost."""
    options = fit.options
    asks = (options.initial_state, options.noise) == ("unknown", "output")
    asks = asks and options.method in ("ml", "awls") and options.extended
    if not (asks and fit.again and fit.records and fit.inputs):
        return False
    odd = [rec for rec in fit.records if rec.dt is None or rec.mask is not None or rec.sigma is not None]
    # Forty to eighty fits, a level of each output before the record being unknown, or as many slow ones.
    return not (odd or len(fit.outputs) > 1 or amplified(fit))


@kept
def _from(fit: Estimates, told: str) -> Estimates | None:
    """The fit with a known start, its delays near their estimates."""
    return again(fit, fit.records, _near(fit), on_band(fit, fit.band).replace(initial_state=told))


def _gains(fit: Estimates, other: Estimates) -> F64:
    """Standard errors over those of another fit at one noise level, of what neither has on a bound."""
    level = np.mean(other.noise_levels**2) / np.mean(fit.noise_levels**2)
    own, theirs = level * np.diag(fit.cov_nonrobust), np.diag(other.cov_nonrobust)
    estimated = (own > 0) & (theirs > 0)
    return np.asarray(np.sqrt(own[estimated] / theirs[estimated]))


def _near(fit: Estimates) -> Any:
    """The structure with free delays bounded about their estimates: a search over wide bounds takes long."""
    layout = fit.layout
    if not layout.rational or not layout.free_delays:
        return fit.structure
    dt = max(rec.dt for rec in fit.records or () if rec.dt)
    late = dict(zip(layout.free_delays, range(len(layout.free), fit.params.size), strict=True))

    def about(path: int) -> Any:
        known: Any = layout.paths[path].delay
        if path not in late or known.sd is not None:
            return known
        here = fit.params[late[path]]
        width = ABOUT * max(dt, np.nan_to_num(fit.bse[late[path]]))
        return Free(here, min=max(known.min, here - width), max=min(known.max, here + width))

    return rewritten(fit, delay=[[about(path) for path in row] for row in layout.routes])
