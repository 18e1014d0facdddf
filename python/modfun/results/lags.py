"""State spaces with the lag of a sensor or an actuator as a state, or the delay of a sensor; as code, too."""

from __future__ import annotations

import re
from itertools import chain, count
from typing import Any

import numpy as np

from ..equations.equation import Equation
from ..equations.matrices import names_in
from ..equations.state_space import StateSpace
from ..models.free import Free
from .estimates import Estimates

__all__ = [
    "EARLY", "EXTRA", "LAG", "acts_later", "delayed", "free_delays", "lagging", "least_time", "none_seen",
    "of_actuator", "of_sensor", "undelayed", "unused", "with_sensors", "with_values",
]  # fmt: skip

EXTRA = "extra"  # name of the parameter that a neighbour has more
LAG = "a lag of the sensor of "  # first words of that of an output
EARLY = 0.5  # radian of the highest line: a time from which a search starts


def least_time(fit: Estimates) -> float:
    """A lag or delay below which no record shows one, a tenth of its step, s."""
    return min([float(np.min(np.diff(rec.t))) for rec in fit.records or ()], default=0.0) / 10


def unused(name: str, model: Equation | StateSpace) -> str:
    """A name that a model has not yet: c, c0, c1 and so on."""
    own = model.states if isinstance(model, StateSpace) else model.hidden
    taken = {*model.all_parameters, *model.outputs, *model.inputs, *own}
    return next(one for one in chain([name], (f"{name}{k}" for k in count())) if one not in taken)


def none_seen(fit: Estimates, name: str) -> str:
    """That a lag which ended at its least value, below a sample, is none; "" of other parameters."""
    model, told = fit.structure, dict(getattr(fit.structure, "params", ())).get(name)
    if not isinstance(model, StateSpace) or not isinstance(told, Free) or fit[name] != told.min:
        return ""
    lags = (f"-1/{name}", f"-2/{name}")
    at = [i for i, row in enumerate(model.A) if row[i] in lags]
    if len(at) != 1 or told.min > 10 * least_time(fit):
        return ""
    state, entries = model.states[at[0]], (*model.A[at[0]], *model.B[at[0]])
    signals = zip((*model.states, *model.inputs), entries, strict=True)
    led = [x for x, entry in signals if entry == f"1/{name}"]
    place = f"with {led[0]} in place of the state {state}" if len(led) == 1 else f"and the state {state}"
    return (
        f"{name} ended at its least value, {told.min:.3g} s: the record shows no lag, and the other "
        f"standard errors hold only for one of that size. First take {name} out, {place}."
    )


def of_sensor(fit: Estimates, model: StateSpace, i: int) -> tuple[str, StateSpace]:
    """A lag of the sensor of output i, in words and as a state."""
    y, lag = model.outputs[i], unused("lag", model)
    words = f"{LAG}{y} ({{}} s), as a state: {y}_sensor' = ({y} - {y}_sensor)/lag"
    if len(model.outputs) == 1:
        words += ", or, where it is known, mf.through(rec, sensor=mf.tf([1], [lag, 1]))"
    shown = _sensor(fit, model, i, lag)
    shown = shown._like(states=[*shown.states[:-1], unused(f"{y}_sensor", model)])
    return f"{words}, {_code(fit, shown, lag)}", _sensor(fit, model, i, EXTRA)


def with_sensors(fit: Estimates, model: StateSpace, lags: dict[int, str]) -> StateSpace:
    """Lags of the sensors of several outputs, by their places."""
    for i, lag in lags.items():
        model = _sensor(fit, model, i, lag)
    return model


def of_actuator(fit: Estimates, model: StateSpace, k: int) -> tuple[str, StateSpace]:
    """A lag of the actuator of input k, in words and as a state."""
    u, lag = model.inputs[k], unused("lag", model)
    words = f"a lag of the actuator of {u} ({{}} s), as a state: {_follows(model, u)}"
    return f"{words}, {_code(fit, _actuator(fit, model, k, lag), lag)}", _actuator(fit, model, k, EXTRA)


