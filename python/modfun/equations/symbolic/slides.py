"""Switches on states (signs, comparisons) as steep ramps: integrations slide where states stay on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

__all__ = ["ramped"]


def ramped(f: Sequence[Any], x: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Slopes of states x with ramps for what jumps where states do, and symbols of widths, one a state.

    Dry friction holds a pendulum, and a relay a level: each step then jumps to and fro over the switch, and
    steps that are to be as accurate as others become as short as numbers go. Within the widths a ramp has
    the slope between both sides with which the state stays. No widths where nothing jumps.
    """
    widths = [sympy.Dummy(f"width_{k}", positive=True) for k in range(len(x))]

    def ramp(g: Any) -> Any:
        width = sum(sympy.Abs(sympy.diff(g, own)) * by for own, by in zip(x, widths, strict=True))
        return sympy.Max(-1, sympy.Min(1, g / width))

    def sliding(g: Any) -> bool:
        return any(g.has(own) for own in x) and not g.has(sympy.sign, sympy.Heaviside, sympy.Piecewise)

    def of_pieces(*pieces: Any) -> Any:
        if not all(c == sympy.true or (_side(c) is not None and sliding(_side(c))) for _, c in pieces):
            return sympy.Piecewise(*pieces)
        found = sympy.Integer(0)
        for value, condition in reversed(pieces):
            share = 1 if condition == sympy.true else (1 + ramp(_side(condition))) / 2
            found = share * value + (1 - share) * found
        return found

    made = []
    for e in f:
        e = e.replace(sympy.sign, lambda g: ramp(g) if sliding(g) else sympy.sign(g))
        e = e.replace(
            sympy.Heaviside,
            lambda g, *at: (1 + ramp(g)) / 2 if sliding(g) else sympy.Heaviside(g, *at),
        )
        made.append(e.replace(sympy.Piecewise, of_pieces))
    return made, widths if any(e.has(*widths) for e in made) else []


def _side(condition: Any) -> Any:
    """What is positive where a comparison holds; None where it is none."""
    kinds = sympy.StrictLessThan | sympy.StrictGreaterThan | sympy.LessThan | sympy.GreaterThan
    return condition.gts - condition.lts if isinstance(condition, kinds) else None
