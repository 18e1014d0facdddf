"""Frequency-domain fits with an explicit transient polynomial: the oracle of `wls`, `awls` and `ml`.

On the lines s = i m ω₀, m = lo..K, the equation error is A(s)Y - Σ B_k(s)U_k, A monic, and what the ends
of the record add to it is a polynomial T(s) with real coefficients of degree n-1 (report's range m >= 0:
for Re and Im apart, polynomials in m of degree < n, those of Im vanishing at m = 0).  White noise of
variance σ² on the samples of y makes the lines independent with variance h_m σ² |A|² v in Re and Im,
h_0 = 1 and otherwise ½, v = Σw²/N² of the rule (about 1/N), so maximum likelihood is

    min over θ, T of  Σ_m |(A Y - Σ B_k U_k - T)/A|²/(h_m v),

here handed to SciPy's least_squares with θ and T as plain real unknowns.  A constant trend of y leaves
line 0 out, a linear one adds a column 1/s.  Dense matrices everywhere, nothing eliminated.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from .coefficients import coefficients, unit_variance
from .spectral import spectral


@dataclass
class Record:
    """Samples y (N+1,) and u (nu, N+1), dt in s, what each input does between samples."""

    y: np.ndarray
    u: np.ndarray
    dt: float
    kinds: tuple


@dataclass
class Result:
    """theta (a1..an, b of each input descending), cost, covariances, whitened residuals."""

    theta: np.ndarray
    cost: float
    df: int
    cov: np.ndarray
    cov_hc3: np.ndarray
    cov_spectral: np.ndarray
    df_spectral: np.ndarray
    residuals: np.ndarray


class Problem:
    """Lines lo..K of the records of one structure, in real rows (Re of every line, Im of those with m > 0).

    Unknowns x: θ in powers of s/scale, then the end terms of each record; `top` is K, one or one a
    record; `ends` the number of end terms, where it is not the order.
    """

    def __init__(
        self, records, order, numerators, top, low=0, trend=None, extended=True, rule="gregory", ends=None
    ):
        self.n, self.numerators, self.trend, self.extended = order, numerators, trend, extended
        self.terms = order if ends is None else ends
        low = max(low, 1) if trend is not None else low
        self.lines = []
        for record, last in zip(records, np.broadcast_to(top, len(records)), strict=True):
            m = np.arange(low, last + 1)
            intervals = record.y.size - 1
            s = 2j * np.pi * m / (intervals * record.dt)
            y = coefficients(record.y, last, rule)[low:]
            kinds = [rule if kind == "smooth" else kind for kind in record.kinds]
            u = [coefficients(v, last, kind)[low:] for v, kind in zip(record.u, kinds, strict=True)]
            self.lines.append((m, s, y, u, unit_variance(rule, intervals)))
        self.scale = max(abs(s[-1]) for _, s, _, _, _ in self.lines)
        kept = [degree for degree in numerators if degree is not None]
        powers = [*range(1, order + 1), *(order - k for d in kept for k in range(d, -1, -1))]
        self.unit = self.scale ** np.array(powers, float)  # θ = unit · scaled θ
        self.p = self.unit.size
        self.ends = [self.transient(m, s) for m, s, _, _, _ in self.lines]

    def transient(self, m, s):
        """Real rows of the end terms of one record."""
        z, x = s / self.scale, m / m[-1] + 0j
        if self.extended:
            columns = [z**j for j in range(self.terms)]
        else:
            columns = [x**j for j in range(self.terms)] + [1j * x**j for j in range(1, self.terms)]
        if self.trend == "linear":
            columns.append(1 / z)
        return np.column_stack([rows(c, m) for c in columns])

    def split(self, x):
        """Unknowns -> (A, list of B, list of end terms)."""
        degrees = [-1 if d is None else d for d in self.numerators]
        sizes = [self.n, *(d + 1 for d in degrees), *(e.shape[1] for e in self.ends)]
        parts = np.split(x, np.cumsum(sizes)[:-1])
        inputs = len(self.numerators)
        return np.concatenate([[1.0], parts[0]]), parts[1 : 1 + inputs], parts[1 + inputs :]

    def system(self, weight_at=None, denoise_at=None, turned=False):
        """Whitened (matrix, target), the residual being matrix @ x - target.

        Weights 1/|A| at the unknowns `weight_at` (None: |A| = 1, equation noise), with the phase of A if
        `turned`, which changes no sum of squares.  With `denoise_at` the columns of Y are made of the
        model's own response there; turned, that is the Jacobian of the residual.
        """
        matrices, targets = [], []
        for i, (m, s, y, u, variance) in enumerate(self.lines):
            z = s / self.scale
            a = 1.0 if weight_at is None else np.polyval(self.split(weight_at)[0], z)
            a = a if turned else np.abs(a)
            weight = 1 / (np.sqrt(variance * np.where(m == 0, 1.0, 0.5)) * a)
            signal = y if denoise_at is None else self.response(denoise_at, i)
            columns = [weight * z ** (self.n - j) * signal for j in range(1, self.n + 1)]
            for degree, v in zip(self.numerators, u, strict=True):
                columns += [] if degree is None else [-weight * z**k * v for k in range(degree, -1, -1)]
            for j, ends in enumerate(self.ends):
                block = complex_columns(ends, m) if i == j else np.zeros((m.size, ends.shape[1]))
                columns += list(-weight * block.T)
            matrices.append(np.column_stack([rows(c, m) for c in columns]))
            targets.append(-rows(weight * z**self.n * y, m))
        return np.vstack(matrices), np.concatenate(targets)

    def response(self, x, i):
        """(Σ B_k U_k + T)/A on the lines of record `i`."""
        a, b, ends = self.split(x)
        m, s, _, u, _ = self.lines[i]
        z = s / self.scale
        total = complex_columns(self.ends[i], m) @ ends[i]
        for bk, v in zip(b, u, strict=True):
            if bk.size:
                total = total + np.polyval(bk, z) * v
        return total / np.polyval(a, z)

    def residual(self, x):
        """Whitened residual (A Y - Σ B_k U_k - T)/A in units of the noise on y."""
        matrix, target = self.system(x, turned=True)
        return matrix @ x - target

    def row_weights(self, x=None):
        """What `system(x)` multiplies each row by."""
        weights = []
        for m, s, _, _, variance in self.lines:
            level = 1.0 if x is None else np.abs(np.polyval(self.split(x)[0], s / self.scale))
            weights.append(rows((1 + 1j) / (np.sqrt(variance * np.where(m == 0, 1.0, 0.5)) * level), m))
        return np.concatenate(weights)


def rows(z, m):
    """Real rows of a complex vector on the lines m: Re of all, Im where m > 0."""
    return np.concatenate([z.real, z.imag[m > 0]])


def complex_columns(real_rows, m):
    """Inverse of `rows`, column by column."""
    out = real_rows[: m.size].astype(complex)
    out[m > 0] += 1j * real_rows[m.size :]
    return out


def solve(matrix, target):
    """Least squares with columns of unit norm."""
    norm = np.linalg.norm(matrix, axis=0)
    return np.linalg.lstsq(matrix / norm, target, rcond=None)[0] / norm


def wls(problem):
    """One solution with the weights of equation noise."""
    return solve(*problem.system())


def awls(problem, iterations=300, tol=1e-13):
    """Reweighted to the fixed point, where the next step changes θ by less than `tol`, relatively."""
    x = wls(problem)
    for _ in range(iterations):
        new = solve(*problem.system(x))
        step = np.max(np.abs(new - x)[: problem.p]) / np.max(np.abs(new)[: problem.p])
        x = new
        if step < tol:
            break
    return x


def with_end_terms(problem, theta):
    """Unknowns of a given θ, with its best end terms."""
    p, scaled = problem.p, np.asarray(theta, float) / problem.unit
    at = np.concatenate([scaled, np.zeros(sum(e.shape[1] for e in problem.ends))])
    matrix, target = problem.system(at)
    return np.concatenate([scaled, solve(matrix[:, p:], target - matrix[:, :p] @ scaled)])


def ml(problem, theta=None):
    """SciPy's least_squares from `theta` (default: the `awls` fixed point)."""
    if theta is None:
        x = awls(problem)
    else:
        x = with_end_terms(problem, theta)
    size = 1 / np.linalg.norm(problem.system(x, x)[0], axis=0)
    found = least_squares(
        lambda v: problem.residual(v * size),
        x / size,
        jac=lambda v: problem.system(v * size, v * size, turned=True)[0] * size,
        method="lm",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=500,
    )
    x, last = found.x * size, np.inf
    for _ in range(30):  # the last digits, which a flat cost hides: Gauss-Newton while its steps shrink
        step = solve(problem.system(x, x, turned=True)[0], problem.residual(x))
        if np.linalg.norm(step / size) >= last:
            break
        x, last = x - step, np.linalg.norm(step / size)
    return x


