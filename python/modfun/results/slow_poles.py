"""Poles slower than a record: of a system that integrates, or of a drift, which they imitate."""

from __future__ import annotations

from math import inf, pi, sqrt

import numpy as np

from ..base.cached import kept
from ..models.transfer_function import TransferFunction
from .cures import CLOSE, DRIFT, WORTH, Cure, again, bic_beside, on_band
from .diagnosis import level_p
from .doubts import Doubt, may_integrate
from .estimates import Estimates
from .rewritten import in_words, rewritten

__all__ = ["drift_imitated", "slow_pole"]

SLOW = 2.0  # time constants in a record: free motion of fewer is hardly more than a line


def slow_pole(fit: Estimates) -> Doubt | None:
    """That a slow pole may be a drift, or a pole at 0 of a system that integrates, by BIC of both."""
    if drift := drift_imitated(fit):
        return Doubt(f"{drift} First try these, unless the system itself is so slow.", sure=False)
    text = may_integrate(fit)
    if not text:
        return None
    if cure := _drift_instead(fit):
        rise = cure.after - cure.before
        if rise > CLOSE:
            text += f" A drift in its place explains less: with {cure.words}, BIC rises by {rise:.3g}."
        else:
            text += (
                f" A drift in its place explains the record about as well: compare {cure.words}, with which "
                f"BIC is {cure.after:.4g} (now {cure.before:.4g})."
            )
    return Doubt(text, sure=False)


def drift_imitated(fit: Estimates) -> str:
    """That a drift explains as much as a slow pole with fewer parameters, in words; "" where it does not."""
    cure = _drift_instead(fit)
    if cure is None or not cure.after < cure.before:
        return ""
    pole, error = _slowest(fit)
    return (
        f"The pole at {pole:.2g} ± {error:.2g} rad/s may be a drift of the output, which explains as much "
        f"with fewer parameters: with {cure.words}, BIC falls from {cure.before:.4g} to {cure.after:.4g}."
    )


@kept
def _drift_instead(fit: Estimates) -> Cure | None:
    """A drift in place of a slow pole and a zero; None where no pole is slow, or none shows without it."""
    structure, layout = fit.structure, fit.layout
    if not isinstance(structure, TransferFunction) or not fit.inputs or len(fit.outputs) > 1:
        return None
    if structure.denominator is not None or structure.params or layout.orders[0] < 2:
        return None
    if not fit.usable or fit.trend != "constant" or fit.again is None or not fit.records:
        return None
    if not abs(_slowest(fit)[0]) * 2 * pi / min(fit.omega0) < SLOW:
        return None
    # The free motion of the pole is the drift; a zero cancels what inputs do to it.
    zeros = [[None if d is None else max(d - 1, 0) for d in row] for row in layout.numerators]
    smaller, options = rewritten(fit, poles=layout.orders[0] - 1, zeros=zeros), on_band(fit, fit.band)
    other = again(fit, fit.records, smaller, options.replace(trend="linear"))
    if other is None:
        return None
    before, after = bic_beside(fit, fit), bic_beside(other, fit)
    if after < before + CLOSE:  # or the pole is one too many, and nothing drifts
        plain = again(fit, fit.records, smaller, options)
        if plain is not None and not after < bic_beside(plain, fit) - WORTH:
            return None
    words = f"poles={smaller.poles}, zeros={in_words(zeros)}, {DRIFT}"
    return Cure(words, before, after, level_p(other))


@kept
def _slowest(fit: Estimates) -> tuple[float, float]:
    """The pole nearest to 0 and its standard error; infinite where that is none of the real axis."""
    poles, slopes = fit.pole_gradients(0)
    at = int(np.argmin(np.abs(poles)))
    if poles[at].imag:
        return inf, inf
    slope = slopes[at].real
    return float(poles[at].real), sqrt(max(float(slope @ Estimates.cov_params(fit) @ slope), 0.0))
