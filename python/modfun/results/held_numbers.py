"""Numbers that equations hold and records contradict: units and signs of channels, and coefficients."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import inf, isfinite, log
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..base.units import angle_of
from ..equations.equation import Equation
from ..equations.matrices import names_in, state_of
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..models.options import Options
from .cures import (
    CLOSE,
    ENOUGH,
    WORTH,
    Cure,
    again,
    as_shift,
    bic_beside,
    convincing,
    likely_cure,
    on_band,
    realigned,
)
from .diagnosis import level_p
from .doubts import Doubt
from .estimates import Estimates
from .factors import OF_ANGLES, OF_FORCES, ROUGH, UNITS, Unit, turned, unit_of
from .hidden_units import DEGREES, GRAVITY, angles_of, forces_of, seem
from .misfit import suspicious
from .sparse import of_sums
from .vanes import of_sensors, vane
from .worth import worth

__all__ = ["Factor", "contradicted_numbers", "factor_beside"]

FREED = "freed_"  # names of the parameters in the place of numbers
SIGMAS = 4.0  # standard errors within which a number agrees
RATE = " in the equation of "  # words of a number beside the derivative of a channel
STEPS = (0.5, 2.0, 0.25, 4.0, 0.2, 5.0, 0.1, 10.0, 1e-3, 1e3)  # what a wrong time step is off by
KNOWN = 0.06  # relative: standard error of a factor beyond which it is none
NEAR = 0.03  # relative, the same of a unit
MOST = 2  # channels that are in another unit at once
DECLARED = 0.1  # relative: how near a factor is that of a unit that was told


@dataclass(frozen=True)
class Number:
    """A number in an equation, beside its estimate.

    `powers`: of the scale of each channel in estimate over number.
    """

    words: str
    held: float
    powers: dict[str, int]
    found: float = 0.0
    error: float = 0.0

    @property
    def off(self) -> float:
        """Standard errors between both."""
        return abs(self.found - self.held) / self.error

    def slack(self, rough: float = ROUGH) -> float:
        """By how much the logarithm of their ratio may be off."""
        return max(SIGMAS * self.error / abs(self.found), rough) if self.found else inf

    def __str__(self) -> str:
        return f"the record has {self.found:.4g} ± {self.error:.2g} times {self.words}"


@dataclass(frozen=True)
class Factor:
    """A number in the equations or a factor of a channel: what is seen of it, its cure, and BIC so."""

    kind: str
    seen: str
    cure: str
    after: float


@kept
def contradicted_numbers(fit: Estimates) -> Doubt | None:
    """That channels are in another unit or of another sign than equations need, or that a number is wrong.

    All numbers are estimated in one fit more; a channel whose scale explains their estimates has that scale.
    """
    made, model = _read(fit), fit.structure
    if not made:
        return None
    told = fit.records[0].units if fit.records else {}
    turns = [name for name, unit in told.items() if angle_of(unit)]
    units = dict.fromkeys(turns, OF_ANGLES) | dict.fromkeys(forces_of(model), OF_FORCES)
    in_g = [name for name, unit in told.items() if unit == "g"]
    return _of_scales(made[0], angles_of(model), units, in_g) or _of_one(fit, *made)


@kept
def _estimated(fit: Estimates) -> tuple[Any, Sequence[Number], Estimates] | None:
    """The model with a parameter for each number, the numbers, and the fit so; None where there is none."""
    if fit.again is None or fit.records is None or fit.options.drives:
        return None
    made = _freed(fit.structure)
    other = again(fit, fit.records, made[0], _options(fit), near=fit.success) if made else None
    return (*made, other) if made and other is not None and other.success else None


def _options(fit: Estimates) -> Options:
    """Of fits with other numbers."""
    return (on_band(fit, fit.band) if fit.usable else fit.options).replace(trend=fit.trend)


def _read(fit: Estimates) -> tuple[list[Number], Cure] | None:
    """The numbers in the equations with their estimates, where these explain residuals beyond doubt."""
    if fit.layout.rational or (fit.usable and fit.success and not suspicious(fit)):
        return None
    falls = worth(fit) if fit.usable else {}
    if max(falls.values(), default=0.0) > max(falls.get(("numbers",), inf) + WORTH, WORTH):
        return None  # one change explains more than all numbers
    if (made := _estimated(fit)) is None:
        return None
    _, held, other = made
    cure = Cure("", bic_beside(fit, fit) if fit.usable else inf, bic_beside(other, fit), level_p(other))
    if fit.success and not convincing(fit, cure):
        return None
    at = [other.param_names.index(f"{FREED}{k}") for k in range(len(held))]
    if not np.all(other.bse[at] > 0):  # exact fits tell no errors
        return None
    return [
        replace(number, found=number.held + float(other.params[k]), error=float(other.bse[k]))
        for number, k in zip(held, at, strict=True)
    ], cure


def _of_scales(
    numbers: Sequence[Number],
    angles: Sequence[str],
    units: Mapping[str, Sequence[Unit]],
    in_g: Sequence[str] = (),
) -> Doubt | None:
    """That some channels have another scale, by which all numbers are explained.

    `units`: what accelerations and declared angles may be in; `in_g`: channels whose unit is said to be g.
    """
    forces = [name for name, own in units.items() if own is OF_FORCES]
    channels = list(dict.fromkeys(name for number in numbers for name in number.powers))
    degrees = dict.fromkeys(angles, DEGREES)
    rests = [replace(number, held=number.held * _size(number, degrees)) for number in numbers]
    tries: list[Any] = [({}, combinations(channels, count), numbers) for count in range(1, MOST + 1)]
    more = [one for one in combinations(channels, MOST + 1) if not set(forces).isdisjoint(one)]
    known = [own for own in numbers if own.error < KNOWN * abs(own.found) and _size(own, degrees) != 1]
    all_angles = [(degrees, combinations(forces, count), rests) for count in (0, 1) if forces and known]
    for given, combined, seen in [*tries, *all_angles, ({}, more, numbers)]:
        found = [
            given | scales
            for chosen in combined
            for scales in (_as_told(own, in_g) for own in _scales(seen, chosen))
            if all(turned(x) or unit_of(x, units.get(name, UNITS)) for name, x in scales.items())
        ]
        if found:
            # Degrees are what people read, and an angle's sign is what they take otherwise.
            best = max(found, key=lambda scales: round(sum(scales.values()), 1))
            return Doubt(_told(best, [other for other in found if other is not best], numbers))
    return None


def _as_told(scales: dict[str, float], in_g: Sequence[str]) -> dict[str, float]:
    """The scales with that of the unit of gravity where it was declared and is near."""
    near = [name for name in in_g if abs(log(abs(scales.get(name, inf)) * GRAVITY)) < DECLARED]
    return scales | dict.fromkeys(near, 1 / GRAVITY)


def _of_one(fit: Estimates, numbers: Sequence[Number], cure: Cure) -> Doubt | None:
    """That the record contradicts one number most, where with other numbers only the noise is left."""
    worst = max(numbers, key=lambda number: number.off)
    if not (cure.level_p > ENOUGH and worst.off > SIGMAS):
        return None
    made, name = _estimated(fit), f"{FREED}{numbers.index(worst)}"
    if made and (doubt := of_sums(fit, made[0], _options(fit), name, worst.found - worst.held, str(worst))):
        return doubt
    # With a parameter for one number, if the others lower -2 log likelihood by 1 each, as by chance.
    after = cure.after - (len(numbers) - 1) * (log(fit.df_resid + fit.params.size) - 1)
    falls = worth(fit) if fit.usable else {}
    others = [fall for key, fall in falls.items() if key[0] in ("shift", "drift")]
    alone = falls.get(("numbers",), -inf) > max(others, default=inf) + WORTH
    beside = (realigned(fit) if alone else likely_cure(fit)) if fit.usable else None
    # A time that all samples share is likelier than a scale factor that looks like it.
    moved = as_shift(fit, beside)
    if (beside and beside.after < after) or (moved and moved.after < after + CLOSE):
        return None
    if sum(number.off > SIGMAS for number in numbers) > 1 and (doubt := _of_calibration(numbers)):
        return doubt
    fallen = f" BIC falls from {cure.before:.4g} to {after:.4g}." if isfinite(cure.before) else ""
    if beside is not None and beside.after < after + CLOSE:
        fallen += f" About as well ({beside.after:.4g}): {beside.words}."
    step = _of_step(fit, numbers)
    if not step and RATE in worst.words:
        output = next(name for name, power in worst.powers.items() if power > 0)
        found = (own for x in worst.powers for own in _scales(numbers, (x,), rough=0.0))
        factors = [pair for own in found for pair in own.items()]
        if doubt := of_sensors(fit, str(worst), output, factors, after, fallen):
            return doubt
    return Doubt(
        f"A number in the equations contradicts the record: {worst}. First {step}write a parameter in its "
        f"place, or look for the unit, the scale factor or the sign of a channel.{fallen}"
    )


def _of_step(fit: Estimates, numbers: Sequence[Number]) -> str:
    """That the time step may be wrong, where all numbers beside a derivative are off by one usual factor."""
    dt = fit.records[0].dt if fit.records else None
    rates = [number for number in numbers if RATE in number.words]
    for size in STEPS if dt and rates else ():
        slacks = [own.slack(NEAR) for own in rates]
        logs = [log(own.found / own.held / size) if own.found * own.held > 0 else inf for own in rates]
        if dt and all(abs(off) < slack for off, slack in zip(logs, slacks, strict=True)):
            return f"look at the time step, which would be {dt * size:.4g} s and not {dt:.4g} s; otherwise "
    return ""


@kept
def factor_beside(fit: Estimates) -> Factor | None:
    """The number in the equations, or the scale of a channel, that alone lowers BIC most; None if none does.

    Which it is, a Wald test tells from a fit with a parameter for each number; that one is fitted.
    """
    if (made := _estimated(fit)) is None:
        return None
    model, held, every = made
    at = [every.param_names.index(f"{FREED}{k}") for k in range(len(held))]
    ways = [*_alone(held), *_of_channels(held)]
    try:
        inverse = np.linalg.inv(np.asarray(every.cov_params())[np.ix_(at, at)])
    except np.linalg.LinAlgError:
        return None
    apart = np.asarray(every.params)[at]
    falls = [(slopes @ inverse @ apart) ** 2 / (slopes @ inverse @ slopes) for _, slopes in ways]
    name, slopes = ways[int(np.argmax(falls))]
    one = _with_one(model, held, name, slopes)
    other = again(fit, fit.records or (), one, _options(fit)) if len(held) > 1 else every
    if other is None or not other.success:
        return None
    k = other.param_names.index(f"{FREED}0")
    found, error, after = float(other.params[k]), float(other.bse[k]), bic_beside(other, fit)
    if not (after < bic_beside(fit, fit) and abs(found) > SIGMAS / 2 * error > 0):
        return None
    if name:
        seen = f"{name} has {1 + found:.4g} ± {error:.2g} times what the equations need"
        cure = f"try rec.assign({name}=rec[{name!r}]/{1 + found:.4g})"
        return Factor("A scale factor of a channel", seen, cure, after)
    if (off := vane(fit)) is not None and off.after < after - CLOSE:
        return Factor("The place of a sensor", off.seen, off.cure, off.after)
    number = held[int(np.argmax(slopes))]
    seen = str(replace(number, found=number.held + found, error=error))
    cure = "look for a sensor's scale factor or place, or write a parameter in its place"
    return Factor("A number in the equations, or a scale factor,", seen, cure, after)


def _alone(numbers: Sequence[Number]) -> list[tuple[str, F64]]:
    """Each number by itself."""
    return [("", own) for own in np.eye(len(numbers))]


def _of_channels(numbers: Sequence[Number]) -> list[tuple[str, F64]]:
    """What a factor of a channel does to the numbers, of channels that stand in several."""
    channels = dict.fromkeys(name for number in numbers for name in number.powers)
    slopes = {x: np.array([own.held * own.powers.get(x, 0) for own in numbers]) for x in channels}
    return [(x, own) for x, own in slopes.items() if np.count_nonzero(own) > 1]


def _with_one(model: Any, numbers: Sequence[Number], name: str, slopes: F64) -> Any:
    """The model with a parameter for one number, or for a factor of one channel, instead of one for each."""

    def one(found: re.Match[str]) -> str:
        k = int(found[1])
        if not name:
            return f"{FREED}0" if slopes[k] else "0"
        power = numbers[k].powers.get(name, 0)
        return f"{numbers[k].held!r}*((1 + {FREED}0)**({power}) - 1)" if power else "0"

    def written(entry: Any) -> Any:
        return re.sub(rf"\b{FREED}(\d+)\b", one, entry) if isinstance(entry, str) else entry

    params = {own: given for own, given in model.params if not own.startswith(FREED)}
    params |= {f"{FREED}0": Free()}
    if isinstance(model, Equation):
        return model._like(text=[written(text) for text in model.texts], params=params)
    words = {x: [[written(own) for own in row] for row in getattr(model, x)] for x in "ABCD"}
    return model._like(**words, params=params)


def _of_calibration(numbers: Sequence[Number]) -> Doubt | None:
    """That the scale factor of one channel, of any size, explains all numbers within their errors."""
    channels = dict.fromkeys(name for number in numbers for name in number.powers)
    found = [scales for name in channels for scales in _scales(numbers, (name,), rough=0.0)]
    return Doubt(_told(found[0], found[1:], numbers)) if found else None


def _scales(
    numbers: Sequence[Number], chosen: Sequence[str], rough: float = ROUGH
) -> Iterator[dict[str, float]]:
    """Factors of these channels by which every number is explained."""
    sure = [number for number in numbers if number.slack(rough) < 1]
    powers = np.array([[number.powers.get(name, 0) for name in chosen] for number in sure], dtype=float)
    if not sure or (chosen and np.linalg.matrix_rank(powers) < len(chosen)):
        return
    ratios = np.array([number.found / number.held for number in sure])
    sizes, weights = np.log(np.abs(ratios)), np.array([abs(number.found) / number.error for number in sure])
    logs = np.linalg.lstsq(powers * weights[:, None], sizes * weights, rcond=None)[0]
    errors = np.sqrt(np.diag(np.linalg.inv((powers * weights[:, None] ** 2).T @ powers)))
    if np.any((np.abs(logs) > ROUGH) & (errors > KNOWN)):
        return  # of a sensor's lever, say, which a unit fits by chance
    if np.any(np.abs(sizes - powers @ logs) > [number.slack(rough) for number in sure]):
        return
    # All signs that fit do the same to the numbers: minuses beyond the fewest cancel out, as of v in v**3.
    fewest = -len(chosen)
    for signs in sorted(product((1, -1), repeat=len(chosen)), key=sum, reverse=True):
        turned = np.prod(np.where(powers % 2 == 1, signs, 1), axis=1)
        if np.all(turned == np.sign(ratios)) and sum(signs) >= fewest:
            fewest = sum(signs)
            yield dict(zip(chosen, (signs * np.exp(logs)).tolist(), strict=True))


def _size(number: Number, scales: Mapping[str, float]) -> float:
    """What these scales of channels make of a number."""
    return float(np.prod([scales.get(name, 1.0) ** power for name, power in number.powers.items()]))


def _told(scales: dict[str, float], others: Sequence[dict[str, float]], numbers: Sequence[Number]) -> str:
    """What is off, by which number, and the change of the record."""
    about = [own for own in numbers if not scales.keys().isdisjoint(own.powers)]
    seen = max(about, key=lambda own: (own.found * own.held < 0 and own.off > SIGMAS, own.off))
    parts, changes = dict[str, list[str]](), []
    for name, factor in scales.items():
        minus, unit = "-" if factor < 0 else "", unit_of(factor)
        sign = "of the opposite sign" if factor < 0 else ""
        words = f"{unit[1]}, {unit[0]:.3g} times what the equations need" if unit else ""
        if not (unit or turned(factor)):
            words, unit = f"{abs(factor):.4g} times what the equations need", (abs(factor), "")
        parts.setdefault(" and ".join(filter(None, (sign, words))), []).append(name)
        size = unit[0] if unit else 1.0
        scaled = "" if size == 1 else f"/{size:.4g}" if size > 1 else f"*{1 / size:.4g}"
        changes.append(f"{name}={minus}rec[{name!r}]{scaled}")
    also = [" and ".join(other) for other in others]
    seems = "; ".join(seem(names, words) for words, names in parts.items())
    both = [scales, *others]
    if others and all(turned(x) for one in both for x in one.values()):
        # A number between two channels does not tell which of them has the wrong sign.
        which = " or ".join(" and ".join(one) for one in both)
        tries = (", ".join(f"{x}=-rec[{x!r}]" for x in one) for one in both)
        cures = ", or ".join(f"rec.assign({words})" for words in tries)
        sign = "seems to be of the opposite sign, the record does not tell which"
        return f"{which} {sign}: {seen}. First try {cures}."
    text = f"{seems}: {seen}. First try rec.assign({', '.join(changes)})"
    return text + (f"; the inverse change of {', or of '.join(also)} would do the same." if also else ".")


def _freed(model: Any) -> tuple[Any, list[Number]] | None:
    """The model with a parameter beside each number that records can tell, and what these numbers are."""
    found = list[Number]()
    if isinstance(model, StateSpace):
        words = _of_matrices(model, found)
    elif isinstance(model, Equation) and not model.hidden:
        words = _of_texts(model, found)
    else:
        return None
    if not found:
        return None
    params = {**dict(model.params), **{f"{FREED}{k}": Free() for k in range(len(found))}}
    try:
        return model._like(**words, params=params), found
    except ModfunError:  # a parameter of that name, say
        return None


def _of_matrices(model: StateSpace, found: list[Number]) -> dict[str, Any]:
    """Matrices with a parameter beside each number between measured channels, and for scales of sensors."""
    from ..equations.symbolic.linear import numbers

    shown = [state_of(c, d) for c, d in zip(model.C, model.D, strict=True)]
    measured = {j: model.outputs[i] for i, j in enumerate(shown) if j is not None}
    a, b, c, d = ([list(row) for row in matrix] for matrix in (model.A, model.B, model.C, model.D))
    held = {name: value for name, value in model.params if not isinstance(value, Free)}
    for i, y in measured.items():
        for row, columns in ((a[i], measured), (b[i], dict(enumerate(model.inputs)))):
            for j, x in columns.items():
                if (i == j and row is a[i]) or not {*names_in(((row[j],),))} <= held.keys():
                    continue
                value = float(numbers(((row[j],),), model.params, {})[0][0])
                if value != 0:
                    row[j] = f"{row[j]} + {FREED}{len(found)}"
                    words = f"{x} in the equation of {y}', where the model has {value:.4g}"
                    found.append(Number(words, value, {y: 1, x: -1}))
    inner = {*names_in(model.A, model.B), *held}
    for i, y in enumerate(model.outputs):
        if shown[i] is None and {*names_in((model.C[i], model.D[i]))} <= inner:
            for row in (c[i], d[i]):
                row[:] = [f"(1 + {FREED}{len(found)})*({own})" for own in row]
            powers = _of_output(model, i, measured, held)
            found.append(Number(f"what the equations make of {y}", 1.0, powers))
    return {"A": a, "B": b, "C": c, "D": d}


def _of_output(model: StateSpace, i: int, measured: dict[int, str], held: dict[str, float]) -> dict[str, int]:
    """How often the scale of each channel stands in that of an output which is made of others.

    In az = V*Za*alpha + V*Zd*de the scale of Za is 1, and that of Zd is alpha's over that of de: az seems to
    have the scale of az over that of alpha. Where entries do not agree on that, az has a scale of its own.
    """
    y, inputs = model.outputs[i], dict(enumerate(model.inputs))
    own = dict[Any, dict[str, int]]()
    for at, to in measured.items():
        for row, columns in ((model.A[at], measured), (model.B[at], inputs)):
            own |= {row[j]: _ratio({to: 1}, {x: 1}) for j, x in columns.items() if isinstance(row[j], str)}
    found = []
    for row, columns in ((model.C[i], measured), (model.D[i], inputs)):
        for j, entry in enumerate(row):
            free = [name for name in names_in(((entry,),)) if name not in held]
            if entry == 0:
                continue
            if j not in columns or len(free) > 1 or (free and not _times(model, entry, free[0], own)):
                return {y: 1}
            found.append(_ratio({y: 1}, {columns[j]: 1}, own[free[0]] if free else {}))
    return found[0] if found and all(one == found[0] for one in found) else {y: 1}


def _times(model: StateSpace, entry: Any, name: str, known: dict[Any, Any]) -> bool:
    """Whether an entry is a number times a parameter whose scale is known."""
    from ..equations.symbolic.linear import numbers

    if name not in known:
        return False
    one, two = (float(numbers(((entry,),), model.params, {name: at})[0][0]) for at in (1.0, 2.0))
    return abs(two - 2 * one) <= 1e-9 * abs(one)


def _ratio(over: dict[str, int], *under: dict[str, int]) -> dict[str, int]:
    """Powers of a ratio, without those that are 0."""
    found = dict(over)
    for powers in under:
        for name, power in powers.items():
            found[name] = found.get(name, 0) - power
    return {name: power for name, power in found.items() if power}


def _of_texts(model: Equation, found: list[Number]) -> dict[str, Any]:
    """Texts with a parameter beside each number but the first of each equation."""
    texts, terms = list(model.texts), model.compiled().terms
    if len(texts) != 1 + max(term.equation for term in terms):
        return {}
    for e, text in enumerate(model.texts):
        own = [(t, powers) for t in terms if t.equation == e and (powers := _powers(t)) is not None]
        first, base = max(own, key=lambda pair: pair[0].order, default=(None, {}))
        for t, powers in own:
            if t is not first:
                # On the right of the equation, where the parameter stands.
                value, shown = -float(t.coefficient), _shown(t)
                texts[e] += f" + {FREED}{len(found)}*{shown}"
                words = f"{shown} on the right of {text!r}, where the model has {value:.4g}"
                both = {x: base.get(x, 0) - powers.get(x, 0) for x in (*base, *powers)}
                found.append(Number(words, value, {x: p for x, p in both.items() if p}))
    return {"text": texts}


def _shown(term: Any) -> str:
    """A signal with its derivatives, as an equation has it."""
    from ..equations.symbolic.words import said

    name: str = said(term.signal)
    if term.signal.is_Symbol:
        return name + "'" * int(term.order)
    return f"D({name}, {term.order})" if term.order else name


def _powers(term: Any) -> dict[str, int] | None:
    """Of a number times a product of channels and derivatives: how often each channel stands in it."""
    from ..equations.symbolic.compiled import time

    signal = term.signal
    if term.factor is not None or not term.coefficient.is_number or signal.is_number:
        return None
    powers: dict[str, int] = {}
    for base, power in signal.as_powers_dict().items():
        if not base.is_Symbol or base == time or not power.is_Integer:
            return None
        name = str(base).rstrip("'")
        powers[name] = powers.get(name, 0) + int(power)
    return powers
