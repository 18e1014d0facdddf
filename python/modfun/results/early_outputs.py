"""Outputs stamped early, which ask for a negative delay: averages over an interval stamped at its start."""

from __future__ import annotations

from math import inf
from typing import Any

from ..base.between import FORMS, form_of
from ..base.cached import kept
from ..base.names import listed
from ..models.free import Free
from ..records.record import Record
from .cures import CLOSE, WORTH, again, as_declared, bic_beside, on_band, otherwise
from .diagnosis import growth
from .doubts import Doubt, still_held
from .estimates import Estimates
from .rewritten import rewritten

__all__ = ["early_output"]

MOST = 0.75  # of what the better of two cures explains: the likelier one is named
WHY = {
    "foh": "the average response to a held input is the response to straight lines between its samples",
    "smooth": "averages of an input are not held, and those of input and output belong together",
}


@kept
def early_output(fit: Estimates) -> Doubt | None:
    """That a free delay ended on zero because outputs come earlier than a response may.

    The mean over a step of the response to a held input is, at the start of the step, the response to
    straight lines between the samples of the input; that to the mean of an input is the response to a smooth
    one. Read so, averages need no shift.
    """
    name, records = _stuck(fit), fit.records or ()
    step = records[0].dt if name and fit.again is not None and records else None
    if step is None or any(rec.dt != step for rec in records):
        return None
    before = bic_beside(fit, fit)
    later = _fitted(fit, [_earlier_inputs(rec) for rec in records], delay=_after(fit.structure.delay, step))
    unheld = _fitted(fit, [_unheld(rec) for rec in records]) if "zoh" in fit.intersample else None
    shifted, declared = _bic(later, fit), _bic(unheld, fit)
    best = min(shifted, declared)
    if later is None or not best < before - WORTH:
        return None
    leads = _bic(_leading(fit), fit)
    if leads < best - WORTH:
        return None
    late = later[name] - step
    seen = (
        f"{name} ended on 0, and {late:.3g} ± {later.bse[later.param_names.index(name)]:.2g} s would fit: "
        f"{listed(fit.outputs)} seem{'s' * (len(fit.outputs) == 1)} to be stamped early, like averages that "
        "are stamped at the start of their interval."
    )
    beside = f" One more zero does about as well (BIC {leads:.4g})." if leads < best + CLOSE else ""
    if before - declared > MOST * (before - best):  # exact of averages, where a shift is about right
        kinds = _unheld(records[0]).intersample
        why = [WHY[word] for word in dict.fromkeys(kinds) if word in WHY]
        cure = f"First declare {as_declared(fit, kinds)}: {', and '.join(why)}"
        return Doubt(f"{seen} {cure} (BIC falls from {before:.4g} to {declared:.4g}).{beside}")
    return Doubt(
        f"{seen} First store outputs a step later, {_later_by_a_step(records)}, and let delays be a step "
        f"({step:.3g} s) longer: BIC falls from {before:.4g} to {shifted:.4g}. Of averages subtract half a "
        f"step ({step / 2:.3g} s) from the delay that you then find.{beside}"
    )


def _stuck(fit: Estimates) -> str:
    """The free delay of a transfer function that ended on zero."""
    layout: Any = fit.layout
    if not layout.rational or not fit.at_bound or still_held(fit):
        return ""
    names = [layout.paths[k].name for k in layout.free_delays]
    return next((name for name in names if name in fit.at_bound and fit[name] == 0.0), "")


def _fitted(fit: Estimates, records: list[Record], **changes: Any) -> Estimates | None:
    """The fit of other records, stable where the fit is, and with no delay on a bound."""
    other = again(fit, tuple(records), rewritten(fit, **changes), on_band(fit, fit.band))
    return other if other and not growth(other) > 0 >= growth(fit) and not _stuck(other) else None


def _bic(other: Estimates | None, fit: Estimates) -> float:
    return bic_beside(other, fit) if other else inf


def _leading(fit: Estimates) -> Estimates | None:
    """The fit with one more zero of each path and without a delay: of a structure that lacks a lead."""
    layout: Any = fit.layout
    degrees = [
        [None if d is None else min(d + 1, n) for d in row]
        for n, row in zip(layout.orders, layout.numerators, strict=True)
    ]
    return _fitted(fit, list(fit.records or ()), zeros=degrees, delay=_without(fit.structure.delay))


def _after(delay: Any, step: float) -> Any:
    """Delays a step longer; free ones may also be shorter."""
    if isinstance(delay, tuple):
        return tuple([_after(own, step) for own in delay])
    if not isinstance(delay, Free):
        return delay + step
    start = None if delay.start is None else delay.start + step
    return Free(start, min=max(delay.min, 0.0), max=delay.max + step, sd=delay.sd)


def _without(delay: Any) -> Any:
    """Delays that are known, and zero for free ones."""
    if isinstance(delay, tuple):
        return tuple([_without(own) for own in delay])
    return 0.0 if isinstance(delay, Free) else delay


def _earlier_inputs(rec: Record) -> Record:
    """The record with its inputs a sample earlier beside the outputs, and so a sample shorter."""
    return rec.window(rec.t[0], rec.t[-2])._like(u=rec.u[:, 1:])


def _unheld(rec: Record) -> Record:
    """The record with straight lines in place of held inputs, or smooth ones that do not look held.

    Averages of a command lie on its levels or, where it moved, between them: under noise, so it seems.
    """
    for k, word in enumerate(rec.intersample):
        form = form_of(rec.u[k])
        between = form == "noisy" or FORMS[form] == "smooth"
        rec = otherwise(rec, k, "smooth" if between else "foh") if word == "zoh" else rec
    return rec


def _later_by_a_step(records: tuple[Record, ...]) -> str:
    """Code that stores the outputs of a record a step later."""
    outputs = ", ".join(f"{y}=rec[{y!r}][:-1]" for y in records[0].outputs)
    masked = any(rec.mask is not None for rec in records)
    moved = ".weigh(mask=rec.mask[:, :-1])" if masked else ""
    return f"rec.window(rec.t[1], rec.t[-1]).assign({outputs}){moved}"
