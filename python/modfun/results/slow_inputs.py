"""Doubts about inputs with a new value every few samples only: held so, or measured by a slower sensor."""

from __future__ import annotations

from ..base.between import form_of
from ..base.cached import kept
from ..records.record import Record
from ..records.slower import held, ordinal
from .cures import again, as_declared, bic_beside, on_band, otherwise
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates
from .undeclared import POSITIVE

__all__ = ["slow_input"]

STRONG = 20.0  # a fall of BIC: held values, which are what the samples say, are doubted beyond chance only
MOTIONS = ("smooth", "walk")  # new values of what may be a motion; others are those of commands


def slow_input(fit: Estimates) -> Doubt | None:
    """That an input stands between its new values and is read otherwise, or is held and did not stand."""
    records = fit.records or ()
    if fit.again is None or all(_grid(rec, k)[0] == 1 for rec in records for k in range(len(rec.inputs))):
        return None
    for channel in range(len(fit.inputs)):
        if found := _held(fit, channel) or _polled(fit, channel):
            return found
    return None


@kept
def _grid(rec: Record, channel: int) -> tuple[int, int]:
    """How many samples lie from one new value of an input to the next, and the first."""
    name = rec.inputs[channel]
    return (1, 0) if name in rec._functions else held(rec[name])


def _held(fit: Estimates, channel: int) -> Doubt | None:
    """That fits are better where an input is held which was declared otherwise."""
    records = fit.records or ()
    wrong = [rec.intersample[channel] != "zoh" and _grid(rec, channel)[0] > 1 for rec in records]
    if not any(wrong):
        return None
    rec = records[wrong.index(True)]
    both = zip(records, wrong, strict=True)
    fallen = _fallen(fit, [otherwise(own, channel, "zoh") if k else own for own, k in both], POSITIVE)
    if fallen is None:
        return None
    words = otherwise(rec, channel, "zoh").intersample
    how = "read as" if rec.inputs[channel] in rec._seen else "declared"
    return Doubt(
        f"{_seen(rec, channel)} and is {how} {rec.intersample[channel]}. First give "
        f"{as_declared(fit, words)} in the record: {fallen}.",
        sure=True,
    )


def _polled(fit: Estimates, channel: int) -> Doubt | None:
    """That fits are better with a curve through the new values, as of a motion that a slower sensor saw."""
    records = fit.records or ()
    read = [(rec, *_grid(rec, channel)) for rec in records]
    slow = [step > 1 and form_of(rec.u[channel, first::step]) in MOTIONS for rec, step, first in read]
    if not any(slow):
        return None
    both = zip(read, slow, strict=True)
    fallen = _fallen(fit, [_curved(*own, channel) if k else own[0] for own, k in both], STRONG)
    if fallen is None:
        return None
    rec, step, first = read[slow.index(True)]
    name, own = rec.inputs[channel], f"[{first}::{step}]"
    word = "" if name in rec._seen else ", with intersample='smooth' in the record"
    return Doubt(
        f"{_seen(rec, channel)}, as a slower sensor does, and did not stand in between. First draw a curve "
        f"through the new values, rec.assign({name}=scipy.interpolate.CubicSpline(rec.t{own}, "
        f"rec[{name!r}]{own})(rec.t)){word}: {fallen}.",
        sure=True,
    )


def _seen(rec: Record, channel: int) -> str:
    step = ordinal(_grid(rec, channel)[0])
    return f"Input {rec.inputs[channel]!r} has a new value only every {step} sample and repeats it"


def _curved(rec: Record, step: int, first: int, channel: int) -> Record:
    """The record with a curve through the new values of an input."""
    from scipy.interpolate import CubicSpline

    name, own = rec.inputs[channel], slice(first, None, step)
    curve = CubicSpline(rec.t[own], rec[name][own])(rec.t)
    return otherwise(rec.assign(**{name: curve}), channel, "smooth")


def _fallen(fit: Estimates, records: list[Record], least: float) -> str | None:
    """How far BIC falls with these records, in words, where that is more than the least and noise is left."""
    other = again(fit, tuple(records), fit.structure, on_band(fit, fit.band))
    if other is None or level_p(other) < SURE:
        return None
    was, now = bic_beside(fit, fit), bic_beside(other, fit)
    return f"BIC falls from {was:.4g} to {now:.4g}" if was - now > least else None
