"""Why searches stopped without settling: too many poles, or parameters hardly told apart, or never."""

from __future__ import annotations

import numpy as np

from ..base.cached import kept
from ..models.transfer_function import TransferFunction
from .collinearity import collinearity_of
from .cures import ENOUGH, again
from .diagnosis import level_p
from .doubts import Doubt, still_held
from .estimates import Estimates
from .rewritten import rewritten

__all__ = ["never_apart", "too_many_poles", "valley"]

NARROW = 1000.0  # condition index of a valley; the bottom of one of 3,000 was reached in 4 of 10 searches


@kept
def never_apart(fit: Estimates) -> Doubt | None:
    """What no record could tell apart, where a search ended without an answer or on bounds.

    Along a line of equal answers it runs to bounds or to the last iteration as often as it finds none to be
    determined, and what it leaves there says nothing of the model: of a motor whose speed alone was measured
    4 of 12 records were told to lack a state.
    """
    if fit.layout.rational or not (fit.status == "rank" or _stopped(fit)):
        return None
    found = fit.structure.identifiable()
    if found:
        return None
    return Doubt(
        f"The equations do not tell their parameters apart, whatever the record: {' '.join(found.sentences)}"
    )


def _stopped(fit: Estimates) -> bool:
    """Whether a search ended outside of a minimum, where the samples alone decide."""
    return (not fit.success or bool(fit.at_bound)) and not fit.layout.priors


@kept
def too_many_poles(fit: Estimates) -> Doubt | None:
    """That the search did not settle, and does with one pole less, which leaves only the noise."""
    structure, layout = fit.structure, fit.layout
    if fit.success or fit.again is None or not isinstance(structure, TransferFunction):
        return None
    if structure.denominator is not None or structure.params or len(fit.outputs) != 1 or layout.orders[0] < 2:
        return None
    poles = layout.orders[0] - 1
    degrees = [[None if d is None else min(d, poles) for d in row] for row in layout.numerators]
    other = again(fit, fit.records, rewritten(fit, poles=poles, zeros=degrees), fit.options)
    if other is None or not (_answers(other) or _does_better(other, fit)):
        return None
    left = "leaves only the noise" if _answers(other) else "leaves less of the outputs"
    held = f" and still held {still_held(fit)[0]}" if still_held(fit) else ""
    return Doubt(
        f"The search stopped after {fit.nit} iterations without settling{held}: the record does not "
        f"show so many poles. First try poles={poles}, with which it settles and {left}."
    )


def valley(fit: Estimates) -> str:
    """Which parameters are hardly told apart where a search ended among answers that leave only the noise.

    Of a motor whose speed alone is measured K, J and b have errors of their own size, and 50 steps along the
    valley did not reach its bottom.
    """
    if fit.status != "maxiter" or not fit.usable or not level_p(fit) > ENOUGH:
        return ""
    found = collinearity_of(fit)
    return found.findings[0] if found.condition > NARROW else ""


def _answers(fit: Estimates) -> bool:
    """Whether a fit settles and leaves only the noise."""
    return fit.usable and fit.success and level_p(fit) > ENOUGH


def _does_better(fit: Estimates, larger: Estimates) -> bool:
    """Whether a smaller structure settles and leaves less, where no band shows noise alone."""
    settled = fit.usable and fit.success and bool(np.isnan(level_p(fit)))
    return settled and bool(np.all(np.diag(fit.noise_cov) < np.diag(larger.noise_cov)))
