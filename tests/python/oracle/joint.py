"""Joint problems solved the slow way: SciPy's least squares on the whitened lines of all outputs.

Written from THEORY's sections 1 and 3: residuals r_i = A_i Y_i − Σ_k B_ik U_k − T_i, covariance
S = D Σ_y D* + B Σ_u B*, T_i a polynomial in s of degree below the order. Known delays only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from .coefficients import coefficients


@dataclass
class Joint:
    """Outputs (output, time) and inputs on lines `first` to `last`, denominators common or separate."""

    y: np.ndarray
    u: np.ndarray
    dt: float
    first: int
    last: int
    order: int
    degrees: list  # [output][input], None without a path
    common: bool

    def __post_init__(self) -> None:
        n = self.y.shape[1] - 1
        m = np.arange(self.first, self.last + 1)
        self.s = 2j * np.pi * m / (n * self.dt)
        weigh = [coefficients(v, self.last)[m] for v in (*self.y, *self.u)]
        self.Y, self.U = np.array(weigh[: len(self.y)]), np.array(weigh[len(self.y) :])
        self.h = np.where(m == 0, 1.0, 0.5)

    def polynomials(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A (output, line) and B (output, input, line)."""
        q, k = len(self.Y), len(self.U)
        a = np.empty((q, self.s.size), complex)
        b = np.zeros((q, k, self.s.size), complex)
        at = self.order if self.common else 0
        for i in range(q):
            if self.common:
                a[i] = np.polyval([1, *theta[: self.order]], self.s)
            else:
                a[i] = np.polyval([1, *theta[at : at + self.order]], self.s)
                at += self.order
            for j in range(k):
                degree = self.degrees[i][j]
                if degree is not None:
                    b[i, j] = np.polyval(theta[at : at + degree + 1], self.s)
                    at += degree + 1
        return a, b

    def residuals(self, theta: np.ndarray, t: np.ndarray, sigma_y: np.ndarray, sigma_u=None) -> np.ndarray:
        """Whitened residuals (line, output), up to the line's own variance."""
        a, b = self.polynomials(theta)
        scaled = self.s / abs(self.s[-1])
        t = t.reshape(len(self.Y), self.order)
        r = a * self.Y - np.einsum("ijl,jl->il", b, self.U)
        r -= np.array([np.polyval(row, scaled) for row in t])
        cov = np.einsum("il,ij,jl->lij", a, sigma_y, a.conj())
        if sigma_u is not None:
            cov = cov + np.einsum("iml,mn,jnl->lij", b, sigma_u, b.conj())
        root = np.linalg.cholesky(cov)
        return np.linalg.solve(root, r.T[:, :, None])[:, :, 0] / np.sqrt(self.h)[:, None]

    def solve(self, theta: np.ndarray, sigma_y: np.ndarray, sigma_u=None) -> np.ndarray:
        """θ of least cost for a known covariance, from a start near it."""
        p, extra = theta.size, len(self.Y) * self.order

        def real(x: np.ndarray) -> np.ndarray:
            e = self.residuals(x[:p], x[p:], sigma_y, sigma_u)
            return np.concatenate([e.real.ravel(), e.imag.ravel()])

        start = np.concatenate([theta, np.zeros(extra)])
        found = least_squares(real, start, x_scale="jac", ftol=1e-15, xtol=1e-15, gtol=1e-15)
        self.transient = found.x[p:]
        return found.x[:p]

    def covariance(self, theta: np.ndarray) -> np.ndarray:
        """Σ_y that the residuals r/A show, per sample, with the degrees of freedom of one output."""
        a, b = self.polynomials(theta)
        scaled = self.s / abs(self.s[-1])
        t = self.transient.reshape(len(self.Y), self.order)
        z = self.Y - (np.einsum("ijl,jl->il", b, self.U) + np.array([np.polyval(r, scaled) for r in t])) / a
        rows = 2 * self.s.size
        free = (rows * len(self.Y) - theta.size - t.size) / len(self.Y)
        return (z @ z.conj().T).real * 2 / free * (self.y.shape[1] - 1)

    def alternate(self, theta: np.ndarray, rounds: int = 60) -> tuple[np.ndarray, np.ndarray]:
        """θ and Σ_y by turns until both stand."""
        sigma = np.diag([np.mean(np.abs(y) ** 2) for y in self.Y])
        for _ in range(rounds):
            theta = self.solve(theta, sigma)
            sigma = self.covariance(theta)
        return theta, sigma

    def errors(self, theta: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Covariance of θ as if Σ_y = `sigma` were known, and by how much errors grow because it is not.

        The second by Kenward and Roger (1997), term by term: elements of Σ_y scatter as those of a Wishart
        matrix do, with degrees of freedom that allow for the inverse.
        """
        q, p = len(self.Y), theta.size
        x = np.concatenate([theta, self.transient])

        def response(x: np.ndarray) -> np.ndarray:
            a, b = self.polynomials(x[:p])
            t = [np.polyval(row, self.s / abs(self.s[-1])) for row in x[p:].reshape(q, self.order)]
            return (np.einsum("ijl,jl->il", b, self.U) + np.array(t)) / a

        steps = 1e-6 * np.diag(np.maximum(np.abs(x), np.abs(x).max() * 1e-3))
        slopes = [(response(x + h) - response(x - h)) / (2 * h.max()) for h in steps]
        whole = np.array(slopes) * np.sqrt((self.y.shape[1] - 1) / self.h)
        rows = np.concatenate([whole.real, whole.imag], axis=2)  # unknown, output, row
        inverse = np.linalg.inv(sigma)
        weighted = np.einsum("oi,uir->uor", np.linalg.inv(np.linalg.cholesky(sigma)), rows)
        flat = weighted.reshape(x.size, -1)
        ends = np.linalg.lstsq(flat[p:].T, flat[:p].T, rcond=None)[0]
        slope = rows[:p] - np.einsum("tp,tor->por", ends, rows[p:])
        gram = np.einsum("por,oi,qir->pq", slope, inverse, slope)
        cov, freedom = np.linalg.inv(gram), 2 * self.s.size - x.size / q
        units = [np.outer(np.eye(q)[i], np.eye(q)[j]) for i in range(q) for j in range(q)]
        places = [(i, j) for i in range(q) for j in range(q)]
        extra = np.zeros((p, p))
        first = [np.einsum("por,oi,qir->pq", slope, -inverse @ e @ inverse, slope) for e in units]
        for (i, j), e, one in zip(places, units, first, strict=True):
            for (k, m), f, two in zip(places, units, first, strict=True):
                scatter = sigma[i, k] * sigma[j, m] + sigma[i, m] * sigma[j, k]
                second = np.einsum("por,oi,qir->pq", slope, inverse @ e @ inverse @ f @ inverse, slope)
                extra += scatter / (freedom - q - 1) * cov @ (second - one @ cov @ two) @ cov
        return cov, np.sqrt(1 + 2 * np.diag(extra) / np.diag(cov))
