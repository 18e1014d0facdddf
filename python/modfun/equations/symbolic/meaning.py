"""The tree of a text as a SymPy expression in jets, time, parameters and known functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NoReturn

import sympy

from ...base.names import nearest
from ...language.parser import EULER, FUNCTIONS, Node, Text
from .compiled import jet, time
from .jets import Jump, Moving

__all__ = ["meaning", "number", "parameter"]

MOST_POWER = 20  # of an integer exponent: what is expanded grows with it
MOST_OPERATIONS = 400  # of an expression that is differentiated
MOST_BITS = 8000
MOST_EXPONENT = 1020

_BOOLEAN = (sympy.core.relational.Relational, sympy.logic.boolalg.BooleanAtom)
_OWN: dict[str, Callable[..., Any]] = {
    "abs": sympy.Abs,
    "log10": lambda x: sympy.log(x) / sympy.log(10),
    "step": lambda x: sympy.Heaviside(x, 1),
    "min": sympy.Min,
    "max": sympy.Max,
    "where": lambda c, a, b: sympy.Piecewise(
        (a, c if isinstance(c, _BOOLEAN) else sympy.Abs(c) > 0), (b, True)
    ),
}
# SymPy calls the others what the language calls them.
_FUNCTIONS = {name: _OWN[name] if name in _OWN else getattr(sympy, name) for name in FUNCTIONS}
_COMPARE: dict[str, Callable[..., Any]] = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge}


def parameter(name: str) -> sympy.Symbol:
    """Symbol of a parameter."""
    return sympy.Symbol(name, real=True)


def number(value: Any) -> sympy.Rational:
    """A number as the decimal fraction it is written as: exact, so that terms cancel exactly."""
    return sympy.Rational(repr(float(value)))


def meaning(
    source: Text,
    moving: Moving,
    *,
    fixed: Mapping[str, float] | None = None,
    varying: Mapping[str, sympy.Expr] | None = None,
) -> sympy.Expr:
    """SymPy's expression of a parsed text.

    Parameters
    ----------
    source : Text
    moving : Moving
        Channels and known functions; delayed signals are added to it.
    fixed : mapping of str to float, optional
        Parameters that are held.
    varying : mapping of str to Expr, optional
        What c(t) stands for.

    Raises
    ------
    SpecError
        A name without a meaning, a derivative that does not exist, or numbers without a value.
    """
    return _Meaning(source, moving, fixed or {}, varying or {}).of(source.tree)


class _Meaning:
    def __init__(
        self, source: Text, moving: Moving, fixed: Mapping[str, float], varying: Mapping[str, sympy.Expr]
    ) -> None:
        self.source, self.moving, self.fixed, self.varying = source, moving, fixed, varying

    def refuse(self, node: Node, reason: str) -> NoReturn:
        self.source.refuse(node.at, node.end, reason)

    def of(self, node: Node) -> sympy.Expr:
        """The expression of a piece; a comparison is 1 where it is true, else 0."""
        found = self.raw(node)
        if isinstance(found, _BOOLEAN):
            found = sympy.Piecewise((1, found), (0, True))
        return found

    def raw(self, node: Node) -> Any:
        match node.kind:
            case "number":
                return sympy.Rational(node.value)
            case "name":
                return self.name(node)
            case "prime":
                return self.derivative(node, self.of(node.parts[0]), node.value)
            case "power" if node.is_exponential:
                self.refuse(node, EULER)
            case "power":
                return self.power(node, *map(self.of, node.parts))
            case "call" if node.value == "D":
                return self.repeated(node)
        if node.value == "where":  # its condition stays a comparison
            condition, *values = node.parts
            return self.real(node, _FUNCTIONS["where"](self.raw(condition), *map(self.of, values)))
        parts = [self.of(part) for part in node.parts]
        match node.kind:
            case "sum":
                return sympy.Add(*parts)
            case "product":
                return self.real(node, sympy.Mul(*parts))
            case "negative":
                return -parts[0]
            case "inverse":
                return self.real(node, 1 / parts[0])
            case "mod":
                left, right = self.floats(node, parts)
                return self.real(node, left - right * sympy.floor(left / right))
            case "compare":
                return _COMPARE[node.value](*self.floats(node, parts))
        if node.value in ("abs", "sign", "floor", "step", "min", "max"):
            parts = self.floats(node, parts)
        return self.real(node, _FUNCTIONS[node.value](*parts))

    def name(self, node: Node) -> sympy.Expr:
        name, primes = str(node.value), node.primes
        if name in self.moving.channels:
            late = self.late(node) if node.parts else sympy.S.Zero
            return jet(name if late == 0 else self.moving.delayed(name, late), primes)
        if name in self.varying:
            if not node.parts or self.of(node.parts[0]) != time:
                self.refuse(node, f"varies with time: write {name}(t)")
            return self.derivative(node, self.varying[name], primes)
        if node.parts:
            self.refuse(
                node,
                f"calls {name!r}, which is not a function; {nearest(name, [*FUNCTIONS, 'D'])}. A product is "
                f"written with *, a delayed signal y(t - h), a coefficient that varies is named in varying=",
            )
        if primes:
            self.refuse(
                node,
                f"has primes, but {name!r} is not a signal: list it in outputs=, inputs= or, not measured, "
                "in hidden=",
            )
        if name == "t":
            return time
        if name == "pi":
            return sympy.pi
        return number(self.fixed[name]) if name in self.fixed else parameter(name)

    def late(self, node: Node) -> sympy.Expr:
        """The delay h of y(t - h)."""
        late = sympy.expand(time - self.of(node.parts[0]))
        named = late.is_Symbol and not self.moving.is_moving(late)
        if not named and not (late.is_Rational and late >= 0):
            self.refuse(
                node,
                "is not a delayed signal: write y(t - h), h one parameter or seconds of at least 0 "
                "(a product is written with *)",
            )
        return late

    def repeated(self, node: Node) -> sympy.Expr:
        times = 1
        if len(node.parts) == 2:
            given = node.parts[1]
            if given.kind != "number" or not str(given.value).isdigit() or int(given.value) > 12:
                self.refuse(given, "is not an order of a derivative: write a whole number from 0 to 12")
            times = int(given.value)
        return self.derivative(node, self.of(node.parts[0]), times)

    def derivative(self, node: Node, expr: sympy.Expr, times: int) -> sympy.Expr:
        for _ in range(times):
            if sympy.count_ops(expr) > MOST_OPERATIONS:
                self.refuse(node, "is too long once it is differentiated; call a part of it a signal")
            try:
                expr = self.moving.derivative(expr)
            except Jump as jump:
                self.refuse(node, f"has no derivative: {jump} jumps; write it without the prime")
        return expr

    def power(self, node: Node, base: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
        if exponent.is_Integer and abs(exponent) > MOST_POWER and not base.is_number:
            self.refuse(node, f"has an exponent beyond {MOST_POWER}; powers to {MOST_POWER} are taken")
        if base.is_number and exponent.is_number and not _small(base, exponent):
            try:
                value = float(base) ** float(exponent)
                base, exponent = number(value), sympy.S.One
            except (OverflowError, ZeroDivisionError, TypeError, ValueError):
                self.refuse(node, "has no value within the range of floating point")
        return self.real(node, base**exponent)

    def floats(self, node: Node, parts: list[sympy.Expr]) -> list[sympy.Expr]:
        """Constants as numbers, where SymPy would otherwise evaluate to as many digits as it takes."""
        try:
            return [number(x) if x.is_number and not x.is_Rational else x for x in parts]
        except (TypeError, ValueError, OverflowError):
            self.refuse(node, "has no value within the range of floating point")

    def real(self, node: Node, expr: sympy.Expr) -> Any:
        """Refuse what has no real value; `where` and comparisons may be true or false for good."""
        if expr.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo, -sympy.oo):
            self.refuse(node, "has no real value")
        if expr.is_Rational and max(expr.p.bit_length(), expr.q.bit_length()) > MOST_BITS:
            self.refuse(node, "is a number of too many digits")
        if expr.is_Rational and expr.p.bit_length() - expr.q.bit_length() > MOST_EXPONENT:
            self.refuse(node, "is outside the range of floating point")
        return expr


def _small(base: sympy.Expr, exponent: sympy.Expr) -> bool:
    """Whether a power of numbers may be left to SymPy: a whole one of few digits, or a small root."""
    if base.is_Rational and exponent.is_Integer:
        bits = max(int(base.p).bit_length(), int(base.q).bit_length())
        return bool(bits * abs(int(exponent)) <= MOST_BITS // 4)
    if base.is_Rational and exponent.is_Rational:
        return bool(max(abs(base.p), base.q) < 10**6 and max(abs(exponent.p), exponent.q) <= MOST_POWER)
    return base in (sympy.pi, sympy.E) and bool(exponent.is_Rational) and bool(abs(exponent) <= MOST_POWER)
