"""Elimination of signals that are not measured: differentiate, solve for their derivatives, substitute."""

from __future__ import annotations

import random
from time import monotonic

import sympy

from .compiled import jet, time
from .jets import Moving, base, order
from .words import said

__all__ = ["NotEliminated", "TooHard", "eliminate"]

MOST_SECONDS = 5.0
MOST_TERMS = 5_000  # of a product before it is expanded; what succeeds has fewer than 100
MOST_OPERATIONS = 2_000  # of what is factored
MOST_DEGREE = 4  # of a resultant


class NotEliminated(ValueError):
    """A hidden signal that cannot be eliminated; the text says which and why."""


class TooHard(NotEliminated):
    """One that other algorithms may eliminate."""


def eliminate(
    equations: tuple[sympy.Expr, ...], hidden: tuple[str, ...], moving: Moving
) -> tuple[tuple[sympy.Expr, ...], tuple[str, ...]]:
    """Equations without the hidden signals, and what was done in words.

    Parameters
    ----------
    equations : tuple of Expr
        Each vanishes.
    hidden : tuple of str
    moving : Moving

    Returns
    -------
    equations : tuple of Expr
        One fewer a hidden signal.
    steps : tuple of str

    Raises
    ------
    NotEliminated
        Too few equations, functions of hidden signals that cannot be solved for, or too much to compute.

    Notes
    -----
    Signal by signal. The equation in which it has the lowest derivative, and that most simply, is
    differentiated until the two have derivatives of equal order, solved for the highest and put into each of
    the others; these steps repeat, as in Euclid's algorithm, until it is gone. Where no equation is linear in
    the highest derivative a resultant takes their place. Factors without the highest derivative of what
    remains vanish on no motion in general and are dropped.
    """
    left: list[sympy.Expr] = list(equations)
    steps: list[str] = []
    until = monotonic() + MOST_SECONDS
    changes = dict(_unrooted(left, _undelayed(left, z, moving), moving) for z in hidden)
    names = list(changes)
    while names:
        chosen = [(_cost(f, z, moving), z, k) for z in names for k, f in enumerate(left) if _order(f, z) >= 0]
        if not chosen:
            break
        _, z, k = min(chosen, key=lambda one: one[0])
        pivot = left.pop(k)
        if not any(_order(f, z) >= 0 for f in left):
            raise NotEliminated(
                f"{z} is not measured and stands in one equation only, which says nothing without it; "
                "leave that equation out, or measure it"
            )
        left = [f if _order(f, z) < 0 else _without(pivot, f, z, moving, until) for f in left]
        names.remove(z)
        steps.append(
            f"{changes[z]}{z} is not measured: it was eliminated by {said(moving.public(pivot))} = 0"
            + (", differentiated as often as it takes." if any(_rises(f, pivot) for f in left) else ".")
        )
    return tuple(left), tuple(steps)


def _order(f: sympy.Expr, z: str) -> int:
    """Highest derivative of a signal in an equation; -1: none."""
    return max((order(s) for s in f.free_symbols if base(s) == z), default=-1)


def _rises(f: sympy.Expr, pivot: sympy.Expr) -> bool:
    highest = [max((order(s) for s in x.free_symbols), default=0) for x in (f, pivot)]
    return highest[0] > highest[1]


def _cost(f: sympy.Expr, z: str, moving: Moving) -> tuple[int, ...]:
    """How hard it is to solve an equation for its highest derivative of z."""
    top = jet(z, _order(f, z))
    slope = sympy.diff(f, top)
    return (
        _order(f, z),
        int(slope.has(top)),
        len(moving.symbols(slope)),
        int(sympy.count_ops(f)),
    )


def _without(f: sympy.Expr, g: sympy.Expr, z: str, moving: Moving, until: float) -> sympy.Expr:
    """What f and g say without z."""
    while True:
        low, high = _order(f, z), _order(g, z)
        if min(low, high) < 0:
            return _simple(f if low < 0 else g, moving)
        if monotonic() > until:
            raise _too_large(z)
        if low > high or (low == high and _degree(f, z, low) > _degree(g, z, high)):
            f, g, low, high = g, f, high, low
        top = jet(z, high)
        risen = moving.derivative(f, high - low)
        slope = sympy.diff(risen, top)
        if not slope.has(top):
            rest = sympy.expand(risen - slope * top)
            if _terms_after(g, top, rest, slope) > MOST_TERMS:
                raise _too_large(z)
            g = _numerator(g.xreplace({top: -rest / slope}))
        else:
            degrees = _degree(f, z, low), _degree(g, z, high)
            if not all(0 < d <= MOST_DEGREE for d in degrees):
                raise TooHard(
                    f"{z} is not measured, and no equation can be solved for {top}: {said(f)} = 0; measure it"
                )
            if _terms(f) ** degrees[1] * _terms(g) ** degrees[0] > MOST_TERMS:
                raise _too_large(z)
            f, g = sympy.expand(sympy.resultant(f, g, top)), f
        if g == 0 or f == 0:
            raise NotEliminated(
                f"{z} is not measured, and two equations say the same about it; leave one out"
            )


