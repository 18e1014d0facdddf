"""Sinusoids in noise by plain formulas: bounds, maximum likelihood by SciPy, lines with their differences."""

import numpy as np
from scipy.optimize import least_squares


def waves(omega, amplitude, phase, n, damping=None):
    """Sum of a e^(-dk) cos(wk + p), k = 0…n-1."""
    k = np.arange(n)
    damping = np.zeros(len(omega)) if damping is None else damping
    return sum(
        a * np.exp(-d * k) * np.cos(w * k + p)
        for w, a, p, d in zip(omega, amplitude, phase, damping, strict=True)
    )


def bound(omega, amplitude, phase, variance, n, damping=None, offset=False):
    """Cramér–Rao covariance of omega, damping (if any), amplitude, phase: derivatives by differences."""
    given = [omega, amplitude, phase] if damping is None else [omega, damping, amplitude, phase]
    theta = np.concatenate(given).astype(float)
    q = len(omega)

    def model(x):
        parts = x.reshape(-1, q)
        rest = (parts[1], parts[2]) if damping is None else (parts[2], parts[3])
        return waves(parts[0], *rest, n, None if damping is None else parts[1])

    step = 1e-6
    columns = [(model(theta + step * e) - model(theta - step * e)) / (2 * step) for e in np.eye(theta.size)]
    if offset:
        columns.append(np.ones(n))
    jacobian = np.column_stack(columns)
    return variance * np.linalg.inv(jacobian.T @ jacobian)[: theta.size, : theta.size]


def refined(y, theta, weights=None, offset=True, damped=False):
    """The least squares of all parameters at once from a start, kinds one after another; and its cost."""
    n, kinds = y.size, 4 if damped else 3
    q = len(theta) // kinds
    weights = np.ones(n) if weights is None else weights

    def residual(x):
        parts = x[: kinds * q].reshape(kinds, q)
        rest = (parts[2], parts[3], n, parts[1]) if damped else (parts[1], parts[2], n)
        return weights * (y - waves(parts[0], *rest) - (x[-1] if offset else 0.0))

    start = np.append(theta, y.mean()) if offset else np.asarray(theta, float)
    scale = np.maximum(np.abs(start), 1e-3)
    found = least_squares(residual, start, x_scale=scale, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return found.x[: kinds * q], 2 * found.cost


def projected(y, omega):
    """What sinusoids of these frequencies and an offset leave: sum of squares."""
    k = np.arange(y.size)
    columns = [np.ones(y.size)] + [f(w * k) for w in omega for f in (np.cos, np.sin)]
    basis, _ = np.linalg.qr(np.column_stack(columns))
    left = y - basis @ (basis.T @ y)
    return float(left @ left)


def best_pair(y, points):
    """The lowest cost of two sinusoids and an offset over a grid of all pairs, then refined."""
    from scipy.optimize import minimize

    grid = np.pi * np.arange(1, points) / points
    n, k = y.size, np.arange(y.size)
    flat = y - y.mean()
    each = np.stack([np.cos(np.outer(k, grid)), np.sin(np.outer(k, grid))], axis=2)
    each = each - each.mean(axis=0)
    gram = np.einsum("kga,khb->ghab", each, each, optimize=True)
    right = np.einsum("k,kga->ga", flat, each)
    i, j = np.triu_indices(grid.size, 1)
    matrix = np.block([[gram[i, i], gram[i, j]], [gram[j, i], gram[j, j]]])
    both = np.concatenate([right[i], right[j]], axis=1)
    with np.errstate(all="ignore"):
        gain = np.einsum("pa,pa->p", both, np.linalg.solve(matrix, both[:, :, None])[:, :, 0])
    best = []
    for p in np.argsort(-gain):
        start = np.array([grid[i[p]], grid[j[p]]])
        if all(np.max(np.abs(start - other)) > np.pi / n for other in best):
            best.append(start)
        if len(best) == 5:
            break
    runs = [
        minimize(lambda w: projected(y, w), s, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12})
        for s in best
    ]
    run = min(runs, key=lambda run: run.fun)
    return np.sort(run.x), float(run.fun)


