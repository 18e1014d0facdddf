"""Equations that share a rational term, as growth and consumption do: all but one are put without it."""

from __future__ import annotations

import sympy

from .jets import Moving, tidy
from .multipliers import is_freed, mixing
from .words import said

__all__ = ["combined"]


def combined(
    equations: tuple[sympy.Expr, ...], moving: Moving, outputs: tuple[str, ...]
) -> tuple[tuple[sympy.Expr, ...], tuple[str, ...]]:
    """Linear combinations of equations in which shared rational terms stand once, and what was done in words.

    X' = μ(S; θ) X, S' = -q μ(S; θ) X are X' + S'/q = 0 and the second one, which its denominators free of
    parameters inside signals. The first cannot be freed: X'/μ is no derivative, and what noise does to a
    signal is told of parameters outside alone.
    """
    left, steps = [_parts(expr, moving) for expr in equations], list[str]()
    freed = [False] * len(left)

    def is_free(e: int) -> bool:
        freed[e] = freed[e] or is_freed(_whole(left[e]), moving, outputs)
        return freed[e]

    for term in dict.fromkeys(term for parts in left for term in parts if mixing(term, moving)):
        having = [e for e, parts in enumerate(left) if term in parts]
        keeps = next(filter(is_free, having), None) if len(having) > 1 else None
        if keeps is None:
            continue
        for e in having:
            if is_free(e):  # by its own denominators
                continue
            ratio = sympy.cancel(left[e][term] / left[keeps][term])
            made = _without(left[e], ratio, left[keeps])
            if any(moving.symbols(one) for one in made):
                left[e] = made
                steps.append(
                    f"Equation {e + 1} was combined with equation {keeps + 1}, which has {said(term)}, too: "
                    "it stands without that."
                )
    if not steps:
        return equations, ()
    return tuple([_whole(parts) for parts in left]), tuple(steps)


# Of each product of what moves its coefficient.
Parts = dict[sympy.Expr, sympy.Expr]


def _parts(expr: sympy.Expr, moving: Moving) -> Parts:
    """Terms of an equation, whose denominators have the factors of their sums taken out."""
    found: Parts = {}
    for part in sympy.Add.make_args(tidy(sympy.expand(expr))):
        # Expanding has multiplied Y (K + S) out.
        below = {b: sympy.factor_terms(b) for b, _ in mixing(part, moving)}
        still, term = moving.split(part.xreplace(below))
        found[term] = found.get(term, sympy.S.Zero) + still
    return {term: still for term, still in found.items() if sympy.cancel(still) != 0}


def _without(parts: Parts, ratio: sympy.Expr, kept: Parts) -> Parts:
    """Terms less so many times others."""
    made = dict(parts)
    for term, still in kept.items():
        made[term] = sympy.cancel(made.get(term, sympy.S.Zero) - ratio * still)
    return {term: still for term, still in made.items() if still != 0}


def _whole(parts: Parts) -> sympy.Expr:
    return sympy.Add(*(still * term for term, still in parts.items()))
