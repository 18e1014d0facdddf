"""Formulas whose noise bias is that of each sample, for outputs whose noise changes from sample to sample."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import sympy

from .formulas import Formulas
from .tape import tape

__all__ = ["spread"]


def spread(formulas: Formulas, outputs: int) -> Formulas:
    """The same with a channel more for each output, behind the others: its samples' noise over the level.

    Variances and covariances in the signals and their slopes are multiplied by it; signals of several
    instants take that of the latest. Formulas in which no variance stands come back as they are.
    """
    results, symbols, coefficients = formulas.expressions
    first, count = formulas.words["channels"], len(formulas.words["noisy"])
    own = [sympy.Symbol(f"spread of {name}", positive=True) for name in formulas.noisy[:outputs]]
    each = [*own, *[sympy.Integer(1)] * (count - outputs)]
    pairs = symbols[first + count :]
    by = {variance: variance * s**2 for variance, s in zip(symbols[first:], each, strict=False)}
    by |= {both: both * a * b for both, (a, b) in zip(pairs, combinations(each, 2), strict=False)}
    made = [expr.xreplace(by) for expr in map(sympy.sympify, results)]
    if made == results:
        return formulas
    inputs = [*symbols[:first], *own, *symbols[first:]]
    words = formulas.words | {"formulas": tape(made, inputs), "channels": first + outputs}
    return replace(formulas, words=words, expressions=(made, inputs, coefficients))
