"""An equation as a sum of derivatives Σ p^k E_k, with products F p^k E for what has no such form."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import factorial

import sympy

from .compiled import jet, time
from .integrals import antiderivative
from .jets import Moving, base, order, tidy

__all__ = ["Form", "NotExact", "Piece", "form", "pieces"]

# A term is its derivatives, as sorted (jet, power), and a coefficient that has none of them.
Key = tuple[tuple[sympy.Symbol, int], ...]
Form = dict[Key, sympy.Expr]

MOST_FIRST = 3  # y' z' w' is written by third derivatives


class NotExact(ValueError):
    """No derivative of a signal, nor a product with one.

    Attributes
    ----------
    term : sympy.Expr
        What is at fault.
    cure : str
        What to change, where that is not to measure a derivative.
    """

    def __init__(self, term: sympy.Expr, cure: str = "") -> None:
        super().__init__(term)
        self.term, self.cure = term, cure


@dataclass(frozen=True)
class Piece:
    """factor · p^order signal; coefficients stand in the signal, and None is the factor 1."""

    order: int
    signal: sympy.Expr
    factor: sympy.Expr | None = None


def form(expr: sympy.Expr, moving: Moving) -> Form:
    """Terms of an expression by their derivatives.

    Raises
    ------
    NotExact
        A derivative in a function, or divided by.
    """
    found: dict[Key, list[sympy.Expr]] = defaultdict(list)
    for term in sympy.Add.make_args(tidy(sympy.expand(expr))):
        key, rest = [], sympy.S.One
        for factor in sympy.Mul.make_args(term):
            b, n = factor.as_base_exp()
            if b.is_Symbol and moving.is_channel(b) and order(b) and n.is_Integer and n > 0:
                key.append((b, int(n)))
            elif any(order(s) for s in moving.symbols(factor)):
                raise NotExact(term)
            else:
                rest *= factor
        found[_key(key)].append(rest)
    return _clean({key: sympy.Add(*parts) for key, parts in found.items()})


def pieces(terms: Form, moving: Moving, *, products: bool) -> list[Piece]:
    """An equation as a sum of pieces.

    Parameters
    ----------
    terms : Form
    moving : Moving
    products : bool
        Whether pieces with a factor are allowed; else every term must be a derivative.

    Raises
    ------
    NotExact
        A term that has no such form.

    Notes
    -----
    From the highest derivative down. Those of order N stand in Σ p^k E_k as Σ ∂E_N/∂y_i · y_i^(N), so their
    coefficients are without derivatives and a gradient, whose potential is E_N; what p^N E_N has besides
    is taken off the lower orders. Coefficients that are no gradient are factors.
    """
    left, found = dict(terms), []
    while any(left):
        top = max(order(s) for key in left for s, _ in key)
        slopes: dict[sympy.Symbol, sympy.Expr] = {}
        for key in [key for key in left if any(order(s) == top for s, _ in key)]:
            coefficient = left.pop(key)
            if len(key) == 1 and key[0][1] == 1:
                slopes[key[0][0]] = coefficient
            elif products and all(order(s) == 1 for s, _ in key) and sum(n for _, n in key) <= MOST_FIRST:
                found += _firsts(key, coefficient, moving)
            elif products and [(base(s), order(s), n) for s, n in key] == _first_and_second(key):
                found += _sixth(coefficient, jet(base(key[0][0])))
            else:
                raise NotExact(coefficient * _product(key))
        potential, rest = _potential(slopes, moving)
        for symbol, slope in rest.items():
            if not products:
                raise NotExact(slope * symbol)
            found += [Piece(top, jet(base(symbol)), f) for f in sympy.Add.make_args(slope)]
        if potential != 0:
            found.append(Piece(top, potential))
            _subtract(left, potential, top, moving)
    if left:
        found.append(Piece(0, left[()]))
    return found


def _key(powers: list[tuple[sympy.Symbol, int]]) -> Key:
    return tuple(sorted(powers, key=lambda pair: pair[0].name))


def _product(key: Key) -> sympy.Expr:
    return sympy.Mul(*(s**n for s, n in key))


def _clean(terms: Form) -> Form:
    """Expanded, and without what cancels."""
    clean = {}
    for key, value in terms.items():
        value = tidy(sympy.expand(value))
        divided = value.is_Add and any(b.is_Add and n.is_negative for b, n in _factors(value))
        if not (value == 0 or (divided and sympy.cancel(value) == 0)):
            clean[key] = value
    return clean


def _factors(total: sympy.Expr) -> Iterator[tuple[sympy.Expr, sympy.Expr]]:
    for term in sympy.Add.make_args(total):
        for factor in sympy.Mul.make_args(term):
            yield factor.as_base_exp()


def _potential(
    slopes: dict[sympy.Symbol, sympy.Expr], moving: Moving
) -> tuple[sympy.Expr, dict[sympy.Symbol, sympy.Expr]]:
    """E with ∂E/∂y_i = slopes[y_i^(N)] as far as there is one, and what is left of the slopes."""
    slots: dict[sympy.Expr, dict[sympy.Symbol, sympy.Expr]] = defaultdict(dict)
    rest: dict[sympy.Symbol, sympy.Expr] = defaultdict(lambda: sympy.S.Zero)
    for symbol, slope in slopes.items():
        own = jet(base(symbol))
        for coefficient, monomial in _grouped(slope, own, moving):
            integral = antiderivative(monomial, own)
            if integral is None:
                rest[symbol] += coefficient * monomial
                continue
            scale, unit = _unit(integral, moving)
            slots[unit][symbol] = slots[unit].get(symbol, 0) + coefficient * scale
    potential = sympy.S.Zero
    for unit, weights in slots.items():
        involved = [s for s in unit.free_symbols if moving.is_channel(s)]
        values = list(weights.values())
        shared = len(values) == len(involved) and all(sympy.expand(v - values[0]) == 0 for v in values)
        if shared:
            potential += values[0] * unit
            continue
        for symbol, weight in weights.items():
            rest[symbol] += weight * sympy.diff(unit, jet(base(symbol)))
    return potential, {s: r for s, r in rest.items() if sympy.expand(r) != 0}


def _grouped(slope: sympy.Expr, own: sympy.Symbol, moving: Moving) -> Iterator[tuple[sympy.Expr, sympy.Expr]]:
    """Terms as (parameters, what moves); those of one variable with denominators stay one."""
    terms = sympy.Add.make_args(slope)
    together = [t for t in terms if any(b.is_Add and n.is_negative and b.has(own) for b, n in _factors(t))]
    for term in terms:
        if term not in together:
            yield moving.split(term)
    if together:
        yield sympy.S.One, sympy.Add(*together)


def _unit(expr: sympy.Expr, moving: Moving) -> tuple[sympy.Expr, sympy.Expr]:
    """A potential as scale times a form in which equal ones are equal."""
    if expr.is_Add:
        return sympy.S.One, expr
    return moving.split(expr)


def _firsts(key: Key, coefficient: sympy.Expr, moving: Moving) -> list[Piece]:
    """f y'² = (∬f)'' − (∫f)·y'', and y'z' = ½((yz)'' − y z'' − z y'') and the like with factors."""
    symbols = [jet(base(s)) for s, n in key for _ in range(n)]
    (y, *others), count = symbols, len(symbols)
    alone = {s for s in coefficient.free_symbols if moving.is_moving(s)} <= {y}
    if count == 2 and others == [y] and alone:
        once = antiderivative(coefficient, y)
        twice = None if once is None else antiderivative(sympy.expand(once), y)
        if twice is not None:
            return [Piece(2, twice), *(Piece(2, y, -f) for f in sympy.Add.make_args(sympy.expand(once)))]
    found: list[Piece] = []
    for size in range(count):
        for taken in combinations(range(count), size):
            outside = sympy.Mul(*(symbols[k] for k in taken))
            inside = sympy.Mul(*(symbols[k] for k in range(count) if k not in taken))
            scale = sympy.Rational((-1) ** size, factorial(count))
            for f in sympy.Add.make_args(sympy.expand(scale * coefficient * outside)):
                found.append(Piece(count, inside, f))
    return found


