"""Doubts about a fit that its residuals give, with the first cure to try."""

from __future__ import annotations

from math import isnan, log10

from .._core import sharpest
from ..base.between import MIXED
from ..base.cached import kept
from ..models.noise import Noise
from .coloured_load import other_drive
from .cures import (
    ENOUGH,
    STRONG,
    Cure,
    again,
    convincing,
    integral_missing,
    likely_cure,
    of_written,
    on_band,
    with_drift,
)
from .diagnosis import Diagnosis, chi_square, diagnose, level_p, level_ratio
from .doubts import SURE, Doubt, crowded, noise_free, numbers
from .drifting import drift_beside, is_drift
from .driven_equations import driven
from .estimates import Estimates
from .fitted_samples import measured_lines, stationary
from .followers import in_loop
from .following import follows
from .further import Explained, event_p
from .hidden_laws import DRIVES, what_drives
from .line_tests import colour_of_lines, correlation_of_lines
from .missing_modes import UNSPOKEN, like_gusts, linear_instead, missing_mode, tone_left
from .next_structures import best_cure
from .origin import either, gain_of_colour, gain_of_process, hum, origin, position
from .response_call import output_error_call
from .sample_levels import seen_noise, slow_beside
from .worth import worth

__all__ = [
    "LEVEL",
    "SUREST",
    "UNLIKELY",
    "bends_in_loop",
    "misfit",
    "of_colour",
    "of_drift",
    "of_residuals",
    "of_tone",
    "reference",
    "refuted",
    "suspicious",
    "too_large",
    "too_small",
]

UNLIKELY = 0.01  # p-value below which a test speaks
PLAUSIBLE = 0.1  # p-value below which a cure is tried where residuals are far above the noise
LOOK = 0.01  # p-value of the cheap tests below which a fit looks further by itself
SUREST = 1e-6  # the same of neighbouring lines, whose law is chi-square's only about, and of gains
LEVEL = 1.5  # ratio of noise levels; with few lines chance makes larger ones, so p-values decide, too
AMPLIFIED = 1.5  # ratio of noise levels beyond which products of derivatives have bent estimates
BENT = ("power", "gain", "change")  # what a system does that is not linear, or changes
LIKE_GUSTS = ("power", "change", "drift")  # of what noise that drives a light mode may be taken for
FIRST = 1e9  # of BIC: above what any cure lowers it by
SLOW_NOISE = "Slow noise of a sensor follows itself, too: it differs in a repetition of the record."
SPIKE = 10.0  # times the mean fourth difference, in which one sample alone shows six times


def misfit(fit: Estimates) -> Doubt | None:
    """The first doubt that residuals give, if it is beyond doubt; looked for where cheap tests speak."""
    if fit.df_resid < 2 or not suspicious(fit) or noise_free(fit) is not None:
        return None
    found = of_residuals(fit, diagnose(fit, PLAUSIBLE), sure_only=True)
    return next((doubt for doubt in found if doubt and doubt.sure), None)


@kept
def suspicious(fit: Estimates) -> bool:
    """Whether a cheap test finds anything odd about the residual lines."""
    level = level_p(fit)
    # Above it the high band holds signal, such as steps, and tells no level.
    if level < (LOOK if fit.layout.rational else _plausible(fit)) or level > 1 - LOOK:
        return True
    if any(sharpest(rec.y) > SPIKE for rec in fit.records or ()):
        return True
    return _uneven(fit, LOOK)


def _plausible(fit: Estimates) -> float:
    """The p-value of the level below which equations next to the fitted ones are tried."""
    return PLAUSIBLE if {"zoh", MIXED}.isdisjoint(fit.intersample) else LOOK  # kinks make such fits slow


def refuted(fit: Estimates) -> bool:
    """Whether a cheap test of the residual lines leaves no doubt that there is more in them than noise."""
    return level_p(fit) < SURE or _uneven(fit, SURE)