def _terms_after(g: sympy.Expr, top: sympy.Symbol, rest: sympy.Expr, slope: sympy.Expr) -> int:
    """Terms of g, at most, once top = -rest/slope was put into it; SymPy cannot be stopped inside a step."""
    degree = int(sympy.degree(g, top)) if g.is_polynomial(top) else 1
    return int(_terms(g) * max(_terms(rest), _terms(slope)) ** degree)


def _terms(f: sympy.Expr) -> int:
    return len(sympy.Add.make_args(sympy.expand(f)))


def _too_large(z: str) -> TooHard:
    return TooHard(
        f"{z} is not measured, and eliminating it grows beyond what is tried ({MOST_SECONDS:.0f} s, "
        f"{MOST_TERMS} terms); measure it, or hold parameters at numbers"
    )


def _undelayed(equations: list[sympy.Expr], z: str, moving: Moving) -> str:
    """Name by which z stands in all equations, once those in which it is not delayed are delayed."""
    names = {base(s) for f in equations for s in f.free_symbols}
    own = [name for name in names if name in moving.delays and moving.delays[name][0] == z]
    if not own:
        return z
    name, late = own[0], moving.delays[own[0]][1]
    for k, f in enumerate(equations):
        if _order(f, z) < 0:
            continue
        others = {base(s) for s in f.free_symbols}
        if len(own) > 1 or others & {*moving.delays, *moving.known}:
            raise NotEliminated(f"{z} is not measured and stands at several times at once; measure it")
        put = {s: jet(moving.delayed(base(s), late), order(s)) for s in moving.symbols(f)}
        equations[k] = f.xreplace({**put, time: time - late})
    return name


def _unrooted(equations: list[sympy.Expr], z: str, moving: Moving) -> tuple[str, str]:
    """Name of the unknown, sqrt(z), log(z) or exp(z) where z stands in one of these, and what was done."""
    y = jet(z)
    ways = ((sympy.sqrt(y), lambda w: w**2), (sympy.log(y), sympy.exp), (sympy.exp(y), sympy.log))
    for function, inverse in ways:
        if not any(f.has(function) for f in equations):
            continue
        own = said(function)
        moving.channels.add(own)
        w = jet(own)
        for k, f in enumerate(equations):
            if _order(f, z) >= 0:
                put = {jet(z, n): moving.derivative(inverse(w), n) for n in range(_order(f, z) + 1)}
                equations[k] = sympy.expand(f.subs(function, w).xreplace(put))
        return own, f"In place of {z}, which is not measured, {own} is the unknown. "
    return z, ""


def _degree(f: sympy.Expr, z: str, at: int) -> int:
    """Degree in z^(at); -1: no polynomial."""
    return int(sympy.degree(f, jet(z, at))) if f.is_polynomial(jet(z, at)) else -1


def _numerator(expr: sympy.Expr) -> sympy.Expr:
    return sympy.expand(sympy.fraction(sympy.together(expr))[0])


def _simple(f: sympy.Expr, moving: Moving) -> sympy.Expr:
    """Without the factors that have not its highest derivative."""
    whole = sympy.factor_terms(_numerator(f))
    numerator = sympy.Mul(*(b for b in sympy.Mul.make_args(whole) if moving.symbols(b)))
    symbols = moving.symbols(numerator)
    highest = max((order(s) for s in symbols), default=0)
    if sympy.count_ops(numerator) > MOST_OPERATIONS or not numerator.is_polynomial(*symbols):
        return sympy.expand(numerator)
    # With numbers for parameters, which is fast, a polynomial has as many factors as it has in general.
    rng = random.Random(0)
    numbers = {s: sympy.Integer(rng.randint(10, 99)) for s in sorted(moving.parameters(numerator), key=str)}
    if _count(sympy.factor_list(numerator.xreplace(numbers))[1]) <= 1:
        return sympy.expand(numerator)
    factors = [
        factor
        for factor, _ in sympy.factor_list(numerator)[1]
        if any(order(s) == highest for s in moving.symbols(factor))
    ]
    return sympy.expand(factors[0] if len(factors) == 1 else numerator)


def _count(factors: list[tuple[sympy.Expr, int]]) -> int:
    return sum(power for _, power in factors)
