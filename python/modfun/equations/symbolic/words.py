"""Expressions as the user writes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy
from sympy.printing.str import StrPrinter

from .compiled import Compiled, Term

__all__ = ["operator", "said", "told"]

MOST_DENOMINATOR = 100


class _Printer(StrPrinter):  # type: ignore[misc]  # SymPy ships no types
    """Delays as y(t - h), functions by their names in the language, decimal fractions as decimals."""

    def _print_Delayed(self, expr: Any) -> str:
        return f"{self._print(expr.args[0])}(t - {self._print(expr.args[1])})"

    def _print_Abs(self, expr: Any) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Max(self, expr: Any) -> str:
        return self._nested("max", expr.args)

    def _print_Min(self, expr: Any) -> str:
        return self._nested("min", expr.args)

    def _nested(self, name: str, args: Sequence[Any]) -> str:
        found = str(self._print(args[0]))
        for one in args[1:]:
            found = f"{name}({found}, {self._print(one)})"
        return found

    def _print_Piecewise(self, expr: Any) -> str:
        *first, last = expr.args
        found = self._print(last[0])
        for value, condition in reversed(first):
            found = f"where({self._print(condition)}, {self._print(value)}, {found})"
        return str(found)

    def _print_Heaviside(self, expr: Any) -> str:
        return f"step({self._print(expr.args[0])})"

    def _print_Rational(self, expr: Any) -> str:
        if self._settings["full_prec"] is True:
            return str(super()._print_Rational(expr))
        if expr.q > MOST_DENOMINATOR or (expr.q not in (2, 3, 4, 6, 8, 9, 12) and abs(expr.p) < 10**6):
            return f"{float(expr):.6g}"
        return str(super()._print_Rational(expr))

    def _print_Exp1(self, expr: Any) -> str:
        return "exp(1)"


def said(expr: sympy.Expr, *, exact: bool = False) -> str:
    """Text of an expression, one line; numbers with six digits, or exactly."""
    return str(_Printer({"order": "none", "full_prec": exact}).doprint(expr))


def operator(order: int) -> str:
    """Text of p^order."""
    return "1" if order == 0 else "p" if order == 1 else f"p^{order}"


def told(compiled: Compiled) -> list[str]:
    """What is measured and estimated, what was done, and the equations that are fitted."""
    found = [
        f"Measured: {', '.join((*compiled.outputs, *compiled.inputs))}"
        + (f"; not measured: {', '.join(compiled.hidden)}." if compiled.hidden else ".")
    ]
    found.append(f"Parameters: {', '.join(compiled.parameters) or 'none'}.")
    found += compiled.steps
    if not compiled.steps:
        found.append("Every term is the derivative of a signal.")
    for e in range(len(compiled.orders)):
        terms = [_term(t) for t in compiled.terms if t.equation == e]
        found.append(f"Fitted: {' + '.join(terms)} = 0".replace("+ -", "- ") + ", p = d/dt.")
    return found


def _term(term: Term) -> str:
    coefficient = said(term.coefficient)
    if term.coefficient.is_Add:
        coefficient = f"({coefficient})"
    factor = "" if term.factor is None else f"({said(term.factor)}) "
    shown = f"{factor}{operator(term.order) + ' ' if term.order else ''}[{said(term.signal)}]"
    return shown if coefficient == "1" else f"-{shown}" if coefficient == "-1" else f"{coefficient} {shown}"