def _uneven(fit: Estimates, least: float) -> bool:
    """Whether lines differ in level, follow each other or show an event with a p-value below `least`."""
    for i in range(len(fit.row_names)):
        pieces = [piece[i] for piece in fit.pieces]
        if colour_of_lines(pieces)[0].p_value < least or correlation_of_lines(pieces)[0].p_value < least:
            return True
    return event_p(fit) < least


@kept
def bends_in_loop(fit: Estimates) -> bool:
    """Whether powers explain residuals beyond doubt though a loop feeds the noise back.

    A controller winds up at a limit, which looks like an event or a slow disturbance, too.
    """
    tests = diagnose(fit, UNLIKELY).further
    least = SUREST / max(len(tests), 1)
    return any(one.what in ("gain", "power") and one.p_value < least for one in tests) and in_loop(fit)


def of_residuals(fit: Estimates, d: Diagnosis, *, sure_only: bool = False) -> list[Doubt | None]:
    """Doubts that tests of the residual lines give, the one that explains most of them first.

    `sure_only`: others may be left out, whose cures would be tried for nothing.
    """
    count = max(len(d.further), 1)
    # Residuals far above the noise of an empty high band need less to convince of a further response.
    high = d.chi2_p < SURE
    said: list[tuple[Doubt, float]] = []
    explained = False
    for one in d.further:
        # A clipped input is one of many shapes of a gain that is not constant.
        spoken = one.p_value < UNLIKELY / count
        sure = one.p_value < (SUREST if one.what == "gain" else SURE) / count
        explained |= spoken and one.what not in LIKE_GUSTS
        likely = high and one.what in ("response", "drift") and one.p_value < PLAUSIBLE
        if sure or likely or (spoken and not sure_only):
            said += _further(fit, one, sure, spoken)
    told = isinstance(fit.options.noise, Noise)  # wrongly, perhaps
    masked = isnan(d.chi2_p) and not (stationary(fit) or fit.options.robust)  # shows no level
    if (high or (masked and refuted(fit))) and not told and not any(doubt.sure for doubt, _ in said):
        said += _of_structure(fit)
    measured = measured_lines(fit)
    seen = measured and min(d.correlation.p_value, d.colour.p_value) < UNLIKELY  # without a level
    if d.chi2_p < _plausible(fit) or (isnan(d.chi2_p) and seen):
        products = _of_products(fit, d)
        said += [(products, 0.0)] if products else _of_written(fit, d, sure_only)
    said.sort(key=lambda pair: (not pair[0].sure, -pair[1]))
    found: list[Doubt | None] = [doubt for doubt, _ in said]
    if measured and d.correlation.p_value < UNLIKELY:
        found.append(
            Doubt(
                f"Neighbouring residual lines{_of(fit, d.correlated)} are correlated (Ljung-Box "
                f"{d.correlation.statistic:.3g}, p = {d.correlation.p_value:.2g}), so something short in "
                "time is not explained, such as a gust, a step of another input or clipping. Look for it "
                "with fit.plot_response().",
                d.correlation.p_value < SUREST and stationary(fit),
            )
        )
    if too_large(d.chi2_p) and not any(DRIVES in doubt.text for doubt, _ in said):
        alone = not explained and not any(doubt.sure for doubt, _ in said)
        found.append(_too_large(fit, d, alone=alone, sure_only=sure_only))
    elif fit.success and too_small(d.chi2_p, d.level_ratio) and not crowded(fit):
        found.append(
            Doubt(
                f"The residuals are only {d.level_ratio:.3g} of {reference(fit)}: the noise is stronger at "
                "high frequency, or there is signal there.",
                sure=False,
            )
        )
    if measured and d.colour.p_value < UNLIKELY:
        several = ", but not for one cause that drives several equations" if len(fit.row_names) > 1 else ""
        errors = f"Spectral standard errors allow for the colour{several}; classical ones do not"
        if fit.process_levels is not None:
            errors = "Standard errors rest on the levels of process_noise(), and do not allow for the colour"
        found.append(
            Doubt(
                f"The residual lines{_of(fit, d.coloured)} are not of one level over the band (lower half "
                f"{d.colour_ratio:.3g} times the upper half, p = {d.colour.p_value:.2g}): the noise is "
                f"coloured or the model misses part of the band. {errors}.",
                sure=False,
            )
        )
    return found