def free_delays(fit: Estimates, model: StateSpace) -> list[str]:
    """Parameters by which one input is late, and which do nothing else.

    Lags of several inputs would be as many states more.
    """
    within = names_in(model.A, model.B, model.C, model.D)
    every = [str(own) for own in model.delay if own in fit.param_names]
    return [name for name in every if every.count(name) == 1 and name not in within]


def undelayed(fit: Estimates, model: StateSpace, late: str) -> tuple[str, str, StateSpace]:
    """A lag in place of the delay of an input that is a parameter, in words, as code and as a state."""
    k = model.delay.index(late)
    u = model.inputs[k]
    plain = model._like(
        delay=[0.0 if own == late else own for own in model.delay],
        params={name: own for name, own in model.params if name != late},
    )
    lag = unused("lag", plain)
    words = f"a lag of the actuator of {u} ({{}} s) in place of the delay {late}, as a state: "
    code = _code(fit, _actuator(fit, plain, k, lag), lag)
    return words + _follows(plain, u), code, _actuator(fit, plain, k, EXTRA)


def lagging(fit: Estimates, model: StateSpace, k: int, late: float) -> tuple[str, str, StateSpace]:
    """A lag of the actuator of input k beside its delay, both free, in words, as code and as a state.

    Alone either was about `late`, so the delay is at most that. `{}` stands for the lag, and the name of the
    delay in braces for it.
    """
    u, given, params = model.inputs[k], model.delay[k], dict(model.params)
    name, beside = unused("h", model), "a delay ({0} = {{{0}}} s)"
    if isinstance(given, str):
        name, beside = given, f"the delay {given}"
    most, own = float(f"{late:.2g}"), params.get(name)
    least = max(own.min, 0.0) if isinstance(own, Free) else 0.0
    params[name] = own if isinstance(own, Free) and own.sd else Free(min=least, max=most)
    made = model._like(delay=[name if j == k else x for j, x in enumerate(model.delay)], params=params)
    lag = unused("lag", made)
    code = _code(fit, _actuator(fit, made, k, lag), lag)
    free = f"{name!r}: mf.Free("
    code = code.replace(free + "min", f"{free}{{{name}}}, min")
    words = (
        f"a lag of the actuator of {u} ({{}} s) beside {beside.format(name)}, as a state: {_follows(made, u)}"
    )
    made = _actuator(fit, made, k, EXTRA)
    starts = {one: Free(fit[one]) for one in fit.param_names if one not in params}
    starts[EXTRA] = Free(late / 2, min=least_time(fit))
    return words, code, made._like(params=dict(made.params) | starts)


def acts_later(fit: Estimates | None, k: int) -> float:
    """By how much input k is late in a fit with a delay or a lag of its actuator more; 0 in others, s."""
    model = fit.structure if fit else None
    if fit is None or not isinstance(model, StateSpace) or EXTRA not in fit.param_names:
        return 0.0
    late = model.delay[k] == EXTRA or model.B[-1][k] == f"1/{EXTRA}"
    return fit[EXTRA] if late and model.delay.count(EXTRA) < 2 else 0.0


def with_values(words: str, fit: Estimates) -> str:
    """Words with estimates for the names in braces, and that of `EXTRA` for empty ones."""
    for name in fit.param_names:
        words = words.replace("{}" if name == EXTRA else f"{{{name}}}", f"{fit[name]:.3g}")
    return words


def delayed(fit: Estimates, model: StateSpace, i: int, late: float) -> tuple[str, StateSpace]:
    """A time by which output i is late, about `late`, as a state with the phase of a delay; in words first.

    Padé's (1 - late s/2)/(1 + late s/2): up to late*omega = 1 its phase is within 0.08 rad of the delay's.
    """
    name = unused("late", model)
    words = f"a delay of {model.outputs[i]} ({{}} s), as a state with a parameter for it"
    made = _padded(fit, model, i, EXTRA)
    made = made._like(params={**dict(made.params), EXTRA: Free(late, min=least_time(fit))})
    return f"{words}, {_code(fit, _padded(fit, model, i, name), name)}", made


