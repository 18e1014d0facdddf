"""Samples of the signals of compiled equations with NumPy, as the core makes them of channels."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64

__all__ = ["sampled"]


def sampled(formulas: Any, rows: F64, levels: F64, params: F64) -> list[F64]:
    """Samples of the signals of `Formulas` and then of their slopes.

    Parameters
    ----------
    formulas : Formulas
    rows : ndarray, shape (channel, time)
    levels : ndarray, shape (noisy channel,)
        Standard deviations of the noise, which has nothing in common among channels.
    params : ndarray, shape (p,)
    """
    results, symbols, _ = formulas.expressions
    apart = [0.0] * (len(levels) * (len(levels) - 1) // 2)
    found = _function(tuple(symbols), tuple(results))(*rows, *levels**2, *apart, *params)
    return [np.broadcast_to(np.asarray(own, dtype=float), rows.shape[1:]) for own in found]


@lru_cache(maxsize=8)
def _function(symbols: tuple[sympy.Symbol, ...], results: tuple[sympy.Expr, ...]) -> Callable[..., list[F64]]:
    """As the core, which has nothing of a kink between samples."""
    plain = [sympy.sympify(own).replace(sympy.DiracDelta, lambda *_: sympy.Integer(0)) for own in results]
    found: Callable[..., list[F64]] = sympy.lambdify(symbols, plain, modules="numpy", cse=True, dummify=True)
    return found