def of_tone(fit: Estimates) -> Doubt | None:
    """That most of the residuals are one tone, such as a hum."""
    found = tone_left(fit)
    return Doubt(_tone(fit, *found), sure=False) if found else None


def _tone(fit: Estimates, output: int, omega: float, part: float) -> str:
    """A tone among the residuals in words, with what to do about it."""
    return (
        f"A tone near {omega:.4g} rad/s is {100 * part:.0f} % of the power of the "
        f"residuals{_of(fit, fit.outputs[output])}: a hum, or an oscillation that acts on the system. Near a "
        "mode it makes intervals too short. If you know its frequency w, as of mains or a rotor, first put "
        'sin(w t) and cos(w t) into the record as inputs; else take cov_type="HC3".'
    )


def of_colour(fit: Estimates, d: Diagnosis) -> Doubt | None:
    """That weights which follow the noise spectrum pay, where lines are not of one level."""
    gain = gain_of_colour(fit) if measured_lines(fit) and d.colour.p_value < UNLIKELY else None
    if gain is None:
        return None
    return Doubt(
        f'Weighting the lines by the noise spectrum, noise="coloured", makes the standard errors {gain:.2g} '
        "times smaller (geometric mean).",
        sure=False,
    )


def of_drift(fit: Estimates) -> Doubt | None:
    """That a slow drift pays by BIC, where lines are odd: tests leave it to noise that may be steep."""
    if fit.trend != "constant" or not suspicious(fit) or level_p(fit) > 1 - LOOK:  # below the noise: no drift
        return None
    drift = with_drift(fit) if measured_lines(fit) else None
    if drift is None or not drift.after < drift.before - STRONG:
        return None
    return Doubt(
        f"A slow drift beside the constant explains part of the residuals: with {drift.words} BIC falls from "
        f"{drift.before:.4g} to {drift.after:.4g}. Compare both fits.",
        sure=False,
    )


