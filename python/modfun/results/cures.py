"""What to try first where residuals follow an input: fits of the structures next to the fitted one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import inf, isfinite, log, nan, pi
from typing import Any

import numpy as np

from ..base.between import BY_FIT, MIXED
from ..base.cached import kept
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .diagnosis import growth, level_p
from .estimates import Estimates
from .neighbours import EXTRA, LEVER, ZERO, absurd, integrals, neighbours
from .refits import lengthy, starts_beside
from .rewritten import in_words, rewritten
from .shifts import Shift, likeliest_shift
from .worth import Key, worth

__all__ = [
    "CLOSE", "DRIFT", "ENOUGH", "WORTH", "Cure", "Realigned", "again", "again_at_all", "amplified",
    "best_cure", "bic_beside", "convincing", "earlier_by", "furthest", "integral_missing", "likely_cure",
    "of_written", "on_band", "otherwise", "realigned", "with_drift",
]  # fmt: skip

DRIFT = 'trend="linear"'  # words of that cure
MOST_POLES = 6  # of an output; more than that is a matter for `select_order`
CLOSE = 6.0  # differences of BIC short of strong evidence: of such cures the more likely, the first, is named
WORTH = 10.0  # by which BIC has to fall for a cure to be named: very strong evidence (Kass and Raftery, 1995)
ENOUGH = 0.01  # probability of a chi-square as large: a cure that leaves more leaves the noise
RADIAN = 0.5  # of the highest line: delays tried first are so far apart,
BEYOND = 10  # and so many of them later than the best one
STEPS = 3  # in which a shift is found
SUREST = 1e-4  # p-value of the level of residuals below which shifts further away are tried, and of one,
FAR = (2, 4, 8, -2, -4, -8)  # these, in samples
FURTHEST = 0.05  # of the record
ALIGNED = 0.1  # samples from whole ones, which are exact
MOST, NEAR = 2, 0.5  # changes that a regression finds best are fitted, if of so much of the best one's worth
MOVED = 11.0  # standard errors of the coefficient of a state that is missing: of slow noise they were below 9
STRONG = 30.0  # by which BIC falls for one of some thirty parameters, even where noise is coloured a little


@dataclass(frozen=True)
class Cure:
    """A change of the record or of the structure, in words, and BIC before and after it.

    `level_p`: probability of a chi-square as large as that after it.
    """

    words: str
    before: float
    after: float
    level_p: float


@dataclass(frozen=True)
class Realigned(Cure):
    """That one channel is read at another time: by how much it was late, and the fit so."""

    shift: Shift
    fit: Estimates


@kept
def best_cure(fit: Estimates, output: int, channel: str | None) -> Cure | None:
    """The neighbouring structure, or hold of the input, whose fit lowers BIC most; None where none pays.

    Without a channel: of free motion, which has poles only.
    """
    if fit.again is None or fit.records is None or not isinstance(fit.structure, TransferFunction):
        return None
    before = bic_beside(fit, fit)
    found: Cure | None = None
    options = on_band(fit, fit.band)
    near = _poles(fit, output) if channel is None else _neighbours(fit, output, fit.inputs.index(channel))
    for words, records, structure in near:
        if words.startswith("more zeros") and found and found.level_p > ENOUGH:
            continue  # what acts at once can do what a delay does
        if options.reference and records is fit.records:
            rough = _roughly(fit, structure, options)
            if rough is None or not bic_beside(rough, fit) < (found.after if found else before):
                continue
        other = again(fit, records, structure, options)
        if other is None or growth(other) > 0 >= growth(fit):  # unstable where the fit is stable
            continue
        after = bic_beside(other, fit)
        # Poles can do what a delay does, or a zero: they have to do more than one that leaves noise alone.
        margin = CLOSE if found and found.level_p < ENOUGH else WORTH
        if isfinite(after) and after < (found.after if found else before) - margin:
            delay = [name for name in other.param_names if name.startswith("delay")]
            late = f" ({other[delay[-1]]:.3g} s)" if "delay" in words and delay else ""
            found = Cure(words + late, before, after, level_p(other))
    # Poles follow a drift, too.
    drift = with_drift(fit) if found and "poles=" in found.words and fit.trend == "constant" else None
    return drift if found and drift and drift.after < found.after else found


def _roughly(fit: Estimates, structure: Any, options: Options) -> Estimates | None:
    """The fit of another structure; of one with a reference on the record in which its rounds ended.

    Rounds of its own are seven fits or more, and most structures next to a right one lower nothing.
    """
    if options.reference and fit.instrumented is not None:
        return again(fit, fit.instrumented, structure, options.replace(reference=()))
    return again(fit, fit.records, structure, options)


@kept
def likely_cure(fit: Estimates) -> Cure | None:
    """The same of equations and state spaces: a drift of each equation, a shift, a sensor or an actuator."""
    if not _alterable(fit):
        return None
    before = bic_beside(fit, fit)
    drifts = fit.trend == "constant" and worth(fit).get(("drift",), inf) > CLOSE
    found = with_drift(fit) if drifts else None
    found = found if found and found.after < before - WORTH else None
    moved = realigned(fit)
    if moved is not None and moved.after < (found.after - CLOSE if found else before - WORTH):
        found = moved
    return _of_group(fit, next(iter(neighbours(fit)), ()), found, moved)


@kept
def of_written(fit: Estimates) -> Cure | None:
    """The same, or one of the many terms that may be missing, where none of these leaves the noise alone."""
    if not _alterable(fit):
        return None
    found = likely_cure(fit)
    # A regression may say that a term explains more than what seems to leave the noise alone.
    expected = max((fall for key, fall in worth(fit).items() if key[0] == "term"), default=0.0)
    if found and found.level_p > ENOUGH and not found.before - expected < found.after - WORTH:
        return found
    if lengthy(fit) and level_p(fit) > ENOUGH:  # nothing contradicts the equations
        return found
    term = _missing_term(fit)
    if term and not (found and term.after >= found.after - CLOSE):
        found = term
    for group in neighbours(fit)[2:]:
        if found is None or not found.level_p > ENOUGH:
            found = _of_group(fit, group, found)
    return found


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
    made = fit.again is not None and fit.records is not None
    return made and not fit.layout.rational and fit.process_levels is None and not amplified(fit)


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
    # To simulate each candidate between the samples took more than half of the time, 50 s with two delays.
    unfolded: Any = getattr(fit, "unfolded", ())
    records, how = (unfolded, {"unfolded": True}) if unfolded else (fit.records, {})
    best = found.after - CLOSE if found else before - WORTH
    afters, chosen = dict[Key, float](), Key()
    for words, structure, key, told in _worthwhile(fit, group):
        if found and found.level_p > ENOUGH and not told and isinstance(structure, Equation):
            break  # no powers where a linear term leaves the noise alone
        other = again(fit, records, structure, options, near=True, **how)
        if other is None or {EXTRA, ZERO} & {*other.at_bound}:
            continue
        if growth(other) > 0 >= growth(fit):  # unstable where the fit is stable
            continue
        extra = other[EXTRA] if EXTRA in other.param_names else nan  # of a delay that is a number none
        after = afters[key] = bic_beside(other, fit)
        # Off the centre of gravity is a likelier place than a time off all the others.
        lever = moved is not None and moved is found and words.startswith(LEVER)
        bar = moved.after + CLOSE if moved and lever else best
        if not (isfinite(after) and after < bar) or _odd_time(fit, words, extra) or absurd(fit, key, extra):
            continue
        if words.startswith("a delay") and _part_of_a_step(fit, other, extra):
            continue
        found, chosen = Cure(words.replace("{}", f"{extra:.3g}"), before, after, level_p(other)), key
        # Of twins in several equations the first is likelier.
        best = after - CLOSE * (isinstance(structure, Equation) and bool(worth(fit)))
    # Powers, sines and the like bend alike over a small range.
    same = [key for key in afters if key[:1] == ("term",) and key != chosen and key[:-1] == chosen[:-1]]
    alike = [key[-1] for key in sorted(same, key=afters.__getitem__) if afters[key] < afters[chosen] + CLOSE]
    if found and alike:
        words = f"{found.words}, or in {' or '.join(alike)}, which the record hardly tells apart"
        found = replace(found, words=words)
    return found


def _worthwhile(
    fit: Estimates, group: Iterable[tuple[str, Any, Key]]
) -> Iterator[tuple[str, Any, Key, bool]]:
    """Changes of a group that a regression finds worth a fit, and then those of which it says nothing."""
    every, falls = list(group), worth(fit)
    best = sorted({falls[key] for _, _, key in every if key in falls}, reverse=True)[:MOST]
    least = max(best[-1], best[0] * NEAR, CLOSE) if best else inf
    for words, structure, key in every:
        if falls.get(key, -inf) >= least:
            yield words, structure, key, True
    for words, structure, key in every:
        if key not in falls:
            yield words, structure, key, not falls


@kept
def realigned(fit: Estimates) -> Realigned | None:
    """The fit with the channel that is likeliest late or early read at its time; None where none is.

    An input that acts late is not meant: that is a delay, which a structure has.
    """
    shift, records = likeliest_shift(fit), fit.records or ()
    refuted = level_p(fit) < SUREST
    if shift is None or fit.again is None or (shift.p_value > ENOUGH and not refuted):
        return None
    if shift.channel in fit.inputs and shift.late < 0:
        return None
    found = _read_at(fit, shift, shift.late)
    if not refuted or (found and found.level_p > ENOUGH):
        return found
    term = _missing_term(fit) if worth(fit) else None
    if term and term.level_p > ENOUGH:
        return found
    # Far from its time the first step of the search may go anywhere.
    steps = [k * (records[0].dt or inf) for k in FAR if k > 0 or shift.channel in fit.outputs]
    tried = [found, *(_read_at(fit, shift, step) for step in steps)]
    best = min((one for one in tried if one), key=lambda one: one.after, default=None)
    # Of several shifts one explains a little of noise that drives the system.
    return best if best and (shift.p_value < SUREST or convincing(fit, best)) else None


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
        made = again(fit, moved, fit.structure, on_band(fit, fit.band))
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
    return Realigned(words, bic_beside(fit, fit), after, level_p(other), found, other)


def earlier_by(
    records: tuple[Record, ...], name: str, late: float, *, whole: bool
) -> tuple[str, tuple[Record, ...]]:
    """Records with a channel at its own time, in words and made so.

    Straight lines between samples would take from the noise, by which levels are seen.
    """
    from scipy.interpolate import CubicSpline

    at = f"rec.t {'+' if late > 0 else '-'} {abs(late):.4g}"
    if whole:
        moved = [np.interp(rec.t + late, rec.t, rec[name]) for rec in records]
        words = f"rec.assign({name}=np.interp({at}, rec.t, rec[{name!r}]))"
    else:
        moved = [CubicSpline(rec.t, rec[name])(rec.t + late) for rec in records]
        words = f"rec.assign({name}=scipy.interpolate.CubicSpline(rec.t, rec[{name!r}])({at}))"
    rows: list[dict[str, Any]] = [{name: row} for row in moved]
    return words, tuple([rec.assign(**row) for rec, row in zip(records, rows, strict=True)])


def _odd_time(fit: Estimates, words: str, value: float) -> bool:
    """Whether a lag or delay is one that no record could show: far below its step, or longer than it is."""
    records = fit.records or ()
    step = min(float(np.min(np.diff(rec.t))) for rec in records)
    return "{} s)" in words and not step / 10 < value < max(rec.duration for rec in records)


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
    if fit.again is None or fit.records is None:
        return None
    other = again(fit, fit.records, fit.structure, on_band(fit, fit.band).replace(trend="linear"))
    if other is None:
        return None
    return Cure(DRIFT, bic_beside(fit, fit), bic_beside(other, fit), level_p(other))


def on_band(fit: Estimates, band: tuple[float, float]) -> Options:
    """The options of a fit over a band of lines."""
    return fit.options.replace(band=(band[0], band[1] * (1 + 1e-9)), harmonics=None)


def bic_beside(fit: Estimates, base: Estimates) -> float:
    """BIC as if the fit had as many equations as the base: a delay or a pole takes a few away."""
    own, rows = fit.df_resid + fit.params.size, base.df_resid + base.params.size
    return (fit.bic - fit.params.size * log(own)) / own * rows + fit.params.size * log(rows)


def furthest(fit: Estimates, other: Estimates) -> tuple[str, str, str, float]:
    """What another fit of the structure changes most: parameter, both estimates, errors between them."""
    far = np.abs(other.params - fit.params) / np.where(other.bse > 0, other.bse, np.inf)
    at = int(np.argmax(far))
    was, now = (f"{one.params[at]:.4g} ± {one.spread[at]:.2g}" for one in (fit, other))
    return fit.param_names[at], was, now, float(far[at])


def _neighbours(
    fit: Estimates, output: int, channel: int
) -> Iterator[tuple[str, tuple[Record, ...], TransferFunction]]:
    """Changes in words, the records and the structure with that change; the most likely ones first."""
    name, layout = fit.inputs[channel], fit.layout
    records: tuple[Record, ...] = fit.records or ()
    degrees: list[list[Any]] = [list(row) for row in layout.numerators]
    path = degrees[output][channel]
    several = len(fit.inputs) > 1
    of = f" of {name}" if several else ""
    if path is None:
        degrees[output][channel] = layout.orders[output] - 1
        words = f"a path from {name} to {fit.outputs[output]}, zeros={in_words(degrees)}"
        yield words, records, rewritten(fit, zeros=degrees)
        return
    for word in ("zoh", "smooth", "foh"):
        if fit.intersample[channel] not in (word, MIXED):
            changed = tuple(otherwise(rec, channel, word) for rec in records)
            given = repr(list(changed[0].intersample)) if several else repr(word)
            yield f"intersample={given} in the record", changed, fit.structure
    if fit.intersample[channel] == "zoh" or records[0]._seen.get(name) == BY_FIT:
        words = f"{name} a sample earlier, since it acts in its own sample (y[:-1] with {name}[1:])"
        yield words, tuple(_earlier(rec, channel) for rec in records), fit.structure
    delays = [[layout.paths[route].delay for route in row] for row in layout.routes]
    known = delays[output][channel]
    if not isinstance(known, Free):
        for late in _likeliest_delay(fit, delays, output, channel):
            delays[output][channel] = late
            yield f"a delay{of}, delay={in_words(delays)}", records, rewritten(fit, delay=delays)
    for degree in range(path + 1, layout.orders[output] + 1):  # as many as poles: an accelerometer
        more = [list(row) for row in degrees]
        more[output][channel] = degree
        count = "one more zero" if degree == path + 1 else "more zeros"
        yield f"{count}{of}, zeros={in_words(more)}", records, rewritten(fit, zeros=more)
    yield from _poles(fit, output)


def _likeliest_delay(
    fit: Estimates, delays: list[list[Any]], output: int, channel: int
) -> tuple[Free, float] | tuple[()]:
    """Bounds about the delay of a path that suits best, and that delay; nothing where none suits better.

    Delays in whole samples are tried one by one, coarsely first: a free one that starts far away ends in
    another minimum, and loses the samples of the longest delay that it may be.
    """
    known, omega = delays[output][channel], fit.band[1]
    dt = max(rec.dt or rec.duration / rec.intervals for rec in fit.records or ())
    # Up to two periods of the highest line, or an eighth of the record: later ones are not next door.
    most = int(min(4 * pi / omega, *(2 * pi / w / 8 for w in fit.omega0)) / dt)
    options, step = on_band(fit, fit.band), max(1, int(RADIAN / omega / dt))
    scores = {0: bic_beside(fit, fit)}

    def score(k: int) -> None:
        late = [list(row) for row in delays]
        late[output][channel] = known + k * dt
        other = _roughly(fit, rewritten(fit, delay=late), options)
        scores[k] = bic_beside(other, fit) if other is not None else inf

    best = 0
    for k in range(step, most + 1, step):
        score(k)
        best = min(scores, key=scores.__getitem__)
        if k - best >= BEYOND * step:
            break
    for k in range(max(best - step, 0) + 1, best + step):
        if k not in scores:
            score(k)
    best = min(scores, key=scores.__getitem__)
    if not best:
        return ()
    low, mid, high = (float(f"{known + k * dt:.3g}") for k in (max(best - 1.5, 0.0), best, best + 1.5))
    return Free(min=low, max=high), mid


def again(fit: Estimates, records: Any, structure: Any, options: Options, **how: bool) -> Estimates | None:
    """The fit made again with other words, as by `again_at_all`; None where it has no answer."""
    other = again_at_all(fit, records, structure, options, **how)
    return other if other is not None and other.usable else None


def again_at_all(
    fit: Estimates, records: Any, structure: Any, options: Options, *, near: bool = False, **how: bool
) -> Estimates | None:
    """The same, also without an answer; None where it is refused. `near`: begun at the estimates."""
    made: Any = fit.again
    try:
        return made(records, structure, options, **(starts_beside(fit, structure) if near else {}), **how)  # type: ignore[no-any-return]
    except ModfunError:  # too many unknowns for the band, say
        return None


def otherwise(rec: Record, channel: int, word: str) -> Record:
    """The record with an input that goes so between its samples."""
    return rec._like(intersample=(*rec.intersample[:channel], word, *rec.intersample[channel + 1 :]))


def _earlier(rec: Record, channel: int) -> Record:
    """The record with a held input a sample earlier, and so a sample shorter."""
    short = rec.window(rec.t[0], rec.t[-2])
    u, kinds = short.u.copy(), list(rec.intersample)
    u[channel], kinds[channel] = rec.u[channel, 1:], "zoh"
    return short._like(u=u, intersample=tuple(kinds))


def _poles(fit: Estimates, output: int) -> Iterator[tuple[str, tuple[Record, ...], TransferFunction]]:
    """The structure with one or two more poles, and as many more zeros."""
    layout, records = fit.layout, fit.records or ()
    degrees = [list(row) for row in layout.numerators]
    for extra in (1, 2):
        poles: Any = [n + extra if layout.common or i == output else n for i, n in enumerate(layout.orders)]
        if max(poles) > MOST_POLES:
            continue
        told = poles[0] if layout.common or len(poles) == 1 else poles
        words = "one more pole" if extra == 1 else "two more poles"
        if not fit.inputs:
            yield (
                f"{words}, poles={told}",
                records,
                TransferFunction(poles=told, denominator=fit.structure.denominator),
            )
            continue
        yield f"{words}, poles={told}, zeros={in_words(degrees)}", records, rewritten(fit, poles=told)
        wider = [
            [None if d is None else d + extra for d in row] if layout.common or i == output else row
            for i, row in enumerate(degrees)
        ]
        shown = f"{words}, poles={told}, zeros={in_words(wider)}"
        yield shown, records, rewritten(fit, poles=told, zeros=wider)
