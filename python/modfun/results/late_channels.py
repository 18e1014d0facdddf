"""Doubts about the time of channels: one recorded late or early beside the others."""

from __future__ import annotations

from math import hypot, inf

from ..equations.state_space import StateSpace
from .actuators import unlike_command
from .cures import (
    ALIGNED,
    CLOSE,
    ENOUGH,
    WORTH,
    Cure,
    Realigned,
    again,
    as_declared,
    as_shift,
    bic_beside,
    furthest,
    likely_cure,
    of_written,
    on_band,
    otherwise,
    realigned,
)
from .diagnosis import level_p
from .doubts import SURE, Doubt, noise_free
from .driven_equations import driven
from .estimates import Estimates
from .held_numbers import contradicted_numbers, factor_beside
from .lags import EXTRA, delayed
from .misfit import UNLIKELY
from .shifts import SEEN, Shift, likeliest_shift

__all__ = ["late_channel", "longest_step"]

HALF = (0.3, 0.7)  # samples: about what an input declared held or smooth by mistake is off
LIKELY = 1e-3  # p-value of a shift that warns where BIC falls, too: of 150 right records none did
LEAST = 0.2  # samples: below that, what signals do between samples makes as much


def late_channel(fit: Estimates) -> Doubt | None:
    """That a channel of equations is late or early beside the others, by a score test of each."""
    shift = likeliest_shift(fit)
    if shift is None or shift.p_value > SEEN or abs(shift.late) < LEAST * longest_step(fit):
        return None
    if noise_free(fit) is not None:
        return None
    sure = shift.p_value < SURE or _falls(fit, shift)
    word = _otherwise(fit, shift)
    if word and (found := _declared(fit, shift.channel, word)) is not None:
        return Doubt(_told(fit, shift) + _first(found), sure)
    if sure and shift.channel in fit.inputs and shift.late < 0 and unlike_command(fit) is not None:
        return None  # a delay explains part of what an actuator does
    # A lever, a lag or a term may look like a shift, and explain more.
    cure = (of_written if sure and level_p(fit) < SURE else likely_cure)(fit)
    if cure is None or not (sure or _of_time(cure, shift)):
        cure = realigned(fit)
    if cure is not None and sure and level_p(fit) < SURE and not cure.level_p > ENOUGH and driven(fit):
        return None  # of gusts a shift explains a little
    if isinstance(cure, Realigned):
        if not cure.after < cure.before:
            return None
        state = _as_state(fit, cure)
        told = _told(fit, cure.shift) + (_with_state(fit, state) if state else _moved(fit, cure))
        return _or_factor(fit, state or cure, told, sure)
    if cure is None:
        acts = shift.channel in fit.inputs and shift.late < 0
        return Doubt(f"{_told(fit, shift)} First try a delay.", sure=False) if acts else None
    if not _of_time(cure, shift):
        return None
    return _or_factor(fit, cure, _told(fit, shift) + _with_state(fit, cure), sure)


def _or_factor(fit: Estimates, cure: Cure, told: str, sure: bool) -> Doubt | None:
    """The doubt of a time, or that of a number where this explains more; both where they are close.

    A factor of a vane by the upwash of a few per cent explains as much as one sample of delay.
    """
    factor, shift = factor_beside(fit), as_shift(fit, cure)
    after = min(cure.after, shift.after if shift else inf)
    moved = realigned(fit) if cure.late else None
    least_likely = max(after, moved.after if moved else -inf)
    if factor is None or not factor.after < least_likely + CLOSE:
        return Doubt(told + _first(cure), sure)
    # A time that all samples share is likelier than a scale factor that looks like it.
    if not factor.after < after - CLOSE * bool(shift):
        well = "about as well" if factor.after < after + CLOSE else "less well"
        beside = f" {factor.kind} does {well} (BIC {factor.after:.4g}): {factor.seen}."
        return Doubt(told + _first(cure) + beside, sure)
    if contradicted_numbers(fit) is not None:
        return None  # said already
    beside = f" About as well (BIC {cure.after:.4g}): {cure.words}, since {told}"
    return Doubt(
        f"{factor.kind} seems to be off: {factor.seen}. First {factor.cure}: BIC falls from "
        f"{cure.before:.4g} to {factor.after:.4g}.{beside if cure.after < factor.after + CLOSE else ''}",
        sure,
    )


