"""Modulated equation errors with their dense covariance: the differenced form of every estimator.

Rows ε(m) = Δⁿ{A(imω₀)Y(m) - Σ B_k(imω₀)U_k(m)}, m = first..M, Δⁿ the n-th forward difference in m (report,
eqs (10), (11)); first is -⌊n/2⌋ (no information lost) or 0 (the report's).  V(-m) is conj V(m).  Re and Im
rows are D_R Re Q and D_I Im Q of the lines 0..K, K = M+n, with covariances D_R diag(hS) D_Rᵀ and D_I
diag(hS) D_Iᵀ, h_0 = 1, h_m = ½, S = |A|²Σw²/N²; the condition of these grows like M^{2n}: for n <= 3 and
moderate M only.
"""

from math import comb

import numpy as np
from scipy.optimize import least_squares

from .coefficients import coefficients, unit_variance
from .differences import central


class Differenced:
    """One record: regressors, target and covariance of the rows, in powers of s/scale.

    They are differenced n times, or as often as `differences` says.
    """

    def __init__(self, record, order, numerators, harmonics, extended=True, rule="gregory", differences=None):
        self.n, self.numerators = order, numerators
        self.q = order if differences is None else differences
        self.top = harmonics + self.q
        self.first = -(self.q // 2) if extended else 0
        self.last = harmonics
        self.intervals = record.y.size - 1
        omega0 = 2 * np.pi / (self.intervals * record.dt)
        self.scale = self.top * omega0
        self.z = 1j * np.arange(self.top + 1) * omega0 / self.scale
        self.variance = unit_variance(rule, self.intervals)
        self.y = coefficients(record.y, self.top, rule)
        kinds = [rule if kind == "smooth" else kind for kind in record.kinds]
        self.u = [coefficients(v, self.top, kind) for v, kind in zip(record.u, kinds, strict=True)]
        kept = [d for d in numerators if d is not None]
        powers = [*range(1, order + 1), *(order - k for d in kept for k in range(d, -1, -1))]
        self.unit = self.scale ** np.array(powers, float)
        self.re, self.im = self.difference_matrices()

    def difference_matrices(self):
        """D_R and D_I: real matrices from Re and Im of the lines 0..K to Re and Im of the rows."""
        count = self.last - self.first + 1
        re, im = np.zeros((count, self.top + 1)), np.zeros((count, self.top + 1))
        for row, m in enumerate(range(self.first, self.last + 1)):
            for j in range(self.q + 1):
                c = (-1) ** (self.q - j) * comb(self.q, j)
                re[row, abs(m + j)] += c
                im[row, abs(m + j)] += c * np.sign(m + j)
        if self.first < 0 and self.q % 2 == 0:
            im = im[1:]  # the row at -q/2 is real
        return re, im

    def rows(self, lines):
        """Stacked Re and Im of Δⁿ of values on the lines 0..K."""
        return np.concatenate([self.re @ lines.real, self.im @ lines.imag])

    def regressors(self, y=None):
        """(Γ, γ₀): ε = Γθ - γ₀ in scaled θ; columns of `y` instead of the measured coefficients if given."""
        y = self.y if y is None else y
        columns = [self.z ** (self.n - j) * y for j in range(1, self.n + 1)]
        for degree, v in zip(self.numerators, self.u, strict=True):
            columns += [] if degree is None else [-(self.z**k) * v for k in range(degree, -1, -1)]
        return np.column_stack([self.rows(c) for c in columns]), -self.rows(self.z**self.n * self.y)

    def polynomial(self, theta):
        """A on the lines at scaled θ."""
        return np.polyval(np.concatenate([[1.0], theta[: self.n]]), self.z)

    def line_variance(self, theta):
        """hS at unit noise on y (θ None: equation noise)."""
        level = 1.0 if theta is None else np.abs(self.polynomial(theta)) ** 2
        h = np.where(np.arange(self.top + 1) == 0, 1.0, 0.5)
        return h * level * self.variance

    def covariance(self, theta):
        """Covariance of the stacked rows: Re and Im are independent."""
        s = self.line_variance(theta)
        c_re, c_im = (self.re * s) @ self.re.T, (self.im * s) @ self.im.T
        zero = np.zeros((c_re.shape[0], c_im.shape[0]))
        return np.block([[c_re, zero], [zero.T, c_im]])

    def whitener(self, theta):
        """Inverse Cholesky factor of the covariance."""
        return np.linalg.inv(np.linalg.cholesky(self.covariance(theta)))

    def denoised(self, theta):
        """Y less the smoothed noise L*C⁻¹ε/A, on the lines."""
        gamma, target = self.regressors()
        dual = np.linalg.solve(self.covariance(theta), gamma @ theta - target)
        s, split = self.line_variance(theta), self.re.shape[0]
        r = s * (self.re.T @ dual[:split]) + 1j * s * (self.im.T @ dual[split:])
        return self.y - r / self.polynomial(theta)


def ls(problem):
    """Report, eq. (19): plain least squares over the stacked rows; returns θ."""
    gamma, target = problem.regressors()
    norm = np.linalg.norm(gamma, axis=0)
    return np.linalg.lstsq(gamma / norm, target, rcond=None)[0] / norm * problem.unit


def _weighted(problem, theta):
    w = problem.whitener(theta)
    gamma, target = problem.regressors()
    return np.linalg.lstsq(w @ gamma, w @ target, rcond=None)[0]


def wls(problem):
    """Equation-error covariance; returns θ."""
    return _weighted(problem, None) * problem.unit


def awls(problem, iterations=300, tol=1e-13):
    """Covariance at the last estimate, to the fixed point; returns θ."""
    theta = _weighted(problem, None)
    for _ in range(iterations):
        new = _weighted(problem, theta)
        step = np.max(np.abs(new - theta)) / np.max(np.abs(new))
        theta = new
        if step < tol:
            break
    return theta * problem.unit


def levenberg_marquardt(problem):
    """Maximum likelihood by SciPy on the whitened residual, its Jacobian by differences; returns θ."""
    gamma, target = problem.regressors()
    start = awls(problem) / problem.unit

    def residual(x):
        return problem.whitener(x) @ (gamma @ x - target)

    found = least_squares(
        residual,
        start,
        jac=central(residual),
        method="lm",
        x_scale=np.abs(start),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return found.x * problem.unit


def ml(problem):
    """Levenberg-Marquardt, then its last digits: the zero of J*C⁻¹ε, J of the denoised columns; returns θ."""
    gamma, target = problem.regressors()
    theta = levenberg_marquardt(problem) / problem.unit
    for _ in range(50):
        w = problem.whitener(theta)
        j = w @ problem.regressors(problem.denoised(theta))[0]
        step = np.linalg.solve(j.T @ w @ gamma, j.T @ w @ (target - gamma @ theta))
        theta = theta + step
        if np.max(np.abs(step)) < 1e-14 * np.max(np.abs(theta)):
            break
    return theta * problem.unit


def estimator(problem, method, x=None):
    """(p, rows) map from the target's rows to scaled θ: (ZᵀΓ)⁻¹Zᵀ, Z = C⁻¹ times Γ (`ml`: denoised Γ).

    C is the identity for `ls`, that of equation noise for `wls`, that of output noise at `x` otherwise.
    """
    gamma, _ = problem.regressors(problem.denoised(x) if method == "ml" else None)
    if method == "ls":
        return np.linalg.pinv(gamma)
    w = problem.whitener(None if method == "wls" else x)
    return np.linalg.pinv(w @ gamma) @ w


def covariance(problem, theta, method):
    """(cost, df, σ² E C Eᵀ) at θ, E the estimator; cost ε*C⁻¹ε and σ² = cost/df of output noise."""
    x = np.asarray(theta) / problem.unit
    gamma, target = problem.regressors()
    e = problem.whitener(x) @ (gamma @ x - target)
    cost, df = float(e @ e), e.size - x.size
    spread = estimator(problem, method, x) @ np.linalg.inv(problem.whitener(x))
    return cost, df, cost / df * spread @ spread.T * np.outer(problem.unit, problem.unit)


def on_lines(problem):
    """(p, real rows of the lines) map of `ls` from the lines' target to scaled θ."""
    plain = estimator(problem, "ls")
    split = problem.re.shape[0]
    return np.hstack([plain[:, :split] @ problem.re, (plain[:, split:] @ problem.im)[:, 1:]])
