"""State-space matrices to equations in outputs and inputs."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from functools import lru_cache, reduce
from math import isfinite

import numpy as np
import sympy
from numpy.typing import NDArray

from ...errors import SpecError
from ...language.parser import expression
from ...models.free import Free
from ..matrices import Entry, Matrix
from .compiled import jet
from .jets import Moving
from .meaning import meaning, number, parameter
from .system import System

__all__ = ["derivatives", "numbers", "polynomials", "system_of"]

OFF = 1e-12  # of the way from a bound without a value to the start: a size that no record tells from none
_NO_VALUE = (sympy.zoo, sympy.nan, sympy.oo, -sympy.oo)

Params = Sequence[tuple[str, float | Free]]  # held at a number, or free within bounds


def numbers(matrix: Matrix, params: Params, given: Mapping[str, float]) -> NDArray[np.float64]:
    """A matrix with numbers for its parameters.

    Parameters
    ----------
    matrix : tuple of tuple
    params : sequence of (str, float or Free)
    given : mapping of str to float
        What is not held.

    Raises
    ------
    SpecError
        An entry without a finite value at these numbers.
    """
    values: dict[sympy.Symbol, sympy.Float] = {}
    entries = []
    for entry in _entries(matrix, params):
        if isinstance(entry, sympy.Expr):
            values = values or {parameter(name): sympy.Float(value, 17) for name, value in given.items()}
            try:
                entries.append(float(entry.xreplace(values)))
            except TypeError:
                entries.append(np.nan)
        else:
            entries.append(given.get(entry, np.nan) if isinstance(entry, str) else entry)
    if not np.all(np.isfinite(entries)):
        raise SpecError(f"StateSpace.model: an entry has no finite value at {dict(given)}")
    return np.array(entries, dtype=np.float64).reshape(len(matrix), len(matrix[0]))


@lru_cache(128)
def _entries(matrix: Matrix, params: Params) -> tuple[float | str | sympy.Expr, ...]:
    """Entries row after row: numbers, names of parameters that stand alone, and expressions."""
    return tuple([
        float(entry) if entry.is_Rational or entry.is_Float else entry.name if entry.is_Symbol else entry
        for entry in _symbolic(matrix, params)
    ])  # fmt: skip


def derivatives(matrix: Matrix, params: Params, given: Mapping[str, float]) -> NDArray[np.float64]:
    """Derivatives of a matrix to each of the parameters in `given`, at their values.

    Parameters
    ----------
    matrix, params, given
        As in `numbers`.

    Returns
    -------
    ndarray, shape (parameter, row, column)
    """
    values = {parameter(name): sympy.Float(value, 17) for name, value in given.items()}
    made = _symbolic(matrix, params)
    found = [[float(entry.diff(symbol).xreplace(values)) for entry in made] for symbol in values]
    return np.array(found).reshape(len(values), *made.shape)


def polynomials(
    a: sympy.Matrix, b: sympy.Matrix, c: sympy.Matrix, d: sympy.Matrix
) -> tuple[list[sympy.Expr], list[list[sympy.Expr]]]:
    """det(sI − A), and C adj(sI − A) B + D det(sI − A) of one output, by Faddeev and LeVerrier.

    Returns
    -------
    den : list of Expr
        Descending powers, the first is 1.
    num : list of list of Expr
        One per input, descending powers, as long as `den`.
    """
    n = a.shape[0]
    den, adjugate = [sympy.S.One], sympy.eye(n)
    num = [[entry] for entry in d]
    for k in range(1, n + 1):
        product = (a * adjugate).expand()
        den.append(sympy.expand(-product.trace() / k))
        for row, direct, through in zip(num, d, (c * adjugate * b).expand(), strict=True):
            row.append(sympy.expand(through + direct * den[-1]))
        adjugate = product + den[-1] * sympy.eye(n)
    return den, num


def system_of(
    matrices: Sequence[Matrix],
    *,
    states: tuple[str, ...],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    delay: Sequence[Entry],
    params: Params,
    parameters: tuple[str, ...],
) -> System:
    """The equations of a state space, without states where linear algebra eliminates them."""
    a, b, c, d = (_symbolic(matrix, params) for matrix in matrices)
    moving = Moving({*states, *inputs, *outputs})
    late = _symbolic((tuple(delay),), params) if inputs else []
    drives = [moving.delayed(name, h) if h != 0 else name for name, h in zip(inputs, late, strict=True)]
    x = sympy.Matrix([jet(name) for name in states])
    u = sympy.Matrix(len(inputs), 1, [jet(name) for name in drives])
    y = sympy.Matrix([jet(name) for name in outputs])
    source = [left - right for left, right in zip(_prime(x), a * x + b * u, strict=True)]
    source += [left - right for left, right in zip(y, c * x + d * u, strict=True) if left != right]
    hidden = tuple(name for name in states if name not in outputs)
    steps: tuple[str, ...] = ()
    invertible = c.is_square and not c.free_symbols and c.det() != 0
    equations, eliminated = tuple(source), hidden
    if invertible:
        back = c.inv()
        free = y - d * u
        right = c * a * back * free + c * b * u
        equations = tuple(left - one for left, one in zip(_prime(y) - d * _prime(u), right, strict=True))
        eliminated = ()
        steps = (
            "Every state is measured: the state equations are fitted as they stand, with shared parameters.",
        )
    elif len(outputs) == 1:
        den, num = _coprime(*polynomials(a, b, c, d))
        n = len(den) - 1
        equations = (
            sympy.Add(
                *(g * jet(outputs[0], n - k) for k, g in enumerate(den)),
                *(
                    -g * jet(name, n - k)
                    for name, row in zip(drives, num, strict=True)
                    for k, g in enumerate(row)
                ),
            ),
        )
        eliminated = ()
        steps = ("The states were eliminated: det(pI - A) y = (C adj(pI - A) B + D det(pI - A)) u.",)
        if n < len(states):
            steps += (f"Factors that are common to both sides were cancelled; order {n} is left.",)
    return System(
        equations=equations,
        moving=moving,
        outputs=outputs,
        inputs=inputs,
        hidden=eliminated,
        parameters=parameters,
        free={
            name: _valued(name, given, matrices, params) for name, given in params if isinstance(given, Free)
        },
        fixed=_held(params),
        source=tuple(source),
        unmeasured=hidden,
        steps=steps,
    )


def _valued(name: str, given: Free, matrices: Sequence[Matrix], params: Params) -> Free:
    """A parameter whose bounds are off those at which an entry has no value, as 1/lag has none at 0.

    There an equation of the state vanishes, and records without a lag ended in that trap.
    """
    symbol, (low, high) = parameter(name), (given.min, given.max)
    entries = [own for matrix in matrices for own in _symbolic(matrix, params) if symbol in own.free_symbols]

    def lost(end: float) -> bool:
        return isfinite(end) and any([own.subs(symbol, end).has(*_NO_VALUE) for own in entries])

    if not (lost(low) or lost(high)):
        return given
    middle = (low + high) / 2 if isfinite(high - low) else low + 1 if isfinite(low) else high - 1
    inside = middle if given.start in (None, low, high) else given.start
    low = low + OFF * (inside - low) if lost(low) else low
    high = high - OFF * (high - inside) if lost(high) else high
    start = None if given.start is None else min(max(given.start, low), high)
    return Free(start, min=low, max=high, sd=given.sd)


def _held(params: Params) -> dict[str, float]:
    return {name: given for name, given in params if not isinstance(given, Free)}


def _symbolic(matrix: Matrix, params: Params) -> sympy.Matrix:
    held, still = _held(params), Moving(set())
    entries = [
        meaning(expression(entry, "entry of a matrix"), still, fixed=held)
        if isinstance(entry, str)
        else number(entry)
        for row in matrix
        for entry in row
    ]
    return sympy.Matrix(len(matrix), len(matrix[0]), entries)


def _prime(vector: sympy.Matrix) -> sympy.Matrix:
    return vector.applyfunc(lambda s: jet(s.name, 1))


def _coprime(
    den: list[sympy.Expr], num: list[list[sympy.Expr]]
) -> tuple[list[sympy.Expr], list[list[sympy.Expr]]]:
    """Polynomials without what all have in common: states that are not seen, or that nothing drives."""
    s = sympy.Dummy("s")
    rows = [den, *num]
    # With numbers for parameters, which is fast, polynomials have in common what they have in general.
    rng = random.Random(0)
    names = sorted({name for row in rows for g in row for name in g.free_symbols}, key=str)
    point = {name: sympy.Rational(rng.randint(101, 997), 128) for name in names}
    plain = [[g.xreplace(point) for g in row] for row in rows]
    if not num or not all(g.is_Rational for row in plain for g in row):
        return den, num
    if reduce(sympy.gcd, [sympy.Poly(row, s) for row in plain]).degree() < 1:
        return den, num
    polys = [sympy.Poly(row, s) for row in rows]
    common = sympy.Poly(sympy.gcd_list([p.as_expr() for p in polys]), s)
    common = common.monic()
    left = [sympy.cancel(p.as_expr() / common.as_expr()) for p in polys]
    n = len(den) - 1 - common.degree()
    made = [[sympy.factor(sympy.Poly(p, s).coeff_monomial(s**k)) for k in range(n, -1, -1)] for p in left]
    return made[0], made[1:]
