"""Gains of a state space: point by point, exact far above its poles, or by one Schur form for many points."""

from __future__ import annotations

import numpy as np

from ..base.arrays import C128, F64

__all__ = ["SchurForm", "gains"]

AT_ONCE, ROWS = 256, 32  # frequencies, and rows of the triangle, whose solutions one product carries on
FEW = 10  # frequencies that are quicker one by one


def gains(a: F64, b: F64, c: F64, d: F64, s: C128) -> C128:
    """G(s) = C(s − A)⁻¹B + D, (s, output, input); infinite where s is a pole.

    Elimination keeps the zeros of A, so that every digit of a response holds that falls by any power of s.
    """
    found = np.empty((s.size, *d.shape), dtype=np.complex128)
    for k, point in enumerate(s):
        try:
            found[k] = c @ np.linalg.solve(point * np.eye(len(a)) - a, b) + d
        except np.linalg.LinAlgError:
            found[k] = np.inf
    return found


class SchurForm:
    """The same for thousands of frequencies of systems with hundreds of states, to rounding of the largest.

    Parameters
    ----------
    a, b, c, d : ndarray
        The matrices.
    """

    def __init__(self, a: F64, b: F64, c: F64, d: F64) -> None:
        from scipy.linalg import schur

        triangle, z = schur(a, output="complex") if a.size else (a, a)
        self.triangle: C128 = triangle.astype(np.complex128)
        self.b, self.c, self.d = z.conj().T @ b, c @ z, d

    def gains(self, omega: F64) -> C128:
        """G(iω), (omega, output, input): triangular solves for many frequencies at once."""
        n, (outputs, inputs) = len(self.triangle), self.d.shape
        found = np.empty((omega.size, outputs, inputs), dtype=np.complex128)
        if n and omega.size < FEW:
            from scipy.linalg.blas import ztrsm

            for k, w in enumerate(omega):
                shifted = -self.triangle
                shifted[np.diag_indices(n)] += 1j * w
                found[k] = self.d + self.c @ ztrsm(1.0, shifted, self.b)
            return found
        for first in range(0, omega.size, AT_ONCE):
            s = 1j * omega[first : first + AT_ONCE]
            x = np.empty((n, inputs * s.size), dtype=np.complex128)
            for last in range(n, 0, -ROWS):
                rows = slice(max(last - ROWS, 0), last)
                x[rows] = self.triangle[rows, last:] @ x[last:] + np.repeat(self.b[rows], s.size, axis=1)
                for k in range(last - 1, rows.start - 1, -1):
                    right = x[k] + self.triangle[k, k + 1 : last] @ x[k + 1 : last]
                    x[k] = (right.reshape(inputs, -1) / (s - self.triangle[k, k])).ravel()
            y = (self.c @ x).reshape(outputs, inputs, s.size)
            found[first : first + AT_ONCE] = self.d + y.transpose(2, 0, 1)
        return found
