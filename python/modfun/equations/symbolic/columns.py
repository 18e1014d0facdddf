"""Candidate terms of an equation, each a column of its own: Σ c p^k E without parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from ...errors import SpecError
from ...language.parser import expression
from .compiled import Compiled, Term
from .exact import NotExact, form, pieces
from .formulas import Formulas, formulas
from .jets import Moving, order
from .meaning import meaning
from .words import said

__all__ = ["Columns", "columns_of"]

KEPT = 16


@dataclass(frozen=True, eq=False)
class Columns:
    """Texts as sums of derivatives of signals, for records of the same channels.

    Attributes
    ----------
    texts : tuple of str
    forms : tuple of str
        Each text multiplied out, the same for texts that mean the same.
    derivatives : tuple of int
        Highest derivative that stands in each text.
    formulas : Formulas
        Signals and their slopes with respect to the noisy channels; a text is an equation of it.
    parts : ndarray, shape (text, derivative, signal)
        Factor of p^derivative of each signal in each text.
    """

    texts: tuple[str, ...]
    forms: tuple[str, ...]
    derivatives: tuple[int, ...]
    formulas: Formulas
    parts: F64

    @property
    def kinds(self) -> list[str]:
        """How the samples of each signal stand for it: rules of quadrature."""
        return [kind for kind, _, _ in self.formulas.words["signals"]]

    def values(self, y: F64, u: F64, t: F64, variances: F64) -> tuple[F64, F64]:
        """Signals (signal, time), noise bias taken out, and slopes (signal, noisy channel, time)."""
        rows = self.formulas.rows(y, u, t)
        found = self._evaluate(*rows, *variances)
        count, noisy = len(self.kinds), len(self.formulas.noisy)
        signals = np.array([np.broadcast_to(one, t.shape) for one in found[:count]], dtype=np.float64)
        slopes = np.zeros((count, noisy, t.size))
        for (signal, channel), one in zip(self.formulas.words["sensitivities"], found[count:], strict=True):
            slopes[signal, channel] = one
        return signals, slopes

    @cached_property
    def _evaluate(self) -> Callable[..., Any]:
        results, symbols = self.formulas.expressions
        plain = [sympy.Dummy() for _ in symbols]
        named = [expr.xreplace(dict(zip(symbols, plain, strict=True))) for expr in results]
        found: Callable[..., Any] = sympy.lambdify(plain, named, "numpy", cse=True)
        return found


@lru_cache(KEPT)
def columns_of(
    texts: Sequence[str],
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    intersample: tuple[str, ...],
    what: str,
) -> Columns:
    """Columns of texts.

    Parameters
    ----------
    texts : sequence of str
    outputs, inputs, intersample : tuple of str
        Channels of the records; outputs are noisy.
    what : str
        Who asks, for messages.

    Raises
    ------
    SpecError
        A text outside the language, with a name that is no channel, or that is no derivative of a signal.
    """
    terms: list[Term] = []
    forms, derivatives = [], []
    for k, text in enumerate(texts):
        moving = Moving({*outputs, *inputs})
        expr = meaning(expression(text, "term"), moving)
        if strangers := sorted(s.name for s in moving.parameters(expr)):
            channels = ", ".join((*outputs, *inputs))
            raise SpecError(
                f"{what}: the term {text!r} holds {strangers[0]!r}, which is no channel of the record "
                f"({channels}); terms have no parameters inside, so write a number"
            )
        if moving.delays:
            raise SpecError(
                f"{what}: the term {text!r} holds a delayed signal; add the shifted samples to the record "
                "as a channel of their own"
            )
        try:
            found = pieces(form(expr, moving), moving, products=False)
        except NotExact as fault:
            raise SpecError(
                f"{what}: the term {text!r} is not the derivative of a signal: {said(fault.term)} has none; "
                "leave it out, or measure the derivative as a channel of its own"
            ) from None
        own = _terms(k, found, moving)
        if not own:
            raise SpecError(f"{what}: the term {text!r} is zero; leave it out")
        terms += own
        forms.append(str(sympy.expand(expr)))
        derivatives.append(max((order(s) for s in moving.symbols(expr)), default=0))
    compiled = Compiled(outputs, inputs, (), {}, tuple(terms))
    made = formulas(compiled, "gregory", intersample, outputs, False, True)
    parts = np.zeros((len(texts), 1 + max(t.order for t in terms), len(made.words["signals"])))
    for (text, signal, times), term in zip(made.words["terms"], terms, strict=True):
        parts[text, times, signal] += float(term.coefficient)
    return Columns(tuple(texts), tuple(forms), tuple(derivatives), made, parts)


def _terms(at: int, found: Sequence[Any], moving: Moving) -> list[Term]:
    own = []
    for piece in found:
        for part in sympy.Add.make_args(sympy.expand(piece.signal)):
            number, signal = moving.split(part)
            if number != 0 and not (signal == 1 and piece.order):
                own.append(Term(at, number, piece.order, signal))
    return own
