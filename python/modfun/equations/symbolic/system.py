"""What the texts of an Equation say: equations in jets, with their names told apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import sympy

from ...errors import SpecError
from ...language.parser import Text, expression
from ...models.free import Free
from .compiled import time
from .jets import Moving, base, order
from .known import Derivative
from .meaning import meaning, number, parameter

__all__ = ["System", "system_of"]


@dataclass(frozen=True)
class System:
    """Equations with their names told apart.

    Attributes
    ----------
    equations : tuple of Expr
        Each vanishes.
    moving : Moving
    outputs, inputs, hidden : tuple of str
    parameters : tuple of str
        In the order of first appearance.
    free : mapping of str to Free
    fixed : mapping of str to float
    known : mapping of str to callable
        Known functions of time by their names.
    varying : mapping of str to tuple of (str, Expr)
        Parameter and function of time of each summand of a varying coefficient.
    source, unmeasured : tuple, optional
        What is simulated and its signals that are not measured, where hidden ones are eliminated already.
    steps : tuple of str, optional
        What was done so far, in words.
    """

    equations: tuple[sympy.Expr, ...]
    moving: Moving
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    hidden: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    free: Mapping[str, Free] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    known: Mapping[str, Any] = field(default_factory=dict)
    varying: Mapping[str, tuple[tuple[str, sympy.Expr], ...]] = field(default_factory=dict)
    source: tuple[sympy.Expr, ...] = ()
    unmeasured: tuple[str, ...] = ()
    steps: tuple[str, ...] = ()

    def functions(self, used: set[sympy.Symbol]) -> dict[sympy.Symbol, Any]:
        """Known functions among symbols, derivatives included."""
        return {
            s: Derivative(self.known[base(s)], order(s)) if order(s) else self.known[base(s)]
            for s in sorted(used, key=lambda s: s.name)
            if base(s) in self.known
        }


def system_of(
    texts: Sequence[Text],
    *,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    hidden: tuple[str, ...],
    varying: Sequence[tuple[str, tuple[Any, ...]]],
    params: Sequence[tuple[str, float | Free]],
    parameters: tuple[str, ...],
) -> System:
    """The system that equations as text describe; the rest is as an Equation holds it.

    Raises
    ------
    SpecError
        Names without a meaning, delays without a bound.
    """
    moving = Moving({*outputs, *inputs, *hidden})
    fixed = {name: given for name, given in params if not isinstance(given, Free)}
    free = {name: given for name, given in params if isinstance(given, Free)}
    known: dict[str, Any] = {}
    summands: dict[str, tuple[tuple[str, sympy.Expr], ...]] = {}
    for name, basis in varying:
        parts = []
        for k, given in enumerate(basis):
            if isinstance(given, str):
                function = _of_time(expression(given, f"function varying[{name!r}][{k}]"))
            else:
                known[f"{name}{k}(t)"] = given
                moving.known.add(f"{name}{k}(t)")
                function = parameter(f"{name}{k}(t)")
            parts.append((f"{name}{k}", function))
        summands[name] = tuple(parts)
    sums = {
        name: sympy.Add(*((number(fixed[p]) if p in fixed else parameter(p)) * f for p, f in parts))
        for name, parts in summands.items()
    }
    equations = tuple(meaning(text, moving, fixed=fixed, varying=sums) for text in texts)
    for own, (_, late) in moving.delays.items():
        bound = free.get(str(late))
        if late.is_Symbol and not (bound is not None and isfinite(bound.max) and bound.max > 0 <= bound.min):
            raise SpecError(
                f"Equation: the delay of {own} is a parameter, which needs bounds, in s: the window starts "
                f'so much later; as params={{"{late}": mf.Free(0.1, min=0, max=0.5)}}, or a number'
            )
    return System(
        equations=equations,
        moving=moving,
        outputs=outputs,
        inputs=inputs,
        hidden=hidden,
        parameters=parameters,
        free=free,
        fixed=fixed,
        known=known,
        varying=summands,
    )


def _of_time(source: Text) -> sympy.Expr:
    found = meaning(source, Moving(set()))
    if others := found.free_symbols - {time}:
        name = min(s.name for s in others)
        at = next(node for node in source.tree.walk() if node.value == name)
        source.refuse(at.at, at.end, "is not t; a basis function of a varying coefficient is of t alone")
    return found
