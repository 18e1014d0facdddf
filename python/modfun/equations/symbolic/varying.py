"""Coefficients that vary with time: the functions their parameters multiply."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from ...base.tables import nearest
from ...errors import SpecError
from .compiled import Compiled, time

__all__ = ["basis"]

F64 = NDArray[np.float64]


def basis(compiled: Compiled, name: str, t: F64) -> tuple[list[str], F64, F64]:
    """Names of the parameters of c(t), their functions (parameter, time), and what held ones add (time,).

    Raises
    ------
    SpecError
        No coefficient of that name, or samples that are not known at these instants.
    """
    if name not in compiled.varying:
        raise SpecError(f"varying: no coefficient {name!r} varies; {nearest(name, list(compiled.varying))}")
    names, rows = [], []
    held = np.zeros(t.size)
    for parameter, expr in compiled.varying[name]:
        values = _values(compiled, expr, t)
        if parameter in compiled.fixed:
            held += compiled.fixed[parameter] * values
        else:
            names.append(parameter)
            rows.append(values)
    return names, np.array(rows).reshape(len(rows), t.size), held


def _values(compiled: Compiled, expr: sympy.Expr, t: F64) -> F64:
    known = sorted(expr.free_symbols - {time}, key=str)
    rows: list[Any] = []
    for symbol in known:
        given = compiled.known[symbol]
        if not callable(given):
            raise SpecError(
                f"varying: {symbol} was given as samples, which are known at a record's instants alone; give "
                "it as a function of t"
            )
        rows.append(np.asarray(given(t), dtype=float))
    found = sympy.lambdify([time, *known], expr, "numpy")(t, *rows)
    return np.broadcast_to(np.asarray(found, dtype=float), t.shape)
