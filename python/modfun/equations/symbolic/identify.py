"""Local identifiability from the coefficients g(θ): the rank of their derivatives."""

from __future__ import annotations

import random
from itertools import groupby

import sympy

from .compiled import Compiled
from .meaning import parameter
from .words import listed

__all__ = ["determined", "identify"]

SEED = 20
TOLERANCE = sympy.Float("1e-25")
DIGITS = 50


def identify(
    compiled: Compiled, lost_before: tuple[str, ...] = ()
) -> tuple[tuple[str, ...], tuple[str, ...], int, tuple[str, ...]]:
    """Which parameters the coefficients of terms determine: the fields of an `Identifiability`.

    Parameters
    ----------
    compiled : Compiled
    lost_before : tuple of str
        Parameters of the model that no term has.

    Notes
    -----
    Ratios of the coefficients of an equation to one of them, and whatever parameters stand in signals, are
    what a record determines. The rank of their derivatives at a random point is the number of combinations
    that can be found; null vectors show what cannot.
    """
    names = [parameter(name) for name in compiled.parameters]
    ratios = determined(compiled)
    points = [_point(names, k) for k in range(2)]
    slopes = [[sympy.diff(g, name) for name in names] for g in ratios]
    spaces = [_null_space(slopes, point, len(names)) for point in points]
    null = min(spaces, key=len)  # a point may be unlucky, and then has more
    gone = {k for vector in null for k, value in enumerate(vector) if value != 0}
    found = tuple(s.name for k, s in enumerate(names) if k not in gone)
    lost = tuple(s.name for k, s in enumerate(names) if k in gone)
    sentences = []
    if lost_before:
        sentences.append(f"{listed(lost_before)}: in no term, so that no record says anything about it.")
    if lost:
        sentences.append(_words(lost, names, spaces, points))
    return found, (*lost, *lost_before), len(names) - len(null), tuple(sentences)


def determined(compiled: Compiled) -> list[sympy.Expr]:
    known = {parameter(name) for name in compiled.parameters}
    ratios: list[sympy.Expr] = []
    for _, group in groupby(compiled.terms, key=lambda term: term.equation):
        terms = list(group)
        scale = next((t.coefficient for t in terms if t.coefficient.is_number), terms[0].coefficient)
        ratios += [t.coefficient / scale for t in terms if not t.coefficient.is_number or scale != 1]
    inside = {
        s
        for t in compiled.terms
        for x in (t.signal, t.factor)
        if x is not None
        for s in x.free_symbols & known
    }
    return [r for r in ratios if r.free_symbols] + sorted(inside, key=lambda s: s.name)


def _point(names: list[sympy.Symbol], k: int) -> dict[sympy.Symbol, sympy.Rational]:
    rng = random.Random(SEED + k)
    return {name: sympy.Rational(rng.randint(101, 997), rng.randint(101, 997)) for name in names}


def _null_space(
    slopes: list[list[sympy.Expr]], point: dict[sympy.Symbol, sympy.Rational], size: int
) -> list[tuple[sympy.Expr, ...]]:
    rows = [[slope.xreplace(point) for slope in row] for row in slopes]
    if not rows:
        return [tuple(sympy.S(int(i == k)) for i in range(size)) for k in range(size)]
    matrix = sympy.Matrix(rows)
    if all(entry.is_Rational for entry in matrix):
        return [tuple(vector) for vector in matrix.nullspace()]
    matrix = matrix.evalf(DIGITS)
    null = matrix.nullspace(iszerofunc=lambda x: abs(x) < TOLERANCE)
    return [tuple(map(_round, vector)) for vector in null]


def _round(x: sympy.Expr) -> sympy.Expr:
    """Whole numbers where only rounding is between."""
    return sympy.Integer(round(x)) if abs(x - round(x)) < TOLERANCE else x


def _words(
    lost: tuple[str, ...],
    names: list[sympy.Symbol],
    spaces: list[list[tuple[sympy.Expr, ...]]],
    points: list[dict[sympy.Symbol, sympy.Rational]],
) -> str:
    """What may change without changing the equations: factors, shifts, or a curve."""
    count = min(map(len, spaces))
    held = "one" if count == 1 else f"{count}"
    cure = f'Hold {held} of them, as params={{"{lost[0]}": 1.0}}, or measure more.'
    if count == 1 and len(spaces[1]) == 1:
        ways = []
        for space, point in zip(spaces, points, strict=True):
            vector = space[0]
            first = next(k for k, value in enumerate(vector) if value != 0)
            shift = [_round(value / vector[first]) for value in vector]
            power = [
                _round(value * point[names[first]] / point[s]) for value, s in zip(shift, names, strict=True)
            ]
            ways.append((shift, power))
        (shift, power), (other_shift, other_power) = ways
        if all(abs(a - b) < TOLERANCE for a, b in zip(power, other_power, strict=True)):
            powers = [
                f"{s.name} by s" + (f"**({n})" if n != 1 else "")
                for s, n in zip(names, power, strict=True)
                if n
            ]
            return f"{listed(lost)}: multiplying {listed(powers)} changes nothing. {cure}"
        if all(abs(a - b) < TOLERANCE for a, b in zip(shift, other_shift, strict=True)):
            shifts = [
                f"{n}*s to {s.name}" if n != 1 else f"s to {s.name}"
                for s, n in zip(names, shift, strict=True)
                if n
            ]
            return f"{listed(lost)}: adding {listed(shifts)} changes nothing. {cure}"
    return (
        f"{listed(lost)}: only {len(lost) - count} combination(s) of these {len(lost)} can be found; they "
        f"may change together without changing the equations. {cure}"
    )
