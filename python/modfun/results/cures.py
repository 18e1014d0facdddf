"""What to try first where equations leave more than noise: fits of those next to the fitted ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, log, nan
from typing import Any

import numpy as np

from ..base.cached import kept
from ..base.effort import Effort, Spent, spend
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.options import Options
from ..models.process import ProcessNoise
from ..records.record import Record
from .diagnosis import growth, level_p
from .drifting import DRIFT, drift_beside, has_constant
from .estimates import Estimates
from .lags import EXTRA, LAG, acts_later, lagging, least_time, with_values
from .neighbours import LEVER, ZERO, absurd, integrals, neighbours, singular
from .promising import promising
from .refits import has_model, lengthy, starts_beside
from .shifts import SEEN, Shift, earlier_by, likeliest_shift
from .worth import Key, worth

__all__ = [
    "ALIGNED", "CLOSE", "DRIFT", "ENOUGH", "WORTH", "Cure", "Realigned", "again", "again_at_all",
    "amplified", "as_declared", "as_shift", "bic_beside", "convincing", "furthest",
    "integral_missing", "likely_cure", "of_written", "on_band", "otherwise", "realigned", "with_drift",
]  # fmt: skip

CLOSE = 6.0  # differences of BIC short of strong evidence: of such cures the more likely, the first, is named
WORTH = 10.0  # by which BIC has to fall for a cure to be named: very strong evidence (Kass and Raftery, 1995)
ENOUGH = 0.01  # probability of a chi-square as large: a cure that leaves more leaves the noise
PLAUSIBLE = 0.1  # the same of a delay, or of a lag, beside which the other one is not looked for
STEPS = 3  # in which a shift is found
SUREST = 1e-4  # p-value of the level of residuals below which shifts further away are tried, and of one,
FAR = (2, 4, 8, -2, -4, -8)  # these, in samples
FURTHEST = 0.05  # of the record
ALIGNED = 0.1  # samples from whole ones, which are exact
MOST, NEAR = 2, 0.5  # changes that a regression finds best are fitted, if of so much of the best one's worth
MOVED = 11.0  # standard errors of the coefficient of a state that is missing: of slow noise they were below 9
EACH = 1.0  # work of a fit, in looks that nobody asked for
FIT, FORMULA = 0.02, 3e-3  # work of a fit beside its iterations: of any, and for each operation of formulas
SOUGHT = 2e-4  # of each free delay of a transfer function beside the first, for each sample
LONGEST = 256  # uneven samples: equations in coloured noise of a thousand take half a minute to fit
APART = ", which the record hardly tells apart"
STRONG = 30.0  # by which BIC falls for one of some thirty parameters, even where noise is coloured a little


@dataclass(frozen=True)
class Cure:
    """A change of the record or of the structure, in words, and BIC before and after it.

    `level_p`: probability of a chi-square as large as that after it; `fit`: the one with it; `late`: the
    channel whose time it changes, by a shift or a lag of its sensor.
    """

    words: str
    before: float
    after: float
    level_p: float
    fit: Estimates | None = None
    late: str = ""


@dataclass(frozen=True, kw_only=True)
class Realigned(Cure):
    """That one channel is read at another time: `shift` as it was found, `by` as it was made, s."""

    shift: Shift
    by: float


@kept
def likely_cure(fit: Estimates) -> Cure | None:
    """What lowers BIC of equations most: a drift of each, a shift, a sensor or an actuator."""
    if not _alterable(fit):
        return None
    before = bic_beside(fit, fit)
    drifts = has_constant(fit) or (fit.trend == "constant" and worth(fit).get(("drift",), inf) > CLOSE)
    found = with_drift(fit) if drifts else None
    found = found if found and found.after < before - WORTH else None
    moved = realigned(fit)
    if moved is not None and moved.after < (found.after - CLOSE if found else before - WORTH):
        found = moved
    return _with_lag(fit, _of_group(fit, next(iter(neighbours(fit)), ()), found, moved))


def _with_lag(fit: Estimates, found: Cure | None) -> Cure | None:
    """What was found, or a lag of an actuator beside a delay where BIC leaves no doubt of both.

    Tried for the input that seems to act late, and for those whose delay is given as a number.
    """
    model = fit.structure
    if not isinstance(model, StateSpace) or (found.level_p if found else level_p(fit)) > PLAUSIBLE:
        return found
    before, alone = bic_beside(fit, fit), found.fit if found else None
    bar = (found.after if found else before) - WORTH
    for k, given in enumerate(model.delay):
        if isinstance(given, str) or not (late := given + acts_later(alone, k)) > 2 * least_time(fit):
            continue
        words, code, structure = lagging(fit, model, k, late)
        other = again(fit, fit.records, structure, on_band(fit, fit.band))
        if other is None or {*other.at_bound} - {*fit.param_names} or growth(other) > 0 >= growth(fit):
            continue
        after = bic_beside(other, fit)
        if after < bar and not singular(other):
            words = with_values(f"{words}, {code}", other)
            found, bar = Cure(words, before, after, level_p(other), other), after
    return found


@kept
def of_written(fit: Estimates) -> Cure | None:
    """The same, or one of the many terms that may be missing, where none of these leaves the noise alone."""
    if not _alterable(fit):
        return None
    found = likely_cure(fit)
    # A regression may say that a term explains more than what seems to leave the noise alone.
    expected = max((fall for key, fall in worth(fit).items() if key[0] == "term"), default=0.0)
    if found and found.level_p > ENOUGH and not found.before - expected < found.after - WORTH:
        return _or_term(fit, found)
    if lengthy(fit) and level_p(fit) > ENOUGH:  # nothing contradicts the equations
        return found
    term = _missing_term(fit)
    if term and not (found and term.after >= found.after - CLOSE):
        found = term
    for group in neighbours(fit)[2:]:
        if found is None or not found.level_p > ENOUGH:
            found = _of_group(fit, group, found)
    return found


def _or_term(fit: Estimates, found: Cure) -> Cure:
    """A cure, or beside the lag of a sensor that is as slow as the motion the term which does as well."""
    longest = max([rec.duration for rec in fit.records or ()])
    if not (found.words.startswith(LAG) and found.fit and found.fit[EXTRA] > FURTHEST * longest):
        return found
    term = _missing_term(fit)
    if term is None or not (term.level_p > ENOUGH and term.after < found.after + CLOSE):
        return found
    return replace(found, words=f"{found.words}, or {term.words.removesuffix(APART)}{APART}")


@kept
def _missing_term(fit: Estimates) -> Cure | None:
    """The term that lowers BIC most."""
    return _of_group(fit, next(iter(neighbours(fit)[1:]), ()), None)


@kept
def integral_missing(fit: Estimates) -> Cure | None:
    """A state that the model lacks, the integral of another one: a bank angle was 15 to 22 errors from 0."""
    if not _alterable(fit) or not isinstance(fit.structure, StateSpace):
        return None
    options, found = on_band(fit, fit.band), list[Cure]()
    for words, structure in integrals(fit.structure):
        other = again(fit, fit.records, structure, options)
        # A constant in the equation of an integral is a drift, which follows slow noise without the state.
        if other is not None and abs(other[EXTRA]) > MOVED * other.bse[other.param_names.index(EXTRA)]:
            told = words.format(f"{other[EXTRA]:.3g}")
            found.append(Cure(told, bic_beside(fit, fit), bic_beside(other, fit), level_p(other)))
    best = min((one for one in found if isfinite(one.after)), key=lambda one: one.after, default=None)
    return best if best and convincing(fit, best) else None


def _alterable(fit: Estimates) -> bool:
    """Whether other equations may be fitted to the records."""
    made = fit.again is not None and fit.records is not None and fit.process_levels is None
    return made and not fit.layout.rational and not amplified(fit)


def amplified(fit: Estimates) -> bool:
    """Whether eliminating a hidden signal has left products of derivatives, which are the likelier cause.

    They amplify noise in whatever stands next to the equations, too, and each fit of that takes a second.
    """
    formulas = getattr(fit.layout, "formulas", None)  # of equations
    return formulas is not None and bool(formulas.compiled.hidden) and bool(formulas.compiled.products)


def _of_group(
    fit: Estimates,
    group: Iterable[tuple[str, Any, Key]],
    found: Cure | None,
    moved: Realigned | None = None,
) -> Cure | None:
    """The change of a group that lowers BIC most, or what was found before."""
    before, options = bic_beside(fit, fit), on_band(fit, fit.band)
    records, how, base = _near_by(fit)
    best = found.after - CLOSE if found else before - WORTH
    afters, chosen = dict[Key, float](), Key()
    first = found  # a shift, perhaps, or the lag that does about as well
    for words, structure, key, told in _worthwhile(fit, group, moved):
        if found and found.level_p > ENOUGH and not told and isinstance(structure, Equation):
            break  # no powers where a linear term leaves the noise alone
        other = again(fit, records, structure, options, near=True, **how)
        if other is None or {EXTRA, ZERO} & {*other.at_bound}:
            continue
        if growth(other) > 0 >= growth(fit):  # unstable where the fit is stable
            continue
        extra = other[EXTRA] if EXTRA in other.param_names else nan  # of a delay that is a number none
        after = afters[key] = bic_beside(other, fit) + base
        # Off the centre of gravity is a likelier place than a time off all the others. So is a lag: its own
        # error counts, and intervals held for vanes 0.03 to 0.06 s late in either way (beside a shift half).
        lag = words.startswith(LAG) and words[len(LAG) :].split()[0]
        slow = moved is not None and moved is first and lag == moved.shift.channel
        likelier = moved is not None and found is first and (slow or words.startswith(LEVER))
        bar = moved.after + CLOSE if moved and likelier else best
        if not (isfinite(after) and after < bar) or _odd_time(fit, words, other) or absurd(fit, key, extra):
            continue
        if singular(other) or (words.startswith("a delay") and _part_of_a_step(fit, other, extra)):
            continue
        text = words.replace("{}", f"{extra:.3g}")
        found, chosen = Cure(text, before, after, level_p(other), other, lag or ""), key
        first = found if slow else first
        # Of twins in several equations the first is likelier.
        after -= CLOSE * (isinstance(structure, Equation) and bool(worth(fit)))
        best = min(best, after) if likelier else after
    # Powers, sines and the like bend alike over a small range.
    same = [key for key in afters if key[:1] == ("term",) and key != chosen and key[:-1] == chosen[:-1]]
    alike = [key[-1] for key in sorted(same, key=afters.__getitem__) if afters[key] < afters[chosen] + CLOSE]
    if found and alike:
        words = f"{found.words}, or in {' or '.join(alike)}{APART}"
        found = replace(found, words=words)
    return found


@kept
def _near_by(fit: Estimates) -> tuple[Any, dict[str, Any], float]:
    """Records to which candidates are fitted, how, and what BIC of the fit made so again lacks of its own.

    Outputs are without what sampling folds, as the fit told, and nonlinear equations without what they leave
    of its response: to simulate each candidate took 50 s. So are linear ones from which nothing was taken.
    """
    layout: Any = fit.layout
    even = all([rec.dt is not None for rec in fit.records or ()])
    if not layout.compiled.is_linear and even:
        return fit.records, {"unfolded": True, "less": getattr(fit, "less", ())}, 0.0
    if even and not (getattr(fit, "unfolded", ()) or getattr(fit, "unsettled", True) or fit.with_past):
        return fit.records, {"unfolded": True}, 0.0
    unfolded = layout.compiled.is_linear and not fit.with_past and getattr(fit, "unfolded", ())
    options = on_band(fit, fit.band)
    same = again(fit, unfolded, fit.structure, options, near=True, unfolded=True) if unfolded else None
    if same is None:
        return fit.records, {}, 0.0
    return unfolded, {"unfolded": True}, bic_beside(fit, fit) - bic_beside(same, fit)


def _worthwhile(
    fit: Estimates, group: Iterable[tuple[str, Any, Key]], moved: Realigned | None
) -> Iterator[tuple[str, Any, Key, bool]]:
    """Changes of a group that a regression finds worth a fit, and then those of which it says nothing.

    A lag of a sensor that a fit has shown to be late is one: a step from estimates far off says little.
    """
    every, falls = list(group), worth(fit)
    sensor: Key = ("late", moved.late) if moved and moved.late in fit.outputs else ("",)
    best = sorted({falls[key] for _, _, key in every if key in falls}, reverse=True)[:MOST]
    least = max(best[-1], best[0] * NEAR, CLOSE) if best else inf
    for words, structure, key in every:
        if falls.get(key, -inf) >= least or key == sensor:
            yield words, structure, key, True
    left = [key for _, _, key in every if key not in falls]
    terms = promising(fit, left)
    for words, structure, key in every:
        if key not in falls and key != sensor and (key[:1] != ("term",) or key in terms):
            yield words, structure, key, not falls


@kept
def realigned(fit: Estimates) -> Realigned | None:
    """The fit with the channel that is likeliest late or early read at its time; None where none is.

    An input that acts late is not meant: that is a delay, which a structure has.
    """
    shift, records = likeliest_shift(fit), fit.records or ()
    refuted = level_p(fit) < SUREST
    if shift is None or fit.again is None or (shift.p_value > SEEN and not refuted):
        return None
    if shift.channel in fit.inputs and shift.late < 0:
        return None
    found = _read_at(fit, shift, shift.late)
    if not refuted or (found and found.level_p > ENOUGH):
        return found
    if worth(fit) and (term := _missing_term(fit)) and term.level_p > ENOUGH:
        return found
    # Far from its time the first step of the search may go anywhere.
    steps = [k * (records[0].dt or inf) for k in FAR if k > 0 or shift.channel in fit.outputs]
    tried = [found, *(_read_at(fit, shift, step) for step in steps)]
    best = min((one for one in tried if one), key=lambda one: one.after, default=None)
    # Of several shifts one explains a little of noise that drives the system.
    return best if best and (shift.p_value < SUREST or convincing(fit, best)) else None


def as_shift(fit: Estimates, cure: Cure | None) -> Realigned | None:
    """The shift that a cure is, or that does about as well as the lag which it is; None of other cures."""
    if cure is None or isinstance(cure, Realigned):
        return cure
    moved = realigned(fit) if cure.late else None
    return moved if moved and moved.late == cure.late and moved.after < cure.after + CLOSE else None


def _read_at(fit: Estimates, shift: Shift, late: float) -> Realigned | None:
    """The same, searched by steps of the score test from a shift on."""
    name, records = shift.channel, fit.records or ()
    step, error = records[0].dt or inf, shift.error
    held = name in fit.inputs and fit.intersample[fit.inputs.index(name)] != "smooth"
    other, seen = fit, late
    for count in range(STEPS):
        near = round(late / step) * step
        late = near if held or (near and abs(late - near) < max(2 * error, ALIGNED * step)) else late
        if not late or (name in fit.inputs and late < 0):
            return None
        words, moved = earlier_by(records, name, late, whole=late == near)
        made = again(fit, moved, fit.structure, on_band(fit, fit.band), near=True)
        if made is None or abs(late) > FURTHEST * min(rec.duration for rec in records):
            return None
        other, left = made, likeliest_shift(made, name)
        if left is None:
            return None
        seen, error = late + left.late, left.error
        if left.p_value > ENOUGH and (late == near or count):
            break
        late = seen
    after = bic_beside(other, fit) + log(fit.df_resid + fit.params.size)  # the shift is a parameter
    found = replace(shift, late=seen, error=error)
    before = bic_beside(fit, fit)
    return Realigned(words, before, after, level_p(other), other, name, shift=found, by=late)


def _odd_time(fit: Estimates, words: str, other: Estimates) -> bool:
    """Whether a lag or delay is one that no record shows: far below its step, longer, or within its error."""
    least, longest = least_time(fit), max(rec.duration for rec in fit.records or ())
    return "{} s)" in words and not max(least, 2 * other.bse[EXTRA]) < other[EXTRA] < longest


def _part_of_a_step(fit: Estimates, other: Estimates, late: float) -> bool:
    """Whether a delay is far less than a sample and leaves more than the noise: of something else."""
    step = max(rec.dt or rec.duration / rec.intervals for rec in fit.records or ())
    return late < step / 2 and not level_p(other) > ENOUGH


def convincing(fit: Estimates, cure: Cure) -> bool:
    """Whether a cure leaves no doubt: only the noise is left, or half the power of an output's residuals."""
    fallen, rows = cure.before - cure.after, fit.df_resid + fit.params.size
    halved = fallen > rows / len(fit.row_names) * log(2)
    return fallen > STRONG and (halved or cure.level_p > ENOUGH)


