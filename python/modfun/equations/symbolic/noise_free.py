"""Signals and coefficients of formulas as numbers, of channels without noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from .formulas import Formulas, of_record

__all__ = ["coefficients_of", "signals_of"]

KEPT = 64  # sets of formulas


def signals_of(formulas: Formulas, rows: F64, params: F64, record: int) -> tuple[F64, list[str], list[float]]:
    """Signals (signal, time) of the terms of a record, their kinds of quadrature and their delays, s."""
    found = _of_channels(formulas)(*rows, *params)
    signals = np.array([np.broadcast_to(one, rows.shape[1:]) for one in found], dtype=float)
    words = formulas.words["signals"][: len(signals)]
    delays = [float(late if k is None else params[k]) for _, late, k in words]
    return signals, [of_record(kinds, record) for kinds, _, _ in words], delays


def coefficients_of(formulas: Formulas, params: F64) -> list[float]:
    """The coefficient of each term."""
    return [float(value) for value in _of_parameters(formulas)(*params)]


@lru_cache(KEPT)
def _of_channels(formulas: Formulas) -> Callable[..., Any]:
    results, symbols, _ = formulas.expressions
    count = 1 + max([signal for _, signal, _ in formulas.words["terms"]])
    channels, parameters = symbols[: formulas.words["channels"]], _parameters(formulas)
    noise = dict.fromkeys(symbols[len(channels) : len(symbols) - len(parameters)], sympy.Integer(0))
    return _function([expr.xreplace(noise) for expr in results[:count]], [*channels, *parameters])


@lru_cache(KEPT)
def _of_parameters(formulas: Formulas) -> Callable[..., Any]:
    return _function(formulas.expressions[2], _parameters(formulas))


def _parameters(formulas: Formulas) -> list[sympy.Symbol]:
    symbols = formulas.expressions[1]
    return symbols[len(symbols) - len(formulas.compiled.parameters) :]


def _function(expressions: Sequence[sympy.Expr], symbols: Sequence[sympy.Symbol]) -> Callable[..., Any]:
    plain = {symbol: sympy.Dummy() for symbol in symbols}  # names may hold what Python does not take
    named = [expr.xreplace(plain) for expr in expressions]
    found: Callable[..., Any] = sympy.lambdify(list(plain.values()), named, "numpy", cse=True)
    return found
