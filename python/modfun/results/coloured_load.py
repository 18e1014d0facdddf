"""Noise that is not white, though a fit takes it for that: in the system or on its outputs."""

from __future__ import annotations

import numpy as np

from ..base.cached import kept
from .cures import WORTH, again, bic_beside, furthest, on_band
from .diagnosis import growth, worst_colour
from .doubts import SURE, Doubt
from .estimates import Estimates

__all__ = ["coloured_load", "in_coloured_noise", "moved_by_weights", "other_drive"]

UNEVEN = 0.05  # distance of the cumulated power of the lines from a straight line, which moves estimates
STILL = 1e-3  # of the lowest frequency: growth of a pole that may as well be an integrator
APART = 1.0  # standard errors that the fit in coloured noise is off where lines are uneven, at least
MUCH = 40.0  # of BIC: of 180 white loads the most was 21, of accelerations in turbulence the least 140
MOVED = 3.0  # standard errors of the fit in white noise: those that hold allow its weights no more
MOST_PATHS = 4  # of inputs to outputs: joint fits in coloured noise of more take seconds


@kept
def coloured_load(fit: Estimates) -> Doubt | None:
    """That what drives the system is not white, by the lines or by a fit in noise of any smooth spectrum.

    Loads vary slowly, as friction, wind or the work of a tool does. Levels of a white one then leave too
    little noise at low frequencies, and estimates give these too much weight. What a sensor of acceleration
    shows of turbulence has zeros, too, and poles alone then leave white lines with a system far off. Coloured
    noise is fitted on the same band, as by itself it may take one without the system's mode.
    """
    if fit.options.noise != "process" or not fit.layout.rational or fit.again is None or fit.df_resid < 2:
        return None
    colour, _, _ = worst_colour(fit)
    uneven = colour.p_value < SURE and colour.statistic > UNEVEN
    if not uneven and len(fit.outputs) * len(fit.inputs) > MOST_PATHS:
        return None
    other = _weighted(fit)
    likelier = other is not None and other.bic < fit.bic - MUCH
    if not (uneven or likelier):
        return None
    if uneven:
        text = (
            "The lines, weighted by the spectrum of a white load and of white noise of the sensor, are not "
            f"of one level over the band (p = {colour.p_value:.1g}): the load is not white, or the model "
            "misses part of the band, and estimates and their standard errors may be wrong."
        )
    else:
        text = (
            "White noise at the input of the poles does not seem to be what drives the system: its spectrum "
            "may have zeros, too, as that of accelerations in turbulence does, and estimates may be wrong."
        )
    if other is None or not _steady(other):
        return Doubt(
            f"{text} First take a record in which the input moves the system more beside the load, or hold "
            "what is known of it, params={...}."
        )
    moved = np.abs(other.params - fit.params) / fit.bse
    at = int(np.argmax(np.where(np.isfinite(moved), moved, 0.0)))
    if uneven and not moved[at] > APART:
        return None
    name, (low, high) = fit.param_names[at], fit.band
    fall = f" (BIC from {fit.bic:.4g} to {other.bic:.4g})" if likelier else ""
    return Doubt(
        f'{text} First try noise="coloured", band=({low:.4g}, {high:.4g}), whose noise may have any smooth '
        f"spectrum{fall}: {name} is {fit.params[at]:.4g} ± {fit.bse[at]:.2g} without and "
        f"{other.params[at]:.4g} ± {other.bse[at]:.2g} with it."
    )


def other_drive(fit: Estimates) -> str:
    """What else to try where something drives the system, in words; "" where neither ends well.

    White noise through the poles of the system, or of any smooth spectrum where the record contradicts that.
    """
    driven = again(fit, fit.records, fit.structure, fit.options.replace(noise="process"))
    if driven is None or not driven.success:
        return ""
    if not coloured_load(driven):
        return ', or noise="process"'
    other, (low, high) = _weighted(driven), driven.band
    steady = other is not None and _steady(other)
    return f', or noise="coloured", band=({low:.4g}, {high:.4g})' if steady else ""


@kept
def moved_by_weights(fit: Estimates) -> str | None:
    """That weights of the noise spectrum move an estimate further than its error allows, in words.

    Where both fits are right, the better weighted one differs from the other by no more than that one's own
    error (J. A. Hausman, Econometrica 46, 1978). Estimates that have followed slow noise leave white lines
    and small errors, and no test of their residuals shows it.
    """
    plain = fit.layout.rational and fit.options.noise == "output" and fit.options.plain_noise
    if not plain or fit.again is None or not fit.records:
        return None
    if len(fit.outputs) * len(fit.inputs) > MOST_PATHS:
        return None
    other = _weighted(fit)
    if other is None or other.param_names != fit.param_names:
        return None
    before, after = bic_beside(fit, fit), bic_beside(other, fit)
    name, now, was, far = furthest(other, fit)
    if not (after < before - WORTH and far > MOVED):
        return None
    return (
        f"on the same lines BIC falls from {before:.4g} to {after:.4g}, and {name} becomes {now} (was {was}, "
        f"{far:.2g} standard errors away)"
    )


@kept
def in_coloured_noise(fit: Estimates) -> Estimates | None:
    """The fit in coloured noise, on the band that its options lead to."""
    options = fit.options.replace(noise="coloured", output_weights=None)
    return again(fit, fit.records or (), fit.structure, options)


@kept
def _weighted(fit: Estimates) -> Estimates | None:
    """The fit in coloured noise on the same band; None where it does not settle."""
    other = again(fit, fit.records, fit.structure, on_band(fit, fit.band).replace(noise="coloured"))
    return other if other is not None and other.success else None


def _steady(fit: Estimates) -> bool:
    return not growth(fit) > STILL * fit.band[0]
