"""Exact derivatives of the output of a transfer function with respect to its parameters.

With Y = (BU + T)/A, T the polynomial of the initial state, the derivatives are filters of the same
denominator: ∂Y/∂a_i = −sⁿ⁻ⁱ Y/A, ∂Y/∂b_k = s^k U/A, ∂Y/∂T_k = s^k/A. All of them are states of one linear
system, so that one exact simulation gives the output and every derivative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import F64
from ..base.words import TRENDS
from ..systems.polynomials import companion
from ..systems.propagate import Inputs

__all__ = ["Sensitivities", "trend_rows"]


def trend_rows(trend: str | None, samples: int) -> F64:
    """Derivatives to the offset and the slope of an output, time counted from −1 to 1: (unknown, time)."""
    return np.asarray(np.linspace(-1.0, 1.0, samples) ** np.arange(TRENDS.index(trend))[:, None])


class Sensitivities:
    """Output and derivatives of a transfer function at the samples, s counted in units of a frequency.

    Parameters
    ----------
    order : int
        Number of poles n.
    degrees : sequence of int or None
        Degree of each input's numerator, None without a path.
    inputs : Inputs
        The inputs, prepared once.
    omega : float
        Unit of frequency, rad/s.
    """

    def __init__(self, order: int, degrees: Sequence[int | None], inputs: Inputs, omega: float) -> None:
        self.order, self.degrees, self.inputs, self.omega = order, tuple(degrees), inputs, omega
        exponents = [-i for i in range(1, order + 1)]
        for degree in self.degrees:
            if degree is not None:
                exponents += [k - order for k in range(degree, -1, -1)]
        # θ in units of omega is θ times these: a_i ω^−i and b of s^k times ω^(k−n).
        self.scale: F64 = omega ** np.array(exponents, dtype=np.float64)

    def run(self, theta: F64, transient: F64 | None = None) -> tuple[F64, F64]:
        """Output and Jacobian.

        Parameters
        ----------
        theta : ndarray, shape (parameter,)
            a1 … an, then the numerators, multiplied by `scale`.
        transient : ndarray, shape (order,), optional
            Coefficients of T in descending powers, in the unit of frequency; default: zero, from rest.

        Returns
        -------
        y : ndarray, shape (time,)
        jacobian : ndarray, shape (parameter + order, time)
            Derivatives to `theta`, then to `transient`.
        """
        n, nu = self.order, len(self.degrees)
        size = n * (nu + 2)
        block = companion(np.append(1.0, theta[:n]))
        last = block[-1]  # the nth derivative from the lower ones
        a: F64 = np.kron(np.eye(nu + 2), block).astype(np.float64)
        b = np.zeros((size, nu))
        # Chains: z_k = u_k/A an input, w = 1/A (an impulse at 0), v = y/A.
        count = theta.size
        c, d = np.zeros((1 + count + n, size)), np.zeros((1 + count + n, nu))
        for i in range(n):
            c[1 + i, size - 1 - i] = -1.0  # −p^(n−i) v
        row = n
        for k, degree in enumerate(self.degrees):
            b[(k + 1) * n - 1, k] = 1.0
            for power in range(-1 if degree is None else degree, -1, -1):
                row += 1
                if power == n:
                    c[row, k * n : (k + 1) * n] = last
                    d[row, k] = 1.0
                else:
                    c[row, k * n + power] = 1.0
                c[0] += theta[row - 1] * c[row]
                d[0] += theta[row - 1] * d[row]
        for i in range(n):
            c[1 + count + i, (nu + 1) * n - 1 - i] = 1.0
            if transient is not None:
                c[0, (nu + 1) * n - 1 - i] += transient[i]
        a[-1] += c[0]
        b[-1] += d[0]
        x0 = np.zeros(size)
        x0[(nu + 1) * n - 1] = 1.0
        out = self.inputs.respond((a * self.omega, b * self.omega, c, d), x0)
        return out[0], out[1:]
