"""Limits of equations in which a parameter grows beyond all bounds or vanishes, as K does in a*y/(K + y)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy

from .compiled import Compiled, time
from .words import said

__all__ = ["Limit", "bends", "limits"]

HIGHEST = 3  # power of the small parameter that is looked for

_small = sympy.Symbol("small", positive=True)
_later = sympy.Symbol("later", positive=True)


@dataclass(frozen=True)
class Limit:
    """Equations in the limit of one parameter.

    Attributes
    ----------
    to : str
        Where the parameter goes: "infinity" or "0".
    texts : tuple of str
        The equations.
    ratios : dict of str to str
        What new parameters stand for, as a/K; empty where the old ones remain.
    lost : tuple of str
        Parameters that the limit has no more.
    large : bool
        Whether larger amplitudes would show the parameter; else finer samples about a jump would.
    """

    to: str
    texts: tuple[str, ...]
    ratios: dict[str, str]
    lost: tuple[str, ...]
    large: bool


def bends(compiled: Compiled, name: str) -> bool:
    """Whether a parameter enters the equations as they stand nonlinearly."""
    p = sympy.Symbol(name, real=True)
    return any(sympy.diff(expr, p, 2) != 0 for expr in compiled.source if p in expr.free_symbols)


def limits(compiled: Compiled, name: str, sign: int) -> Iterator[Limit]:
    """Limits of the equations for a parameter of that sign; none where they are not simple to derive."""
    if compiled.known:
        return
    p = sympy.Symbol(name, real=True)
    for to, value in (("infinity", sign / _small), ("0", sign * _small)):
        for second in (False, True):
            found = _limit(compiled, p, value, to, second)
            if found is not None:
                yield found


def _limit(compiled: Compiled, p: sympy.Symbol, value: sympy.Expr, to: str, second: bool) -> Limit | None:
    """`second`: of terms that begin with a constant the next part; the equation has a constant of its own."""
    parameters = [sympy.Symbol(name, real=True) for name in compiled.parameters]
    ratios: dict[str, str] = {}
    taken = {symbol.name for expr in compiled.source for symbol in expr.free_symbols}
    jumps, used, texts = False, False, []
    for expr in compiled.source:
        total = sympy.Integer(0)
        for term in sympy.Add.make_args(expr):
            if p not in term.free_symbols:
                total += term
                continue
            front, own = term.as_independent(p, as_Add=False)
            jumped, jump = _jumps(own.subs(p, value))
            jumps |= jump
            parts = _leading(jumped)
            if parts is None:
                return None
            constant = not parts[0][1].free_symbols - set(parameters)
            if constant and second and len(parts) > 1:
                parts, used = parts[1:], True
            power, part = parts[0]
            partner = _partner(front, parameters, compiled.source)
            if power == 0:
                total += front * part
            elif partner is not None:
                q = next(n for n in ("q", *(f"q{k}" for k in range(1, 99))) if n not in taken)
                taken.add(q)
                grows = (power > 0) == (to == "infinity")
                by = p.name if abs(power) == 1 else f"{p.name}**{abs(power)}"
                ratios[q] = f"{partner.name}/{by}" if grows else f"{partner.name}*{by}"
                # The sign of p is in the part, which has the power of |p|.
                odd = sympy.sign(value.subs(_small, 1)) if power % 2 else 1
                total += front.subs(partner, sympy.Symbol(q, real=True)) * part * odd
            elif power < 0:
                return None  # the other terms would have to grow as well
        texts.append(sympy.sympify(total))
    if second != used:
        return None
    left = {symbol.name for expr in texts for symbol in expr.free_symbols}
    lost = tuple([name for name in compiled.parameters if name not in left])
    return Limit(to, tuple([f"{said(expr, exact=True)} = 0" for expr in texts]), ratios, lost, not jumps)


def _partner(
    front: sympy.Expr, parameters: Sequence[sympy.Symbol], source: Sequence[sympy.Expr]
) -> sympy.Symbol | None:
    """A factor that stands in one term only, and can grow or vanish with the parameter."""
    for c in parameters:
        terms = [term for expr in source for term in sympy.Add.make_args(expr) if c in term.free_symbols]
        if len(terms) == 1 and c in front.free_symbols and c not in sympy.cancel(front / c).free_symbols:
            return c
    return None


def _jumps(expr: sympy.Expr) -> tuple[sympy.Expr, bool]:
    """Functions of what grows beyond all bounds in their limits: signs, and what dies at once."""
    found = {}
    for one in expr.atoms(sympy.tanh, sympy.atan, sympy.exp):
        grown = sympy.cancel(one.args[0] * _small)
        if _small in grown.free_symbols or grown == 0:
            continue
        if one.func == sympy.exp:
            if grown.subs(time, _later).is_negative:
                found[one] = sympy.Integer(0)
            continue
        found[one] = sympy.sign(grown) * (1 if one.func == sympy.tanh else sympy.pi / 2)
    return expr.xreplace(found), bool(found)


def _leading(expr: sympy.Expr) -> list[tuple[int, sympy.Expr]] | None:
    """The first two parts (power of what is small, coefficient) of an expression; None where it has none."""
    if expr == 0:
        return [(0, expr)]
    for shift in range(HIGHEST):
        own, parts = sympy.cancel(expr * _small**shift) if shift else expr, []
        if own.is_rational_function(_small):
            own = sympy.cancel(own)
        for k in range(HIGHEST + 1):
            at = own.subs(_small, 0)
            if at.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
                break
            if at != 0:
                parts.append((k - shift, at / sympy.factorial(k)))
            if len(parts) == 2:
                return parts
            own = sympy.diff(own, _small)
        if parts:
            return parts
    return None
