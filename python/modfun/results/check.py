"""What is doubtful about a fit: the one warning it is made with, and what its check finds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import Any

import numpy as np

from ..base.cached import kept
from ..base.effort import Effort, Spent
from ..base.tables import Findings
from ..base.waiting import Waiting
from ..records.steady import QUIET, standing
from .actuators import limited_input, unlike_command
from .band_end import beyond
from .baselines import taken_for_constant
from .coloured_load import coloured_load
from .computed_channels import computed_channel
from .cures import DRIFT, ENOUGH, again, convincing, furthest
from .dead_bands import stands_still, stored_late
from .degrees import in_degrees
from .diagnosis import diagnose, growth, level_p, level_ratio
from .doubts import (
    SURE,
    Doubt,
    biased,
    clipped,
    coded,
    condition,
    contradicted,
    eliminated,
    few_samples,
    in_hertz,
    in_two_units,
    joined,
    minima,
    noise_bends,
    noise_free,
    of_records,
    of_samples,
    of_stability,
    on_bound,
    repeated,
    unexpected,
    unstable,
)  # fmt: skip
from .driven_equations import one_cause
from .driven_loops import COMMAND, command_of, driven_loop
from .dry_friction import dry_friction
from .early_outputs import early_output
from .estimates import Estimates
from .feedback import feedback
from .free_motion import bent
from .held_numbers import contradicted_numbers
from .hidden_by_start import hidden_by_start
from .hidden_laws import hidden_law
from .hidden_units import in_other_units
from .jumps import flips, jumps
from .known_drift import drifting
from .known_start import contradicted_p, gain_of_start, off_zero
from .lag_or_delay import acts_by_lag, uncounted_lag
from .late_channels import late_channel
from .levers import off_centre
from .lopsided import lopsided
from .loud_noise import loud_noise
from .misfit import UNLIKELY, bends_in_loop, misfit, of_colour, of_drift, of_residuals, of_tone, reference
from .missing_states import missing_states
from .multiplied import misweighted, multiplied
from .next_structures import best_cure
from .noise_modes import noise_mode
from .noisy_inputs import noisy_input
from .nothing_free import nothing_free
from .offsets import is_all, mean, offset, unanswered
from .origin import LEAST_GAIN, smaller_errors
from .powers import not_linear
from .runaway import runaway
from .serial import in_samples, serial
from .short_pulses import short_pulse
from .slow_inputs import slow_input
from .slow_noise import slow_noise
from .slow_poles import slow_pole
from .sparse import sparse
from .stand_in import stand_in
from .still_inputs import of_still_inputs
from .stopped import never_apart, too_many_poles, valley
from .swapped import swapped
from .timing import uncounted_time
from .twins import other_minimum, other_signs, twin
from .uncertain_poles import uncertain_poles
from .undeclared import undeclared, wandering
from .uneven_noise import of_time
from .unlike_records import unlike_alone, unlike_records
from .unnamed_inputs import missing_input
from .unrecorded_inputs import unforced, unrecorded_input
from .unseen_events import unseen_event
from .unused_outputs import unused_output

__all__ = ["check", "doubts_in_line", "remarks", "warnings_of"]


STANDS = (
    "First make a record in which the command moves, or a dither is added to the input, by more than the "
    "noise does and about as slowly as the system answers; keep it"
)
UNASKED, MOMENT = 40.0, 0.5  # work of the looks that a fit is made with, and of those while a line is printed
SHARE = 4.0  # of the former, of the look that tries values of actuators one after the other
BIASED = 0.16  # standard errors: bias that is said, so that one of 0.3 seldom is not


def unsettled(fit: Estimates) -> Doubt | None:
    """That the iteration did not end by itself."""
    return None if fit.success else Doubt(_message(fit))


@kept
def _message(fit: Estimates) -> str:
    """What went wrong, and that a start which is no such start looks like it."""
    start = fit.options.initial_state
    if isinstance(start, str) and start == "unknown":
        return valley(fit) or _from_rest(fit) or _driven(fit) or fit.message
    ends = ""
    if fit.again is not None and fit.records:
        free = again(fit, fit.records, fit.structure, fit.options.replace(initial_state="unknown"))
        if free is None or not free.success:
            return fit.message
        ends = ", with which the search ends"
    said = repr(start) if isinstance(start, str) else "..."
    return f'First try initial_state="unknown"{ends}: the record may not begin as {said} says. {fit.message}'


def _from_rest(fit: Estimates) -> str:
    """That the search ends from rest, where inputs begin steady; one step tells little else of the gain."""
    plain = fit.layout.rational and fit.options.noise == "output" and fit.again is not None
    if not (plain and fit.records and fit.inputs and all(standing(rec) >= QUIET for rec in fit.records)):
        return ""
    other = again(fit, fit.records, fit.structure, fit.options.replace(initial_state="rest"))
    if other is None or not other.success or contradicted_p(other) < ENOUGH:
        return ""
    return (
        f'{fit.message} First try initial_state="rest", with which the search ends: the inputs begin steady, '
        "and the outputs agree with a start at rest."
    )


def _driven(fit: Estimates) -> str:
    """That the search for linear equations ends where noise may drive them; "" where it does not."""
    plain = fit.options.noise == "output" and fit.again is not None and bool(fit.records)
    if fit.layout.rational or not plain or not getattr(fit.structure, "linear", True):
        return ""
    other = again(fit, fit.records, fit.structure, fit.options.replace(noise="process"))
    if other is None or not other.success:
        return ""
    return (
        f'{fit.message} First try noise="process", with which the search ends: turbulence may drive '
        "the system."
    )


def _failed(fit: Estimates) -> str:
    """Why there is no estimate."""
    if never := never_apart(fit):
        return never.text
    if still := of_still_inputs(fit):
        return still
    with np.errstate(all="ignore"):
        doubt = (
            of_samples(fit)
            or in_degrees(fit)
            or unlike_records(fit)
            or missing_input(fit)
            or in_other_units(fit)
            or contradicted_numbers(fit)
            or runaway(fit)
            or one_record(fit)
            or unanswered(fit)
            or unrecorded_input(fit)
        )
    return doubt.text if doubt else _message(fit)


def one_record(fit: Estimates) -> Doubt | None:
    """That one record is not explained, in words of its own fit, where the others leave only the noise."""
    found = unlike_alone(fit)
    if found is None:
        return None
    k, own = found
    if not fit.usable and not (own is not None and own.success):
        return None  # the search for either went astray
    text = next(iter(warnings_of(own)), "") if own is not None else ""
    if not text:
        text = "First compare it with a fit of the others, fit.plot_response(rec), or leave it out."
    return Doubt(
        f"Record {k} contradicts the model, and the others leave only the noise. {text.removeprefix('fit: ')}"
    )


def bounded(fit: Estimates) -> Doubt | None:
    """That parameters ended on bounds, or why: records of regulation hold no plant, and slow noise drives."""
    doubt = on_bound(fit)
    loop = feedback(fit) if doubt else None
    return fed_back(fit) if loop and loop.regulates else (doubt and _slow(fit)) or doubt


@kept
def fed_back(fit: Estimates) -> Doubt | None:
    """That the noise of the outputs comes back in the inputs, and biases the estimates."""
    found = feedback(fit)
    if found is None or found.p_value > UNLIKELY or not found.bias > BIASED:
        return None
    u, y = found.channel, found.output
    if not found.regulates and growth(fit) > 0 and _settled(fit, y, u):
        return None  # residuals of an unstable model spread in time, and hold later inputs
    if found.regulates:
        text = (
            f"{u} does nothing but answer {y}, as a controller does whose command stands still (p = "
            f"{found.p_value:.1g}): the record cannot tell the system from the inverse of the controller, "
            f"and the estimates may be those of the latter. {_by_command(fit, u, STANDS)}"
        )
        return Doubt(text, sure=found.p_value < SURE)
    if bends_in_loop(fit):
        return None
    if not command_of(fit) and (driven := driven_loop(fit)):
        return driven
    return Doubt(
        f"{u} follows earlier residuals of {y} (p = {found.p_value:.1g}): a loop feeds the noise back, which "
        f"biases the estimates by about {found.bias:.2g} standard errors. {_by_command(fit, u)}",
        sure=found.p_value < SURE and found.least > BIASED,
    )


def _settled(fit: Estimates, y: str, u: str) -> bool:
    """Whether a structure next to the fitted one leaves the noise alone."""
    cure = best_cure(fit, fit.outputs.index(y), u)
    return cure is not None and cure.level_p > ENOUGH and convincing(fit, cure)


def _by_command(fit: Estimates, channel: str, otherwise: str = "") -> str:
    """What to do about a loop: its command as the reference, or where that one was tried in vain, another.

    `otherwise`: what to do where the record keeps no command that helps.
    """
    free = "" if fit.options.initial_state == "unknown" else ', initial_state="unknown"'
    name = command_of(fit)
    if not name:
        words = f'Record(keep={{"{COMMAND}": ...}}), and fit with reference="{COMMAND}"{free}'
        if otherwise:
            return f"{otherwise}, {words}."
        helps = f"it helps where the command moves {channel} more than noise does"
        return f"First keep the command of the loop in the record, {words}; {helps}."
    options = fit.options.replace(reference=(name,), initial_state="unknown")
    others = tuple([look for look in LOOKS if look is not uncertain_poles])
    # In slow disturbances a loop's record is bad without weights, too, and the search may not settle.
    plain, in_colour = (
        again(fit, fit.records, fit.structure, own) if fit.again else None
        for own in (options, options.replace(noise="coloured"))
    )
    in_colour = in_colour if in_colour and not warnings_of(in_colour, others) else None
    pays = in_colour and not (plain and smaller_errors(plain, in_colour) <= LEAST_GAIN)
    # Of a fit that leaves slow noise its own cures take long, and where weights pay nobody needs to know.
    enough = not pays and plain and not warnings_of(plain, others)
    if enough or in_colour:
        colour = "" if enough else ', noise="coloured"'
        return f'First fit with the command of the loop, reference="{name}"{free}{colour}.'
    if otherwise:
        return f'{otherwise}, and fit with reference="{name}"{free}.'
    if slow := _slow(fit):
        return f'A fit with reference="{name}" does not settle or leaves more than noise. {slow.text}'
    return (
        f'A fit with reference="{name}" does not settle or leaves more than noise: {name} moves {channel} '
        "too little beside the noise. First take one that moves it more, a longer record, or fewer poles."
    )


def unexplained(fit: Estimates) -> Doubt | None:
    """What residuals say beyond doubt; what the record shows by itself comes first, as the likelier cause."""
    doubt = _left(fit)
    return joined(fit) or clipped(fit) or doubt if doubt and doubt.sure else doubt


def _left(fit: Estimates) -> Doubt | None:
    """What residuals say first: that noise is slow, where that is beyond doubt or candidates take minutes."""
    if in_samples(fit):
        return serial(fit)
    slow = _slow(fit)
    return slow if slow and (slow.sure or not fit.layout.rational) else misfit(fit) or slow


def saturated(fit: Estimates) -> Doubt | None:
    """That an output sits at an extreme, where residuals of equations leave no doubt of more than noise."""
    return clipped(fit) if not fit.layout.rational and level_p(fit) < SURE else None


@kept
def _slow(fit: Estimates) -> Doubt | None:
    return slow_noise(fit, warnings_of)


def not_from_zero(fit: Estimates) -> Doubt | None:
    """That records begin at an operating point, not at zero, which may drive estimates to their bounds."""
    starts = off_zero(fit)
    doubt = contradicted(fit) if starts else None
    return doubt and Doubt(
        f'The record does not begin at zero, though initial_state="zero" says so: {starts}. First subtract '
        'the operating point from the inputs and outputs, or give initial_state="rest".',
        sure=doubt.sure,
    )


def drifts(fit: Estimates) -> Doubt | None:
    """That an output drifts beside its response: a known state leaves the constant nothing to hide it in."""
    found = drifting(fit)
    if found is None:
        return None
    other, fall = found
    name, was, now, _ = furthest(fit, other)
    return Doubt(
        "The outputs drift beside their response, which a fit from a known start takes for gain. First try "
        f"{DRIFT} beside initial_state={fit.options.initial_state!r}: BIC of the samples falls by "
        f"{fall:.3g}, and {name} becomes {now} (was {was}).",
        sure=True,
    )


def misbegun(fit: Estimates) -> Doubt | None:
    """That records begin otherwise than they were said to, if not by an operating point."""
    return None if off_zero(fit) else contradicted(fit)


# What a fit looks at by itself, in the order of what its one warning says first.
LOOKS: tuple[Callable[[Estimates], Doubt | None], ...] = (
    coded, nothing_free, never_apart, in_degrees, jumps, unlike_records, one_record, unforced, offset, mean,
    taken_for_constant,
    repeated, sparse, not_from_zero, runaway, unseen_event, noise_bends, too_many_poles, early_output,
    limited_input, bounded, drifts, misbegun,
    unexpected, stored_late, stands_still, slow_input, saturated, in_two_units, off_centre,
    in_other_units, contradicted_numbers, missing_input, unused_output, unrecorded_input, hidden_by_start,
    acts_by_lag, late_channel, bent, dry_friction, swapped, misweighted, unlike_command, fed_back,
    noisy_input, short_pulse, driven_loop, hidden_law, coloured_load, eliminated, not_linear,
    unexplained, missing_states, one_cause, flips, other_signs, other_minimum, unsettled, unstable, condition,
    noise_mode, uncertain_poles, wandering, twin,
)  # fmt: skip

# Of code that looks for causes, which must not lose a fit. Tests take it for empty, so that they see errors.
FAILURES: tuple[type[Exception], ...] = (Exception,)


def warnings_of(fit: Estimates, looks: tuple[Callable[[Estimates], Doubt | None], ...] = LOOKS) -> list[str]:
    """The one warning a fit is made with: the first of what is beyond doubt, if there is any."""
    return _first(fit, looks, ())


def remarks(fit: Estimates) -> list[str]:
    """The same, of looks that nobody asked for: what takes more work than these are given, `check` finds."""
    with Effort(UNASKED):
        return _first(fit, LOOKS, Spent)


def _first(
    fit: Estimates,
    looks: tuple[Callable[[Estimates], Doubt | None], ...],
    ended: type[BaseException] | tuple[()],
) -> list[str]:
    """What looks are first to find beyond doubt; those that `ended` stops find nothing."""
    if not fit.usable:
        try:
            return [f"fit: {_failed(fit)}"]
        except ended:
            return [f"fit: {fit.message}"]
    with np.errstate(all="ignore"):  # fits of hostile numbers leave the range of floating point
        try:
            whole = stand_in(fit)
        except ended:
            return []
        for look in looks:
            try:
                with Effort(SHARE) if ended and look is unlike_command else nullcontext():
                    doubt = _looked(look, fit, whole)
            except ended:
                doubt = _above_noise(fit) if look is unexplained else None
            if doubt and doubt.sure:
                return [f"fit: {doubt.text}"]
    return []


def _above_noise(fit: Estimates) -> Doubt | None:
    """That residuals are beyond doubt more than noise, where to look for the cause takes long."""
    if not level_p(fit) < SURE:
        return None
    return Doubt(
        f"The residuals are {level_ratio(fit):.3g} times {reference(fit)}: a part of the response, a term or "
        "an input is missing. To look for it takes longer than the fit did; fit.check() does."
    )


def _looked(look: Callable[[Estimates], Doubt | None], fit: Estimates, whole: Estimates) -> Doubt | None:
    """What a look finds; one that fails, as in models at other parameters, must not lose the fit.

    The fit is seen with masked samples filled; what a historian stored is seen without these.
    """
    try:
        return look(fit if look is stored_late else whole)
    except FAILURES as error:
        return _failure(look.__name__, error)


def _failure(part: str, error: Exception) -> Doubt:
    text = f"{type(error).__name__}: {error}"
    return Doubt(f"A part of this check, {part}, failed ({text}): please report it.", sure=False)


def doubts_in_line(fit: Any) -> int | None:
    """How many doubts a printed line tells of; None where to look for all takes more than a moment."""
    if not fit.success:
        return 0
    return len(fit.check()) if "_findings" in fit.__dict__ else _in_a_moment(fit)


@kept
def _in_a_moment(fit: Any) -> int | None:
    try:
        with Effort(MOMENT):
            return len(fit.check())
    except Spent:
        return None


def check(fit: Estimates, line: str) -> Findings:
    """What is wrong or doubtful about a fit, `line` in words; see `Fit.check`."""
    title = f"Check of {line}"
    if not fit.usable:
        return Findings(title, [_failed(fit)])
    with Waiting("check"), np.errstate(all="ignore"):
        whole = stand_in(fit)
        if held := nothing_free(whole) or never_apart(whole):  # at other numbers residuals tell another story
            return Findings(title, [held.text])
        said = {look: _looked(look, fit, whole) for look in LOOKS if look is not unexplained}
        if said[runaway]:  # which is why
            said |= dict.fromkeys((noise_bends, unsettled, condition))
        if said[unseen_event]:
            said |= dict.fromkeys((bounded, unsettled, unstable))
        if said[early_output]:
            said |= dict.fromkeys((limited_input, bounded))
        if said[hidden_by_start]:  # which the others take for something else
            said |= dict.fromkeys((acts_by_lag, not_linear))
        found = [None if said[unseen_event] else slow_pole(whole)]
        found += [doubt for look, doubt in said.items() if look is not flips]
        note = noise_free(whole)
        first = (
            coded, in_degrees, stored_late, slow_input, unlike_records, one_record, unseen_event,
            saturated, off_centre, in_other_units, contradicted_numbers, missing_input, unused_output,
            unrecorded_input, hidden_by_start, acts_by_lag, late_channel, bent, dry_friction, swapped,
            misweighted, unlike_command, fed_back, noisy_input, driven_loop, hidden_law, eliminated,
            not_linear, missing_states,
        )  # fmt: skip
        told = [said[look] for look in first]
        told += [said[mean]] if said[mean] and is_all(whole) else []
        # Residuals of another model than the record has say no more.
        time = ""
        if in_samples(whole):
            found += [_looked(serial, whole, whole)]
        elif note is None and not any(doubt and doubt.sure for doubt in told):
            try:
                left, time = _of_lines(whole, said)
            except FAILURES as error:
                left = [_failure("of_residuals", error)]
            found += left
        # After what residuals tell beyond doubt, which noise in signs does not explain.
        found += [said[flips], None if said[wandering] else _looked(undeclared, whole, whole)]
        found += [_looked(look, whole, whole) for look in (loud_noise, computed_channel)]
        found += [
            _looked(look, fit, fit) for look in (biased, lopsided, minima, few_samples, in_hertz, beyond)
        ]
        found += of_records(fit, [doubt.text for doubt in found if doubt])
        try:
            gains = None if said[hidden_by_start] else gain_of_start(fit, warnings_of)
            note = of_stability(fit) or gains or note
        except FAILURES as error:
            found.append(_failure("gain_of_start", error))
    doubts = sorted([doubt for doubt in found if doubt], key=lambda doubt: not doubt.sure)
    return Findings(title, [doubt.text for doubt in doubts], note=f"{note or ''} {time}".strip())


def _of_lines(whole: Estimates, said: Any) -> tuple[list[Doubt | None], str]:
    """What residual lines say, and beside it a note about the time of the inputs; `said` by other looks."""
    d = diagnose(whole)
    late = said[late_channel] or said[hidden_by_start]
    time = "" if late else f"{uncounted_time(whole)} {uncounted_lag(whole)}".strip()
    slow = _slow(whole)
    slow = slow if slow and _left(whole) is slow else None  # else nothing is looked for twice
    residual = [slow] if slow else of_residuals(whole, d)
    sure = any(doubt and doubt.sure for doubt in residual)
    found = [clipped(whole)] if sure else []
    named = any(doubt and 'trend="linear"' in doubt.text for doubt in residual)
    found += [of_tone(whole), *residual]
    found += [] if slow else [None if named else of_drift(whole), of_colour(whole, d)]
    return [*found, (None if sure else multiplied(whole)) or of_time(whole)], time
