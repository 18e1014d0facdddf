"""Fourier modulating functions themselves, complex and real, for integrals in the time domain.

Complex (report, eq. (7)): φ_m(t) = (1/T) exp(-i m ω₀ t)(exp(-i ω₀ t) - 1)ⁿ.  Real, the report's earlier ones:
Σ c_k cos kω₀t with Σ c_k k^{2i} = 0 and Σ s_k sin kω₀t with Σ s_k k^{2i+1} = 0, which make the derivatives
0..n-1 vanish at both ends; the coefficients of the lowest harmonics follow from the others by inverting a
Vandermonde matrix in k².
"""

import numpy as np


def phi(t, m, order, period):
    """φ_m at times t."""
    turn = np.exp(-2j * np.pi * t / period)
    return turn**m * (turn - 1) ** order / period


def real_functions(order, top):
    """(C, S): rows of coefficients c_0..c_top of the cosine and s_0..s_top of the sine functions."""
    k = np.arange(top + 1.0)
    even, odd = (order + 1) // 2, order // 2  # derivatives 0, 2, … and 1, 3, … below the order
    cosines = np.zeros((top + 1 - even, top + 1))
    for row, free in enumerate(range(even, top + 1)):
        cosines[row, free] = 1.0
        if even:
            vandermonde = k[:even] ** (2 * np.arange(even)[:, None])
            cosines[row, :even] = -np.linalg.solve(vandermonde, k[free] ** (2 * np.arange(even)))
    sines = np.zeros((top - odd, top + 1))
    for row, free in enumerate(range(odd + 1, top + 1)):
        sines[row, free] = 1.0
        if odd:
            powers = 2 * np.arange(odd) + 1
            vandermonde = k[1 : odd + 1] ** powers[:, None]
            sines[row, 1 : odd + 1] = -np.linalg.solve(vandermonde, k[free] ** powers)
    return cosines, sines
