"""Polynomials in descending powers of s: read, stripped, their roots, companion forms and text."""

from __future__ import annotations

from math import copysign, sqrt
from operator import mul
from typing import Any

import numpy as np

from ..base.arguments import reals
from ..base.arrays import C128, F64
from ..errors import SpecError

__all__ = [
    "Polynomials",
    "all_equal",
    "by_modulus",
    "companion",
    "fractions",
    "polynomials_of",
    "root_slopes",
    "roots",
    "roots_of",
    "strip",
    "text_of",
    "time_unit",
]

Polynomials = tuple[tuple[F64, ...], ...]  # (output, input)


def polynomials_of(given: Any, name: str) -> list[list[F64]]:
    """Polynomials as (output, input), whatever the nesting given."""

    def depth(x: Any) -> int:
        if isinstance(x, np.ndarray) and (x.dtype != object or x.ndim == 0):
            return int(x.ndim)
        return 1 + max(map(depth, x), default=0) if isinstance(x, list | tuple | np.ndarray) else 0

    deep = depth(given)
    if deep > 3 or (deep and len(given) == 0):
        raise SpecError(f"mf.tf: {name} is empty or nested too deep; give [[polynomial an input] an output]")
    nested: Any = given if deep == 3 else [given] if deep == 2 else [[given]]
    table = []
    if not all(isinstance(row, list | tuple | np.ndarray) for row in nested):
        raise SpecError(f"mf.tf: {name} mixes nestings; give [[polynomial an input] an output]")
    for row in nested:
        polynomials = []
        for p in row:
            array = np.atleast_1d(reals("mf.tf", name, [0.0] if p is None else p))
            if array.ndim != 1 or array.size == 0 or not np.all(np.isfinite(array)):
                raise SpecError(f"mf.tf: {name} must hold polynomials with finite coefficients, got {p!r}")
            polynomials.append(array)
        table.append(polynomials)
    return table


def strip(p: F64, relative: float = 0.0) -> F64:
    """Without leading zeros (or, of a computed polynomial, what is rounding of zero)."""
    if relative == 0.0 and p[0] != 0:
        return p
    keep = np.flatnonzero(np.abs(p) > relative * np.max(np.abs(p)))
    return p[keep[0] :] if keep.size else np.zeros(1)


def time_unit(monic: F64, still: float = 1.0) -> float:
    """Frequency in rad/s that keeps the coefficients of a monic polynomial near 1 when s is counted in it.

    It is `still` where all coefficients but the first are zero.
    """
    return max((abs(monic[k]) ** (1.0 / k) for k in range(1, monic.size)), default=still) or still


def companion(monic: F64, unit: float = 1.0) -> F64:
    """A of the states y, y'/unit, y''/unit², … whose y solves monic(d/dt) y = 0."""
    matrix = np.eye(monic.size - 1, k=1)
    matrix[-1:] = -(monic * unit ** -np.arange(float(monic.size)))[:0:-1]
    return matrix * unit


def roots(p: F64) -> C128:
    """Roots, with the variable scaled as the coefficients suggest."""
    return _scaled_roots(p)[0]


def root_slopes(p: F64) -> tuple[C128, C128]:
    """Roots r by increasing modulus and their derivatives (root, coefficient), −r^k/p'(r) to that of s^k."""
    found, q, w = _scaled_roots(p)
    found = by_modulus(found)
    scale = w ** np.arange(p.size + 1.0 - q.size, 1.0 - q.size, -1.0) / strip(p)[0]
    each = [_powers(r, p.size) for r in (found / w).tolist()]
    rising = [k * c for k, c in enumerate(q[::-1].tolist())]
    steepness = [-sum(map(mul, rising[1:], powers)) for powers in each]
    with np.errstate(divide="ignore", invalid="ignore"):  # repeated roots have no derivatives
        slopes = np.array(each).reshape(-1, p.size) / np.array(steepness)[:, None]
    return found, slopes[:, ::-1] * scale


def _powers(x: complex, count: int) -> list[complex]:
    """The first powers of a number, from 1 on: of few, plain numbers are fastest."""
    found = [1.0 + 0j]
    for _ in range(count - 1):
        found.append(found[-1] * x)
    return found


def _scaled_roots(p: F64) -> tuple[C128, F64, float]:
    """Roots, and the polynomial made monic with its variable counted in units of a frequency, and this."""
    p = strip(p)
    if p.size < 2:
        return np.zeros(0, dtype=np.complex128), np.ones(1), 1.0
    q = p / p[0]
    w = time_unit(q)
    q = q * w ** -np.arange(float(q.size))
    if q[-1] == 0:
        return np.asarray(np.roots(q) * w, dtype=np.complex128), q, w
    if q.size == 3:
        return _of_square(*q[1:].tolist()) * w, q, w
    matrix = np.eye(q.size - 1, k=-1)  # as np.roots has it, at half its time
    matrix[0] = -q[1:]
    return np.asarray(np.linalg.eigvals(matrix) * w, dtype=np.complex128), q, w


def _of_square(b: float, c: float) -> C128:
    """Roots of s² + b s + c, c not 0: of real ones the smaller by their product, which rounds less."""
    inside = b * b / 4 - c
    if inside < 0:
        half = sqrt(-inside)
        return np.array([complex(-b / 2, half), complex(-b / 2, -half)])
    larger = -(b / 2 + copysign(sqrt(inside), b))
    return np.array([larger, c / larger], dtype=np.complex128)


def roots_of(p: F64) -> C128:
    """Roots of a polynomial in descending powers, by increasing modulus."""
    return by_modulus(roots(p))


def by_modulus(roots: Any) -> C128:
    found = np.asarray(roots, dtype=np.complex128).tolist()
    found.sort(key=lambda r: (round(abs(r), 12), r.real, r.imag))
    return np.array(found, dtype=np.complex128)


def all_equal(table: Polynomials) -> bool:
    first = table[0][0]
    return all(np.array_equal(p, first) for row in table for p in row)


def text_of(p: F64) -> str:
    """A polynomial for reading: "s^2 + 3 s + 8"."""
    terms: list[str] = []
    for k, value in enumerate(p):
        power = p.size - 1 - k
        if value == 0 and p.size > 1:
            continue
        size = f"{abs(value):.6g}"
        symbol = "" if power == 0 else "s" if power == 1 else f"s^{power}"
        body = symbol if size == "1" and symbol else f"{size} {symbol}".strip()
        terms.append(
            ("-" if value < 0 else "") + body if not terms else f" {'-' if value < 0 else '+'} {body}"
        )
    return "".join(terms) or "0"


def fractions(num: Polynomials, den: Polynomials, late: F64) -> str:
    """Fractions of all paths as text, one below the other, with their delays in seconds."""
    blocks = []
    for i, (nums, dens) in enumerate(zip(num, den, strict=True)):
        for j, (n, d) in enumerate(zip(nums, dens, strict=True)):
            top, bottom = text_of(n), text_of(d)
            if late[i, j]:
                top = f"({top}) e^(-{late[i, j]:.6g} s)"
            width = max(len(top), len(bottom))
            title = "" if late.shape == (1, 1) else f"input {j + 1} to output {i + 1}\n"
            blocks.append(
                f"{title}{top.center(width).rstrip()}\n{'-' * width}\n{bottom.center(width).rstrip()}"
            )
    return "\n\n".join(blocks)