@kept
def with_drift(fit: Estimates) -> Cure | None:
    """A drift of the output beside the constant."""
    words, model, trend = drift_beside(fit)
    options = on_band(fit, fit.band).replace(trend=trend)
    if not (fit.again and fit.records and (other := again(fit, fit.records, model, options, near=True))):
        return None
    told = words.format(f"{other[EXTRA]:.3g}" if EXTRA in other.param_names else "")
    return Cure(told, bic_beside(fit, fit), bic_beside(other, fit), level_p(other))


def on_band(fit: Estimates, band: tuple[float, float]) -> Options:
    """The options of a fit over a band of lines."""
    return fit.options.replace(band=(band[0], band[1] * (1 + 1e-9)), harmonics=None)


def bic_beside(fit: Estimates, base: Estimates) -> float:
    """BIC as if the fit had as many equations as the base: a delay or a pole takes a few away.

    A window that starts late, as that of a long delay, may leave out the very response that the base has
    wrong: what counts is how much lower BIC is than that of the base over the same window. Lines of such a
    window scatter, so that a short delay counts over its own.
    """
    late = _late_by(fit, base)
    if not any(late) or not _acts_late(fit):
        return _as_many(fit, base)
    same = _from_sample(base, late)
    return inf if same is None else _as_many(base, base) + _as_many(fit, base) - _as_many(same, base)


