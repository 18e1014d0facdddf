"""Logarithms that integration made, of what is negative in a record: log(-x) has the derivative of log(x)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from .compiled import Compiled
from .meaning import parameter

__all__ = ["side", "sided"]


def sided(
    exprs: Sequence[sympy.Expr], compiled: Compiled, channels: set[sympy.Symbol], own: set[sympy.Symbol]
) -> tuple[list[sympy.Expr], dict[sympy.Symbol, sympy.Expr]]:
    """Expressions in which log(x) is log(s x), and of each symbol s, 1 or -1, the x whose sign it has.

    A logarithm that the user wrote is left: there a negative argument is a fault of the record. So is one
    with a parameter that has no start inside, of which nobody knows on which side of zero it lies. Where x
    changes its sign in a record the logarithm has no value still: nothing can be integrated across that.

    Parameters
    ----------
    exprs : sequence of Expr
        Derived already: the derivatives of both logarithms are the same.
    compiled : Compiled
    channels, own : set of Symbol
        All that stand in them, and those of which each record has its own.
    """
    if not compiled.source:
        return list(exprs), {}
    written = set().union(*(expr.atoms(sympy.log) for expr in compiled.source))
    # Expressions: a logarithm of a parameter alone, as K**n makes one, would otherwise become a bare float.
    starts = {
        parameter(name): sympy.Float(given.start)
        for name, given in compiled.free.items()
        if given.start is not None
    }
    found: dict[sympy.Symbol, sympy.Expr] = {}
    put: dict[sympy.Expr, sympy.Expr] = {}
    for one in sorted(set().union(*(expr.atoms(sympy.log) for expr in exprs)) - written, key=str):
        x = one.args[0].xreplace(starts)
        if x.free_symbols <= channels and x.free_symbols & own:
            s = sympy.Symbol(f"side {len(found)}", real=True)
            found[s], put[one] = x, sympy.log(s * one.args[0])
    return [expr.xreplace(put) for expr in exprs], found


def side(x: sympy.Expr, rows: dict[sympy.Symbol, Any]) -> float:
    """Whether an expression of channels is rather positive, 1, or negative, -1, in a record."""
    symbols = tuple(sorted(x.free_symbols, key=str))
    values: F64 = np.asarray(_function(x, symbols)(*(rows[s] for s in symbols)), dtype=float)
    return -1.0 if np.sum(values < 0) > np.sum(values > 0) else 1.0


@lru_cache(32)
def _function(x: sympy.Expr, symbols: tuple[sympy.Symbol, ...]) -> Any:
    plain = [sympy.Dummy() for _ in symbols]
    return sympy.lambdify(plain, x.xreplace(dict(zip(symbols, plain, strict=True))), "numpy")
