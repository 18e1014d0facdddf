"""Events that hide in a default fit: loads that nobody measured, which estimates follow."""

from __future__ import annotations

from ..base.cached import kept
from ..models.transfer_function import TransferFunction
from .coloured_load import MOST_PATHS, in_coloured_noise
from .cures import DRIFT
from .diagnosis import diagnose
from .doubts import SURE, Doubt, clipped, joined, noise_free
from .estimates import Estimates
from .fitted_samples import stationary
from .further import event
from .misfit import UNLIKELY, bends_in_loop, refuted, suspicious
from .next_structures import best_cure, settles

__all__ = ["settles_otherwise", "unseen_event"]

EDGE = 0.05  # of a record


@kept
def unseen_event(fit: Estimates) -> Doubt | None:
    """That something begins to act on an output at one time, which weights of white noise leave in estimates.

    A step of a load is strongest on the lowest lines, which a fit follows with its poles and its delay. Where
    lines are weighted by the spectrum of the residuals it does not, and lines turn as those of one event do.
    """
    plain = isinstance(fit.structure, TransferFunction) and fit.options.noise == "output"
    if not plain or not fit.inputs or fit.again is None or not fit.records or noise_free(fit):
        return None
    # Masked samples tell no event, for which the fit in coloured noise took five times as long as the fit.
    if not stationary(fit):
        return None
    if len(fit.outputs) * len(fit.inputs) > MOST_PATHS:
        return None
    if not suspicious(fit) or not refuted(fit) or joined(fit) or clipped(fit):
        return None
    tests = diagnose(fit, UNLIKELY).further
    if any(one.what in ("event", "spike") and one.p_value < UNLIKELY for one in tests):
        return None  # is told already
    if bends_in_loop(fit):
        return None
    other = in_coloured_noise(fit)
    found = event(other) if other is not None and other.success else None
    if found is None or not found.p_value < SURE or not _inside(fit, found.time) or settles_otherwise(fit):
        return None
    if any(one.what == "gain" and one.p_value < found.p_value for one in tests):
        return None  # a valve whose gain goes with its stem moves its loads at the times of its steps
    return Doubt(
        f"From about t = {found.time:.6g} s on something acts on {found.channel} that is not in the model, "
        f"such as a load or a step of another input (p = {found.p_value:.1g} in coloured noise), and the "
        "estimates follow it. First look there, fit.plot_response(), and add that input to the record; "
        'without it, noise="coloured" weights the lines by what it does to them.'
    )


def _inside(fit: Estimates, time: float) -> bool:
    """Whether a time is not near the ends of any record, where free motion of poles that are missing is."""
    for rec in fit.records or ():
        margin = EDGE * float(rec.t[-1] - rec.t[0])
        if min(abs(time - rec.t[0]), abs(time - rec.t[-1])) < margin:
            return False
    return True


def settles_otherwise(fit: Estimates) -> bool:
    """Whether another structure leaves noise: after a single step of an input what is missing is an event."""
    cures = [best_cure(fit, i, u) for i in range(len(fit.outputs)) for u in fit.inputs]
    return any(cure is not None and cure.words != DRIFT and settles(cure) for cure in cures)
