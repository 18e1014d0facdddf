"""The terms of a model as texts, for a search among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy

from ...errors import SpecError
from .compiled import Compiled, Term
from .jets import Jump, Moving
from .words import said

__all__ = ["Side", "sides_of"]


@dataclass(frozen=True)
class Side:
    """One equation of a model.

    Attributes
    ----------
    left : str
        The terms without a parameter.
    terms : tuple of str
        One per coefficient, so that left = Σ coefficient · term.
    signs : tuple of int
        Of the coefficients: 1 or -1 where the bounds of a parameter decide it, otherwise 0.
    """

    left: str
    terms: tuple[str, ...]
    signs: tuple[int, ...]


def sides_of(compiled: Compiled, what: str) -> list[Side]:
    """The equations of a model, each with its left side and candidates.

    Raises
    ------
    SpecError
        A product that is no derivative of a signal.
    """
    moving = Moving({*compiled.outputs, *compiled.inputs})
    found = []
    for e in range(len(compiled.orders)):
        known: list[str] = []
        groups: dict[sympy.Expr, list[tuple[sympy.Expr, Term]]] = {}
        for term in (one for one in compiled.terms if one.equation == e):
            if term.factor is not None:
                raise SpecError(
                    f"{what}: the model has the product of {said(term.factor)} with a derivative, which is "
                    "no derivative of a signal; list the candidates as text"
                )
            number, rest = term.coefficient.as_coeff_Mul()
            if rest.free_symbols:
                groups.setdefault(rest, []).append((number, term))
            else:
                known.append(_text(term.coefficient, term, moving))
        terms, signs = [], []
        for rest, own in groups.items():
            turn = -1 if own[0][0] < 0 else 1
            terms.append(_sum(_text(turn * number, term, moving) for number, term in own))
            signs.append(-turn * _sign(compiled.free.get(str(rest))))
        found.append(Side(_sum(known), tuple(terms), tuple(signs)))
    return found


def _sign(free: Any) -> int:
    """Sign of a parameter by its bounds; 0 where they leave both."""
    if free is None:
        return 0
    return int(free.min >= 0) - int(free.max <= 0)


def _sum(texts: Any) -> str:
    return " + ".join(texts).replace("+ -", "- ")


def _text(number: sympy.Expr, term: Term, moving: Moving) -> str:
    """A number times a derivative of a signal: y*y' rather than (y**2)'/2."""
    signal = term.signal
    if term.order == 1 and not signal.is_Add:
        try:
            whole = sympy.expand(number * moving.derivative(signal))
        except Jump:
            pass
        else:
            if not whole.is_Add and not whole.has(sympy.sign):
                return _said(whole)
    if term.order == 0:
        return _said(number * signal)
    primed = signal.name if signal.is_Symbol else f"({_said(signal)})"
    factor = "" if number == 1 else "-" if number == -1 else f"{_said(number)}*"
    return factor + primed + "'" * term.order


def _said(expr: sympy.Expr) -> str:
    """An expression with six digits, or exactly where these are too few."""
    rounded = any(float(one) != float(f"{float(one):.6g}") for one in expr.atoms(sympy.Rational))
    return said(expr, exact=rounded)
