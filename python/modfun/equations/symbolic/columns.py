"""Candidate terms of an equation, each a column of its own: Σ c p^k E without parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from ...base.arrays import F64
from ...base.cached import cached_property
from ...errors import DataError, SpecError
from ...language.parser import expression
from ...records.forms import Forms
from .compiled import Compiled, Term
from .exact import NotExact, form, pieces
from .formulas import Formulas, formulas, of_record
from .jets import Moving
from .meaning import meaning
from .words import said

__all__ = ["Columns", "ReadTerm", "columns_of", "read_term"]

KEPT, KEPT_TERMS = 16, 4096


@dataclass(frozen=True, eq=False)
class Columns:
    """Texts as sums of derivatives of signals, for records of the same channels.

    Attributes
    ----------
    texts : tuple of str
    forms : tuple of str
        Each text multiplied out, the same for texts that mean the same.
    degrees : tuple of int
        Factors of each text, powers and functions counted: 2 of y*y', y**2 and sin(y).
    formulas : Formulas
        Signals and their slopes with respect to the noisy channels; a text is an equation of it.
    parts : ndarray, shape (text, derivative, signal)
        Factor of p^derivative of each signal in each text.
    """

    texts: tuple[str, ...]
    forms: tuple[str, ...]
    degrees: tuple[int, ...]
    formulas: Formulas
    parts: F64

    def kinds(self, record: int) -> list[str]:
        """How the samples of each signal of a record stand for it: rules of quadrature."""
        return [of_record(kinds, record) for kinds, _, _ in self.formulas.words["signals"]]

    def values(self, record: int, y: F64, u: F64, t: F64, variances: F64) -> tuple[F64, F64]:
        """Signals (signal, time) of a record, noise bias taken out, and slopes (signal, noisy channel, time).

        Raises
        ------
        DataError
            A term without a finite value, as log(y) where y is negative.
        """
        rows = self.formulas.rows(y, u, t, record=record)
        count, noisy = len(self.formulas.words["signals"]), len(self.formulas.noisy)
        independent = np.zeros(noisy * (noisy - 1) // 2)
        with np.errstate(all="ignore"):
            found = self._evaluate(*rows, *variances, *independent)
        signals = np.array([np.broadcast_to(one, t.shape) for one in found[:count]], dtype=np.float64)
        slopes = np.zeros((count, noisy, t.size))
        for (signal, channel), one in zip(self.formulas.words["sensitivities"], found[count:], strict=True):
            slopes[signal, channel] = one
        sound = np.all(np.isfinite(signals), axis=1) & np.all(np.isfinite(slopes), axis=(1, 2))
        if not sound.all():
            at = int(np.argmin(sound))
            text = self.texts[int(np.argmax(np.any(self.parts[:, :, at] != 0, axis=1)))]
            bad = ~(np.isfinite(signals[at]) & np.all(np.isfinite(slopes[at]), axis=0))
            raise DataError(
                f"select_terms: the term {text!r} or its slope has no finite value at sample "
                f"{np.argmax(bad)}; leave it out, or cut the record"
            )
        return signals, slopes

    @cached_property
    def _evaluate(self) -> Callable[..., Any]:
        results, symbols, _ = self.formulas.expressions
        plain = [sympy.Dummy() for _ in symbols]
        to = dict(zip(symbols, plain, strict=True))
        # A kink lies between the samples.
        smooth = [expr.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0)) for expr in results]
        named = [expr.xreplace(to) for expr in smooth]
        found: Callable[..., Any] = sympy.lambdify(plain, named, "numpy", cse=True)
        return found


@dataclass(frozen=True)
class ReadTerm:
    """One text, read.

    Attributes
    ----------
    form : str
        The text multiplied out.
    degree : int
        Number of factors, powers and functions counted.
    terms : tuple of Term
        Derivatives of signals that it is the sum of.
    factors : tuple of str
        Forms of the factors of a product of different ones, otherwise none.
    fault : str
        Why it is no such sum; empty where it is one.
    """

    form: str
    degree: int
    terms: tuple[Term, ...]
    factors: tuple[str, ...] = ()
    fault: str = ""


@lru_cache(KEPT_TERMS)
def read_term(text: str, outputs: tuple[str, ...], inputs: tuple[str, ...], what: str) -> ReadTerm:
    """Read one text; `columns_of` describes the arguments.

    Raises
    ------
    SpecError
        A text outside the language, with a name that is not a channel, or with a delay.
    """
    moving, parsed = Moving({*outputs, *inputs}), expression(text, "term")
    known = (*outputs, *inputs, "t", "pi")
    named = [str(node.value) for node in parsed.tree.walk() if node.kind == "name"]
    if strangers := [name for name in named if name not in known]:
        channels = ", ".join((*outputs, *inputs))
        raise SpecError(
            f"{what}: the term {text!r} has {strangers[0]!r}, which is not a channel of the record "
            f"({channels}); terms have no parameters inside, so write a number"
        )
    expr = meaning(parsed, moving)
    if moving.delays:
        raise SpecError(
            f"{what}: the term {text!r} has a delayed signal; add the shifted samples to the record as a "
            "channel of their own"
        )
    whole = sympy.expand(expr)
    shape, degree = str(whole), _degree(whole)
    try:
        found = pieces(form(expr, moving), moving, products=False)
    except NotExact as fault:
        return ReadTerm(
            shape,
            degree,
            (),
            (),
            f"{what}: the term {text!r} cannot be used: {said(fault.term)} is not a derivative of a signal; "
            "leave it out, or measure the derivative by a sensor of its own; one that is computed from the "
            "signal, as by np.gradient, has its noise and makes terms wrong",
        )
    terms = []
    for piece in found:
        for part in sympy.Add.make_args(sympy.expand(piece.signal)):
            number, signal = moving.split(part)
            if number != 0 and not (signal == 1 and piece.order):
                terms.append(Term(0, number, piece.order, signal))
    empty = "" if terms else f"{what}: the term {text!r} is zero; leave it out"
    return ReadTerm(shape, degree, tuple(terms), _factors(whole), empty)


@lru_cache(KEPT)
def columns_of(
    texts: Sequence[str],
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    forms: Forms,
    what: str,
) -> Columns:
    """Columns of texts.

    Parameters
    ----------
    texts : sequence of str
    outputs, inputs : tuple of str
        Channels of the records; outputs are noisy.
    forms : tuple of tuple of str
        How inputs go between samples: in all records, or in each.
    what : str
        Who asks, for messages.

    Raises
    ------
    SpecError
        A text outside the language, a name that is not a channel, or not the derivative of a signal.
    """
    read = [read_term(text, outputs, inputs, what) for text in texts]
    if fault := next((one.fault for one in read if one.fault), None):
        raise SpecError(fault)
    terms = [replace(term, equation=k) for k, one in enumerate(read) for term in one.terms]
    texts_read = tuple(one.form for one in read)
    degrees = tuple(one.degree for one in read)
    compiled = Compiled(outputs, inputs, (), {}, tuple(terms))
    made = formulas(compiled, "gregory", forms, outputs, False, True)
    parts = np.zeros((len(texts), 1 + max(t.order for t in terms), len(made.words["signals"])))
    for (text, signal, times), term in zip(made.words["terms"], terms, strict=True):
        parts[text, times, signal] += float(term.coefficient)
    return Columns(tuple(texts), texts_read, degrees, made, parts)


def _factors(expr: sympy.Expr) -> tuple[str, ...]:
    """Factors of a product of at least two, numbers aside."""
    found = [one for one in sympy.Mul.make_args(expr) if one.free_symbols]
    return tuple(map(str, found)) if len(found) > 1 else ()


def _degree(expr: sympy.Expr) -> int:
    """Number of factors of a term, with one more for each function; of a sum the most."""
    if not expr.free_symbols:
        return 0
    if expr.is_Symbol:
        return 1
    if expr.is_Pow and expr.exp.is_Integer:
        return abs(int(expr.exp)) * _degree(expr.base)
    parts = [_degree(part) for part in expr.args]
    return sum(parts) if expr.is_Mul else max(parts) + (not expr.is_Add)
