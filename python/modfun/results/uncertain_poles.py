"""Modes so uncertain that standard errors, which hold near the estimate, say too little."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from ..base.cached import kept
from ..base.student import root
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["Mode", "modes", "uncertain_poles", "worst_mode"]

# Standard errors of a mode's real part, over that part: up to 0.1 95 % of the intervals of 95 % held the
# truth, up to a quarter 89 to 92 %, and beyond 51 to 75 % (benches/uncertain_modes.py, 3,600 fits).
SOME, MUCH = 0.25, 0.3
SLOW = 4.0  # over the length of a record: what decays more slowly hardly decays in it


@dataclass(frozen=True)
class Mode:
    """A pole above the real axis, of an output's denominator, and the standard error of its real part."""

    output: int
    pole: complex
    error: float


def uncertain_poles(fit: Estimates) -> Doubt | None:
    """That a mode may lie so far away that the likelihood has another shape there, or another minimum.

    Two real poles near each other are uncertain by themselves, and their coefficients are not.
    """
    if not fit.has_poles or fit.options.method != "ml" or not fit.omega0:
        return None
    worst, at, error = worst_mode(fit)
    if not worst > SOME:
        return None
    return Doubt(
        f"The mode at {at.real:.3g} ± {at.imag:.3g}j rad/s is uncertain: the standard error of its real part "
        f"is {error:.2g}. Where modes are known so badly, intervals from standard errors are too short: they "
        "miss the truth more often than they say. First take intervals from mf.bootstrap(fit); fewer poles, "
        f"or a record that moves more near {abs(at):.2g} rad/s, make them shorter.",
        sure=worst > MUCH,
    )


def worst_mode(fit: Estimates) -> tuple[float, complex, float]:
    """Of the most uncertain mode the ratio that tells it, its pole, and the error; 0 without a mode."""
    slowest = SLOW * min(fit.omega0) / (2 * pi)
    worst, at, error = 0.0, 0j, 0.0
    for mode in modes(fit):
        ratio = mode.error / max(abs(mode.pole.real), slowest)
        if ratio > worst:  # not where it is no number
            worst, at, error = ratio, mode.pole, mode.error
    return worst, at, error


@kept
def modes(fit: Estimates) -> list[Mode]:
    """The modes of all denominators."""
    cov, found = Estimates.cov_params(fit), list[Mode]()
    for _, output in fit.denominators():
        poles, gradients = fit.pole_gradients(output)
        errors = root(np.sum(gradients.real @ cov * gradients.real, axis=1))
        pairs = zip(poles.tolist(), errors.tolist(), strict=True)
        found += [Mode(output, pole, error) for pole, error in pairs if pole.imag > 0]
    return found