def _lag(fit: Estimates) -> Free:
    """A time constant that divides, and so is never 0."""
    least = least_time(fit)
    return Free(max(EARLY / fit.band[1], least), min=least)


def _sensor(fit: Estimates, model: StateSpace, i: int, lag: str) -> StateSpace:
    """One more state, which output i shows and which follows what it showed."""
    n, y = len(model.states), model.outputs[i]
    over = [_over(entry, lag) for entry in model.C[i]]
    a = [*([*row, 0] for row in model.A), [*over, f"-1/{lag}"]]
    b = [*model.B, [_over(entry, lag) for entry in model.D[i]]]
    c = [[*row, 0] for row in model.C]
    c[i] = [*[0] * n, 1]
    d = [list(row) for row in model.D]
    d[i] = [0] * len(model.inputs)
    states = [f"{x}_itself" if x == y else x for x in model.states]
    params = {**dict(model.params), lag: _lag(fit)}
    return model._like(A=a, B=b, C=c, D=d, states=[*states, y], params=params)


def _padded(fit: Estimates, model: StateSpace, i: int, late: str) -> StateSpace:
    made = _sensor(fit, model, i, late)
    a: list[list[Any]] = [list(row) for row in made.A]
    b: list[list[Any]] = [list(row) for row in made.B]
    c: list[list[Any]] = [list(row) for row in made.C]
    d: list[list[Any]] = [list(row) for row in made.D]
    a[-1], b[-1] = (
        [own if own == 0 else f"2*{own}".replace("2*1/", "2/") for own in row] for row in (a[-1], b[-1])
    )
    a[-1][-1] = f"-2/{late}"
    c[i] = [*(_minus(own) for own in model.C[i]), 2]
    d[i] = [_minus(own) for own in model.D[i]]
    states = [*made.states[:-1], unused(f"{model.outputs[i]}_sensor", model)]
    return made._like(A=a, B=b, C=c, D=d, states=states)


def _actuator(fit: Estimates, model: StateSpace, k: int, lag: str) -> StateSpace:
    """One more state, which follows input k and stands in its place."""
    n, u = len(model.states), model.inputs[k]
    a = [*([*row, own[k]] for row, own in zip(model.A, model.B, strict=True)), [*[0] * n, f"-1/{lag}"]]
    b: list[list[Any]] = [[0 if j == k else own for j, own in enumerate(row)] for row in model.B]
    b.append([f"1/{lag}" if j == k else 0 for j in range(len(model.inputs))])
    c = [[*row, own[k]] for row, own in zip(model.C, model.D, strict=True)]
    d = [[0 if j == k else own for j, own in enumerate(row)] for row in model.D]
    params = {**dict(model.params), lag: _lag(fit)}
    return model._like(A=a, B=b, C=c, D=d, states=[*model.states, _moved(model, u)], params=params)


def _moved(model: StateSpace, u: str) -> str:
    """The name of what an actuator makes of an input."""
    return unused(f"{u}_moved", model)


def _follows(model: StateSpace, u: str) -> str:
    return f"{_moved(model, u)}' = ({u} - {_moved(model, u)})/lag"


def _over(entry: Any, lag: str) -> Any:
    """An entry over a lag."""
    return entry if entry == 0 else f"1/{lag}" if entry == 1 else f"({entry})/{lag}"


def _minus(entry: Any) -> Any:
    return f"-({entry})" if isinstance(entry, str) else -entry if entry else 0


def _code(fit: Estimates, model: StateSpace, lag: str) -> str:
    """The model with such a time as Python takes it, `{}` for where its search begins."""
    given = {**{name: repr(own) for name, own in model.params}, lag: f"Free({{}}, min={least_time(fit):.2g})"}
    params = ", ".join(f"{name!r}: {own}" for name, own in given.items())
    text = re.sub(r"params=\{.*?\}", f"params={{{params}}}", repr(model))
    text = re.sub(r"(?<=\d)\.0(?=[],])", "", text)  # 1 in place of 1.0
    return f"mf.{text.replace('Free(', 'mf.Free(')}"
