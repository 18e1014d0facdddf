"""Systems as formulas of LaTeX, which notebooks typeset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.arrays import F64
from .polynomials import Polynomials, text_of

__all__ = ["in_fractions", "in_matrices"]


def in_fractions(num: Polynomials, den: Polynomials, late: F64) -> str:
    """The transfer functions of all paths, a matrix where there are several."""
    rows = [
        [_fraction(n, d, late[i, j]) for j, (n, d) in enumerate(zip(*row, strict=True))]
        for i, row in enumerate(zip(num, den, strict=True))
    ]
    body = rows[0][0] if late.shape == (1, 1) else _matrix(rows)
    return f"$$G(s) = {body}$$"


def in_matrices(matrices: Sequence[F64], delays: Sequence[Any]) -> str:
    """The equations of a state space with its matrices."""
    a, b, c, d = (_matrix([[_number(v) for v in row] for row in m]) for m in matrices)
    late = "" if not np.any(delays) else rf",\quad \tau = {_matrix([[_number(v) for v in np.ravel(delays)]])}"
    u = "u" if not late else r"u(t - \tau)"
    driven = matrices[1].size > 0  # a free motion has no inputs
    of_states, of_outputs = (f" + {b} {u}", f" + {d} {u}") if driven else ("", "")
    return rf"$$\dot x = {a} x{of_states},\quad y = {c} x{of_outputs}{late}$$"


def _fraction(n: F64, d: F64, late: float) -> str:
    over = _polynomial(n) if d.size == 1 else rf"\frac{{{_polynomial(n)}}}{{{_polynomial(d)}}}"
    return over if not late else rf"{over} e^{{-{_number(late)} s}}"


def _polynomial(p: F64) -> str:
    """The text of a polynomial with its powers in braces."""
    words = [_power(word) for word in text_of(p).split(" ")]
    return " ".join(words)


def _power(word: str) -> str:
    base, mark, power = word.partition("^")
    if mark:
        return f"{base}^{{{power}}}"
    number, mark, power = word.partition("e")
    return rf"{number} \cdot 10^{{{int(power)}}}" if mark else word


def _number(value: float) -> str:
    return _power(f"{value:.6g}")


def _matrix(rows: Sequence[Sequence[str]]) -> str:
    lines = r" \\ ".join(" & ".join(row) for row in rows)
    return rf"\begin{{bmatrix}} {lines} \end{{bmatrix}}"
