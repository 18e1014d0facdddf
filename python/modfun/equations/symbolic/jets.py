"""What moves with time, and the derivative with respect to it of expressions in jets."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import sympy

from .compiled import Delayed, jet, time

__all__ = ["Jump", "Moving", "base", "order", "tidy"]

_STEPS = (sympy.Piecewise, sympy.floor)


class Jump(ValueError):
    """A function that jumps has no derivative; the text is the function's."""


def tidy(expr: sympy.Expr) -> sympy.Expr:
    """Products in which x sign(x) is |x|, |x| sign(x) is x and sign(x)**2 is 1."""
    if not expr.has(sympy.sign):
        return expr
    return sympy.Add(*map(_tidy_product, sympy.Add.make_args(sympy.expand(expr))))


def _tidy_product(product: sympy.Expr) -> sympy.Expr:
    for found in product.atoms(sympy.sign):
        x = found.args[0]
        power = int(product.as_powers_dict().get(found, 0))
        product *= found ** (-power)
        if power % 2:
            rest = product.as_powers_dict()
            if rest.get(sympy.Abs(x), 0):
                product *= x / sympy.Abs(x)
            elif x.is_Symbol and rest.get(x, 0):
                product *= sympy.Abs(x) / x
            else:
                product *= found
    return product


def base(symbol: sympy.Symbol) -> str:
    """Name of a jet without its primes."""
    return str(symbol.name).rstrip("'")


def order(symbol: sympy.Symbol) -> int:
    """Number of primes of a jet."""
    return int(str(symbol.name).count("'"))


@dataclass(frozen=True)
class Moving:
    """The names that depend on time; every other symbol is a parameter.

    Attributes
    ----------
    channels : set of str
        Signals, and delayed signals by a name of their own, as "y(t-h)".
    known : set of str
        Known functions of time, as "c1(t)".
    delays : dict of str to tuple of str and Expr
        Signal and delay of each delayed signal.
    """

    channels: set[str]
    known: set[str] = field(default_factory=set)
    delays: dict[str, tuple[str, Any]] = field(default_factory=dict)

    def delayed(self, name: str, late: sympy.Expr) -> str:
        """Name of a signal at t - late, from now on one of the channels."""
        own = f"{name}(t-{late})"
        self.channels.add(own)
        self.delays[own] = (name, late)
        return own

    def is_channel(self, symbol: sympy.Symbol) -> bool:
        """Tell whether a symbol is a signal or one of its derivatives."""
        return base(symbol) in self.channels

    def is_moving(self, symbol: sympy.Symbol) -> bool:
        """Tell whether a symbol depends on time."""
        return symbol == time or base(symbol) in self.channels or base(symbol) in self.known

    def split(self, expr: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
        """A product as (what does not move, what moves)."""
        still, moving = sympy.S.One, sympy.S.One
        for factor in sympy.Mul.make_args(expr):
            if any(self.is_moving(s) for s in factor.free_symbols):
                moving *= factor
            else:
                still *= factor
        return still, moving

    def symbols(self, expr: sympy.Expr) -> list[sympy.Symbol]:
        """Symbols of channels and their derivatives in an expression, in order of their names."""
        return sorted((s for s in expr.free_symbols if self.is_channel(s)), key=lambda s: s.name)

    def parameters(self, expr: sympy.Expr) -> set[sympy.Symbol]:
        """Symbols in an expression that do not depend on time."""
        return {s for s in expr.free_symbols if not self.is_moving(s)}

    def derivative(self, expr: sympy.Expr, times: int = 1) -> sympy.Expr:
        """d^times/dt^times of an expression; Jump where there is none."""
        for _ in range(times):
            for jumping in expr.atoms(*_STEPS):
                if self._movers(jumping):
                    raise Jump(jumping)
            rates = (self.rate(s) * sympy.diff(expr, s) for s in self._movers(expr))
            found = tidy(sympy.Add(*rates))
            if found.has(sympy.DiracDelta):
                raise Jump(expr)
            expr = found
        return expr

    def rate(self, symbol: sympy.Symbol) -> sympy.Expr:
        """Derivative of one symbol."""
        return sympy.S.One if symbol == time else jet(base(symbol), order(symbol) + 1)

    def _movers(self, expr: sympy.Expr) -> list[sympy.Symbol]:
        return sorted((s for s in expr.free_symbols if self.is_moving(s)), key=lambda s: s.name)

    def public(self, expr: sympy.Expr) -> sympy.Expr:
        """An expression in which delayed signals stand as `Delayed`."""
        late = {
            s: Delayed(jet(self.delays[base(s)][0], order(s)), self.delays[base(s)][1])
            for s in expr.free_symbols
            if base(s) in self.delays
        }
        return expr.xreplace(late) if late else expr