def _too_large(fit: Estimates, d: Diagnosis, *, alone: bool, sure_only: bool) -> Doubt | None:
    """Residuals far above the high band's noise, and where their spectrum says that it comes from.

    `alone`: nothing else explains them.
    """
    if not alone and follows(fit):  # said beside what is missing
        return None
    slow = d.chi2_p < SURE and slow_beside(fit)
    if sure_only and not (slow or (alone and d.chi2_p < SURE)):
        return None
    chi2, df = chi_square(fit)
    text = (
        f"The residuals are {d.level_ratio:.3g} times {reference(fit)}: chi-square {chi2:.4g} for "
        f"{df:g} degrees of freedom (p = {d.chi2_p:.2g})."
    )
    if alone and not hum(fit) and (tone := tone_left(fit, wide=True)):
        return Doubt(_tone(fit, *tone), sure=d.chi2_p < SURE)
    found = origin(fit) if alone else None
    drift = with_drift(fit) if found == "process" and fit.trend == "constant" else None
    if drift is not None and convincing(fit, drift):
        text += (
            f" A slow drift of the output explains them. First try {drift.words}: BIC falls from "
            f"{drift.before:.4g} to {drift.after:.4g}."
        )
        return Doubt(text, sure=d.chi2_p < SURE)
    if found == "process":
        text += (
            " Their spectrum is that of something which drives the system itself, such as turbulence, load "
            f"or an input that is not in the record.{position(fit)} First try that input"
            f"{other_drive(fit)}."
        )
        return Doubt(text, sure=d.chi2_p < SURE)
    if itself := follows(fit):
        text = (
            f"The residuals are {d.level_ratio:.3g} times {reference(fit)}, and {itself}: either the "
            "response misses a part of the motion that is slower than the samples, and estimates may be off "
            "by many errors, or noise of a sensor is slow. First look where, fit.plot_response(), and try a "
            f"further term, such as a square of {fit.outputs[0]}, or a hidden signal. {SLOW_NOISE}"
        )
        return Doubt(text)
    if slow:
        look = (
            "try a further pole, select_order" if fit.layout.rational else "look at it, fit.plot_response()"
        )
        text += (
            " What the response leaves of the samples moves as slowly as the model does: a pole, a term or "
            f"an input is missing, or samples are too far apart for sums. First {look}."
        )
        return Doubt(text)
    if sure_only:
        return None
    gain = gain_of_process(fit) if alone else None
    text += (
        " Either the model misses something, or the record was low-pass filtered and the high band is empty "
        "of noise, as flight records often are."
    )
    if gain is not None:
        text += (
            ' Noise in each equation, such as turbulence, explains them better: with noise="process" BIC '
            f"falls from {gain[0]:.4g} to {gain[1]:.4g}. Where one cause, such as a gust, enters several "
            "equations at once, take noise=mf.ProcessNoise(gust=...)."
        )
    if found == "either":
        text += either(fit)
    if found == "coloured":
        low, high = fit.band
        # Where noise is steep, a band of its own goes far beyond the system, and leads to other minima.
        over = f'noise="coloured", band=({low:.4g}, {high:.4g})'
        text += f" Coloured noise on the samples fits their spectrum: compare {over}, the band of this fit."
    return Doubt(text, sure=False)


def _further(fit: Estimates, one: Explained, sure: bool, spoken: bool) -> list[tuple[Doubt, float]]:
    """What further columns explain with what to try first, and by how much that lowers BIC.

    A structure whose residuals are the noise of the high band, where those of the fit are far above it,
    leaves no doubt either.
    """
    y = fit.outputs[one.output] if fit.layout.rational else one.channel
    chance = f"p = {one.p_value:.1g}"
    if one.what == "drift" and not sure:
        # The slope that the test allows the noise hides a drift, which is steep itself.
        drift = with_drift(fit)
        settled = drift is not None and drift.level_p > UNLIKELY > SURE > level_p(fit)
        return [(Doubt(_words(fit, one, y, chance), settled), one.bic)] if spoken or settled else []
    if one.what != "response":
        bent = one.what in BENT
        drift = with_drift(fit) if bent and fit.trend == "constant" and level_p(fit) < SURE else None
        slow = drift is not None and drift.level_p > UNLIKELY
        cure = drift if slow else linear_instead(fit, one) if bent else None
        text, fall = _words(fit, one, y, chance), one.bic
        if cure:
            start, _, _ = text.partition(chance)
            fall = cure.before - cure.after
            text = (
                f"{start}{chance}). A {'slow drift' if slow else 'linear structure'} explains them, too. "
                f"First try {cure.words}: BIC falls from {cure.before:.4g} to {cure.after:.4g}."
            )
        if one.what in LIKE_GUSTS and level_p(fit) < SURE and like_gusts(fit, cure):
            text += (
                " Noise that drives the system, such as turbulence, makes a light mode look like this, too: "
                'compare noise="process".'
            )
        return [(Doubt(text, sure), fall)]
    cure = best_cure(fit, one.output, one.channel)
    text = f"The residuals of {y} follow {one.channel} ({chance}): part of the response is missing."
    if cure is None:
        text += " No structure next to this one explains it: first try select_order."
        return [(Doubt(text, sure), 0.0)] if spoken else []
    if is_drift(cure.words):
        text = f"The residuals of {y} follow {one.channel} ({chance}), and a slow drift explains that."
    if not spoken:
        text = _above(fit, y)
    fallen = cure.before - cure.after
    settled = cure.level_p > UNLIKELY > SURE > level_p(fit) and (spoken or fallen > UNSPOKEN)
    text += f" First try {cure.words}: BIC falls from {cure.before:.4g} to {cure.after:.4g}."
    if settled:  # nothing is left for others to explain; of several the surest
        fallen = FIRST - log10(max(one.p_value, 1e-300))
    return [(Doubt(text, sure or settled), fallen)] if spoken or settled else []


