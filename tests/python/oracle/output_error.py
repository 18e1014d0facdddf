"""Time-domain output error with free initial state: the rival and the bound of the lines' estimators.

min over θ, x(0) of Σ_k (y_k - ŷ_k)² for one smooth input and numerator degree < n.  Exact responses: in
each sample the input enters through its moments M_j = dt^{j+1}/j! ∫₀¹ (1-ξ)^j u(t_k + ξ dt) dξ, because ∫
e^{A(dt-τ)} B u dτ = Σ_j A^j B M_j; moments are known once for all parameters, so a response is one small
product and one recursive filter (the characteristic polynomial of e^{A dt}).  The series ends at j = 15:
‖A‖ dt < 1.
"""

from math import factorial

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

TERMS = 12


class OutputError:
    """Responses of order `n` with `zeros` to a function of time, sampled N+1 times every dt seconds."""

    def __init__(self, u, dt, intervals, order=2, zeros=0):
        self.n, self.zeros, self.dt = order, zeros, dt
        x, w = np.polynomial.legendre.leggauss(12)
        x, w = 0.5 * (x + 1), 0.5 * w
        values = u(dt * np.arange(intervals)[:, None] + dt * x)
        powers = [dt ** (j + 1) / factorial(j) * w * (1 - x) ** j for j in range(TERMS)]
        self.moments = np.array(powers) @ values.T

    def response(self, unknowns):
        """y (N+1,) of [a1..an, b descending, state in observer form]."""
        n = self.n
        a = np.zeros((n, n))
        a[:, 0] = -unknowns[:n]
        a[np.arange(n - 1), np.arange(1, n)] = 1.0
        b = np.zeros(n)
        b[n - 1 - self.zeros :] = unknowns[n : n + self.zeros + 1]
        power, phi, krylov = np.eye(n), np.eye(n), np.empty((n, TERMS))
        for j in range(TERMS):
            krylov[:, j] = power @ b
            power = power @ a
            phi = phi + power * (self.dt ** (j + 1) / factorial(j + 1))
        drive = krylov @ self.moments  # x_{k+1} = Φ x_k + drive_k
        # Cayley-Hamilton: Σ_i c_i x_{k-i} = Σ_{i=1..n} (Φ^{i-1} + c_1 Φ^{i-2} + …) drive_{k-i}
        c = np.poly(phi) if n > 2 else np.array([1.0, -np.trace(phi), np.linalg.det(phi)][: n + 1])
        state = unknowns[n + self.zeros + 1 :]
        right = np.zeros(drive.shape[1] + 1)
        adjugate = np.eye(n)
        for i in range(1, n + 1):
            right[i:] += (adjugate[0] @ drive)[: drive.shape[1] + 1 - i]
            right[i - 1] += adjugate[0] @ state  # the initial state is a pulse before the first sample
            adjugate = adjugate @ phi + c[i] * np.eye(n)
        return lfilter([1.0], c, right)

    def fit(self, y, start):
        """SciPy's Levenberg-Marquardt from unknowns `start`; returns the unknowns."""
        size = np.maximum(np.abs(start), 0.1 * np.max(np.abs(y)))

        def residual(v):
            return self.response(v * size) - y

        return least_squares(residual, start / size, method="lm", xtol=1e-8, ftol=1e-10).x * size

    def bound(self, unknowns, sigma):
        """Cramér-Rao covariance of θ for white noise of sd `sigma`, initial state unknown."""
        unknowns = np.asarray(unknowns, float)
        columns = []
        for i in range(unknowns.size):
            h = 1e-5 * max(1.0, abs(unknowns[i]))
            up, down = unknowns.copy(), unknowns.copy()
            up[i] += h
            down[i] -= h
            columns.append((self.response(up) - self.response(down)) / (2 * h))
        j = np.column_stack(columns)
        p = self.n + self.zeros + 1
        return sigma**2 * np.linalg.inv(j.T @ j)[:p, :p]
