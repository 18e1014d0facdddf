"""Local models around a frequency by plain formulas: one dense least-squares problem a line."""

import numpy as np


def around(values, line, half):
    """Coefficients on the lines around one, mirrored below 0, (channel, 2·half + 1)."""
    m = np.arange(line - half, line + half + 1)
    return np.where(m < 0, values[:, np.abs(m)].conj(), values[:, np.abs(m)])


def powers(half, degree):
    return np.array([(np.arange(-half, half + 1) / half) ** s for s in range(degree + 1)])


def differences(width, order):
    """Δ of that order as a matrix (width − order, width)."""
    d = np.eye(width)
    for _ in range(order):
        d = np.diff(d, axis=0)
    return d


def polynomial(y, u, line, half, degree, weigh=True):
    """A = 1: Δ^{R+1} rows, weighted by (DDᵀ)⁻¹ (the local polynomial method) or not (the report's)."""
    y, u, r = around(y, line, half), around(u, line, half), powers(half, degree)
    d = differences(2 * half + 1, degree + 1)
    columns = d @ np.array([u[j] * r[s] for s in range(degree + 1) for j in range(len(u))]).T
    white = np.linalg.inv(np.linalg.cholesky(d @ d.T)) if weigh else np.eye(len(d))
    return np.array(
        [np.linalg.lstsq(white @ columns, white @ (d @ row), rcond=None)[0][: len(u)] for row in y]
    )


def transient(y, u, line, half, degree):
    """A = 1 and T fitted: the textbook's local polynomial method, with its covariance of vec G."""
    y, u, r = around(y, line, half), around(u, line, half), powers(half, degree)
    ours = [u[j] * r[s] for s in range(degree + 1) for j in range(len(u))]
    columns = np.concatenate([ours, r + 0j]).T
    found = [np.linalg.lstsq(columns, row, rcond=None)[0] for row in y]
    left = np.array([row - columns @ x for row, x in zip(y, found, strict=True)])
    noise = left @ left.conj().T / (columns.shape[0] - columns.shape[1])
    own = np.linalg.inv(columns.conj().T @ columns)[: len(u), : len(u)]
    return np.array([x[: len(u)] for x in found]), np.kron(noise, own), noise


def rational(y, u, line, half, degree, reweightings=0):
    """A of the same degree, one per output; rows divided by the last A, `reweightings` times."""
    y, u, r = around(y, line, half), around(u, line, half), powers(half, degree)
    ours = [u[j] * r[s] for s in range(degree + 1) for j in range(len(u))]
    shared = np.concatenate([ours, r + 0j]).T
    gains = []
    for row in y:
        columns = np.column_stack([shared, *(-row * r[s] for s in range(1, degree + 1))])
        a = np.ones(2 * half + 1, complex)
        for _ in range(reweightings + 1):
            x = np.linalg.lstsq(columns / a[:, None], row / a, rcond=None)[0]
            a = 1 + sum(c * r[s] for s, c in enumerate(x[shared.shape[1] :], 1))
        gains.append(x[: len(u)])
    return np.array(gains)


def misfit(x, row, u, half, degree):
    """Residuals of the output for parameters of B, T, A as real numbers, for an optimiser."""
    x = x[: x.size // 2] + 1j * x[x.size // 2 :]
    r = powers(half, degree)
    terms, count = degree + 1, len(u)
    b = sum(x[s * count + j] * u[j] * r[s] for s in range(terms) for j in range(count))
    t = x[terms * count : terms * (count + 1)] @ r
    a = 1 + x[terms * (count + 1) :] @ r[1:]
    left = row - (b + t) / a
    return np.concatenate([left.real, left.imag])
