"""Starts of linear equations with several free delays: what transfer functions of their channels say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.layout import EquationLayout
from ..errors import ModfunError
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.estimates import Estimates
from .scales import sizes

__all__ = ["delay_starts"]

FEW = 2  # delays: one is found from any start
TRIES = 40  # starts of the parameters, of which one in four or so leads to the least distance
NEAR = 4.0  # times the squared distance that chance leaves
DECADES = 1.0  # of their sizes, either way
STEPS = 300
TINY = 1e-12
FAR = 1e6  # standard errors; where a coefficient is no number
FLOOR = 1e-12  # of the variances of combinations, in parts of the largest


@dataclass(frozen=True)
class _Sought:
    """One equation as transfer functions: `places` of its coefficients, its delays and their names there."""

    output: str
    inputs: list[str]
    structure: TransferFunction
    places: list[tuple[str, int]]
    delays: dict[str, str]


def delay_starts(
    structure: Any,
    layout: EquationLayout,
    records: Sequence[Record],
    options: Options,
    again: Callable[..., Any],
) -> list[float] | None:
    """Starts of the parameters; None where there is nothing to gain, or no such transfer functions.

    The way from one start leads to a false minimum where a response is late by more than the time in which
    inputs change. Transfer functions of one output try many delays at once, and need no start for the rest.
    """
    free = {k for _, _, k in layout.formulas.words["signals"] if k is not None}
    if len(free) < FEW or not layout.compiled.is_linear:
        return None
    found = []
    for equation in range(len(layout.orders)):
        sought = _transfer_function(layout, equation)
        if sought is None:
            return None
        own = tuple([rec.select(outputs=[sought.output], inputs=sought.inputs) for rec in records])
        try:
            fit = again(own, sought.structure, options.replace(output_weights=None))
        except ModfunError:
            return None
        if not fit.usable or not np.all(fit.bse > 0):
            return None
        found.append((equation, sought, fit))
    return _matched(layout, found, sizes(structure, layout.param_names, records))


def _transfer_function(layout: EquationLayout, equation: int) -> _Sought | None:
    """None where more than one output stands in the equation, or one input with two delays."""
    compiled = layout.compiled
    late: dict[str, Any] = {}
    degrees: dict[str, int] = {}
    for term in compiled.terms:
        if term.equation != equation or not term.signal.free_symbols:
            continue
        name, delay = _channel(term)
        if late.setdefault(name, delay) != delay:
            return None
        degrees[name] = max(degrees.get(name, 0), term.order)
    outputs = [name for name in late if name in compiled.outputs]
    inputs = [name for name in compiled.inputs if name in late]
    if len(outputs) != 1 or len(inputs) + 1 != len(late) or late[outputs[0]] != 0 or not inputs:
        return None
    poles = degrees[outputs[0]]
    if poles == 0 or max(degrees[name] for name in inputs) > poles:
        return None
    free = {name: str(late[name]) for name in inputs if str(late[name]) in compiled.free}
    delays = [compiled.free[free[name]] if name in free else float(late[name]) for name in inputs]
    places = [(outputs[0], k) for k in range(poles - 1, -1, -1)]
    places += [(name, k) for name in inputs for k in range(degrees[name], -1, -1)]
    return _Sought(
        outputs[0],
        inputs,
        TransferFunction(poles=poles, zeros=[degrees[name] for name in inputs], delay=delays),
        places,
        {own: "delay" if len(inputs) == 1 else f"delay[{name}]" for name, own in free.items()},
    )


def _channel(term: Any) -> tuple[str, Any]:
    """The channel of a term, and its delay."""
    from ..equations.symbolic.compiled import Delayed

    channel, delay = term.signal.args if isinstance(term.signal, Delayed) else (term.signal, 0)
    return str(channel), delay


def _matched(
    layout: EquationLayout, found: Sequence[tuple[int, _Sought, Any]], size: F64
) -> list[float] | None:
    """Parameters whose transfer functions are nearest to those that were fitted, by their covariance.

    Coefficients that are free of one another are far more uncertain than the parameters they have in common,
    and so alike in their errors that without the covariance the nearest ones lie elsewhere.
    """
    import sympy

    starts = list(layout.formulas.words["starts"])
    symbols = [sympy.Symbol(name, real=True) for name in layout.param_names]
    for equation, sought, fit in found:
        known = {symbols[k]: value for k, value in enumerate(starts) if value is not None}
        expressions = [one.subs(known) for one in _coefficients(layout, equation, sought)]
        used = set().union(*(one.free_symbols for one in expressions))
        open_ = [k for k, symbol in enumerate(symbols) if symbol in used]
        own = [fit.param_names.index(name) for name in sought.delays.values()]
        late = dict(zip(sought.delays, fit.params[own].tolist(), strict=True))
        order = [*range(len(sought.places)), *own]
        values = _nearest(
            sympy.lambdify([[symbols[k] for k in open_]], expressions, "numpy"),
            fit.params[order],
            _whitening(Estimates.cov_params(fit)[np.ix_(order, order)]),
            size[open_],
            np.array([layout.formulas.words["bounds"][k] for k in open_]),
            [late.get(layout.param_names[k]) for k in open_],
        )
        if values is None:
            return None
        for k, value in zip(open_, values, strict=True):
            starts[k] = value
    return starts if None not in starts else None


def _nearest(
    function: Callable[[F64], Any],
    target: F64,
    whitening: F64,
    size: F64,
    bounds: F64,
    told: Sequence[float | None],
) -> list[float] | None:
    """What makes a function of parameters nearest to its target; None where nothing comes near."""
    from scipy.optimize import least_squares

    def residuals(x: F64) -> F64:
        with np.errstate(all="ignore"):
            away = whitening @ (np.array(function(x), dtype=float) - target)
        return np.clip(np.nan_to_num(away, nan=FAR), -FAR, FAR)

    rng, (low, high) = np.random.default_rng(0), bounds.T
    for _ in range(TRIES if size.size else 0):
        x = size * 10 ** rng.uniform(-DECADES, DECADES, size.size) * rng.choice([-1.0, 1.0], size.size)
        x = np.array([own if value is None else value for own, value in zip(x, told, strict=True)])
        x = np.clip(x, low, high)
        end = least_squares(
            residuals, x, bounds=(low, high), x_scale=np.maximum(np.abs(x), TINY), max_nfev=STEPS
        )
        if 2 * end.cost < NEAR * target.size:
            return [float(value) for value in end.x]
    return None


def _coefficients(layout: EquationLayout, equation: int, sought: _Sought) -> list[Any]:
    """Coefficients and delays of an equation's transfer functions, of its parameters."""
    import sympy

    whole: dict[tuple[str, int], Any] = {}
    for term in layout.compiled.terms:
        if term.equation == equation and term.signal.free_symbols:
            at = (_channel(term)[0], term.order)
            whole[at] = whole.get(at, 0) + term.coefficient
    lead = whole[sought.output, layout.orders[equation]]
    found = []
    for at in sought.places:
        sign = 1 if at[0] == sought.output else -1
        found.append(sign * whole.get(at, sympy.Integer(0)) / lead)
    return found + [sympy.Symbol(own, real=True) for own in sought.delays]


def _whitening(cov: F64) -> F64:
    """A root of the inverse of a covariance, of unknowns of very different sizes."""
    sd = np.sqrt(np.diag(cov))
    values, vectors = np.linalg.eigh(np.nan_to_num(cov / np.outer(sd, sd)))
    return np.asarray((vectors / np.sqrt(np.maximum(values, FLOOR))).T / sd)