def _falls(fit: Estimates, shift: Shift) -> bool:
    """Whether a shift that is likely by its test also lowers BIC, itself or as a lag of the sensor."""
    if not shift.p_value < LIKELY:
        return False
    cures = [cure for cure in (realigned(fit), likely_cure(fit)) if cure and cure.late == shift.channel]
    return any(cure.after < cure.before - CLOSE for cure in cures)


def _moved(fit: Estimates, cure: Realigned) -> str:
    """What a shift changes most, at the time that was found, with an error that counts that of the time."""
    assert cure.fit is not None
    name, was, _, _ = furthest(fit, cure.fit)
    at = fit.param_names.index(name)
    slope = (cure.fit.params[at] - fit.params[at]) / cure.by
    value = fit.params[at] + slope * cure.shift.late
    error = hypot(cure.fit.spread[at], slope * cure.shift.error)
    return f" {name} is {was} so, and {value:.4g} ± {error:.2g} with {cure.late} at its time."


def _with_state(fit: Estimates, cure: Cure) -> str:
    """What a lag or a delay of a sensor changes most, with its errors; nothing of other cures."""
    if not cure.late or cure.fit is None:
        return ""
    name, was, now, _ = furthest(fit, cure.fit)
    return f" {name} is {was} so, and {now} with its sensor as a state."


def _as_state(fit: Estimates, cure: Realigned) -> Cure | None:
    """The same with the time as a parameter, whose error counts: where samples are moved it does not."""
    model, shift = fit.structure, cure.shift
    exact = shift.error < ALIGNED * longest_step(fit)
    if exact or not isinstance(model, StateSpace) or shift.channel not in model.outputs or shift.late < 0:
        return None
    words, structure = delayed(fit, model, model.outputs.index(shift.channel), shift.late)
    other = again(fit, fit.records, structure, on_band(fit, fit.band))
    if other is None or EXTRA in other.at_bound:
        return None
    after = bic_beside(other, fit)
    text = words.replace("{}", f"{other[EXTRA]:.3g}")
    return (
        Cure(text, cure.before, after, level_p(other), other, shift.channel)
        if after < cure.after + CLOSE
        else None
    )


def _otherwise(fit: Estimates, shift: Shift) -> str:
    """How an input may go between samples that is half a sample off as declared."""
    if shift.channel not in fit.inputs or not HALF[0] < abs(shift.late) / longest_step(fit) < HALF[1]:
        return ""
    now = fit.intersample[fit.inputs.index(shift.channel)]
    return {("smooth", False): "zoh", ("zoh", True): "smooth"}.get((now, shift.late > 0), "")


def _declared(fit: Estimates, channel: str, word: str) -> Cure | None:
    """The input read so, where this explains more than the shift's least worth."""
    at, records = fit.inputs.index(channel), fit.records or ()
    changed = tuple([otherwise(rec, at, word) for rec in records])
    other = again(fit, changed, fit.structure, on_band(fit, fit.band))
    if other is None:
        return None
    left, before, after = likeliest_shift(other, channel), bic_beside(fit, fit), bic_beside(other, fit)
    if left is None or left.p_value < UNLIKELY or not after < before - WORTH:
        return None
    return Cure(f"{as_declared(fit, changed[0].intersample)} in the record", before, after, level_p(other))


def _of_time(cure: Cure, shift: Shift) -> bool:
    """Whether a cure moves the channel in time, by a delay or a lag."""
    kinds = (f"{what} of {shift.channel}" for what in ("sensor", "actuator", "delay"))
    return any(kind + end in cure.words for kind in kinds for end in (" (", ","))


def _told(fit: Estimates, shift: Shift) -> str:
    size, samples = abs(shift.late), abs(shift.late) / longest_step(fit)
    if shift.channel in fit.inputs and shift.late < 0:
        what, word = "act", "later than the equations say"
    else:
        what, word = "be recorded", f"{'late' if shift.late > 0 else 'early'} beside the other channels"
    return (
        f"{shift.channel} seems to {what} {size:.3g} ± {shift.error:.2g} s ({samples:.2g} samples) {word} "
        f"(p = {shift.p_value:.1g})."
    )


def _first(cure: Cure) -> str:
    return f" First try {cure.words}: BIC falls from {cure.before:.4g} to {cure.after:.4g}."


def longest_step(fit: Estimates) -> float:
    """The longest step of the records, s."""
    return max(rec.dt or 0.0 for rec in fit.records or ())
