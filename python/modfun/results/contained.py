"""Whether equations have a term already, in other words: what others of them say its signals are, too."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..equations.nonlinear import model_of
from ..errors import ModfunError
from ..language.evaluate import function_of
from ..models.free import Free
from .estimates import Estimates

__all__ = ["contained"]

POINTS = 40  # at random within the records: more than the parameters of an equation, or it is not asked
STEP = 1e-5  # of signals and parameters: differences
SAME = 1e-6  # of a term: what rounding leaves of one that is there
PRIMED = re.compile(r"(?<![\w.])([A-Za-z_]\w*)('+)")


def contained(fit: Estimates, k: int, term: str) -> bool:
    """Whether changes of free parameters do to equation k what a term there does: nothing tells them apart.

    In x' = a*v and v' = b*x + c*x**2*v a term in x**2*x' is one in x**2*v. Noise tells the two apart all the
    same, as it biases them otherwise: coefficients of 93 and of -93 lowered BIC.
    """
    try:
        signals, columns = _flow(fit)
        if not signals or not 0 < columns[k].shape[1] < POINTS:
            return False
        column = np.broadcast_to(_function(term, list(signals))(signals), POINTS)
    except (ModfunError, ArithmeticError, KeyError, TypeError, ValueError):
        return False  # in what this does not read, such as delays
    if not (np.isfinite(column).all() and np.isfinite(columns[k]).all()):
        return False
    by, *_ = np.linalg.lstsq(columns[k], column, rcond=SAME)
    return bool(np.linalg.norm(column - columns[k] @ by) < SAME * np.linalg.norm(column))


@kept
def _flow(fit: Estimates) -> tuple[dict[str, F64], dict[int, F64]]:
    """Signals with their derivatives at points where the equations hold; slopes of each to its parameters."""
    structure: Any = fit.structure
    compiled = structure.compiled(fit.outputs, fit.inputs)
    model = model_of(compiled, fit.params)
    form, theta = model.form, np.array(list(model.params.values()))
    plain = not (form.pasts or model._known or structure.hidden or any(one.order for one in form.drives))
    if fit.trend is not None or not plain:  # what a trend adds to a rate is no parameter
        return {}, {}
    rng, records = np.random.default_rng(0), fit.records or ()

    def drawn(name: str, primes: int) -> F64:
        low, high = (each([each(rec[name]) for rec in records]) for each in (np.min, np.max))
        if primes:  # at rates that the band has room for
            low, high = (side * (high - low) * fit.band[1] ** primes / 2 for side in (-1.0, 1.0))
        return np.asarray(rng.uniform(low, high, POINTS))

    def at(x: F64, v: F64) -> F64:
        rows = [form.rates(0.0, list(a), list(b), [], list(theta)) for a, b in zip(x.T, v.T, strict=True)]
        return np.array(rows, dtype=float).T

    u = {name: drawn(name, 0) for name in fit.inputs}
    moving = {name: drawn(name, 1) for name in fit.inputs}
    channels = [fit.inputs[one.input] for one in form.drives]
    x = np.array([drawn(own.rstrip("'"), own.count("'")) for own in model.states])
    v, dv = (np.array([of[name] for name in channels]).reshape(-1, POINTS) for of in (u, moving))
    rates = at(x, v)
    bend = (at(x + STEP * rates, v + STEP * dv) - at(x - STEP * rates, v - STEP * dv)) / (2 * STEP)
    signals = u | {f"{name}'": row for name, row in moving.items()}
    for more, rows in (("''", bend), ("'", rates), ("", x)):  # a state beside what its derivative says
        signals |= {own + more: row for own, row in zip(model.states, rows, strict=True)}
    signals = {_plain(name): row for name, row in signals.items()}
    return signals, {k: _slopes(fit, text, signals) for k, text in enumerate(structure.texts)}


def _slopes(fit: Estimates, text: str, signals: dict[str, F64]) -> F64:
    """Derivatives of an equation to its free parameters, (point, parameter)."""
    left, _, right = text.partition("=")
    held = {name: np.float64(value) for name, value in fit.structure.params if not isinstance(value, Free)}
    of = _function(f"({left}) - ({right or 0})", [*signals, *held, *fit.param_names])
    found, own = [], dict(zip(fit.param_names, map(float, fit.params), strict=True))
    for name, value in own.items():
        step = STEP * (abs(value) or 1.0)
        sides = [of(signals | held | own | {name: value + side * step}) for side in (1.0, -1.0)]
        found.append(np.broadcast_to((sides[0] - sides[1]) / (2 * step), POINTS))
    slopes = np.array(found).T
    size = np.linalg.norm(slopes, axis=0)
    return np.asarray(slopes[:, size > 0] / size[size > 0])


def _function(text: str, names: list[str]) -> Any:
    return function_of(_plain(text), names)


def _plain(text: str) -> str:
    """A text whose derivatives are names of their own: the language of numbers has no primes."""
    return PRIMED.sub(lambda found: f"{found[1]}_{'d' * len(found[2])}__", text)