def result(problem, x, method="ml"):
    """θ and its covariances at the solution `x` of `wls`, `awls` or `ml`.

    `awls` and `ml` map the whitened rows by (JᵀJ)⁻¹Jᵀ, J the whitened matrix of the data, or of the model's
    response, end terms included.  `wls` is linear in the rows as they are.
    """
    matrix = problem.system(None if method == "wls" else x, x if method == "ml" else None)[0]
    norm = np.linalg.norm(matrix, axis=0)
    q, r = np.linalg.qr(matrix / norm)
    estimator = (np.linalg.inv(r) @ q.T / norm[:, None])[: problem.p]
    if method == "wls":
        return linear_result(problem, x[: problem.p] * problem.unit, estimator * problem.row_weights())
    return _result(problem, x, estimator, np.sum(q * q, axis=1))


def linear_result(problem, theta, estimator):
    """The same for θ = estimator @ target on rows of A(s)Y - Σ B_k U_k, not whitened (`ls`, `wls`).

    Cost, σ and residuals are those of output noise at θ with the best end terms.  The hat matrix is that of
    the end terms, plus what is left of the columns of θ without these times the estimator.
    """
    p, x = problem.p, with_end_terms(problem, theta)
    matrix = problem.system(x)[0]
    q = np.linalg.qr(matrix[:, p:] / np.linalg.norm(matrix[:, p:], axis=0))[0]
    estimator = estimator / problem.row_weights(x)
    left = matrix[:, :p] - q @ (q.T @ matrix[:, :p])
    return _result(problem, x, estimator, np.sum(q * q, axis=1) + np.sum(left * estimator.T, axis=1))


def _result(problem, x, estimator, leverage):
    """Classical σ²EEᵀ with σ² = cost/df, HC3 E diag(e²/(1-h)²)Eᵀ, E the map from whitened rows to θ."""
    matrix, target = problem.system(x)
    e = matrix @ x - target
    cost, df = float(e @ e), e.size - x.size
    pull = estimator * (e / (1 - leverage))
    unit = np.outer(problem.unit, problem.unit)
    theta = x[: problem.p] * problem.unit
    slowest = min(np.abs(s[-1]) / m[-1] for m, s, _, _, _ in problem.lines)
    place = np.concatenate([rows(np.abs(s) / slowest * (1 + 1j), m) for m, s, _, _, _ in problem.lines])
    found, degrees = spectral(estimator, e, 1 - leverage, place)
    classical = cost / df * estimator @ estimator.T
    return Result(theta, cost, df, classical * unit, pull @ pull.T * unit, found * unit, degrees, e)