def _as_many(fit: Estimates, base: Estimates) -> float:
    own, rows = fit.df_resid + fit.params.size, base.df_resid + base.params.size
    return (fit.bic - fit.params.size * log(own)) / own * rows + fit.params.size * log(rows)


def _acts_late(fit: Estimates) -> bool:
    """Whether a delay is a large part of a record, as far as a fit has such a number."""
    model: Any = fit.model if fit.layout.rational or isinstance(fit.structure, StateSpace) else None
    if model is None:
        return True
    longest = max([rec.duration for rec in fit.records or ()], default=0.0)
    return bool(np.max(np.asarray(model.delays, float), initial=0.0) > FURTHEST * longest)


def _late_by(fit: Estimates, base: Estimates) -> tuple[int, ...]:
    """By how many samples of each record the window of a fit starts after that of another."""
    ours, theirs = (
        [rec.t[max(rec.intervals - n, 0) :] for rec, n in zip(one.records or (), one.intervals, strict=False)]
        for one in (fit, base)
    )
    if base.again is None or len(ours) != len(theirs):
        return ()
    return tuple([int(np.sum(own[1:] <= t[0])) for t, own in zip(ours, theirs, strict=True)])


@kept
def _from_sample(fit: Estimates, late: tuple[int, ...]) -> Estimates | None:
    """The fit over windows that start so many samples later; None where there is no such fit."""
    try:
        cut = [rec.window(rec.t[n], rec.t[-1]) for rec, n in zip(fit.records or (), late, strict=True)]
    except ModfunError:
        return None
    _, how, apart = ((), {}, 0.0) if fit.layout.rational else _near_by(fit)
    if how and not apart:  # as the candidates
        less = [own[..., n:] for own, n in zip(how.get("less", ()), late, strict=False)]
        how = how | {"near": True, "less": less}
    return again(fit, tuple(cut), fit.structure, on_band(fit, fit.band), **({} if apart else how))


