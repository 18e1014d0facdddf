"""Known functions of time: samples, callables, derivatives, and what varying coefficients are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.arrays import F64
from ...base.names import nearest
from ...errors import DataError, SpecError

if TYPE_CHECKING:
    import sympy

    from .compiled import Compiled

__all__ = ["Derivative", "Samples", "basis"]

DEGREE = 5  # of the spline that is differentiated


class Samples:
    """One value a sample of the record; equal where the values are, and cannot be changed."""

    __slots__ = ("values",)

    values: F64

    def __init__(self, values: ArrayLike, what: str = "varying") -> None:
        try:
            array = np.array(values, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise SpecError(f"{what}: expected text, a function of t or samples ({error})") from None
        if array.ndim != 1 or array.size < 2 or not np.all(np.isfinite(array)):
            raise SpecError(
                f"{what}: samples have shape {array.shape}; give one finite value a sample, (N+1,)"
            )
        array.flags.writeable = False
        object.__setattr__(self, "values", array)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("samples cannot be changed")

    def __reduce__(self) -> tuple[Any, ...]:
        return Samples, (self.values,)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Samples) and np.array_equal(self.values, other.values)

    def __hash__(self) -> int:
        return hash(self.values.tobytes())

    def __repr__(self) -> str:
        return f"{self.values.size} samples"

    def __call__(self, t: ArrayLike) -> F64:
        """The samples, at as many instants."""
        instants = np.asarray(t)
        if instants.shape != self.values.shape:
            raise DataError(
                f"a varying coefficient is given by {self.values.size} samples, and the record has "
                f"{instants.size} instants; give one value a sample, or a function of t"
            )
        return self.values


@dataclass(frozen=True)
class Derivative:
    """Derivative of a known function, from a spline through its values at the instants asked for.

    Attributes
    ----------
    source : callable
        Instants in s to values.
    order : int
        Number of derivatives.
    """

    source: Callable[[Any], Any]
    order: int

    def __call__(self, t: ArrayLike) -> F64:
        from scipy.interpolate import make_interp_spline

        instants = np.asarray(t, dtype=np.float64)
        values = np.asarray(self.source(instants), dtype=np.float64)
        degree = min(DEGREE, instants.size - 1)
        if self.order > degree:
            raise DataError(
                f"derivative {self.order} of a varying coefficient: {instants.size} instants are too few"
            )
        spline = make_interp_spline(instants, np.broadcast_to(values, instants.shape), k=degree)
        return np.asarray(spline.derivative(self.order)(instants), dtype=np.float64)


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
    from sympy import lambdify

    from .compiled import time

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
    found = lambdify([time, *known], expr, "numpy")(t, *rows)
    return np.broadcast_to(np.asarray(found, dtype=float), t.shape)
