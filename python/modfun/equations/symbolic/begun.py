"""Linear equations of what moves beside a given state: what the start adds, as inputs that begin with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from ...errors import SpecError
from .compiled import jet
from .jets import base, order
from .meaning import number
from .words import said

__all__ = ["begun"]


def begun(
    model: Any, what: str, states: Sequence[str], starts: Sequence[Mapping[str, float]], holds: Sequence[str]
) -> Any:
    """The equations of z = y − y(0) from zero, where the state and the inputs at the first sample are given.

    Beside a zero past, a derivative is y⁽ᵏ⁾ = (yh)⁽ᵏ⁾ − Σ y⁽ʲ⁾(0) h⁽ᵏ⁻ʲ⁾ over j < k, and that of an input
    (uh)⁽ᵏ⁾, since y⁽ʲ⁾(0) is that of the free response. With yh = z + y(0)h and uh = v + u(0)h all signals
    begin at zero. h is an input that is 1 from there on and was 0 before, one a record.

    Parameters
    ----------
    model : Equation
    what : str
        What is asked for, for messages.
    states : sequence of str
        "y", "y'", … of the free response.
    starts : sequence of mapping of str to float
        Of each record the values of `states`, and of the inputs at the first sample.
    holds : sequence of str
        Name of h of each record.

    Raises
    ------
    SpecError
        Equations that are not linear, change with time, or look back at their outputs.
    """
    from ..equation import equations_of

    system = equations_of(model)
    moving, made = system.moving, []
    for expr in system.equations:
        signals = moving.symbols(expr)
        rest = expr.xreplace(dict.fromkeys(signals, sympy.Integer(0)))
        for part in (rest, *(sympy.diff(expr, s) for s in signals)):
            if any(map(moving.is_moving, part.free_symbols)):
                raise SpecError(
                    f"{what}: numbers are for linear equations with constant coefficients, and "
                    f'{said(moving.public(expr))} = 0 is none; take "rest", "zero" or "unknown"'
                )
        moved = {}
        for s in signals:
            name, late = moving.delays.get(base(s), (base(s), 0))
            if name in model.inputs:
                moved[s] = s + _held(starts, holds, name, order(s))
                continue
            if late != 0:
                raise SpecError(
                    f"{what}: the equations look back at {name}, whose motion before the record is unknown; "
                    'take initial_state="unknown"'
                )
            jumps = [_held(starts, holds, name + "'" * j, order(s) - j) for j in range(1, order(s))]
            level = [_held(starts, holds, name, 0)] if order(s) == 0 and name in states else []
            moved[s] = sympy.Add(s, *level, *(-jump for jump in jumps))
        made.append(moving.public(expr.xreplace(moved) + rest * (sum(map(jet, holds)) - 1)))
    used = {symbol.name for expr in made for symbol in expr.free_symbols}
    return model._like(
        text=[f"{said(expr, exact=True)} = 0" for expr in made],
        inputs=[*model.inputs, *holds],
        varying={},
        params={name: given for name, given in system.free.items() if name in used},
    )


def _held(starts: Sequence[Mapping[str, float]], holds: Sequence[str], name: str, k: int) -> Any:
    """Σ value · h⁽ᵏ⁾ over the records."""
    return sympy.Add(*(number(own[name]) * jet(h, k) for own, h in zip(starts, holds, strict=True)))
