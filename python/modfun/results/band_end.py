"""Where the default band ends: whether its rule chose the end, and what lies beyond."""

from __future__ import annotations

import numpy as np

from ..base.student import root
from ..systems.polynomials import roots_of
from .cures import again
from .diagnosis import growth
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["beyond", "end_in_words", "gains", "meets_end"]

LIGHT = 0.3  # damping below which a mode shows as a peak
WORTH = 1.25  # factor by which a standard error has to fall for a wider band to be named
RISES = 1.1  # by which others may rise, and the noise level may fall
MOVED = 3.0  # standard errors by which an estimate may move


def end_in_words(fit: Estimates) -> str:
    """Why the default rule looked no further, where its choice ends with what it looked at."""
    rule = fit.band_rule
    if rule is None or not meets_end(fit) or getattr(fit, "by_response", False):
        return ""
    if rule["k_max"] >= (max(fit.intervals) - 1) // 2:
        return "; these are all lines that the samples show"
    if _was_asked(fit):
        return "; beyond, residuals rise, the estimate changes, or too little is gained"
    return "; errors may fall beyond: compare a wider band="


def beyond(fit: Estimates) -> Doubt | None:
    """That something lies beyond the end of the default band: a mode, or what lowers the errors."""
    if not meets_end(fit) or getattr(fit, "by_response", False):  # of equations; lines say nothing more
        return None
    if _was_asked(fit):
        return _mode(fit) if fit.layout.rational else None
    return _wider(fit)


def meets_end(fit: Estimates) -> bool:
    """Whether the default rule chose a band up to where it looked; files of old do not say."""
    return fit.band_rule is not None and fit.band_rule.get("meets_end", 0.0) > 0.0


def _was_asked(fit: Estimates) -> bool:
    """Whether a wider band was tried: of transfer functions and even samples by the core, or after it."""
    return "asked" in (fit.band_rule or {}) or (fit.layout.rational and None not in fit.steps)


def _mode(fit: Estimates) -> Doubt | None:
    if not fit.has_poles:
        return None
    for _, i in fit.denominators():
        poles = roots_of(fit.polynomials(i)[0])
        light = poles[(poles.imag > fit.band[1]) & (-poles.real < LIGHT * np.abs(poles))]
        if light.size:
            return Doubt(
                f"The mode at {abs(light[0]):.4g} rad/s lies beyond the band, which ends at "
                f"{fit.band[1]:.4g} rad/s: only its tail determines it, and the record contradicts it there. "
                "Sample faster, or compare a wider band=.",
                sure=False,
            )
    return None


def _wider(fit: Estimates) -> Doubt | None:
    """That errors fall in a band twice as wide, by the fit on it."""
    if fit.again is None or fit.records is None or not fit.params.size or fit.at_bound:
        return None
    edge = float(f"{2 * fit.band[1]:.3g}")
    other = again(fit, fit.records, fit.structure, fit.options.replace(band=(fit.band[0], edge)))
    if other is None or getattr(other, "by_response", False) or not gains(fit, other):
        return None
    was, now = np.asarray(fit.bse), np.asarray(other.bse)
    at = int(np.argmax(np.where(now > 0, was / np.where(now > 0, now, 1.0), 1.0)))
    return Doubt(
        f"Standard errors still fall where the default band ends, at {fit.band[1]:.4g} rad/s: with "
        f"band={edge:.4g} that of {fit.param_names[at]} is {now[at]:.2g}, not {was[at]:.2g}.",
        sure=False,
    )


def gains(fit: Estimates, wider: Estimates) -> bool:
    """Whether a wider band lowers standard errors and contradicts nothing: neither estimates nor noise.

    Errors as of even noise: whether it changes takes a simulation, half of the time of chaotic records' fits.
    """
    if not wider.success or growth(wider) > max(growth(fit), 0.0):
        return False
    if fit.at_bound:  # others' errors hold the bound as known
        return not wider.at_bound
    was, now = (root(np.diag(Estimates.cov_params(each))) for each in (fit, wider))
    free = (was > 0) & (now > 0)
    fall = np.where(free, was / np.where(free, now, 1.0), 1.0)
    moved = np.abs(np.asarray(wider.params) - np.asarray(fit.params)) / np.where(free, was, np.inf)
    quieter = np.diag(fit.noise_cov) / np.diag(wider.noise_cov)
    return bool(
        fall.max() >= WORTH and fall.min() >= 1 / RISES and moved.max() <= MOVED and quieter.max() <= RISES**2
    )
