"""Elimination by the package DifferentialAlgebra, where it is installed (Rosenfeld and Gröbner)."""

from __future__ import annotations

from importlib.util import find_spec

import sympy

from .compiled import jet, time
from .jets import Moving, base, order

__all__ = ["available", "rosenfeld"]

SECONDS = 10


def available() -> bool:
    """Whether the package can be imported."""
    return find_spec("DifferentialAlgebra") is not None


def rosenfeld(
    equations: tuple[sympy.Expr, ...], hidden: tuple[str, ...], outputs: tuple[str, ...], moving: Moving
) -> tuple[sympy.Expr, ...] | None:
    """Equations without the hidden signals, of the general solution; None where there are none.

    Parameters
    ----------
    equations : tuple of Expr
        Each vanishes.
    hidden : tuple of str
    outputs : tuple of str
        Ranked above inputs and known functions, below what is hidden.
    moving : Moving
    """
    import DifferentialAlgebra

    polynomials = [sympy.fraction(sympy.together(f))[0] for f in equations]
    symbols = sorted({s for f in polynomials for s in f.free_symbols}, key=lambda s: str(s.name))
    if not all(f.is_polynomial(*symbols) for f in polynomials):
        return None
    names = list(dict.fromkeys(base(s) for s in symbols if moving.is_moving(s) and s != time))
    functions = dict(zip(names, (sympy.Function(f"f{k}") for k in range(len(names))), strict=True))
    constants = {s: sympy.Symbol(f"p{k}") for k, s in enumerate(symbols) if not moving.is_moving(s)}
    t = sympy.Symbol("t")
    there = {**constants, time: t}
    for s in symbols:
        if s != time and moving.is_moving(s):
            own = functions[base(s)](t)
            there[s] = sympy.Derivative(own, (t, order(s))) if order(s) else own
    blocks = [
        [functions[name] for name in names if name in hidden],
        [functions[name] for name in names if name in outputs],
        [functions[name] for name in names if name not in (*hidden, *outputs)],
        *([p] for p in constants.values()),
    ]
    ring = DifferentialAlgebra.DifferentialRing(
        derivations=[t], blocks=[block for block in blocks if block], parameters=list(constants.values())
    )
    try:
        chains = ring.RosenfeldGroebner(
            [f.xreplace(there) for f in polynomials], singsol="none", timeout=SECONDS
        )
    except (RuntimeError, ValueError, MemoryError):
        return None
    back = {p: s for s, p in constants.items()} | {t: time}
    found = [_back(f, functions, back) for chain in chains[:1] for f in chain.equations()]
    left = tuple(f for f in found if not any(base(s) in hidden for s in f.free_symbols))
    return left if len(left) == len(equations) - len(hidden) else None


def _back(
    f: sympy.Expr, functions: dict[str, sympy.Function], back: dict[sympy.Symbol, sympy.Symbol]
) -> sympy.Expr:
    names = {own: name for name, own in functions.items()}
    jets = {d: jet(names[d.expr.func], d.derivative_count) for d in f.atoms(sympy.Derivative)}
    f = f.xreplace(jets)
    jets = {own: jet(names[own.func]) for own in f.atoms(sympy.Function) if own.func in names}
    return sympy.expand(f.xreplace(jets).xreplace(back))
