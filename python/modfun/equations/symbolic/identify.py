"""Local identifiability: which small changes of parameters leave what equations say as it is."""

from __future__ import annotations

import random
from itertools import groupby

import numpy as np
import sympy

from ...base.names import series
from .compiled import Compiled
from .meaning import parameter
from .mirrors import exponents, mirrors

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
    Equations M(p; θ) of signals say the same as (I + X(p)) M for any small polynomial matrix X: a multiple of
    an equation or of its derivatives may be added to another. What a record cannot tell at a random point are
    the changes δθ of which ∂M/∂θ δθ = X M for some X, and that move no parameter inside a signal.
    """
    names = [parameter(name) for name in compiled.parameters]
    points = [_point(names, k) for k in range(2)]
    changes = [_changes(compiled, name) for name in names]
    spaces = [_null_space(compiled, changes, point) for point in points]
    null = min(spaces, key=len)  # a point may be unlucky, and then has more
    gone = {k for vector in null for k, value in enumerate(vector) if value != 0}
    found = tuple(s.name for k, s in enumerate(names) if k not in gone)
    lost = tuple(s.name for k, s in enumerate(names) if k in gone)
    sentences = []
    if lost_before:
        sentences.append(f"{series(lost_before)}: in no term, so that no record says anything about it.")
    if lost:
        sentences.append(_words(lost, names, spaces, points))
    at = np.array([float(points[0][name]) for name in names])
    for other in [] if lost else mirrors(compiled, at):
        turned = next(names[k].name for k in exponents(compiled) if other[k] != at[k])
        more = [s.name for s, new, old in zip(names, other, at, strict=True) if abs(new - old) > 1e-9 * old]
        sentences.append(
            f"{turned}: its other sign makes the same equations with other values of "
            f"{series([name for name in more if name != turned])}. To choose one, "
            f"params={{{turned!r}: mf.Free(min=0)}}."
        )
    return found, (*lost, *lost_before), len(names) - len(null), tuple(sentences)


def determined(compiled: Compiled) -> list[sympy.Expr]:
    ratios: list[sympy.Expr] = []
    for _, group in groupby(compiled.terms, key=lambda term: term.equation):
        terms = list(group)
        scale = next((t.coefficient for t in terms if t.coefficient.is_number), terms[0].coefficient)
        ratios += [t.coefficient / scale for t in terms if not t.coefficient.is_number or scale != 1]
    return [r for r in ratios if r.free_symbols] + _inside(compiled)


def _inside(compiled: Compiled) -> list[sympy.Symbol]:
    """Parameters inside signals."""
    known = {parameter(name) for name in compiled.parameters}
    parts = [x for t in compiled.terms for x in (t.signal, t.factor) if x is not None]
    return sorted({s for x in parts for s in x.free_symbols & known}, key=lambda s: s.name)


# Of each (equation, signal, factor, derivatives) a coefficient.
Cells = dict[tuple[int, sympy.Expr, sympy.Expr | None, int], sympy.Expr]


def _cells(compiled: Compiled) -> Cells:
    found: Cells = {}
    for x in compiled.terms:
        place = (x.equation, x.signal, x.factor, x.order)
        found[place] = found.get(place, sympy.S.Zero) + x.coefficient
    return found


def _changes(compiled: Compiled, name: sympy.Symbol) -> Cells:
    """Derivatives of the coefficients to a parameter."""
    slopes = {place: sympy.diff(g, name) for place, g in _cells(compiled).items()}
    return {place: slope for place, slope in slopes.items() if slope != 0}


def _multiples(compiled: Compiled) -> list[Cells]:
    """Each equation and its derivatives in the place of every equation: what X may be made of."""
    cells, most = _cells(compiled), max(compiled.orders)
    products = {e for e, _, factor, _ in cells if factor is not None}
    made: list[Cells] = []
    for one in range(len(compiled.orders)):
        # A derivative of F p^k E is no term of this kind.
        for more in range(1 if one in products else most + 1):
            rows = {
                (signal, factor, order + more): g
                for (e, signal, factor, order), g in cells.items()
                if e == one and not (more and signal.is_number)  # derivatives of a constant are 0
            }
            made += [
                {(other, *place): g for place, g in rows.items()} for other in range(len(compiled.orders))
            ]
    return made


def _point(names: list[sympy.Symbol], k: int) -> dict[sympy.Symbol, sympy.Rational]:
    rng = random.Random(SEED + k)
    return {name: sympy.Rational(rng.randint(101, 997), rng.randint(101, 997)) for name in names}


def _null_space(
    compiled: Compiled, changes: list[Cells], point: dict[sympy.Symbol, sympy.Rational]
) -> list[tuple[sympy.Expr, ...]]:
    """Changes of the parameters that make the same as multiples of the equations."""
    columns = [*changes, *_multiples(compiled)]
    places = list(dict.fromkeys(place for column in columns for place in column))
    rows = [[column.get(place, sympy.S.Zero).xreplace(point) for column in columns] for place in places]
    names = [parameter(name) for name in compiled.parameters]
    still = [
        [sympy.S(int(k == names.index(name))) for k in range(len(columns))] for name in _inside(compiled)
    ]
    null = _null(
        sympy.Matrix(len(places) + len(still), len(columns), [x for row in rows + still for x in row])
    )
    # Without the multiples some are sums of others, or nothing.
    cut = [vector[: len(changes)] for vector in null]
    return _independent(cut, len(changes))


def _null(matrix: sympy.Matrix) -> list[list[sympy.Expr]]:
    if all(entry.is_Rational for entry in matrix):
        return [list(vector) for vector in matrix.to_DM().to_field().nullspace().to_Matrix().tolist()]
    found = matrix.evalf(DIGITS).nullspace(iszerofunc=_is_zero)
    return [list(vector) for vector in found]


def _independent(vectors: list[list[sympy.Expr]], size: int) -> list[tuple[sympy.Expr, ...]]:
    reduced, pivots = sympy.Matrix(len(vectors), size, [x for row in vectors for x in row]).rref(
        iszerofunc=_is_zero
    )
    return [tuple(map(_round, reduced.row(k))) for k in range(len(pivots))]


def _is_zero(x: sympy.Expr) -> bool:
    return bool(x == 0 if x.is_Rational else abs(x) < TOLERANCE)


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
            return f"{series(lost)}: multiplying {series(powers)} changes nothing. {cure}"
        if all(abs(a - b) < TOLERANCE for a, b in zip(shift, other_shift, strict=True)):
            shifts = [
                f"{n}*s to {s.name}" if n != 1 else f"s to {s.name}"
                for s, n in zip(names, shift, strict=True)
                if n
            ]
            return f"{series(lost)}: adding {series(shifts)} changes nothing. {cure}"
    return (
        f"{series(lost)}: only {len(lost) - count} combination(s) of these {len(lost)} can be found; they "
        f"may change together without changing the equations. {cure}"
    )
