"""Samples too far apart for the integrals of a fit: its own simulation tells, which needs none."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np

from ..base.cached import kept
from ..equations.equation import Equation
from ..errors import ModfunError
from ..models.options import Options
from ..records.uneven_rows import unit_of_time
from .cures import again
from .doubts import Doubt, rms
from .estimates import Estimates
from .misfit import suspicious
from .response_call import output_error_call

__all__ = ["of_sums", "sparse"]

LARGE = 3.0  # times the noise of the lines: below, estimates are rather off by their own errors
ALIKE = 0.5  # of an estimate's distance, beyond which sums over samples have made it
RARE = 0.01  # probability by F below which that is no scatter of few lines
BIASED = (
    "Estimates are biased, and no standard error counts that. First take more samples where the outputs "
    "move; for these few, fit simulations, "
)


@kept
def sparse(fit: Estimates) -> Doubt | None:
    """That simulated outputs miss uneven samples by far more than the noise that lines show.

    Integrals over signals that move between samples are off by far more than their noise, and alike on the
    few lines of few samples, so that residuals are small and so are standard errors.
    """
    if not fit.usable or fit.options.noise not in ("output", "log-normal") or fit.df_resid < 1:
        return None
    noise_goes_with_level = fit.options.noise == "log-normal"
    if (
        noise_goes_with_level
        or getattr(fit, "unsettled", False)
        or all(rec.dt is not None for rec in fit.records or ())
    ):
        return _unsettled(fit)
    from scipy.special import fdtrc

    for rec, levels in zip(fit.records or (), fit.noise_levels, strict=False):
        if rec.dt is not None or rec.sigma is not None:
            continue
        try:
            errors = cast(Any, fit).errors(rec)
        except ModfunError:
            continue
        for name, error, level in zip(rec.outputs, errors, levels, strict=True):
            seen = error[np.isfinite(error)]
            size = rms(seen, 0.0) if seen.size else math.nan
            ratio = size / level if level > 0 else math.nan
            if ratio > LARGE and fdtrc(seen.size, fit.df_resid, ratio**2) < RARE:
                return Doubt(
                    f"The simulated {name} is {size:.3g} (rms) off its samples, {ratio:.2g} "
                    "times the noise on the lines: the signals move between samples, which are up to "
                    f"{np.diff(rec.t).max():.3g}{unit_of_time(rec)} apart, or the model is another. "
                    f"{_cure(fit)}"
                )
    return None


def _widest(fit: Estimates) -> tuple[float, str]:
    """The longest step of the records, and its unit."""
    return max((float(np.diff(rec.t).max()), unit_of_time(rec)) for rec in fit.records or ())


def _cure(fit: Estimates) -> str:
    """More samples, or what needs no sums."""
    steps = "as scipy.optimize.least_squares does"
    if isinstance(fit.structure, Equation):  # others' times have to be even
        steps = f"{output_error_call(fit)}(rec)"
    return f"{BIASED}{steps}."


def _unsettled(fit: Estimates) -> Doubt | None:
    """That sums over samples err by what the fit's own response could not tell, and residuals are quiet.

    Louder ones have a doubt of their own.
    """
    if not getattr(fit, "unsettled", False) or suspicious(fit):  # of equations
        return None
    step, unit = _widest(fit)
    upto = "" if all(rec.dt for rec in fit.records or ()) else "up to "
    return Doubt(
        "Sums over the samples err, since the signals move between them: they are "
        f"{upto}{step:.3g}{unit} apart. The correction by the fit's own response did not settle. {_cure(fit)}"
        f"{_late(fit)}"
    )


def _late(fit: Estimates) -> str:
    """What no search finds where the equations lack it: that an input acts later than its rows."""
    if fit.options.initial_state != "zero" or not fit.inputs:
        return ""
    return (
        " If that ends on a bound or in an error, the equations lack something, whatever the search: "
        f"where {fit.inputs[0]} acts late, as a dose before its absorption begins, give rows with it shifted "
        'and compare several lags (page "Doses and blood samples").'
    )


def of_sums(
    fit: Estimates, structure: Any, options: Options, name: str, off: float, seen: str
) -> Doubt | None:
    """That sums over samples make a number differ, as they do with simulated outputs, which have it as it is.

    Parameters
    ----------
    fit : Estimates
    structure, options
        Of the fit with a parameter of this name for what the number lacks.
    name : str
    off : float
        Its estimate.
    seen : str
        The number in words.
    """
    if not fit.usable or fit.exact_lines:
        return None
    records = fit.records or ()
    try:
        own = tuple(rec._like(y=cast(Any, fit).predict(rec).y, mask=None) for rec in records)
    except ModfunError:
        return None
    other = again(fit, own, structure, options)
    if other is None or not other.success:
        return None
    if not float(other.params[other.param_names.index(name)]) / off > ALIKE:
        return None
    step, unit = _widest(fit)
    return Doubt(
        f"The signals move between samples, which are {step:.3g}{unit} apart, so that sums over them err: "
        f"{seen}, and a simulation with that number at the same instants differs alike. {_cure(fit)}"
    )