def _first_and_second(key: Key) -> list[tuple[str, int, int]]:
    """What the key of y' y'' holds."""
    return [(base(key[0][0]), k, 1) for k in (1, 2)]


def _sixth(f: sympy.Expr, y: sympy.Symbol) -> list[Piece]:
    """f y' y'' = f p³(y²)/6 - f y p³ y/3."""
    parts = ((f / 6, y**2), (-f * y / 3, y))
    return [
        Piece(3, signal, one) for whole, signal in parts for one in sympy.Add.make_args(sympy.expand(whole))
    ]


def _subtract(left: Form, potential: sympy.Expr, times: int, moving: Moving) -> None:
    """Take off what p^times of a potential has besides its highest derivatives."""
    grown: Form = {(): potential}
    for _ in range(times):
        grown = _derivative(grown, moving)
    for key, value in grown.items():
        if not (len(key) == 1 and order(key[0][0]) == times):
            left[key] = left.get(key, sympy.S.Zero) - value
    clean = _clean(left)
    left.clear()
    left.update(clean)


def _derivative(terms: Form, moving: Moving) -> Form:
    found: Form = defaultdict(lambda: sympy.S.Zero)
    for key, value in terms.items():
        for s in value.free_symbols:
            if not moving.is_moving(s):
                continue
            slope = tidy(sympy.diff(value, s))
            if moving.is_channel(s):
                found[_key([*_less(key, jet(s.name, 1), -1)])] += slope
            else:
                found[key] += slope * (1 if s == time else moving.rate(s))
        for s, n in key:
            risen = moving.rate(s)
            found[_key(_less(_key(_less(key, s, 1)), risen, -1))] += n * value
    return _clean(found)


def _less(key: Key, symbol: sympy.Symbol, count: int) -> list[tuple[sympy.Symbol, int]]:
    """A key with `count` powers of a jet taken off."""
    powers = dict(key)
    powers[symbol] = powers.get(symbol, 0) - count
    return [(s, n) for s, n in powers.items() if n]
