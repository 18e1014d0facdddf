"""Equations and state spaces next to a fitted one: what sensors, actuators and a missing term would add."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import chain, combinations
from typing import Any

import numpy as np

from .._core import sharpest
from ..base.names import listed
from ..equations.equation import Equation
from ..equations.layout import layout_of
from ..equations.matrices import state_of
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..records.forms import forms_of
from .contained import contained
from .estimates import Estimates
from .lags import EARLY, EXTRA, free_delays, of_actuator, of_sensor, undelayed, unused, with_sensors
from .shifts import likeliest_lever, likeliest_shift
from .worth import Key

__all__ = [
    "LEVER",
    "ZERO",
    "absurd",
    "integrals",
    "neighbours",
    "of_levers",
    "rates_of",
    "singular",
    "with_levers",
    "with_offset",
]

ZERO = "extra_zero"  # and of another beside it
LEVER = "lever_"  # first word of that of a sensor away from the reference point
MOST_SENSORS = 3  # whose pairs are tried with lags
LATEST = 12  # samples of an input that acts late, where its delay is no parameter
BENDS = 1.0  # rad: below, a sine is a line and a cube
TURNS = 4 * math.pi  # rad: beyond, what is no angle is as likely
ABOUT = 0.8  # a number that is nearly 1, as that of the yaw rate in the equation of sideslip
FARTHEST = 3.0  # times what a score test finds of a lever
SPIKE = 10.0  # times the mean fourth difference: a sample that stands out
BEYOND = 1e3  # times the fastest change that the band has room for: no term of an equation is as large
ROUNDING = 1e-14  # of an output: less is left by no record


Changed = Iterator[tuple[str, Any, Key]]


def neighbours(fit: Estimates) -> tuple[Changed, ...]:
    """Changes in words, `{}` for the value of the parameter that they add, with the structure and its key.

    The more likely ones first: sensors and actuators, then terms, then two of them. By its key `worth` knows
    a change of a state space; others have none.
    """
    model = fit.structure
    if not isinstance(model, StateSpace | Equation) or EXTRA in (*model.all_parameters, *model.outputs):
        return ()
    if isinstance(model, StateSpace):
        return _instruments(fit, model), _entries(model)
    return chain(_shifts(fit, model), _offsets(model)), _terms(fit, model), _pairs(model)


def absurd(fit: Estimates, key: Key, coefficient: float) -> bool:
    """Whether a term with such a coefficient is far beyond all that an equation holds."""
    found = re.fullmatch(r"(\w+)('*)(?:\*\*(\d))?", key[2]) if key[:1] == ("term",) else None
    records, omega = fit.records or (), fit.band[1]
    if found is None or found[1] not in (*fit.outputs, *fit.inputs):
        return False
    sizes = {x: max(float(np.ptp(rec[x])) for rec in records) for x in (found[1], *fit.outputs)}
    term = abs(coefficient) * sizes[found[1]] ** int(found[3] or 1) * omega ** len(found[2])
    return not term < BEYOND * max(sizes[y] for y in fit.outputs) * max(omega, 1.0) ** max(fit.layout.orders)


def singular(other: Estimates) -> bool:
    """Whether a neighbour fits by rounding alone: what it adds is within its error, or nothing is left.

    At next to no noise a term of 1.9e64 with a standard error of 9e73 left 4e-21 of an output.
    """
    most = [max(float(np.max(np.abs(rec[y]))) for rec in other.records or ()) for y in other.outputs]
    if np.any(other.noise_levels < ROUNDING * np.array(most)):
        return True
    if EXTRA not in other.param_names:
        return False
    at, cov = other.param_names.index(EXTRA), Estimates.cov_params(other)  # without a look at uneven noise
    return bool(abs(other[EXTRA]) < math.sqrt(max(cov[at, at], 0.0)))


def integrals(model: StateSpace) -> Iterator[tuple[str, StateSpace]]:
    """One more state, the integral of a state, in the equation of another: an attitude beside its rate."""
    n, nothing = len(model.states), [0] * len(model.inputs)
    if EXTRA in model.all_parameters:
        return
    for i, j in ((i, j) for i in range(n) for j in range(n) if i != j):
        row = [int(k == j) for k in range(n)]
        a = [*([*own, EXTRA if k == i else 0] for k, own in enumerate(model.A)), [*row, 0]]
        name, of = f"{model.states[j]}_integral", model.states[j]
        words = (
            f"a state more that is the integral of {of}, x' = {of}, with a term in x in the equation of "
            f"{model.states[i]}' (coefficient {{}}), as a bank or pitch angle beside its rate; if it is "
            "measured, as an output"
        )
        c = [[*own, 0] for own in model.C]
        params = _more(model, Free())
        made = model._like(A=a, B=[*model.B, nothing], C=c, states=[*model.states, name], params=params)
        yield words, made


def _late(fit: Estimates) -> Free:
    """A time constant or a delay."""
    return Free(EARLY / fit.band[1], min=0.0)


def _delay(fit: Estimates) -> Free:
    """A delay, up to an eighth of the shortest record."""
    return Free(EARLY / fit.band[1], min=0.0, max=math.pi / 4 / max(fit.omega0))


def _instruments(fit: Estimates, model: StateSpace) -> Changed:
    for i, y in enumerate(model.outputs):
        yield *of_sensor(fit, model, i), ("late", y)
    for name in free_delays(fit, model):
        words, code, made = undelayed(fit, model, name)
        yield f"{words}, {code}", made, ()
    for k, u in enumerate(model.inputs):
        yield *of_actuator(fit, model, k), ("late", u)
        if model.delay[k] == 0:
            late = [EXTRA if j == k else own for j, own in enumerate(model.delay)]
            shown = "h" if len(late) == 1 else [("h" if one == EXTRA else one) for one in late]
            words = (
                f"a delay of {u}, delay={shown!r} and params={{'h': mf.Free(min=0, max=...)}} (h = {{}} s)"
            )
            yield words, model._like(delay=late, params=_more(model, _delay(fit))), ("late", u)
    yield from _all_inputs(fit, model)
    yield from _two_sensors(fit, model)
    for i, y in enumerate(model.outputs):
        if state_of(model.C[i], model.D[i]) is not None:
            continue  # a measured state is no accelerometer
        for j in rates_of(model):
            bounds = [_about(fit, y, model.states[j])]
            words = of_levers(y, [model.states[j]], ["{}"], bounds)
            yield words, with_levers(model, i, [j], bounds), ()


def _all_inputs(fit: Estimates, model: StateSpace) -> Changed:
    """One delay of all inputs, where one of them seems to act late: filters of the outputs act like that."""
    shift = likeliest_shift(fit) if len(model.inputs) > 1 and not any(model.delay) else None
    if shift is None or shift.channel not in model.inputs or shift.late > 0:
        return
    late = [EXTRA] * len(model.inputs)
    words = (
        f"a delay of {listed(list(model.inputs))}, one of all inputs, delay={['h'] * len(late)!r} and "
        "params={'h': mf.Free(min=0, max=...)} (h = {} s), as where the data system filtered the outputs"
    )
    yield words, model._like(delay=late, params=_more(model, _delay(fit))), ()


def _two_sensors(fit: Estimates, model: StateSpace) -> Changed:
    """Lags of two sensors, where an input seems to act late: what they have in common looks like that."""
    shift = likeliest_shift(fit) if 1 < len(model.outputs) <= MOST_SENSORS else None
    if shift is None or shift.channel not in model.inputs:
        return
    for i, j in combinations(range(len(model.outputs)), 2):
        y, other = model.outputs[i], model.outputs[j]
        words = (
            f"lags of the sensors of {y} ({{}} s) and of {other}, each as a state: "
            f"{y}_sensor' = ({y} - {y}_sensor)/lag"
        )
        yield words, with_sensors(fit, model, {i: EXTRA, j: ZERO}), ()


def with_levers(model: StateSpace, i: int, states: Sequence[int], bounds: Sequence[float]) -> StateSpace:
    """Output i as of a sensor that feels derivatives of states, too; the first lever is `EXTRA`."""
    c, d = (list(model.C[i]), list(model.D[i]))
    params = dict(model.params)
    for name, j, most in zip([EXTRA, *(f"{EXTRA}_{k}" for k in states[1:])], states, bounds, strict=True):
        c = [_plus(own, f"{name}*({a})") for own, a in zip(c, model.A[j], strict=True)]
        d = [_plus(own, f"{name}*({b})") for own, b in zip(d, model.B[j], strict=True)]
        params[name] = Free(min=-most, max=most) if most else Free()
    rows = [*model.C[:i], c, *model.C[i + 1 :]], [*model.D[:i], d, *model.D[i + 1 :]]
    return model._like(C=rows[0], D=rows[1], params=params)


def of_levers(y: str, rates: Sequence[str], values: Sequence[str], bounds: Sequence[float]) -> str:
    """How an output shows levers times derivatives, and how that is written."""
    terms = " + ".join(f"{LEVER}{x}*{x}'" for x in rates)
    told = ", ".join(f"{LEVER}{x} = {value}" for x, value in zip(rates, values, strict=True))
    rows = listed([f"{LEVER}{x} times the row of {x} in A" for x in rates])
    free = ", ".join(
        f"'{LEVER}{x}': mf.Free({value}" + (f", min={-most:.2g}, max={most:.2g})" if most else ")")
        for x, value, most in zip(rates, values, bounds, strict=True)
    )
    return (
        f"{terms} in the output {y} ({told}), as of a sensor away from the reference point: add {rows} to "
        f"the row of {y} in C, the same of B to D, with params={{{free}}}"
    )


def _about(fit: Estimates, y: str, rate: str) -> float:
    """How far a lever may go, by the size that a score test finds: far away a second may explain as much."""
    found = likeliest_lever(fit, [(y, rate)]) if rate in fit.outputs else None
    return FARTHEST * abs(found.length) if found else 0.0


def rates_of(model: StateSpace) -> list[int]:
    """States that are the rate of another one, by a number near 1 in its equation; all where none is.

    Sensors feel angular accelerations times their lever. With any other derivative an accelerometer does the
    same to the record, and estimates are of another aircraft.
    """
    found = [
        j
        for j in range(len(model.states))
        if any(_near_one(own[j]) for i, own in enumerate(model.A) if i != j)
    ]
    return found or list(range(len(model.states)))


def _near_one(entry: Any) -> bool:
    return isinstance(entry, int | float) and ABOUT < abs(entry) < 1 / ABOUT


def _entries(model: StateSpace) -> Changed:
    """Every entry that is 0, free; of outputs that are states, which have their names, none."""
    for name, rows, columns in (("B", model.states, model.inputs), ("A", model.states, model.states),
                                ("D", model.outputs, model.inputs)):  # fmt: skip
        for i, row in enumerate(rows):
            for j, column in enumerate(columns):
                matrix = [list(own) for own in getattr(model, name)]
                shown = name == "D" and state_of(model.C[i], model.D[i]) is not None
                if matrix[i][j] == 0 and not shown:
                    matrix[i][j] = EXTRA
                    target = row if name == "D" else f"{row}'"
                    words = f"a term in {column} in the equation of {target} (coefficient {{}})"
                    made = model._like(**{name: matrix}, params=_more(model, Free()))
                    yield words, made, () if name == "D" else ("term", row, column)


def _plus(one: Any, other: str) -> Any:
    return f"({one}) + {other}"


def _shifts(fit: Estimates, model: Equation) -> Changed:
    late = _late(fit)
    for y in model.outputs:
        yield from _tried(
            f"a lag of the sensor of {y}, ({y} + lag*{y}') in its place (lag = {{}} s)",
            model, _replaced(model, y, f"({y} + {EXTRA}*{y}')"), late, ("late", y),
        )  # fmt: skip
    for u in model.inputs:
        words = f"a delay of {u}, {u}(t - h) with h = mf.Free(min=0, max=...) (h = {{}} s)"
        text = _replaced(model, u, f"{u}(t - {EXTRA})")
        free = [own for own in _tried(words, model, text, _delay(fit), ("late", u)) if _has_form(fit, own[1])]
        yield from free or _known_delays(fit, model, u)
    if len(model.inputs) > 1:  # a computer, or the sensor, is late for all of them
        texts = list(model.texts)
        for u in model.inputs:
            texts = [_replaced_in(own, u, f"{u}(t - {EXTRA})") for own in texts]
        words = f"a delay of {listed(list(model.inputs))}, {', '.join(f'{u}(t - h)' for u in model.inputs)}"
        yield from _tried(f"{words} with h = mf.Free(min=0, max=...) (h = {{}} s)", model, texts, _delay(fit))


def _has_form(fit: Estimates, model: Equation) -> bool:
    """Whether a delay that is a parameter stands in no product with other channels."""
    try:
        layout_of(model, fit.options, fit.outputs, fit.inputs, forms_of(fit.records or ()))
    except ModfunError:
        return False
    return True


def _known_delays(fit: Estimates, model: Equation, u: str) -> Changed:
    """Delays of whole samples, where an input stands in products, in which a free one has no form."""
    steps = {rec.dt or 0.0 for rec in fit.records or ()}
    step = min(steps, default=0.0)
    for k in range(1, LATEST + 1) if len(steps) == 1 and step else ():
        late = f"{u}(t - {k * step:.12g})"
        try:
            made = model._like(text=_replaced(model, u, late))
        except ModfunError:
            return
        yield f"a delay of {u}, {u}(t - {k * step:.4g})", made, ("late", u)


def _offsets(model: Equation) -> Changed:
    """Where equations are linear, a constant says the same."""
    if not model.linear:
        for x, structure, key in with_offset(model):
            name = unused("c", model)
            words = f"an offset of {x}, ({x} - {name}) in its place ({name} = {{}})"
            # Of a law that nothing drives, one that saturates looks the same.
            yield words if model.inputs else f"{words}, or a law of another form", structure, key


def _terms(fit: Estimates, model: Equation) -> Changed:
    terms = [f"{x}{prime}" for prime in ("", "'") for x in (*model.inputs, *model.outputs)]
    terms += [f"{x}**{power}" for power in (2, 3) for x in (*model.outputs, *model.inputs)]
    if len(model.texts) == 1 or not model.linear:
        terms += _products(fit, model)
    for k in range(len(model.texts)):
        where = f" in equation {k + 1}" if len(model.texts) > 1 else ""
        higher = [_next_derivative(y, model.texts[k]) for y in model.outputs]
        for term in dict.fromkeys([*terms, *higher]):
            if contained(fit, k, term):
                continue
            texts = [f"{own} + {EXTRA}*{term}" if i == k else own for i, own in enumerate(model.texts)]
            words, key = f"a term in {term}{where} (coefficient {{}})", ("term", str(k), term)
            yield from _tried(words, model, texts, Free(), key)


def _products(fit: Estimates, model: Equation) -> list[str]:
    """What makes equations of machines and populations nonlinear, besides powers.

    None where single samples stand out, as a sine that bounds them would explain these.
    """
    if any(sharpest(rec.y) > SPIKE for rec in fit.records or ()):
        return []
    found = [f"{x}*{z}" for x, z in combinations((*model.outputs, *model.inputs), 2) if x in model.outputs]
    for y in model.outputs:
        found += [f"{y}*abs({y})", f"{y}*{y}'", f"{y}**2*{y}'"]
        if not fit.records:
            continue
        low, high = (bound([bound(rec[y]) for rec in fit.records]) for bound in (np.min, np.max))
        if BENDS < max(-low, high) < TURNS:
            found.append(f"sin({y})")
        if low > 0:  # what is always above zero, as absolute temperatures, radiates
            found.append(f"{y}**4")
    return found


def _pairs(model: Equation) -> Changed:
    """A pole and a zero more."""
    if len(model.texts) == 1:
        text = model.texts[0]
        for u in model.inputs:
            pole, zero = _next_derivative(model.outputs[0], text), _next_derivative(u, text)
            words = f"terms in {pole} and {zero} (coefficient of {pole} {{}})"
            texts = [f"{text} + {EXTRA}*{pole} + {ZERO}*{zero}"]
            yield from _tried(words, model, texts, Free(), (), {ZERO: Free()})


def _next_derivative(y: str, text: str) -> str:
    """The derivative after the highest in a text: with it the equation has a pole or a zero more."""
    primes = re.findall(rf"(?<![\w.]){re.escape(y)}(?!\w)('*)", text)
    return y + "'" * (1 + max(map(len, primes), default=0))


def with_offset(model: Any) -> Changed:
    """An unknown offset of one channel: where it enters nonlinearly, a constant is not the same."""
    if isinstance(model, Equation) and EXTRA not in model.all_parameters:
        for x in (*model.outputs, *model.inputs):
            yield from _tried(x, model, _replaced(model, x, f"({x} - {EXTRA})"), Free(0.0))


def _more(model: Any, extra: Free) -> dict[str, Any]:
    return {**dict(model.params), EXTRA: extra}


def _tried(
    words: str,
    model: Equation,
    texts: list[str],
    extra: Free,
    key: Key = (),
    more: dict[str, Free] | None = None,
) -> Changed:
    """The equation with these texts; nothing where they make none."""
    try:
        made = model._like(text=texts, params=_more(model, extra) | (more or {}))
    except ModfunError:
        return
    yield words, made, key


def _replaced(model: Equation, name: str, text: str) -> list[str]:
    """The texts with a signal replaced, its primes kept: (y - c)'' of y''."""
    return [_replaced_in(own, name, text) for own in model.texts]


def _replaced_in(own: str, name: str, text: str) -> str:
    return re.sub(rf"(?<![\w.]){re.escape(name)}(?!\w)(?!\()", text, own)