def _of_structure(fit: Estimates) -> list[tuple[Doubt, float]]:
    """That another structure brings residuals down to the noise, which no test of them has shown.

    Free motion has no response to test, and a sharp mode is like none of the smooth ones that are tested.
    """
    found = []
    for i, y in enumerate(fit.outputs):
        if cure := missing_mode(fit, i):
            fallen = f"BIC falls from {cure.before:.4g} to {cure.after:.4g}"
            text = f"{_above(fit, y)} First try {cure.words}: {fallen}."
            found.append((Doubt(text), cure.before - cure.after))
    return found


def _above(fit: Estimates, y: str) -> str:
    if isnan(level_p(fit)):
        return f"Part of the response of {y} is missing."
    return f"The residuals of {y} are far above the noise {seen_noise(fit)[0]}."


def _of_written(fit: Estimates, d: Diagnosis, sure_only: bool) -> list[tuple[Doubt, float]]:
    """What equations and a state space lack, of what sensors, actuators and a term more explain.

    Where that leaves more than the noise of the high band, noise that drives the equations may explain more.
    """
    # Terms, of which there are many, are for `check`, unless one equation is refuted, or fits take no search.
    beyond, formulas = d.chi2_p < SURE, getattr(fit.layout, "formulas", None)  # of equations
    at_once = formulas is not None and formulas.words["linear"] and not worth(fit)
    few = sure_only and not (beyond and (at_once or len(fit.row_names) == 1))
    cure = likely_cure(fit) if few else of_written(fit)
    driving = beyond and not (cure and cure.level_p > ENOUGH)
    # A term that leaves the noise alone comes before noise that drives; regressions find it sooner than fits.
    if few and beyond and (worth(fit) or (driving and driven(fit))):
        term = of_written(fit)
        if term and term.level_p > ENOUGH:
            return [_lacking(fit, term)]
    # A drift of the equations, or noise that drives them, may be what an integral that they lack does.
    slow = cure is None or (is_drift(cure.words) and not cure.level_p > ENOUGH)
    if beyond and slow and (integral := integral_missing(fit)):
        return [_lacking(fit, integral)]
    said = [_lacking(fit, cure)] if cure else []
    # A servo is little more than a lag or delay of its command, which halves what is left, unlike a gust.
    late = cure and cure.words.startswith(("a lag of the actuator", "a delay of")) and convincing(fit, cure)
    if driving and not late and (noise := driven(fit)) is not None:
        level = f"The residuals are {d.level_ratio:.3g} times {reference(fit)} (p = {d.chi2_p:.2g}), "
        doubt = what_drives(fit, noise, level, at_once=event_p(fit) < UNLIKELY)
        said.append((doubt, noise.before - noise.after))
    return said


def _lacking(fit: Estimates, cure: Cure) -> tuple[Doubt, float]:
    """What is missing in words, and by how much it lowers BIC."""
    ratio = level_ratio(fit)
    level = "" if isnan(ratio) else f": the residuals are {ratio:.3g} times {reference(fit)}"
    itself = follows(fit)  # few lines of a slow response convince of no cure, though of one that is wanted
    level += f", and {itself}" if itself else ""
    fallen = f"BIC falls from {cure.before:.4g} to {cure.after:.4g}"
    if is_drift(cure.words) and not cure.level_p > ENOUGH and _drift_leaves_more(fit):
        text = (
            f"Part of the response is missing{level}. A drift explains a part of it ({fallen}) and no more: "
            "an input that is not in the record seems to act, such as a flap, a throttle or another control. "
            "First look when it does, fit.plot_response(), and add that input to the record."
        )
    else:
        text = f"Part of the response is missing{level}. First try {cure.words}: {fallen}."
    text += f" {SLOW_NOISE}" if itself else ""
    return Doubt(text, bool(itself) or convincing(fit, cure)), cure.before - cure.after


