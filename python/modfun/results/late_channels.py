"""Doubts about the time of channels: one recorded late or early beside the others."""

from __future__ import annotations

from .cures import (
    ENOUGH,
    WORTH,
    Cure,
    Realigned,
    again,
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
from .held_numbers import number_beside
from .misfit import UNLIKELY
from .shifts import Shift, likeliest_shift

__all__ = ["late_channel"]

HALF = (0.3, 0.7)  # samples: about what an input declared held or smooth by mistake is off
LEAST = 0.2  # samples: below that, what signals do between samples makes as much


def late_channel(fit: Estimates) -> Doubt | None:
    """That a channel of equations is late or early beside the others, by a score test of each."""
    shift = likeliest_shift(fit)
    if shift is None or shift.p_value > UNLIKELY or abs(shift.late) < LEAST * _step(fit):
        return None
    if noise_free(fit) is not None:
        return None
    sure = shift.p_value < SURE
    word = _otherwise(fit, shift)
    if word and (found := _declared(fit, shift.channel, word)) is not None:
        return Doubt(_told(fit, shift) + _first(found), sure)
    # A lever, a lag or a term may look like a shift, and explain more.
    cure = (of_written if level_p(fit) < SURE else likely_cure)(fit) if sure else None
    if cure is None:
        cure = realigned(fit)
    if cure is not None and sure and level_p(fit) < SURE and not cure.level_p > ENOUGH and driven(fit):
        return None  # of gusts a shift explains a little
    if isinstance(cure, Realigned):
        if not cure.after < cure.before:
            return None
        name, was, now, _ = furthest(fit, cure.fit)
        moved = f" {name} is {was} so, and {now} with {shift.channel} at its time."
        return Doubt(_told(fit, cure.shift) + moved + _first(cure) + _else(fit, cure, sure), sure)
    if cure is None:
        acts = shift.channel in fit.inputs and shift.late < 0
        return Doubt(f"{_told(fit, shift)} First try a delay.", sure=False) if acts else None
    if not _of_time(cure, shift):
        return None
    return Doubt(_told(fit, shift) + _first(cure) + _else(fit, cure, sure), sure)


def _otherwise(fit: Estimates, shift: Shift) -> str:
    """How an input may go between samples that is half a sample off as declared."""
    if shift.channel not in fit.inputs or not HALF[0] < abs(shift.late) / _step(fit) < HALF[1]:
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
    kinds = list(changed[0].intersample)
    given = repr(kinds if len(kinds) > 1 else word)
    return Cure(f"intersample={given} in the record", before, after, level_p(other))


def _of_time(cure: Cure, shift: Shift) -> bool:
    """Whether a cure moves the channel in time, by a delay or a lag."""
    kinds = (f"{what} of {shift.channel}" for what in ("sensor", "actuator", "delay"))
    return any(kind + end in cure.words for kind in kinds for end in (" (", ","))


def _told(fit: Estimates, shift: Shift) -> str:
    size, samples = abs(shift.late), abs(shift.late) / _step(fit)
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


def _else(fit: Estimates, cure: Cure, sure: bool) -> str:
    return number_beside(fit, cure) if sure else ""


def _step(fit: Estimates) -> float:
    """The longest step of the records, s."""
    return max(rec.dt or 0.0 for rec in fit.records or ())
