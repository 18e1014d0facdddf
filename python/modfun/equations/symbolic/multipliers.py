"""One equation as pieces: as it stands, times a multiplier that makes it exact, or with products."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import product

import sympy

from ...base.names import series
from .compiled import jet
from .exact import Form, NotExact, Piece, form, pieces
from .integrals import antiderivative
from .jets import Moving
from .words import said

__all__ = ["arrange", "is_freed", "mixing"]

CLEARED = "The equation was multiplied by its denominators, to free signals of parameters."
_POWERS = (0, -1, -2, 1)


def arrange(
    expr: sympy.Expr, moving: Moving, outputs: tuple[str, ...]
) -> tuple[list[Piece], tuple[str, ...]]:
    """Pieces of an equation, and what was done to it in words.

    Parameters
    ----------
    expr : Expr
        Vanishes; in jets, time, parameters and known functions.
    moving : Moving
    outputs : tuple of str
        Signals whose powers are tried as multipliers.

    Raises
    ------
    NotExact
        No way was found; holds the term at fault of the equation as it stands.

    Notes
    -----
    In this order: as it stands; times its denominators, if that takes parameters out of signals; times powers
    of the outputs; with products (Property 2).
    """
    cleared = _clear(expr, moving)
    words: tuple[str, ...] = ()
    terms, plain = _exact(expr, moving)
    if plain is not None and not _has_parameters(plain, moving):
        return plain, ()
    if cleared is not None:
        words = (CLEARED,)
        tidied, found = _exact(cleared, moving)
        if found is not None and (plain is None or not _has_parameters(found, moving)):
            return found, words
        terms = terms if tidied is None else tidied
    if plain is not None:
        return plain, ()
    mixed: tuple[list[Piece], tuple[str, ...]] | None = None
    for multiplier in _multipliers(terms or {}, outputs, moving):
        times = {key: _expanded(multiplier * value, moving) for key, value in (terms or {}).items()}
        found = _pieces(times, moving)
        if found is None:
            continue
        made = found, (*words, _multiplied(multiplier))
        if not _has_parameters(found, moving):
            return made
        mixed = mixed or made
    if mixed is not None:
        return mixed
    found, words = pieces(form(expr, moving), moving, products=True), ()
    if cleared is not None and _mixed_factor(found, moving):
        found, words = pieces(form(cleared, moving), moving, products=True), (CLEARED,)
    if (fault := _mixed_factor(found, moving)) is not None:
        term = fault.factor * jet(str(fault.signal), fault.order)
        names = sorted(s.name for s in moving.parameters(moving.split(fault.factor)[1]))
        raise NotExact(
            term, f"hold {series(names)} at a number, params={{...}}: a factor has no parameters inside"
        )
    return found, (
        *words,
        "No multiplier was found that makes every term the derivative of a signal: products of a signal and "
        "a derivative are left, which are convolutions in the harmonic index (Property 2) and amplify noise.",
    )


def mixing(term: sympy.Expr, moving: Moving) -> list[tuple[sympy.Expr, sympy.Expr]]:
    """Denominators of a term that mix parameters and signals, and their powers."""
    factors = [factor.as_base_exp() for factor in sympy.Mul.make_args(term)]
    return [
        (b, n)
        for b, n in factors
        if b.is_Add and n.is_Integer and n.is_negative and moving.symbols(b) and moving.parameters(b)
    ]


def is_freed(expr: sympy.Expr, moving: Moving, outputs: tuple[str, ...]) -> bool:
    """Whether an equation is arranged as derivatives of signals without parameters inside."""
    try:
        found, _ = arrange(expr, moving, outputs)
    except NotExact:
        return False
    return all(piece.factor is None for piece in found) and not _has_parameters(found, moving)


def _clear(expr: sympy.Expr, moving: Moving) -> sympy.Expr | None:
    """An equation times the denominators that mix parameters and signals; None: there are none."""
    terms = sympy.Add.make_args(sympy.expand(expr))
    most: dict[sympy.Expr, sympy.Expr] = {}
    for term in terms:
        for b, n in mixing(term, moving):
            most[b] = max(most.get(b, sympy.S.Zero), -n)
    common = sympy.Mul(*(b**n for b, n in most.items()))
    return sympy.Add(*(sympy.expand(term * common) for term in terms)) if most else None


def _exact(expr: sympy.Expr, moving: Moving) -> tuple[Form | None, list[Piece] | None]:
    """Terms of an equation and, if all are exact, its pieces."""
    try:
        terms = form(expr, moving)
    except NotExact:
        return None, None
    return terms, _pieces(terms, moving)


def _pieces(terms: Form, moving: Moving) -> list[Piece] | None:
    try:
        return pieces(terms, moving, products=False)
    except NotExact:
        return None


def _multiplied(multiplier: sympy.Expr) -> str:
    step = f"Multiplied by {said(multiplier)}, every term is the derivative of a signal."
    if zeros := sorted(said(b) for b, n in multiplier.as_powers_dict().items() if n.is_negative):
        step += f" That takes a record in which {series(zeros)} stays away from 0."
    return step


def _expanded(expr: sympy.Expr, moving: Moving) -> sympy.Expr:
    """A coefficient as a sum; where denominators have parameters, of partial fractions."""
    below = sympy.denom(expr)
    symbols = moving.symbols(below)
    if len(symbols) == 1 and any(b.is_Add and moving.parameters(b) for b in below.as_powers_dict()):
        with suppress(sympy.PolynomialError):
            return sympy.apart(sympy.cancel(expr), symbols[0])
    return sympy.expand(expr)


def _multipliers(terms: Form, outputs: tuple[str, ...], moving: Moving) -> Iterator[sympy.Expr]:
    """Those the derivatives of second order ask for, then products of powers of the signals."""
    used = {s for f in terms.values() for s in f.free_symbols}
    involved = [name for name in outputs if jet(name) in used]
    for name in involved:
        if (solved := _solved(terms, jet(name), moving)) is not None:
            yield solved
    for powers in product(_POWERS, repeat=min(len(involved), 2)):
        if any(powers):
            yield sympy.Mul(*(jet(name) ** n for name, n in zip(involved, powers, strict=False)))


def _solved(terms: Form, y: sympy.Symbol, moving: Moving) -> sympy.Expr | None:
    """μ(y) with (μ h)' = μ q for the terms h y'' + q y'²: what makes them one second derivative."""
    h = terms.get(((jet(y.name, 2), 1),))
    q = terms.get(((jet(y.name, 1), 2),), sympy.S.Zero)
    if h is None:
        return None
    ratio = sympy.cancel((q - sympy.diff(h, y)) / h)
    if ratio == 0 or {s for s in ratio.free_symbols if moving.is_moving(s)} - {y}:
        return None
    if (slope := sympy.diff(h, y)) != 0 and (power := sympy.cancel(ratio * h / slope)).is_Rational:
        return sympy.factor(h) ** power
    integral = None if moving.parameters(ratio) else antiderivative(sympy.expand(ratio), y)
    return None if integral is None else sympy.powsimp(sympy.exp(integral))


def _mixed_factor(found: list[Piece], moving: Moving) -> Piece | None:
    """A piece whose factor holds a parameter in a function of signals."""
    factors = ((piece, piece.factor) for piece in found if piece.factor is not None)
    return next((piece for piece, factor in factors if moving.parameters(moving.split(factor)[1])), None)


def _has_parameters(found: list[Piece], moving: Moving) -> bool:
    """Whether a signal cannot be evaluated before the parameters are known."""
    return any(
        moving.parameters(moving.split(term)[1])
        for piece in found
        for term in sympy.Add.make_args(sympy.expand(piece.signal))
    )
