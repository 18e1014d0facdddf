"""Exponents whose other sign makes the same equations: u^n/(K^n + u^n) is 1 less that of -n."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from .compiled import Compiled, Delayed
from .meaning import parameter

__all__ = ["exponents", "mirrors"]

SEED, POINTS = 20, 64
SAME = 1e-9  # of the terms, that rounding leaves


def exponents(compiled: Compiled) -> list[int]:
    """Positions of parameters that stand in exponents of signals."""
    powers = [p for t in compiled.terms for p in t.signal.atoms(sympy.Pow) if p.base.free_symbols]
    inside = {s for p in powers for s in p.exp.free_symbols}
    return [k for k, name in enumerate(compiled.parameters) if parameter(name) in inside]


def mirrors(compiled: Compiled, params: F64, turned: Sequence[int] | None = None) -> list[F64]:
    """Sets of parameters with the other sign of an exponent that leave all terms what they are.

    `turned`: positions of other parameters whose sign is turned, such as v of c*tanh(w/v), instead.
    What stands in signals besides stays; coefficients change as far as the terms are linear in them. Compared
    are the terms of each derivative at random values of the signals.
    """
    at = exponents(compiled) if turned is None else turned
    if not at or not np.all(np.isfinite(params)):
        return []
    values, linear = _functions(compiled.terms, compiled.parameters)
    low, high = (
        np.array([getattr(compiled.free.get(name), side, other) for name in compiled.parameters])
        for side, other in (("min", -np.inf), ("max", np.inf))
    )
    found = []
    for k in at:
        other = params.copy()
        other[k] *= -1
        with np.errstate(all="ignore"):
            given, columns = values(params), [values(_moved(other, j, 1.0)) for j in linear]
            base = values(_moved(other, linear, 0.0))
            columns = [one - values(_moved(other, j, 0.0)) for one, j in zip(columns, linear, strict=True)]
        matrix = np.array(columns).T.reshape(given.size, len(linear))
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(given - base))):
            continue
        other[linear] = np.linalg.lstsq(matrix, given - base, rcond=1e-12)[0]
        left = np.max(np.abs(matrix @ other[linear] + base - given))
        if left <= SAME * np.max(np.abs(given)) and np.all((low <= other) & (other <= high)):
            found.append(other)
    return found


def _moved(params: F64, at: Any, value: float) -> F64:
    moved = params.copy()
    moved[at] = value
    return moved


@lru_cache(32)
def _functions(terms: tuple[Any, ...], names: tuple[str, ...]) -> tuple[Any, list[int]]:
    """The terms of each equation and derivative at random signals, of the parameters, and the linear ones."""
    theta = [parameter(name) for name in names]
    sums: dict[Any, sympy.Expr] = {}
    for t in terms:
        place = t.equation, t.order, t.factor
        sums[place] = sums.get(place, sympy.S.Zero) + t.coefficient * t.signal
    late = {one: sympy.Dummy() for e in sums.values() for one in e.atoms(Delayed)}
    whole = [e.xreplace(late) for e in sums.values()]
    moving = sorted(set().union(*(e.free_symbols for e in whole)) - set(theta), key=str)
    linear: list[int] = []
    for k, p in enumerate(theta):
        both = [p, *(theta[j] for j in linear)]
        if all(sympy.diff(e, p, q) == 0 for e in whole for q in both):
            linear.append(k)
    made = sympy.lambdify([theta, moving], whole, modules="numpy", cse=True)
    points = np.exp(np.random.default_rng(SEED).normal(size=(len(moving), POINTS)))

    def values(params: F64) -> F64:
        return np.concatenate([np.broadcast_to(one, POINTS) for one in made(params, list(points))])

    return values, linear
