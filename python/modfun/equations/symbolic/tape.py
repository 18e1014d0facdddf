"""Expressions as lists of operations that the compiled core runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy

from ...errors import SpecError

__all__ = ["Operation", "tape"]

Operation = tuple[str, float, int, int]

_FUNCTIONS = {
    sympy.sin: "sin",
    sympy.cos: "cos",
    sympy.tan: "tan",
    sympy.asin: "asin",
    sympy.acos: "acos",
    sympy.atan: "atan",
    sympy.sinh: "sinh",
    sympy.cosh: "cosh",
    sympy.tanh: "tanh",
    sympy.exp: "exp",
    sympy.log: "ln",
    sympy.Abs: "abs",
    sympy.sign: "sign",
    sympy.floor: "floor",
    sympy.Heaviside: "step",
}
_PAIRS = {sympy.Min: "min", sympy.Max: "max"}
_MOST_POWER = 64


class _Writer:
    def __init__(self, inputs: Mapping[sympy.Symbol, int]) -> None:
        self.inputs = inputs
        self.operations: list[Operation] = []
        self.known: dict[sympy.Expr, int] = {}

    def add(self, name: str, value: float = 0.0, a: int = 0, b: int = 0) -> int:
        self.operations.append((name, value, a, b))
        return len(self.operations) - 1

    def write(self, expr: sympy.Expr) -> int:
        if expr not in self.known:
            self.known[expr] = self._written(expr)
        return self.known[expr]

    def _written(self, expr: sympy.Expr) -> int:
        if expr.is_Symbol:
            if expr not in self.inputs:
                raise SpecError(f"fitting an equation: {expr} is neither a channel nor a parameter")
            return self.add("input", a=self.inputs[expr])
        if expr.is_number:
            value = complex(expr.evalf(17))
            if value.imag:
                raise SpecError(f"fitting an equation: the number {expr} is not real")
            return self.add("constant", value.real)
        if expr.is_Add or expr.is_Mul:
            return self._folded("add" if expr.is_Add else "multiply", expr.args)
        if expr.is_Pow:
            return self._power(*expr.as_base_exp())
        if isinstance(expr, sympy.DiracDelta):
            return self.add("constant", 0.0)  # of a kink: nothing between the samples
        if expr.func in _FUNCTIONS:
            return self.add(_FUNCTIONS[expr.func], a=self.write(expr.args[0]))
        if expr.func in _PAIRS:
            first, *rest = expr.args
            at = self.write(first)
            for arg in rest:
                at = self.add(_PAIRS[expr.func], a=at, b=self.write(arg))
            return at
        if isinstance(expr, sympy.Piecewise):
            return self._pieces(expr)
        if isinstance(
            expr, sympy.StrictLessThan | sympy.StrictGreaterThan | sympy.LessThan | sympy.GreaterThan
        ):
            name = (
                "less" if isinstance(expr, sympy.StrictLessThan | sympy.StrictGreaterThan) else "less_equal"
            )
            return self.add(name, a=self.write(expr.lts), b=self.write(expr.gts))
        if expr in (sympy.true, sympy.false):
            return self.add("constant", float(bool(expr)))
        raise SpecError(
            f"fitting an equation: {expr} holds {expr.func.__name__}, which has no value sample by sample"
        )

    def _folded(self, name: str, args: Sequence[sympy.Expr]) -> int:
        over = [] if name == "add" else [a for a in args if a.is_Pow and a.exp.could_extract_minus_sign()]
        rest = [a for a in args if a not in over]
        at = self.write(rest[0]) if rest else self.add("constant", 1.0)
        for arg in rest[1:]:
            at = self.add(name, a=at, b=self.write(arg))
        for arg in over:
            at = self.add("divide", a=at, b=self.write(1 / arg))
        return at

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> int:
        if base == sympy.E:
            return self.add("exp", a=self.write(exponent))
        if exponent == sympy.Rational(1, 2):
            return self.add("sqrt", a=self.write(base))
        if exponent.is_Integer and abs(int(exponent)) <= _MOST_POWER:
            return self.add("whole", float(int(exponent)), self.write(base))
        if exponent.is_number and exponent.is_negative:
            return self.add("divide", a=self.add("constant", 1.0), b=self.write(base**-exponent))
        return self.add("raise", a=self.write(base), b=self.write(exponent))

    def _pieces(self, expr: sympy.Piecewise) -> int:
        """Sums of pieces times their conditions; later ones count where the earlier do not."""
        left = self.add("constant", 1.0)
        total = self.add("constant", 0.0)
        minus = self.add("constant", -1.0)
        one = self.add("constant", 1.0)
        for value, condition in expr.args:
            holds = self.add("multiply", a=left, b=self.write(condition))
            total = self.add("add", a=total, b=self.add("multiply", a=holds, b=self.write(value)))
            opposite = self.add("add", a=one, b=self.add("multiply", a=minus, b=self.write(condition)))
            left = self.add("multiply", a=left, b=opposite)
        return total


def tape(results: Sequence[sympy.Expr], inputs: Sequence[sympy.Symbol]) -> tuple[list[Operation], list[int]]:
    """Operations for expressions, and the position of each expression's value; common parts stand once.

    Raises
    ------
    SpecError
        A symbol that is not an input, or a function that the core does not know.
    """
    writer = _Writer({symbol: k for k, symbol in enumerate(inputs)})
    places = [writer.write(sympy.sympify(expr)) for expr in results]
    return writer.operations, places
