"""Smooth levels of noise: squares of which the logarithm of the mean is a sum of few smooth functions."""

from __future__ import annotations

import numpy as np

from .arrays import F64

__all__ = ["smooth_level"]

TERMS = 6  # Chebyshev polynomials
SPREAD = 2.0  # prior standard deviation of a coefficient times its degree
ROUNDS = 50
RANGE = 50.0  # of the logarithm of a level over the mean


def smooth_level(squares: F64, x: F64, freedom: F64 | float, terms: int = TERMS) -> F64:
    """Means of squares that are chi-squared over their degrees of freedom, smooth in x.

    A gamma regression: the logarithm of the mean is a sum of Chebyshev polynomials over the range of x, which
    a prior keeps small (P. McCullagh, J. A. Nelder, Generalized Linear Models, 1989, chapter 8).

    Parameters
    ----------
    squares : ndarray, shape (n,)
    x : ndarray, shape (n,)
    freedom : ndarray or float
        Degrees of freedom of each square; 0 where it does not count.
    terms : int
    """
    half = np.broadcast_to(np.asarray(freedom, dtype=np.float64), squares.shape) / 2
    mean = float(half @ squares / half.sum())
    if not mean > 0:
        return np.zeros_like(squares)
    low, high = x.min(), x.max()
    if not high > low:
        return np.full_like(squares, mean)
    basis = np.polynomial.chebyshev.chebvander(2 * (x - low) / (high - low) - 1, terms - 1)
    prior = np.diag((np.arange(terms) / SPREAD) ** 2)
    values = squares / mean
    c = np.zeros(terms)

    def cost(c: F64) -> float:
        log = np.clip(basis @ c, -RANGE, RANGE)
        return float(half @ (log + values * np.exp(-log)) + c @ prior @ c / 2)

    here = cost(c)
    for _ in range(ROUNDS):
        ratio = values * np.exp(-np.clip(basis @ c, -RANGE, RANGE))
        slope = basis.T @ (half * (1 - ratio)) + prior @ c
        # Between the expected curvature and that of the data, which is the larger where squares are.
        curvature = (basis.T * (half * np.maximum(ratio, 1.0))) @ basis + prior
        step = np.linalg.solve(curvature, slope)
        size = 1.0
        while (there := cost(c - size * step)) > here and size > 1e-3:
            size /= 2
        if not there < here - 1e-10:
            break
        c, here = c - size * step, there
    return np.asarray(mean * np.exp(np.clip(basis @ c, -RANGE, RANGE)))
