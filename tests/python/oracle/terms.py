"""Modulated equations Σ_j g_j(θ) p^{k_j} E_j(v, t) = 0 with dense matrices: the oracle of general terms.

v are noisy channels (white noise of standard deviation σ_c, correlation R), E any function of them and of
time.  On the lines s = i m ω₀, m = low..K, each equation is ε(θ) = Σ_j g_j(θ) A_j E_j less a polynomial T(s)
with n_e real coefficients, n_e its highest derivative; A_j are the real rows of s^{k_j} W, W the weighted
DFT.  To first order ε moves with the noise by L_c(θ) = Σ_j g_j A_j diag(∂E_j/∂v_c), so that
C = Σ_cd Σ_cd L_c L_dᵀ and

    ml: min over θ of min over T of (ε - T)ᵀ C(θ)⁻¹ (ε - T)

by Gauss-Newton: v̂_c = Σ_d Σ_cd L_dᵀ C⁻¹ (ε - T) is the smoothed noise, J_i = ∂ε/∂θ_i - Σ_c (∂L_c/∂θ_i) v̂_c
are the columns of the denoised signals, which makes JᵀC⁻¹ε the exact gradient.  `awls` has J = ∂ε/∂θ instead.

Order of rows: line by line, in a line equation by equation, Re before Im; Im of line 0 is left out.

Bias: the mean of f(v + noise) is e^{½∂Σ∂} f, so signals are replaced by e^{-½∂Σ∂} f, which is the mean of
f(v + iWz) over normal z, WWᵀ = Σ: Gauss-Hermite sums, exact for polynomials, with no derivative taken.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from math import comb

import numpy as np
from scipy.optimize import least_squares

from .coefficients import coefficients, unit_variance, weights
from .differences import central


@dataclass
class Term:
    """coefficient(θ) · p^order signal(v, t, θ), v (channels, N+1); slopes[c] is ∂signal/∂v_c, same arguments.

    Signals without slopes are known; of these `kind` may be "zoh" or "foh".  Signals that depend on θ are
    `moving`.
    """

    coefficient: Callable
    order: int
    signal: Callable
    slopes: dict = field(default_factory=dict)
    equation: int = 0
    kind: str | None = None
    moving: bool = False


@dataclass
class Result:
    """θ, cost ε*C⁻¹ε, degrees of freedom, covariances, iterations and the smoothed noise (channels, N+1)."""

    theta: np.ndarray
    cost: float
    df: int
    cov: np.ndarray
    cov_hc3: np.ndarray
    iterations: int
    noise: np.ndarray


class Problem:
    """Terms on the lines low..top of a record v (channels, N+1) with noise levels sigma, one per channel, and
    their correlation (default: none).

    `correct` takes the bias of nonlinear signals away; slopes are taken at `at` (default: at v).
    """

    def __init__(
        self, terms, v, dt, sigma, top, low=0, correct=True, rule="gregory", at=None, correlation=None
    ):
        self.terms, self.correct, self.rule = terms, correct, rule
        self.v = np.atleast_2d(np.asarray(v, float))
        self.at = self.v if at is None else at
        self.sigma = np.broadcast_to(np.asarray(sigma, float), self.v.shape[0])
        whole = np.eye(self.sigma.size) if correlation is None else np.asarray(correlation, float)
        self.spread = np.outer(self.sigma, self.sigma) * whole
        self.intervals = self.v.shape[1] - 1
        self.t = dt * np.arange(self.intervals + 1)
        self.m = np.arange(low, top + 1)
        self.s = 2j * np.pi * self.m / self.t[-1]
        k = np.arange(self.intervals + 1)
        turns = np.outer(self.m, k) % self.intervals / self.intervals  # reduced exactly, in integers
        self.dft = np.exp(-2j * np.pi * turns) * weights(rule, self.intervals) / self.intervals
        equations = 1 + max(term.equation for term in terms)
        self.orders = [max(x.order for x in terms if x.equation == e) for e in range(equations)]
        self.matrices = [self.rows(self.s[:, None] ** x.order * self.dft, x.equation) for x in terms]
        z = self.s / abs(self.s[-1])
        ends = [(z**j, e) for e, n in enumerate(self.orders) for j in range(n)]
        self.ends = np.column_stack([np.zeros((len(self.matrices[0]), 0)), *(self.rows(*x) for x in ends)])
        self.known = {}  # signals and slopes that do not depend on θ

    def rows(self, z, equation):
        """Real rows of a complex vector or matrix on the lines, which stands in one equation."""
        all_rows = np.zeros((self.m.size, len(self.orders), 2, *z.shape[1:]))
        all_rows[:, equation, 0], all_rows[:, equation, 1] = z.real, z.imag
        return all_rows.reshape(-1, *z.shape[1:])[self.kept()]

    def kept(self):
        """Which of (line, equation, Re or Im) are rows."""
        part = np.arange(2 * self.m.size * len(self.orders)) % 2
        return (np.repeat(self.m, 2 * len(self.orders)) > 0) | (part == 0)

    def unbiased(self, function, depends, v, theta):
        """e^{-½∂Σ∂} of a function of the channels `depends`, at v."""
        noisy = [c for c in depends if self.sigma[c] > 0]
        if not self.correct or not noisy:
            return function(v, self.t, theta) + np.zeros(v.shape[1])
        nodes, mass = np.polynomial.hermite_e.hermegauss(8)
        root = np.linalg.cholesky(self.spread[np.ix_(noisy, noisy)])
        total = np.zeros(v.shape[1])
        for pick in product(range(nodes.size), repeat=len(noisy)):
            w = v.astype(complex)
            w[noisy] += 1j * (root @ nodes[list(pick)])[:, None]
            total = total + np.prod(mass[list(pick)]) * np.real(function(w, self.t, theta))
        return total / np.sum(mass) ** len(noisy)

    def signal(self, term, theta, channel=None):
        """E of a term, unbiased, or its slope by a channel."""
        key = (id(term), channel)
        if key in self.known:
            return self.known[key]
        if channel is None:
            value = self.unbiased(term.signal, term.slopes, self.v, theta)
        else:
            value = self.unbiased(term.slopes[channel], term.slopes, self.at, theta)
        if not term.moving:
            self.known[key] = value
        return value

    def error(self, theta):
        """ε(θ) before end terms."""
        total = 0.0
        for term, matrix in zip(self.terms, self.matrices, strict=True):
            e = self.signal(term, theta)
            if term.kind is None:
                lines = matrix @ e
            else:
                held = coefficients(e, self.m[-1], term.kind)[self.m[0] :]
                lines = self.rows(self.s**term.order * held, term.equation)
            total = total + term.coefficient(theta) * lines
        return total

    def sensitivity(self, theta):
        """L(θ): (channels, rows, N+1)."""
        out = np.zeros((self.v.shape[0], *self.matrices[0].shape))
        for term, matrix in zip(self.terms, self.matrices, strict=True):
            for c in term.slopes:
                out[c] += term.coefficient(theta) * matrix * self.signal(term, theta, c)
        return out

    def moved(self, theta, noise):
        """Σ_c L_c(θ) noise_c."""
        total = np.zeros(len(self.ends))
        for term, matrix in zip(self.terms, self.matrices, strict=True):
            for c in term.slopes:
                total += term.coefficient(theta) * matrix @ (self.signal(term, theta, c) * noise[c])
        return total

    def covariance(self, theta):
        """C(θ); θ None: that of equation noise, lines independent, their Re and Im alike."""
        if theta is None:
            m = np.repeat(self.m, 2 * len(self.orders))[self.kept()]
            return np.diag(np.where(m == 0, 1.0, 0.5)) * unit_variance(self.rule, self.intervals)
        lines = self.sensitivity(theta)
        return sum(lines[c] @ lines[d].T * own for (c, d), own in np.ndenumerate(self.spread) if own)

    def columns(self, theta, noise=None):
        """∂(ε - L noise)/∂θ, with `noise` held (None: zero), by five-point differences."""
        theta = np.asarray(theta, float)
        out = []
        for i in range(theta.size):
            h = 1e-3 * max(abs(theta[i]), 1e-3)
            slope = 0.0
            for step, factor in ((-2, 1), (-1, -8), (1, 8), (2, -1)):
                x = theta.copy()
                x[i] += step * h
                slope = slope + factor / (12 * h) * (
                    self.error(x) - (0.0 if noise is None else self.moved(x, noise))
                )
            out.append(slope)
        return np.column_stack(out)

    def at_theta(self, theta, weight_at):
        """(whitening matrix, best end terms, residual rows ε - T) with the covariance at `weight_at`."""
        whiten = np.linalg.inv(np.linalg.cholesky(self.covariance(weight_at)))
        error = self.error(theta)
        ends = solve(whiten @ self.ends, whiten @ error)
        return whiten, ends, error - self.ends @ ends

    def noise(self, theta, whiten, residual):
        """v̂ = Σ Lᵀ C⁻¹ (ε - T), (channels, N+1)."""
        dual = whiten.T @ (whiten @ residual)
        return self.spread @ (self.sensitivity(theta).transpose(0, 2, 1) @ dual)

    def differences(self):
        """Δ^{n_e} of the lines of every equation, rows from -⌊n_e/2⌋ on: maps rows to rows (low = 0)."""
        shape = (self.m.size, len(self.orders), 2)
        place = np.full(shape, -1)
        place.reshape(-1)[self.kept()] = np.arange(np.count_nonzero(self.kept()))
        out = []
        for e, n in enumerate(self.orders):
            for first in range(-(n // 2), self.m.size - n):
                for part in (0, 1):
                    row = np.zeros(len(self.ends))
                    for j in range(n + 1):
                        line = first + j
                        sign = 1 if part == 0 or line > 0 else -1
                        if part == 0 or line != 0:
                            row[place[abs(line), e, part]] += sign * (-1) ** (n - j) * comb(n, j)
                    if part == 0 or 2 * first != -n:  # the row at -n/2 is real
                        out.append(row)
        return np.array(out)


def solve(matrix, target):
    """Least squares with columns of unit norm."""
    norm = np.linalg.norm(matrix, axis=0)
    return np.linalg.lstsq(matrix / norm, target, rcond=None)[0] / norm


def ls(problem, start, iterations=50):
    """Plain least squares over the differenced rows; Gauss-Newton, one step where g is linear; returns θ."""
    d, theta = problem.differences(), np.asarray(start, float)
    for _ in range(iterations):
        step = solve(d @ problem.columns(theta), d @ problem.error(theta))
        theta = theta - step
        if np.max(np.abs(step)) <= 1e-13 * np.max(np.abs(theta)):
            break
    return theta


def iterate(problem, method, start, iterations=100, tol=1e-12):
    """`wls`, `awls` or `ml` from `start`; (θ, iterations).

    A step of `ml` after the third is halved while the cost rises.
    """
    theta, last = np.asarray(start, float), np.inf
    for count in range(1, iterations + 1):
        whiten, _, residual = problem.at_theta(theta, None if method == "wls" else theta)
        noise = problem.noise(theta, whiten, residual) if method == "ml" else None
        jacobian = whiten @ np.hstack([problem.columns(theta, noise), problem.ends])
        step = solve(jacobian, whiten @ residual)[: theta.size]
        now = float(np.sum((whiten @ residual) ** 2))
        if method == "ml" and count > 3:
            for _ in range(20):
                w, _, r = problem.at_theta(theta - step, theta - step)
                if np.sum((w @ r) ** 2) <= now * (1 + 1e-12):
                    break
                step = step / 2
        theta = theta - step
        size = np.max(np.abs(step) / np.maximum(np.abs(theta), 1e-3 * np.max(np.abs(theta))))
        if size <= tol or (size <= 1e-9 and size >= last):  # the last digits are rounding
            break
        last = size
    return theta, count


def wls(problem, start):
    """Covariance of equation noise; returns θ."""
    return iterate(problem, "wls", start)[0]


def awls(problem, start):
    """Covariance at the last estimate, to the fixed point; returns θ."""
    return iterate(problem, "awls", start)[0]


def ml(problem, start):
    """The denoised-regressor Gauss-Newton step, to the end; returns θ."""
    return iterate(problem, "ml", start)[0]


def minimum(problem, start):
    """The minimiser of ε*C(θ)⁻¹ε by SciPy on the whitened residual with numerical slopes; returns θ."""

    def residual(x):
        whiten, _, r = problem.at_theta(x * size, x * size)
        return whiten @ r

    size = np.abs(np.asarray(start, float))
    found = least_squares(
        residual, start / size, jac=central(residual), method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    return found.x * size


def fit(problem, method, start):
    """θ with both covariances.

    Rows whitened at θ, residual e, are mapped to θ by E: classical σ²EEᵀ, σ² = cost/df; HC3
    E diag(e²/(1-h)²)Eᵀ, h the leverages with the end terms.  Estimators linear in unweighted rows (`ls`,
    `wls`) have their own E, and the end terms that are best at θ.
    """
    if method == "ls":
        theta, count = ls(problem, start), 1
    else:
        theta, count = iterate(problem, method, start)
    p = theta.size
    whiten, _, residual = problem.at_theta(theta, theta)
    noise = problem.noise(theta, whiten, residual)
    e = whiten @ residual
    columns = problem.columns(theta, noise if method == "ml" else None)
    q = np.linalg.qr(whiten @ problem.ends)[0] if problem.ends.size else np.zeros((e.size, 0))
    if method in ("awls", "ml"):
        left = whiten @ columns - q @ (q.T @ (whiten @ columns))
        norm = np.linalg.norm(left, axis=0)
        estimator = np.linalg.pinv(left / norm) / norm[:, None]
    else:
        if method == "ls":
            first = problem.differences()
        else:
            first = np.linalg.inv(np.linalg.cholesky(problem.covariance(None)))
            w = np.linalg.qr(first @ problem.ends)[0]
            first = first - w @ (w.T @ first)
        norm = np.linalg.norm(first @ columns, axis=0)
        rows = np.linalg.pinv(first @ columns / norm) / norm[:, None] @ first
        estimator = rows @ np.linalg.inv(whiten)
        left = whiten @ columns - q @ (q.T @ (whiten @ columns))
    leverage = np.sum(q * q, axis=1) + np.sum(left * estimator.T, axis=1)
    cost, df = float(e @ e), e.size - p - problem.ends.shape[1]
    pull = estimator * (e / (1 - leverage))
    return Result(theta, cost, df, cost / df * estimator @ estimator.T, pull @ pull.T, count, noise)