def _drift_leaves_more(fit: Estimates) -> bool:
    """Whether residual lines of a fit with a drift are those of no stationary white noise, either."""
    _, model, trend = drift_beside(fit)
    other = again(fit, fit.records, model, on_band(fit, fit.band).replace(trend=trend))
    return other is not None and _uneven(other, LOOK)


def _of_products(fit: Estimates, d: Diagnosis) -> Doubt | None:
    """That products of a signal and a derivative amplify noise; `eliminated` has those of hidden ones."""
    formulas = getattr(fit.layout, "formulas", None)  # of equations
    if formulas is None or not d.chi2_p < SURE or not d.level_ratio > AMPLIFIED:
        return None
    if formulas.compiled.hidden or all(term.factor is None for term in formulas.compiled.terms):
        return None
    return Doubt(
        "Products of a signal and a derivative are left in the equation, which amplify noise, and the "
        f"residuals are {d.level_ratio:.3g} times {reference(fit)}: estimates may be off by much more than "
        f"their errors. First fit the response itself, {output_error_call(fit, start='')}."
    )


def _words(fit: Estimates, one: Explained, y: str, chance: str) -> str:
    """What is not a linear response to an input, and its first cure."""
    if one.what == "power":
        return (
            f"The residuals of {y} follow powers of the simulated {y} or of its rate ({chance}): the system "
            f"is not linear. First try an Equation with terms such as {y}**2 and {y}**3, or a record of "
            "smaller amplitude."
        )
    if one.what == "gain":
        u = one.channel
        return (
            f"The residuals of {y} follow powers of {u} ({chance}): the actuator saturates or its gain is "
            f"not constant. First try an Equation with {u}**3, or a record of smaller {u}."
        )
    if one.what == "change":
        return (
            f"The residuals of {y} go with the simulated {y} times the time ({chance}): the system changes "
            "over the record. First fit pieces of it, rec.split(every=...), and compare them."
        )
    if one.what == "drift":
        return f'The residuals of {y} hold a slow drift ({chance}). First try trend="linear".'
    several = len(fit.pieces) > 1
    where = f" s of record {one.record}" if several else " s"
    if one.what == "spike":
        rec = f"records[{one.record}]" if several else "rec"
        return (
            f"The sample of {y} at t = {one.time:.6g}{where} is far from all that the model and its noise "
            f"explain ({chance}). First leave it out, {rec}.weigh(mask={rec}.t != {one.time!r}), or weight "
            "all samples, robust=True."
        )
    return (
        f"Something short at about t = {one.time:.6g}{where} is in {y} and not in the model ({chance}). "
        "First look there, fit.plot_response(), for a gust, a step of another input, a fault, or records "
        "joined end to end."
    )


def too_large(chi2_p: float) -> bool:
    """Whether the residuals are more than the noise of the high band explains."""
    return chi2_p < UNLIKELY


def too_small(chi2_p: float, ratio: float) -> bool:
    """Whether they are far less, by their level over that of the high band."""
    return chi2_p > 1 - UNLIKELY and ratio < 1 / LEVEL


def _of(fit: Estimates, output: str) -> str:
    return f" of {output}" if len(fit.row_names) > 1 else ""


def reference(fit: Estimates) -> str:
    """The level that residuals are compared with."""
    if isinstance(fit.options.noise, Noise):
        return "the noise that was given"
    if fit.options.noise == "errors-in-variables":
        return "the noise seen in the unused high band"
    seen, left, levels = seen_noise(fit)
    return f"the noise level {seen} ({numbers(left)} against {numbers(levels)})"
