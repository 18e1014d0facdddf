"""Equations in jets to terms g(θ)·F·p^k E: what estimation takes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import sympy

from ...base.names import series
from ...errors import SpecError
from .compiled import Compiled, Term
from .elimination import NotEliminated, TooHard, eliminate
from .exact import NotExact, Piece
from .jets import Moving
from .multipliers import arrange
from .rosenfeld import available, rosenfeld
from .shared import combined
from .system import System
from .words import said

__all__ = ["as_written", "compile_system"]

MOST_FACTORED = 8  # terms of a coefficient
MOST_TERMS = 3000  # of an equation once it is multiplied out


def compile_system(system: System, what: str) -> Compiled:
    """Terms of a system.

    Parameters
    ----------
    system : System
    what : str
        Whose equations they are, for messages.

    Raises
    ------
    SpecError
        An equation outside the class: the term at fault, and what would help.
    """
    moving, equations = system.moving, system.equations
    steps = list(system.steps)
    for expr in equations:
        if _size(expr) > MOST_TERMS:
            raise SpecError(
                f"{what}: multiplied out, the equation {said(expr)[:60]}... has more than {MOST_TERMS} "
                "terms; call a part of it a signal of its own, or lower its powers"
            )
    if system.hidden:
        try:
            equations, gone = eliminate(equations, system.hidden, moving)
        except NotEliminated as fault:
            hard = isinstance(fault, TooHard) and available()
            left = rosenfeld(equations, system.hidden, system.outputs, moving) if hard else None
            if left is None:
                cure = f"; {_by_response(system)}" if isinstance(fault, TooHard) else ""
                raise SpecError(f"{what}: {fault}{cure}") from None
            equations = left
            gone = (f"{series(system.hidden)}: eliminated by Rosenfeld and Gröbner's algorithm.",)
        if not equations:
            raise SpecError(
                f"{what}: no equation is left without {', '.join(system.hidden)}; measure it, or write "
                "more equations"
            )
        steps += gone
    else:
        equations, shared = combined(equations, moving, system.outputs)
        steps += shared
    terms: list[Term] = []
    for e, expr in enumerate(equations):
        try:
            found, words = arrange(_separated(_logarithms(expr, moving), moving), moving, system.outputs)
        except NotExact as fault:
            told = _not_eliminated(fault, system, what) if system.hidden else _outside(fault, moving, what)
            raise SpecError(told) from None
        own, more = _normal(_terms(e, found, moving, system.outputs), turn=bool(system.hidden))
        if not own:
            raise SpecError(f"{what}: equation {e + 1} says 0 = 0; there is nothing to fit")
        terms += own
        number = f"Equation {e + 1}: " if len(equations) > 1 else ""
        steps += [number + text for text in (*words, *more)]
    return _compiled(system, tuple(terms), tuple(steps))


def as_written(system: System) -> Compiled:
    """A system without terms, to simulate: hidden signals stay."""
    return _compiled(system, (), ())


def _compiled(system: System, terms: tuple[Term, ...], steps: tuple[str, ...]) -> Compiled:
    source = tuple(system.moving.public(expr) for expr in system.source or system.equations)
    parts = [x for t in terms for x in (t.coefficient, t.signal, t.factor) if x is not None]
    used = {s for x in parts or source for s in x.free_symbols}
    names = {s.name for s in used}
    return Compiled(
        outputs=system.outputs,
        inputs=system.inputs,
        parameters=tuple(name for name in system.parameters if name in names),
        free={name: given for name, given in system.free.items() if name in names},
        terms=terms,
        known=system.functions(used | {s for x in source for s in x.free_symbols}),
        source=source,
        hidden=system.unmeasured or system.hidden,
        steps=steps,
        varying=dict(system.varying),
        fixed=dict(system.fixed),
    )


def _terms(e: int, found: list[Piece], moving: Moving, outputs: tuple[str, ...]) -> list[Term]:
    """Pieces as terms, equal ones added; highest derivative first."""
    sums: dict[tuple[int, sympy.Expr, sympy.Expr | None], sympy.Expr] = {}
    for piece in found:
        still, factor = moving.split(sympy.S.One if piece.factor is None else piece.factor)
        for part in sympy.Add.make_args(sympy.expand(piece.signal)):
            coefficient, signal = moving.split(part)
            if signal == 1 and piece.order:
                continue
            key = (piece.order, signal, None if factor == 1 else factor)
            sums[key] = sums.get(key, sympy.S.Zero) + still * coefficient
    terms = []
    for (order, signal, factor), total in sums.items():
        coefficient = _factored(total)
        if coefficient != 0:
            public = None if factor is None else moving.public(factor)
            terms.append(Term(e, coefficient, order, moving.public(signal), public))

    def place(t: Term) -> tuple[Any, ...]:
        noisy = any(s.name in outputs for s in t.signal.free_symbols)
        return -t.order, t.factor is not None, not noisy, said(t.signal)

    return sorted(terms, key=place)


def _normal(terms: list[Term], *, turn: bool) -> tuple[list[Term], tuple[str, ...]]:
    """Terms of which at least one has a number for its coefficient; `turn`: the first without a minus."""
    if not terms:
        return terms, ()
    if free := not any(term.coefficient.is_number for term in terms):
        scale = terms[0].coefficient
    else:
        turned = turn and terms[0].coefficient.could_extract_minus_sign()
        scale = sympy.S.NegativeOne if turned else sympy.S.One
    if scale == 1:
        return terms, ()
    divided = [replace(t, coefficient=_factored(t.coefficient / scale)) for t in terms]
    words = f"Divided by {said(scale)}, so that one term has no parameter: only ratios can be found."
    return divided, (words,) if free else ()


def _factored(total: sympy.Expr) -> sympy.Expr:
    """A coefficient with its factors apart where its terms are few: long sums take long.

    Exponentials stay whole: exp(0.00335401643*E) is exp(E/10**11) to the power 335,401,643 for SymPy.
    """
    expanded = sympy.expand(total)
    if len(sympy.Add.make_args(expanded)) > MOST_FACTORED:
        return expanded
    whole = {one: sympy.Dummy(positive=True) for one in expanded.atoms(sympy.exp)}
    return sympy.factor(expanded.xreplace(whole)).xreplace({name: one for one, name in whole.items()})


def _separated(expr: sympy.Expr, moving: Moving) -> sympy.Expr:
    """sin(x + φ) as cos(φ) sin(x) + sin(φ) cos(x), and cos alike: the parameter leaves the signal."""
    for found in sorted(expr.atoms(sympy.sin, sympy.cos), key=str):
        parts = sympy.Add.make_args(sympy.expand(found.args[0]))
        phase = sympy.Add(*(part for part in parts if not any(map(moving.is_moving, part.free_symbols))))
        x = sympy.Add(*parts) - phase
        if phase != 0 != x and not moving.parameters(x):
            turned = sympy.cos(x) if found.func == sympy.sin else -sympy.sin(x)
            expr = expr.xreplace({found: sympy.cos(phase) * found.func(x) + sympy.sin(phase) * turned})
    return expr


def _logarithms(expr: sympy.Expr, moving: Moving) -> sympy.Expr:
    """log(K/x) as log(K) - log(x): the parameter leaves the signal, where both are positive."""
    for found in sorted(expr.atoms(sympy.log), key=str):
        still, signal = moving.split(sympy.factor(found.args[0]))
        if still != 1 and moving.parameters(still) and signal != 1 and not moving.parameters(signal):
            if still.could_extract_minus_sign():
                still, signal = -still, -signal
            expr = expr.xreplace({found: _log(still) + _log(signal)})
    return expr


def _log(positive: sympy.Expr) -> sympy.Expr:
    """A logarithm, of 1/x as -log(x)."""
    over, below = sympy.fraction(positive)
    return -sympy.log(below) if over == 1 else sympy.log(positive)


def _size(expr: sympy.Expr) -> int:
    """Bound on the number of terms once a sum is multiplied out."""
    if expr.is_Add:
        return sum(map(_size, expr.args))
    if expr.is_Mul:
        size = 1
        for part in expr.args:
            size = min(size * _size(part), 10 * MOST_TERMS)
        return size
    if expr.is_Pow and expr.exp.is_Integer and expr.exp > 1:
        return int(min(sympy.binomial(_size(expr.base) + int(expr.exp) - 1, int(expr.exp)), 10 * MOST_TERMS))
    return 1


def _not_eliminated(fault: NotExact, system: System, what: str) -> str:
    """That hidden signals leave what is no term, in words."""
    names = series(system.hidden)
    return (
        f"{what}: {names} {'is' if len(system.hidden) == 1 else 'are'} not measured, and eliminating leaves "
        f"{said(system.moving.public(fault.term))}, which is neither the derivative of a signal nor the "
        f"product of a signal and one; measure {names}, or {_by_response(system)}"
    )


def _by_response(system: System) -> str:
    """The way without elimination, in words."""
    held = ", ".join(f"{name!r}: ..." for name in system.parameters if name not in system.fixed)
    return f"fit the response from starts, mf.rivals.output_error(model, start={{{held}}})(rec)"


def _outside(fault: NotExact, moving: Moving, what: str) -> str:
    term = fault.term
    derivatives = sorted(
        {s.name for s in moving.symbols(term) if "'" in s.name}, key=lambda name: (len(name), name)
    )
    lower = derivatives[0].replace("'", "", 1) if derivatives else "y"
    shown = derivatives[0] if derivatives else "y'"
    cure = fault.cure or (
        f"measure {shown} and call it an output of its own: a signal v, the equation {lower}' = v, and v in "
        f"place of {shown}"
    )
    return (
        f"{what}: the term {said(moving.public(term))} is neither the derivative of a signal nor the product "
        f"of a signal and one; {cure}"
    )
