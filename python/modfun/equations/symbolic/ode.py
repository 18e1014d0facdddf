"""Equations in jets solved for their highest derivatives: first-order form that can be integrated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from typing import Any, NamedTuple

import sympy
from sympy.solvers.solveset import NonlinearError

from ...errors import SpecError
from .compiled import Compiled, Delayed, jet, time
from .slides import ramped
from .tape import Operation, tape

__all__ = ["Drive", "FirstOrder", "first_order", "with_trend"]

CHANGES = 20  # of states, to take derivatives of inputs out of the right sides
ROUNDING = 1e-9  # that equations are off by at a solution


class Drive(NamedTuple):
    """The `order`-th derivative of input number `input`, so much later."""

    input: int
    order: int
    delay: sympy.Expr


class Past(NamedTuple):
    """State number `state`, so much earlier."""

    state: int
    delay: sympy.Expr


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """x' = f(t, x, v, known, θ), y = g(t, x, v, known, θ).

    v holds the inputs and their derivatives, then states of the past.

    Attributes
    ----------
    states : tuple of str
        Names of x: "y", "y'", … of outputs, then of hidden signals. Where derivatives of an input stand in
        the equations, less what the input feeds through to them at once, as for linear systems.
    drives : tuple of Drive
    pasts : tuple of Past
    rates, outputs : callable
        f and g of (t, x, v, known, θ), lists; x and v may hold arrays.
    delays : callable
        Delays of drives, then of pasts, in s, of θ.
    feeds : bool
        Whether g needs drives or known functions.
    tape : tuple
        f for the compiled core, of t, x, drives, known, pasts, θ and widths.
    slides : bool
        Whether f jumps where states do, and the tape takes widths of states, within which it does not.
    """

    states: tuple[str, ...]
    drives: tuple[Drive, ...]
    pasts: tuple[Past, ...]
    rates: Callable[..., Sequence[Any]]
    outputs: Callable[..., Sequence[Any]]
    delays: Callable[..., Sequence[Any]]
    feeds: bool
    tape: tuple[list[Operation], list[int]]
    slides: bool


@lru_cache(maxsize=64)
def first_order(
    source: tuple[sympy.Expr, ...],
    outputs: tuple[str, ...],
    hidden: tuple[str, ...],
    inputs: tuple[str, ...],
    parameters: tuple[str, ...],
    known: tuple[sympy.Symbol, ...],
) -> FirstOrder:
    """Solve equations that vanish for the highest derivative of every signal.

    Raises
    ------
    SpecError
        Not as many equations as signals, or no unique solution.
    """
    signals = (*outputs, *hidden)
    # NumPy's amax and amin, which SymPy would print, do not take numbers beside arrays.
    equations = [e.replace(sympy.Max, _largest).replace(sympy.Min, _least) for e in source]
    stand_in = {
        one: sympy.Dummy("late", real=True)
        for one in sorted(set().union(*(e.atoms(Delayed) for e in equations)), key=str)
    }
    equations = [e.xreplace(stand_in) for e in equations]
    tops = {s: _top(equations, s) for s in signals}
    missing = [s for s in signals if tops[s] < 0]
    if missing:
        raise SpecError(f"simulating: no equation has {', '.join(missing)}; give one, or leave it out")
    if len(equations) != len(signals):
        raise SpecError(
            f"simulating: {len(equations)} equation(s) for the {len(signals)} signals {', '.join(signals)}; "
            "give as many equations as signals that are not inputs (phi' = p, say, where both are measured)"
        )
    solved = _solved(equations, [jet(s, n) for s, n in tops.items()])
    x = [jet(s, k) for s, n in tops.items() for k in range(n)]
    f = [solved.get(jet(s, k + 1), jet(s, k + 1)) for s, n in tops.items() for k in range(n)]
    g = [solved.get(jet(s), jet(s)) for s in outputs]
    f, g = _without_slopes(x, f, g, inputs)

    drives: dict[Any, Drive] = {}
    for i, name in enumerate(inputs):
        for k in range(_top([*f, *g], name) + 1):
            if any(e.has(jet(name, k)) for e in (*f, *g)):
                drives[jet(name, k)] = Drive(i, k, sympy.Integer(0))
    pasts: dict[Any, Past] = {}
    for one, symbol in stand_in.items():
        channel, delay = one.args
        base, k = _split(channel)
        if base in inputs:
            drives[symbol] = Drive(inputs.index(base), k, delay)
        elif channel in x:
            pasts[symbol] = Past(x.index(channel), delay)
        else:
            raise SpecError(
                f"simulating: {channel} stands with a delay, but is not a state of the equation "
                f"({', '.join(map(str, x))}); lower derivatives may be delayed, the highest may not"
            )
    theta = [sympy.Symbol(name, real=True) for name in parameters]
    late = [*(d.delay for d in drives.values()), *(p.delay for p in pasts.values())]
    used = set().union(*(e.free_symbols for e in (*f, *g, *late)))
    named = {str(p): p for p in used}
    theta = [named.get(name, p) for name, p in zip(parameters, theta, strict=True)]
    v = [*drives, *pasts]
    if any(e.free_symbols & set(pasts) for e in g):
        raise SpecError(
            f"simulating: an output among {', '.join(outputs)} is given by a past state at once; name the "
            "past state by an equation with a derivative"
        )
    # Elimination takes parameters that only scale what is hidden: outputs are the same at any values.
    stray = used - {*x, *v, *theta, *known, time}
    ones = dict.fromkeys(stray, sympy.Integer(1))
    whole, (f, g) = (*f, *g), ([e.xreplace(ones) for e in own] for own in (f, g))
    scales = hidden and all(
        e.free_symbols - stray == one.free_symbols for e, one in zip(whole, (*f, *g), strict=True)
    )
    if stray and not scales:
        names = sorted(map(str, stray))
        raise SpecError(
            f"simulating: nothing gives {', '.join(names)} a value; hold them, "
            f"params={dict.fromkeys(names, 1.0)}"
        )
    arguments = [time, x, v, list(known), theta]
    smooth, widths = ramped(f, x)
    return FirstOrder(
        states=tuple(map(str, x)),
        drives=tuple(drives.values()),
        pasts=tuple(pasts.values()),
        rates=_function(arguments, f),
        outputs=_function(arguments, g),
        delays=_function([theta], late),
        feeds=any(e.free_symbols & {*drives, *known} for e in g),
        tape=tape(smooth, [time, *x, *drives, *known, *pasts, *theta, *widths]),
        slides=bool(widths),
    )


def with_trend(compiled: Compiled, terms: int) -> Compiled:
    """The equations with a constant each, or a constant and a drift, as further parameters."""
    source, names = [], list(compiled.parameters)
    for k, e in enumerate(compiled.source):
        for power in range(terms):
            names.append(f"trend {k} {power}")
            e = e + sympy.Symbol(names[-1], real=True) * time**power
        source.append(e)
    return replace(compiled, source=tuple(source), parameters=tuple(names))


def _function(arguments: list[Any], values: list[Any]) -> Callable[..., Sequence[Any]]:
    # Made from the tree; symbols get names of SymPy's own, so that a channel's name is never code.
    made: Callable[..., Sequence[Any]] = sympy.lambdify(
        arguments, values, modules="numpy", cse=True, dummify=True
    )
    return made


def _largest(*given: Any) -> Any:
    return reduce(lambda a, b: (a + b + sympy.Abs(a - b)) / 2, given)


def _least(*given: Any) -> Any:
    return reduce(lambda a, b: (a + b - sympy.Abs(a - b)) / 2, given)


def _split(symbol: Any) -> tuple[str, int]:
    name = str(symbol)
    base = name.rstrip("'")
    return base, len(name) - len(base)


def _top(expressions: Sequence[Any], signal: str) -> int:
    """Highest derivative of a signal, -1 where it does not occur."""
    found = (_split(s) for e in expressions for s in e.free_symbols)
    return max((k for base, k in found if base == signal), default=-1)


def _solved(equations: list[Any], unknown: list[Any]) -> dict[Any, Any]:
    """The unknowns of square equations, linear in them or with one solution."""
    found: dict[Any, Any] = {}
    # What is a plain function of the states goes first, so that it may stand in the rest in any form.
    for z in [z for z in unknown if _split(z)[1] == 0]:
        for e in equations:
            slope = sympy.diff(e, z)
            if slope != 0 and not (slope.free_symbols | e.subs(z, 0).free_symbols) & set(unknown):
                value = -e.subs(z, 0) / slope
                equations = [one.subs(z, value) for one in equations if one is not e]
                found = {name: one.subs(z, value) for name, one in found.items()} | {z: value}
                break
    left = [z for z in unknown if z not in found]
    return found | (_linear(equations, left) if left else {})


def _linear(equations: list[Any], left: list[Any]) -> dict[Any, Any]:
    names = ", ".join(map(str, left))
    try:
        solutions = [dict(zip(left, one, strict=True)) for one in sympy.linsolve(equations, left)]
    except NonlinearError:
        try:
            # SymPy's own test of solutions simplifies them, which takes minutes where sizes |x| occur.
            solutions = sympy.solve(equations, left, dict=True, check=False, simplify=False)
        except NotImplementedError:
            solutions = []
        solutions = [
            one
            for one in solutions
            if not any(value.is_real is False or value.has(sympy.I) for value in one.values())
            and _solves(one, equations)
        ]
        if len(solutions) != 1:
            raise SpecError(
                f"simulating: the equations are not linear in the highest derivatives {names}, and SymPy "
                f"finds {len(solutions) or 'no'} solution(s) for them where one is needed; write the "
                "equation solved for them"
            ) from None
    if not solutions or any(set(left) & value.free_symbols for value in solutions[0].values()):
        raise SpecError(
            f"simulating: the equations do not determine the highest derivatives {names}; each signal needs "
            "an equation with its highest derivative, and measured ones are functions of these (y = v + w)"
        )
    return dict(solutions[0])


def _solves(solution: dict[Any, Any], equations: list[Any]) -> bool:
    """Whether the equations hold with a solution, at some values of what it depends on."""
    free = sorted(set().union(*(e.free_symbols for e in equations)) - set(solution), key=str)
    values = {s: sympy.Float(0.3 + 0.1 * math.sqrt(k + 2)) for k, s in enumerate(free)}
    try:
        numbers = {name: sympy.N(value.subs(values)) for name, value in solution.items()}
    except TypeError:  # a case of it, x < 0, compares a complex number
        return False
    left = [sympy.N(e.subs(values).subs(numbers)) for e in equations]
    return all(e.is_number and abs(complex(e)) < ROUNDING for e in left)


def _without_slopes(
    x: list[Any], f: list[Any], g: list[Any], inputs: tuple[str, ...]
) -> tuple[list[Any], list[Any]]:
    """Take derivatives of inputs out of the right sides, where that goes.

    A rate f_i = … + β(u)u⁽ᵏ⁾ becomes one without it for the state x_i − B, dB/du⁽ᵏ⁻¹⁾ = β: held inputs have
    no derivatives, and smooth ones none as good as themselves.
    """
    first = f, g
    for _ in range(CHANGES):
        k, name = max(((_top(f, name), name) for name in inputs), default=(0, ""))
        if k < 1:
            return f, g
        at = next(i for i, e in enumerate(f) if e.has(jet(name, k)))
        slope = sympy.simplify(sympy.diff(f[at], jet(name, k)))
        below = {jet(name, j) for j in range(k)}
        if slope.free_symbols & {*x, time, jet(name, k)}:
            return first
        if not all(_split(s)[0] not in inputs or s in below for s in slope.free_symbols):
            return first
        moved = sympy.integrate(slope, jet(name, k - 1))
        flow = sum(sympy.diff(moved, jet(name, j)) * jet(name, j + 1) for j in range(k))
        f = [sympy.expand(e - flow) if i == at else e for i, e in enumerate(f)]
        f, g = ([e.subs(x[at], x[at] + moved) for e in side] for side in (f, g))
        f = [sympy.expand(e) if e.has(jet(name, k)) else e for e in f]
    return first
