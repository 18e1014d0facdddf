"""Other parameters with the same equations."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from .compiled import Compiled
from .identify import determined
from .meaning import parameter

__all__ = ["flips", "twins", "unwound"]

SEED, STARTS = 20, 40
FURTHEST = 100  # evaluations from a start: those that arrive take some 20, and others go to infinity
SAME = 1e-9  # relative difference of coefficients that rounding leaves
APART = 1e-3  # relative difference of parameters that are others
MOST = 3
TURN = 2 * np.pi
MOST_SIGNS = 10  # parameters, of which every choice of signs is tried


def twins(compiled: Compiled, params: F64) -> list[F64]:
    """Other sets of parameters within their bounds that leave all coefficients what they are, at most three.

    Gauss-Newton iterations from points around `params`. Sets that differ in signs alone are left out, and so
    are those that differ by whole turns of an angle, but for the one within half a turn. There are none where
    the coefficients are linear in the parameters; where they do not determine these, none is sought.
    """
    from scipy.optimize import least_squares

    values, slopes = _functions(compiled)
    if values is None or not np.all(np.isfinite(params)):
        return []
    given, size = values(params), np.where(params == 0, 1.0, np.abs(params))
    scale = np.where(given == 0, 1.0, np.abs(given))
    if np.linalg.matrix_rank(slopes(params) / scale[:, None] * size, tol=SAME) < params.size:
        return []
    rng = np.random.default_rng(SEED)
    low, high = _bounds(compiled)
    least = _unwound(values, params, low, high)
    found = [] if least is None else [least]
    for _ in range(STARTS):
        start = params * np.exp(rng.normal(size=params.size)) * rng.choice([1.0, 1.0, -1.0], params.size)
        start = np.clip(start, low, high)
        try:
            ended = least_squares(
                lambda x: (values(x * size) - given) / scale,
                start / size,
                lambda x: slopes(x * size) / scale[:, None] * size,
                method="lm" if given.size >= params.size else "trf",
                xtol=1e-15,
                ftol=1e-15,
                gtol=1e-15,
                max_nfev=FURTHEST,
            )
        except (ValueError, FloatingPointError):  # a start at which a coefficient has no value
            continue
        other = ended.x * size
        if np.all(np.isfinite(other)) and (least := _unwound(values, other, low, high)) is not None:
            other = least
        others = [params, *found]
        flipped = np.max(np.abs(np.abs(other) - np.abs(params)) / size) < APART
        same = not flipped and np.max(np.abs(ended.fun)) < SAME and np.all((low <= other) & (other <= high))
        if same and all(np.max(np.abs(other - own) / size) > APART for own in others):
            found.append(other)
        if len(found) == MOST:
            break
    return found


def unwound(compiled: Compiled, params: F64) -> F64 | None:
    """The same parameters with angles within half a turn; None where they are, or none is an angle."""
    if not np.any(np.abs(params) > np.pi):
        return None
    values, _ = _functions(compiled)
    return None if values is None else _unwound(values, params, *_bounds(compiled))


def _unwound(values: Any, params: F64, low: F64, high: F64) -> F64 | None:
    """The same parameters less whole turns, of those beyond half a turn by which they change nothing."""
    other, given = params.copy(), values(params)
    for k in np.flatnonzero(np.abs(params) > np.pi).tolist():
        less = other.copy()
        less[k] -= TURN * np.round(other[k] / TURN)
        same = np.allclose(values(less), given, rtol=SAME, atol=0.0)
        if same and low[k] <= less[k] <= high[k]:
            other = less
    return None if np.array_equal(other, params) else other


def flips(compiled: Compiled, params: F64) -> list[F64]:
    """The signs, factors of 1 and -1, that leave all coefficients what they are beside those of `params`."""
    names = [parameter(name) for name in compiled.parameters]
    own = determined(compiled)
    if not (0 < len(names) <= MOST_SIGNS) or not own or not np.all(np.isfinite(params)):
        return []
    signs = np.array(list(product((1.0, -1.0), repeat=len(names))))
    with np.errstate(all="ignore"):
        found = sympy.lambdify(names, own, "numpy")(*(signs * params).T)
        given = np.array([np.broadcast_to(np.asarray(value, dtype=float), len(signs)) for value in found])
        same = np.all(np.abs(given - given[:, :1]) <= SAME * np.abs(given[:, :1]), axis=0)
    told = np.all((signs > 0) | (params != 0), axis=1)
    return [own for own in signs[1:][same[1:] & told[1:]]]


def _bounds(compiled: Compiled) -> tuple[F64, F64]:
    free = [compiled.free.get(name) for name in compiled.parameters]
    low = [-np.inf if own is None else own.min for own in free]
    high = [np.inf if own is None else own.max for own in free]
    return np.array(low, dtype=float), np.array(high, dtype=float)


def _functions(compiled: Compiled) -> tuple[Any, Any]:
    """What a record determines as a function of the parameters, and its slopes; none where it is linear."""
    names = [parameter(name) for name in compiled.parameters]
    own = determined(compiled)
    matrix = sympy.Matrix([[sympy.diff(g, name) for name in names] for g in own])
    if not names or not matrix.free_symbols:
        return None, None
    value, slope = (sympy.lambdify([names], expr, "numpy") for expr in (sympy.Matrix(own), matrix))

    def at(function: Any, x: F64, shape: tuple[int, ...]) -> F64:
        with np.errstate(all="ignore"):  # what has no value there is no number, and a search ends
            return np.asarray(function(x), dtype=float).reshape(shape)

    return (
        lambda x: at(value, x, (len(own),)),
        lambda x: at(slope, x, (len(own), len(names))),
    )