def furthest(fit: Estimates, other: Estimates) -> tuple[str, str, str, float]:
    """What another fit of the structure changes most: parameter, both estimates, errors between them."""
    rows = [other.param_names.index(name) for name in fit.param_names]
    values, errors = other.params[rows], np.where(other.bse[rows] > 0, other.bse[rows], np.inf)
    far = np.abs(values - fit.params) / errors
    at = int(np.argmax(far))
    was = f"{fit.params[at]:.4g} ± {fit.spread[at]:.2g}"
    now = f"{values[at]:.4g} ± {other.spread[rows[at]]:.2g}"
    return fit.param_names[at], was, now, float(far[at])


def again(fit: Estimates, records: Any, structure: Any, options: Options, **how: Any) -> Estimates | None:
    """The fit made again with other words, as by `again_at_all`; None where it has no answer."""
    other = again_at_all(fit, records, structure, options, **how)
    return other if other is not None and other.usable and has_model(other) else None


def again_at_all(
    fit: Estimates, records: Any, structure: Any, options: Options, *, near: bool = False, **how: Any
) -> Estimates | None:
    """The same, also without an answer; None where it is refused. `near`: begun at the estimates.

    Of looks that nobody asked for one that takes undue work is refused, too: a candidate whose response is
    stiff took as much as all others.
    """
    coloured = options.noise == "coloured" != fit.options.noise and not fit.layout.rational
    if coloured and any([rec.dt is None and rec.t.size > LONGEST for rec in fit.records or ()]):
        return None
    if not Effort.limited():
        return _made(fit, records, structure, options, near, how)
    layout: Any = fit.layout
    delays = len(layout.free_delays) if layout.rational else 0
    spend(SOUGHT * max(delays - 1, 0) * sum([rec.t.size for rec in records or ()]))
    try:
        with Effort(EACH):
            return _made(fit, records, structure, options, near, how)
    except Spent:
        spend(0.0)  # which is for the whole look to say
        return None


def _made(
    fit: Estimates, records: Any, structure: Any, options: Options, near: bool, how: dict[str, Any]
) -> Estimates | None:
    made: Any = fit.again
    spend(FIT)
    try:
        other = made(records, structure, options, **(starts_beside(fit, structure) if near else {}), **how)
    except ModfunError:  # too many unknowns for the band, say
        return None
    formulas = getattr(other.layout, "formulas", None)  # of equations
    spend(FORMULA * len(formulas.words["formulas"][0]) if formulas else 0.0)
    return other  # type: ignore[no-any-return]


def otherwise(rec: Record, channel: int, word: str) -> Record:
    """The record with an input that goes so between its samples."""
    return rec._like(intersample=(*rec.intersample[:channel], word, *rec.intersample[channel + 1 :]))


def as_declared(fit: Estimates, words: Sequence[str]) -> str:
    """How inputs go between samples, as a `Record` takes it, which has none that nobody measured."""
    noise = fit.options.noise
    unmeasured = noise.names if isinstance(noise, ProcessNoise) else ()
    kinds = [word for name, word in zip(fit.inputs, words, strict=True) if name not in unmeasured]
    return f"intersample={kinds if len(kinds) > 1 else kinds[0]!r}"
