"""Doubts about constants: offsets, trim and gravity that a model does not have."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..equations.equation import Equation
from ..errors import ModfunError
from ..models.free import Free
from .baselines import apart, as_written, curved, undriven, with_written
from .contained import contained
from .cures import (
    CLOSE,
    ENOUGH,
    STRONG,
    WORTH,
    Cure,
    again,
    amplified,
    bic_beside,
    convincing,
    furthest,
    of_written,
    on_band,
)
from .diagnosis import level_p, lower_p
from .doubts import FINEST, SURE, Doubt, numbers, rms
from .estimates import Estimates
from .held_numbers import contradicted_numbers
from .lags import EXTRA, unused
from .neighbours import with_offset

__all__ = ["is_all", "mean", "offset", "unanswered", "with_constant"]

# Mean over rms about it. Powers of a channel that far from zero are all but the same regressor.
OFFSET = 1000.0
ROUNDING = 1e-12  # the same the other way round: a channel that stands, as the speed of a record may
# Where an offset bends the estimate, residuals are so many times the noise of the high band, and a constant
# makes them smaller by such a factor.
AWAY, BENT = 1.5, 2.0
UNIT = 3.0  # a factor as large is that of a unit
UNLIKE = 0.01  # probability of a parameter that a constant changes so much by chance
ABSURD = 1000.0  # times the largest sample of a channel: no sensor is that far off, the equation is another


def offset(fit: Estimates) -> Doubt | None:
    """That a channel of an equation is far from zero for how little it moves."""
    if fit.has_poles or fit.structure.linear:
        return None  # of linear models the core takes offsets out before its sums
    for record in fit.records or ():
        for name, values in zip((*record.outputs, *record.inputs), (*record.y, *record.u), strict=True):
            mean = float(values.mean())
            spread = rms(values, mean)
            if abs(mean) > OFFSET * spread > ROUNDING * abs(mean):
                return Doubt(
                    f"Channel {name!r} moves by {spread:.2g} (rms) about {mean:.6g}, which is "
                    f"{abs(mean) / spread:.2g} times larger and costs the equation's terms digits. Write the "
                    "equation for deviations from it."
                )
    return None


@kept
def mean(fit: Estimates) -> Doubt | None:
    """That the mean of a record, line 0, contradicts a model without a constant."""
    without = fit.trend is None and any(low == 0 for low, _ in fit.lines)
    if not without or fit.df_resid < 2 or not fit.records:
        return None
    if fit.layout.rational:
        told = _bent(fit) or _better(fit)
        return Doubt(f'{told} Fit with trend="constant".{_both_ways(fit)}') if told else None
    spread, means = _motion(fit)
    if np.any(np.abs(means) > 3 * spread) and np.all(np.abs(fit.params) < fit.bse):
        # The equation took the offset for the signal.
        return Doubt(
            f"The outputs move by {numbers(spread)} (rms) about {numbers(means)}, the equation has no "
            f"constant, and no parameter is larger than its standard error. {_constant(fit)[0]}"
        )
    if np.all(np.sqrt(np.diag(fit.noise_cov)) <= FINEST * spread):
        return None  # what a search or rounding leaves of a record without noise
    if told := _bent(fit) or _settled(fit) or _off_zero(fit):
        cure, after = _constant(fit)
        if _lacks_a_term(fit, after):
            return None  # which is said by the look at residuals
        number = _number(fit)
        if number is None or not number.after < after - CLOSE:
            return Doubt(f"{told} {cure}")
        # A number in one equation, or a unit or sign of a channel, is said by the look at held numbers.
        return Doubt(number.words) if number.shared or contradicted_numbers(fit) is None else None
    if told := _assumed(fit, means, spread):
        return Doubt(told, sure=False)
    # Of several outputs, each channel in each equation takes a fit.
    one = len(fit.outputs) == 1 and not amplified(fit)
    found = _offset_of(fit, math.inf) if one and level_p(fit) < SURE else None
    if found is not None and found.settles and found.trend is not None:
        return Doubt(
            "The equation has no constant, and a channel that does not enter linearly has an offset. "
            f"{found.words}"
        )
    return None


def _lacks_a_term(fit: Estimates, after: float) -> bool:
    """Whether a term leaves the noise alone, and a constant, with which BIC is `after`, more than that.

    A law that saturates looks like a constant where its argument is large.
    """
    other = with_constant(fit)
    if other is None or level_p(other) > ENOUGH or not level_p(fit) < SURE:
        return False
    term = of_written(fit)
    return term is not None and term.level_p > ENOUGH and term.after < after - WORTH


def unanswered(fit: Estimates) -> Doubt | None:
    """That equations without an estimate have one beside a constant, where outputs are far from zero."""
    if not fit.records or fit.layout.rational or fit.trend is not None or fit.again is None:
        return None
    spread, means = _motion(fit)
    if not np.any(np.abs(means) > spread):
        return None
    told = (
        f"The outputs move by {numbers(spread)} (rms) about {numbers(means)}, and equations without a "
        "constant have no answer: "
    )
    for y, structure, _ in with_offset(fit.structure) if curved(fit) else ():
        other = again(fit, fit.records, structure, fit.options)
        if other is not None and other.success and EXTRA in other.param_names and level_p(other) > SURE:
            c = unused("c", fit.structure)
            return Doubt(
                f'{told}an offset is missing. Write ({y} - {c}) for {y}, params={{"{c}": mf.Free(0)}}, which '
                f"leaves the noise alone: {c} = {other[EXTRA]:.4g}, {_values(fit, other)}."
            )
    other = again(fit, fit.records, fit.structure, fit.options.replace(trend="constant"))
    if other is None or not other.success or not level_p(other) > SURE:
        return None
    return Doubt(
        f'{told}gravity, trim or an offset is missing. Fit with trend="constant", which leaves the noise '
        f"alone: {_values(fit, other)}."
    )


def _values(fit: Estimates, other: Estimates) -> str:
    """What another fit has for the parameters of a fit."""
    rows = [(name, other.param_names.index(name)) for name in fit.param_names]
    return ", ".join([f"{name} = {other.params[k]:.4g} ± {other.bse[k]:.2g}" for name, k in rows])


def _motion(fit: Estimates) -> tuple[F64, F64]:
    """By how much outputs move, and about what."""
    records = fit.records or ()
    spread = np.sqrt(np.mean([rec.y.var(axis=1) for rec in records], axis=0))
    return spread, np.mean([rec.y.mean(axis=1) for rec in records], axis=0)


def _assumed(fit: Estimates, means: F64, spread: F64) -> str:
    """That gains of linear equations rest on outputs that are zero with the inputs, where levels are high.

    Of a step test whose step a late window cuts off, the residuals say nothing: K takes the ambient
    temperature, with an error of a hundredth of that which a constant beside it leaves.
    """
    layout: Any = fit.layout
    if not layout.compiled.is_linear or not np.any(np.abs(means) > 3 * spread):
        return ""
    other = with_constant(fit)
    if other is None or not other.success:
        return ""
    from scipy.special import stdtr

    name, was, now, far = furthest(fit, other)
    if 2 * float(stdtr(max(other.df_resid, 1), -far)) > UNLIKE:
        return ""
    return (
        f"The outputs move by {numbers(spread)} (rms) about {numbers(means)}, and the equations have no "
        f"constant: {name} is {was} if outputs and inputs are zero together, else {now}, with "
        'trend="constant".'
    )


def _off_zero(fit: Estimates) -> str:
    """That line 0 alone is far from what an equation makes of it."""
    at = [np.abs(piece[:, 0].real) for piece, (low, _) in zip(fit.pieces, fit.lines, strict=True) if low == 0]
    from scipy.special import stdtr

    # Residuals have unit variance; the degrees of freedom that this one leaves are those of the others.
    worst, others = float(np.max(at)), fit.df_resid - 1
    t = worst / math.sqrt(max(fit.df_resid - worst**2, 1e-9) / others)
    if 2 * float(stdtr(others, -t)) * np.size(at) > SURE:
        return ""
    return (
        f"The mean of the record is {t:.2g} standard deviations from what the equation makes of it: channels "
        "have an offset, and the equation has no constant."
    )


def _bent(fit: Estimates) -> str:
    """That a constant explains residuals: an offset larger than the motion bends the estimate to line 0."""
    levels = np.sqrt(np.diag(fit.noise_cov))
    if np.all(levels < AWAY * fit.high_band_levels):
        return ""  # before the means, which take longer than all else here
    moved = [np.concatenate([rec.y, rec.u]) for rec in fit.records or ()]
    means = np.mean([values.mean(axis=1) for values in moved], axis=0)
    spread = np.sqrt(np.mean([values.var(axis=1) for values in moved], axis=0))
    noise = np.fmax(AWAY * fit.high_band_levels, FINEST * spread[: levels.size])
    if not np.any(np.abs(means) > spread) or np.all(levels < noise):
        return ""
    if (other := with_constant(fit)) is None:
        return ""
    left = np.sqrt(np.diag(other.noise_cov))
    ratio = float(np.prod(levels / left)) ** (1 / levels.size)
    if ratio < BENT or lower_p(fit, other, ratio) > SURE:
        return ""
    names = ", ".join((*fit.outputs, *fit.inputs))
    return (
        f"The means of {names} are {numbers(means)}, of motions of {numbers(spread)} (rms), and a constant "
        f"lowers the residuals from {numbers(levels)} to {numbers(left)}: channels have an offset"
        f"{', or the law has another form' if undriven(fit) else ''}."
    )


def _better(fit: Estimates) -> str:
    """That a constant explains residuals which are far above the noise, whatever the size of the offset."""
    if not level_p(fit) < SURE or (other := with_constant(fit)) is None:
        return ""
    before, after = bic_beside(fit, fit), bic_beside(other, fit)
    if not after < before - WORTH:
        return ""
    return (
        f"The model has no constant, and with one BIC falls from {before:.4g} to {after:.4g}: channels have "
        "an offset."
    )


def _settled(fit: Estimates) -> str:
    """That a constant in equations leaves only the noise of residuals far above it, or a quarter of them.

    Products that an elimination left are the likelier cause: a constant takes part of what noise does there.
    """
    if not level_p(fit) < SURE or amplified(fit) or (other := with_constant(fit)) is None:
        return ""
    before, after = bic_beside(fit, fit), bic_beside(other, fit)
    left = [np.sqrt(np.diag(own.noise_cov)) for own in (fit, other)]
    ratio = float(np.prod(left[0] / left[1])) ** (1 / left[0].size)
    if not after < before - STRONG or (ratio < BENT and not level_p(other) > ENOUGH):
        return ""
    return (
        f"The equations have no constant, and with one BIC falls from {before:.4g} to {after:.4g} and the "
        f"residuals from {numbers(left[0])} to {numbers(left[1])}: gravity, trim or an offset is missing."
    )


@kept
def with_constant(fit: Estimates) -> Estimates | None:
    """The fit with a constant in each equation."""
    if fit.again is None or fit.records is None:
        return None
    options = on_band(fit, fit.band).replace(trend="constant")
    near = _is_near(fit)
    other = again(fit, fit.records, fit.structure, options, near=near)
    if other is None and not fit.layout.rational:  # what sampling folds may have taken the work
        other = again(fit, fit.records, fit.structure, options, near=near, unfolded=True)
    return other if other is not None and other.params.shape == fit.params.shape else None


def _is_near(fit: Estimates) -> bool:
    """Whether searches may begin at the estimate: what leaves more than noise may be far from the answer."""
    return level_p(fit) > SURE


def is_all(fit: Estimates) -> bool:
    """Whether a constant leaves the noise alone, so that nothing else is to be looked for."""
    other = with_constant(fit)
    return other is not None and level_p(other) > ENOUGH


@dataclass(frozen=True)
class _Numbered:
    """A number before one signal of the equations, beside what the record has for it."""

    words: str
    after: float
    shared: bool


def _number(fit: Estimates) -> _Numbered | None:
    """The number before a signal, in all equations that have one, that lowers BIC most with a parameter."""
    found, model = None, fit.structure
    if fit.again is None or fit.records is None or not isinstance(model, Equation) or model.hidden:
        return None
    before = bic_beside(fit, fit)
    best = before - WORTH
    for shown, texts, count in _numbered(model):
        try:
            other = model._like(text=texts, params={**dict(model.params), EXTRA: Free()})
        except ModfunError:
            continue
        made = again(
            fit, fit.records, other, on_band(fit, fit.band).replace(trend=fit.trend), near=_is_near(fit)
        )
        if made is None or not made.success or not (after := bic_beside(made, fit)) < best:
            continue
        factor, error = 1 + made[EXTRA], float(made.bse[made.param_names.index(EXTRA)])
        if not 1 / UNIT < factor < UNIT:
            continue  # of a channel in another unit, which is looked for by itself
        best, q = after, unused("q", model)
        place = "the equations, which share one" if count > 1 else "the equation"
        found = _Numbered(
            f"A number in the equations contradicts the record, which has {factor:.4g} ± {error:.2g} times "
            f"what they have of {shown}. Write a parameter, {q}, before {shown} in {place}: BIC falls from "
            f"{before:.4g} to {after:.4g}.",
            after,
            count > 1,
        )
    return found


def _numbered(model: Equation) -> Iterator[tuple[str, list[str], int]]:
    """Signals before which numbers stand, texts with a factor of these, and in how many equations."""
    from ..equations.symbolic.words import said

    terms = model.compiled().terms
    if len(model.texts) != 1 + max(term.equation for term in terms):
        return
    highest = [max(t.order for t in terms if t.equation == e) for e in range(len(model.texts))]
    places: dict[str, dict[int, float]] = {}
    for t in terms:
        plain = t.factor is None and t.coefficient.is_number and not t.signal.is_number
        if plain and t.order < highest[t.equation]:
            shown = f"D({said(t.signal)}, {t.order})" if t.order else said(t.signal)
            # On the right of the equation, where the parameter stands.
            places.setdefault(shown, {})[t.equation] = -float(t.coefficient)
    for shown, own in places.items():
        texts = [
            text + (f" + {EXTRA}*{own[e]!r}*{shown}" if e in own else "")
            for e, text in enumerate(model.texts)
        ]
        yield shown, texts, len(own)


def _constant(fit: Estimates) -> tuple[str, float]:
    """The first cure of an offset, of a channel where that explains more than a constant, and BIC so.

    A law that nothing drives has no trim: there the offset of a sensor comes first where it explains as much.
    With a constant instead, logistic growth over a baseline had K 17 to 34 errors too large.
    """
    written = with_written(fit) if curved(fit) else None
    other = with_constant(fit) if written is None else written
    after = math.inf if other is None else bic_beside(other, fit)
    found = _offset_of(fit, after, alike=curved(fit))
    if found is not None and found.after < after - CLOSE:
        return found.words, found.after
    form = _other_form(fit, after) if undriven(fit) else ""
    if found is not None and other is not None:
        words = f"w{found.words[1:]}" if form else found.words
        return f"{form}{words} {_as_inflow(fit, found.fit, other, after)}", min(found.after, after)
    if written is not None:
        name, was, now, _ = apart(fit, fit, written)
        return (
            f"{form}{'w' if form else 'W'}rite a constant into the equation, {as_written(fit, written)}: "
            f"{name} is {was} without and {now} with it. An offset of one output, as (y - c) for y, explains "
            "less.",
            after,
        )
    cure = 'it with trend="constant", or write a constant into the equation.'
    return f"{form}{'f' if form else 'F'}{cure}{_both_ways(fit)}", after


def _as_inflow(fit: Estimates, offset: Estimates, other: Estimates, after: float) -> str:
    """That a constant in each equation explains as much as an offset, and what it changes most."""
    name, sensor, process, _ = apart(fit, offset, other)
    return (
        f"The constant, {as_written(fit, other)}, explains as much, with BIC {after:.4g}, but then {name} is "
        f"{process}, and {sensor} with the offset. The record does not tell which it is: write the offset "
        "for a sensor with a baseline, the constant for a process with an inflow."
    )


def _other_form(fit: Estimates, constant: float) -> str:
    """The terms of an output that explain a record as well as a constant does, with which BIC is `constant`.

    Beside a logistic law, one lowers the residuals of growth by Gompertz's law to the noise: r is half.
    """
    model, records = fit.structure, fit.records or ()
    assert isinstance(model, Equation)
    found = []
    for y in model.outputs:
        terms = [f"{y}**2", f"{y}**3"]
        if min(float(np.min(rec[y])) for rec in records) > 0:
            terms += [f"{y}*log({y})", f"sqrt({y})"]
        for k, term in product(range(len(model.texts)), terms):
            if contained(fit, k, term):
                continue
            texts = [own + f" + {EXTRA}*{term}" if i == k else own for i, own in enumerate(model.texts)]
            try:
                other = model._like(text=texts, params={**dict(model.params), EXTRA: Free()})
            except ModfunError:
                continue
            made = again(fit, records, other, on_band(fit, fit.band), near=_is_near(fit))
            if made is not None and made.success and (after := bic_beside(made, fit)) < constant + CLOSE:
                found.append((after, term if len(texts) == 1 else f"{term} in equation {k + 1}"))
    if not found:
        return ""
    found.sort()
    alike = " or ".join([term for after, term in found if after < found[0][0] + CLOSE])
    before, after = bic_beside(fit, fit), found[0][0]
    first = "First try" if after < constant - CLOSE else "As likely as a constant is"
    return (
        f"{first} a term in {alike}: BIC falls from {before:.4g} to {after:.4g}, and with a constant "
        f"to {constant:.4g}. Otherwise "
    )


@dataclass(frozen=True)
class _Offset:
    """An offset of a channel of an equation, beside a constant or not; whether it explains most residuals."""

    words: str
    trend: str | None
    settles: bool
    after: float
    fit: Estimates


def _offset_of(fit: Estimates, other: float, *, alike: bool = False) -> _Offset | None:
    """The offset of a channel that explains an equation's residuals better than a constant does.

    `other`: BIC with a constant. Where outputs are deviations, too, the offset needs one beside it. `alike`:
    an offset without one may also explain about as much.
    """
    if fit.again is None or fit.records is None:
        return None
    found, before = None, bic_beside(fit, fit)
    best = before - CLOSE
    for x, structure, _ in with_offset(fit.structure):
        for trend in dict.fromkeys((fit.trend, "constant")):
            made = again(
                fit, fit.records, structure, on_band(fit, fit.band).replace(trend=trend), near=_is_near(fit)
            )
            if made is None or not made.success or EXTRA not in made.param_names:
                continue  # an output of which only derivatives act has none
            bar = other + (CLOSE if alike and trend == fit.trend else -CLOSE)
            if not (after := bic_beside(made, fit)) < min(best, bar):
                continue
            if abs(made[EXTRA]) > ABSURD * max(float(np.nanmax(np.abs(rec[x]))) for rec in fit.records):
                continue
            best, c = after - CLOSE, unused("c", fit.structure)
            beside = "" if trend == fit.trend else f', and fit with trend="{trend}" beside it'
            words = (
                f"Write ({x} - {c}) for {x} in the equation, with its offset {c} as a parameter that "
                f'starts at 0, params={{"{c}": mf.Free(0)}}{beside}: {c} = '
                f"{made[EXTRA]:.4g}, and BIC falls from {before:.4g} to {after:.4g}. A constant in the "
                f"equation is not the same, since {x} does not enter linearly."
            )
            found = _Offset(
                words, trend, convincing(fit, Cure("", before, after, level_p(made))), after, made
            )
    return found


def _both_ways(fit: Estimates) -> str:
    """The parameter that a constant changes most, without and with it."""
    other = with_constant(fit)
    if other is None or not fit.params.size:
        return ""
    name, was, now, _ = furthest(fit, other)
    return f" {name} is {was} without and {now} with it."
