"""What parameters multiply inside functions, as y in sin(k*y): it says how large they may sensibly be."""

from __future__ import annotations

import sympy

from ...models.free import Free
from .compiled import Compiled, Delayed, jet

__all__ = ["exponentials", "factors", "multiplied"]

STEEP = (sympy.exp, sympy.Pow, sympy.sinh, sympy.cosh)  # which overflow, unlike sines and tanh


def multiplied(compiled: Compiled) -> list[tuple[int, list[tuple[sympy.Expr, bool]], bool]]:
    """Position of each free parameter without start, bounds or prior that stands in functions; what it
    multiplies there, of outputs and inputs, and whether in exponentials; and whether its sign is a matter of
    taste.
    """
    found = []
    measured = {jet(name) for name in (*compiled.outputs, *compiled.inputs)}
    for k, name in enumerate(compiled.parameters):
        p, free = sympy.Symbol(name, real=True), compiled.free.get(name)
        told = free is not None and (free.start is not None or free.min > -sympy.oo or free.max < sympy.oo)
        terms = [t for expr in compiled.source for t in sympy.Add.make_args(expr) if p in t.free_symbols]
        if told or not terms or any(t.has(Delayed) for t in terms):
            continue
        # Where it stands anywhere else, that says how large it is.
        held = {
            one: sympy.Dummy() for t in terms for one in t.atoms(sympy.Function, sympy.Pow) if _inside(one, p)
        }
        if any(p in t.xreplace(held).free_symbols for t in terms):
            continue
        slopes = [
            (sympy.diff(_argument(one), p), isinstance(one, STEEP) and not isinstance(one, sympy.Pow))
            for one in held
            if isinstance(one, sympy.Pow) or len(one.args) == 1
        ]
        seen = all(w.free_symbols and w.free_symbols <= measured for w, _ in slopes)
        if seen and len(slopes) == len(held):
            found.append((k, slopes, all(_keeps(t, p, compiled) for t in terms)))
    return found


def factors(compiled: Compiled, k: int) -> list[str]:
    """Parameters without start, bounds or prior that are factors of each term with one inside a function, and
    stand nowhere else: k0 of k0*exp(-E/T) for E.
    """
    terms = [term for expr in compiled.source for term in sympy.Add.make_args(expr)]
    p = sympy.Symbol(compiled.parameters[k], real=True)
    own = [term for term in terms if p in term.free_symbols]
    found = []
    for name in compiled.parameters:
        factor = sympy.Symbol(name, real=True)
        only = all(term in own for term in terms if factor in term.free_symbols)
        if only and all(factor in term.args for term in own) and compiled.free.get(name, Free()) == Free():
            found.append(name)
    return found


def exponentials(compiled: Compiled) -> list[tuple[sympy.Expr, list[str]]]:
    """Exponentials with parameters inside, as users wrote them, and the names of these."""
    atoms = set().union(*(expr.atoms(*STEEP) for expr in compiled.source))
    found = []
    for one in sorted(atoms, key=str):
        inside = one.exp if isinstance(one, sympy.Pow) else one.args[0]
        free = {s.name for s in inside.free_symbols}
        if own := [name for name in compiled.parameters if name in free]:
            found.append((one, own))
    return found


def _inside(one: sympy.Expr, p: sympy.Symbol) -> bool:
    """Whether a parameter stands in the argument of a function, or in an exponent."""
    return p in (one.exp if isinstance(one, sympy.Pow) else one).free_symbols


def _argument(one: sympy.Expr) -> sympy.Expr:
    """Of a function; a power is an exponential."""
    return one.exp * sympy.log(one.base) if isinstance(one, sympy.Pow) else one.args[0]


def _keeps(term: sympy.Expr, p: sympy.Symbol, compiled: Compiled) -> bool:
    """Whether the other sign of a parameter leaves a term, or is that of a factor which stands here only."""
    other = term.subs(p, -p)
    if other == term:
        return True
    alone = [
        c
        for c in term.args
        if c.is_Symbol and c.name in compiled.parameters and c.name not in compiled.free
        and sum(t.has(c) for expr in compiled.source for t in sympy.Add.make_args(expr)) == 1
    ]  # fmt: skip
    return other == -term and bool(alone)
