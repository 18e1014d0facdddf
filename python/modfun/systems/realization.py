"""From polynomials to matrices and back."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from .polynomials import Polynomials, all_equal, companion, strip, time_unit

__all__ = ["observable", "transfer"]

ROUNDING = 1e-13  # what two coefficients leave that cancel, over their size


def transfer(a: F64, b: F64, c: F64, d: F64) -> tuple[Polynomials, Polynomials]:
    """Numerators and monic denominators (output, input) of a state space, in descending powers of s."""
    outputs, inputs = d.shape
    den = np.atleast_1d(np.poly(a)).real if a.size else np.ones(1)

    def numerator(i: int, j: int) -> F64:
        # det(sI − A + bc) = det(sI − A)(1 + c(sI − A)⁻¹b), so the path's numerator is a difference.
        first = np.poly(a - np.outer(b[:, j], c[i])).real if a.size else np.ones(1)
        second = (d[i, j] - 1.0) * den
        found = first + second
        found[np.abs(found) < ROUNDING * np.maximum(np.abs(first), np.abs(second))] = 0.0
        return strip(found, relative=1e-12)

    num = tuple(tuple(numerator(i, j) for j in range(inputs)) for i in range(outputs))
    return num, ((den,) * inputs,) * outputs


def observable(num: Polynomials, den: Polynomials) -> tuple[F64, F64, F64, F64, F64]:
    """A, B, C, D of the observable companion form, and the factors from y, y', … to its states.

    A companion matrix of a fast or slow system holds powers of its frequency; counting time in units of that
    frequency keeps the entries near 1.
    """
    outputs, inputs = len(num), len(num[0])
    blocks: list[tuple[int, list[int], F64]] = []
    for i in range(outputs):
        if all_equal((den[i],)):
            blocks.append((i, list(range(inputs)), den[i][0]))
        else:
            blocks.extend((i, [j], den[i][j]) for j in range(inputs))
    n = sum(p.size - 1 for _, _, p in blocks)
    a, b = np.zeros((n, n)), np.zeros((n, inputs))
    c, d = np.zeros((outputs, n)), np.zeros((outputs, inputs))
    scale = np.ones(n)
    at = 0
    for i, which, p in blocks:
        m = p.size - 1
        w = time_unit(p)
        powers = w ** -np.arange(m + 1.0)
        q = p * powers
        rows = slice(at, at + m)
        if m:
            a[rows, rows] = companion(p, w)
            c[i, at] = 1.0
            scale[rows] = powers[:m]
        for j in which:
            numerator = np.concatenate([np.zeros(m + 1 - num[i][j].size), num[i][j]]) * powers
            markov = np.zeros(m + 1)
            for k in range(m + 1):
                markov[k] = numerator[k] - q[1 : k + 1] @ markov[:k][::-1]
            d[i, j] += markov[0]
            b[rows, j] = w * markov[1:]
        at += m
    return a, b, c, d, scale