# The report's form: A(z)Y on the lines is a transient polynomial ------------------------------------


def lines(y, m):
    """The discrete Fourier coefficients of y at lines m and the points z of the unit circle."""
    z = np.exp(2j * np.pi * m / y.size)
    return np.array([np.sum(y * point ** (-np.arange(y.size))) for point in z]), z


def symmetric(x, z):
    """Product of z + 1/z - x_i: real on the unit circle, undamped by construction."""
    return np.prod([(z + 1 / z).real - each for each in x], axis=0)


def transient_powers(q):
    """Powers of z in what the ends of the record add to A(z)Y for q sinusoids."""
    return np.arange(q, -q, -1)


def by_transient(y, m, q, weight):
    """Coefficients g of A = c^q + g_1 c^(q-1) + …, c = z + 1/z: weighted lines, transient also unknown."""
    Y, z = lines(y, m)
    c = (z + 1 / z).real
    columns = [c ** (q - j) * Y for j in range(1, q + 1)] + [-(z**p) for p in transient_powers(q)]
    rows = np.column_stack(columns) * np.sqrt(weight)[:, None]
    target = -(c**q) * Y * np.sqrt(weight)
    stacked = np.vstack([rows.real, rows.imag])
    return np.linalg.lstsq(stacked, np.concatenate([target.real, target.imag]), rcond=None)[0][:q]


def by_difference(y, m, q, weight):
    """The same by the q-difference: Π(S - W^-p) takes the transient out; generalised least squares."""
    Y, z = lines(y, m)
    c = (z + 1 / z).real
    kernel = np.array([1.0 + 0j])
    for p in transient_powers(q):
        kernel = np.convolve(kernel, [-np.exp(2j * np.pi * p / y.size), 1.0])
    count = m.size - 2 * q
    differences = np.array(
        [np.concatenate([np.zeros(k), kernel, np.zeros(count - 1 - k)]) for k in range(count)]
    )
    columns = differences @ np.column_stack([c ** (q - j) * Y for j in range(q + 1)])
    covariance = differences @ np.diag(1 / weight) @ differences.conj().T
    whitened = np.linalg.solve(np.linalg.cholesky(covariance), columns)
    stacked = np.vstack([whitened.real, whitened.imag])
    return np.linalg.lstsq(stacked[:, 1:], -stacked[:, 0], rcond=None)[0]


def around(omega, reach, n):
    """Lines on both sides of tones, neither 0 nor half the sampling rate."""
    below = np.floor(np.asarray(omega) * n / (2 * np.pi)).astype(int)
    chosen = {int(b + k) for b in below for k in range(1 - reach, reach + 1)}
    return np.array(sorted(m for m in chosen if 0 < 2 * m < n))


def awls(y, omega, m):
    """Reweighted least squares on lines, from tones near by: frequencies."""
    x = 2 * np.cos(omega)
    _, z = lines(y, m)
    for _ in range(200):
        g = by_transient(y, m, len(x), 1 / symmetric(x, z) ** 2)
        x = np.sort(np.roots(np.concatenate([[1.0], g])).real)[::-1]
    return np.arccos(x / 2)


def refined_on(y, theta, m):
    """The least squares of the lines m instead of the samples; estimates and their covariance."""
    n, q = y.size, len(theta) // 3
    wanted, _ = lines(y, m)

    def residual(x):
        w, a, p = x.reshape(3, q)
        left = (wanted - lines(waves(w, a, p, n), m)[0]) * np.sqrt(2 / n)
        return np.concatenate([left.real, left.imag])

    found = least_squares(residual, theta, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    variance = 2 * found.cost / (2 * m.size - 3 * q)
    return found.x, variance * np.linalg.inv(found.jac.T @ found.jac)
