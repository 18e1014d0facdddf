"""Equations with held inputs: what kinks between samples do to estimates, found by simulation, taken out."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from math import pi

import numpy as np

from ..base.named import Named
from ..errors import ModfunError
from ..models.noise import Noise
from ..results.cures import on_band
from ..results.of_equations import EquationFit

__all__ = ["bent", "without_kinks"]

FINE = 40  # samples per period of the highest line: with as many, kinks of held inputs are below 0.1 % noise
ROUNDS = 4
SETTLED = 0.25  # of a standard error: the last step, which is taken
LESS = 0.3  # of the first step: where the last one is not as much smaller, the estimate stays as it was


def without_kinks(fit: EquationFit, refit: Callable[..., EquationFit]) -> EquationFit:
    """The fit with parameters whose simulated samples, fitted in the same way, give those estimated.

    A held input puts a kink into the output at every sample, and an equation takes outputs as smooth. Below
    `FINE` samples per period of the highest line, that biases estimates by several standard errors. It is
    seen by fitting samples simulated without noise: indirect inference (C. Gouriéroux, A. Monfort and
    E. Renault, J. Appl. Econometrics 8, S85, 1993). Errors and residuals stay those of the fit.

    Parameters
    ----------
    fit : EquationFit
    refit : callable
        Takes records, structure and options.
    """
    records = fit.records
    if records is None or not bent(fit):
        return fit
    options = on_band(fit, fit.band)
    if len(fit.outputs) > 1:  # without noise, samples do not tell how much each of them counts
        options = options.replace(noise=Noise(y=list(np.mean(fit.levels[:, : len(fit.outputs)], axis=0))))
    low, high = np.transpose(fit.layout.formulas.words["bounds"])
    theta, sizes = np.asarray(fit.params), list[float]()
    while len(sizes) < ROUNDS and not (sizes and sizes[-1] < SETTLED):
        try:
            moved = replace(fit, params=Named(theta, fit.param_names))
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                simulated = tuple([rec._like(y=moved.simulate(rec)[0]) for rec in records])
                step = np.asarray(fit.params - refit(simulated, fit.structure, options).params)
        except ModfunError:
            return fit
        sizes.append(float(np.max(np.abs(step) / np.asarray(fit.bse), initial=0.0)))
        theta = np.clip(theta + step, low, high)
    closer = sizes[-1] < max(SETTLED, LESS * sizes[0])  # nan is not
    return replace(fit, params=Named(theta, fit.param_names)) if closer else fit


def bent(fit: EquationFit) -> bool:
    """Whether inputs are held through lines too fast for equations, in a fit of samples alone."""
    options = fit.options
    plain = (options.initial_state, options.robust, options.reference) == ("unknown", False, ())
    plain = plain and options.noise == "output" and not fit.layout.formulas.words["priors"]
    held = "zoh" in fit.intersample
    steps = [step for step in fit.steps if step is not None]
    fast = any(fit.band[1] * step * FINE > 2 * pi for step in steps)
    return plain and held and fast and fit.success and not fit.at_bound and len(steps) == len(fit.steps)
