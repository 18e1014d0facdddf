"""Slow twins of mf.timelag, written from formulas: fixed steps, Lambert's W, contours, brute force."""

import numpy as np
from scipy.integrate import simpson
from scipy.linalg import expm
from scipy.special import lambertw


def scalar_roots(a0, a1, h, branches=range(-40, 41)):
    """Roots of s = a0 + a1 e^{-sh}, rightmost first."""
    found = np.array([a0 + lambertw(a1 * h * np.exp(-a0 * h), k) / h for k in branches])
    return found[np.argsort(-found.real, kind="stable")]


def determinant(matrices, s):
    """det(sI - sum A_k e^{-s h_k})."""
    n = len(next(iter(matrices.values())))
    return np.linalg.det(s * np.eye(n) - sum(m * np.exp(-s * h) for h, m in matrices.items()))


def steps(a, b, past, u, duration, count):
    """Classical Runge-Kutta of order 4 with `count` steps, which must divide all lags; states (n, count + 1).

    The delayed state half a step on is read from the cubic through values and slopes at both ends.
    """
    h = duration / count
    longest = max([*a, *b])
    early = round(longest / h) + 1
    t = h * np.arange(-early, count + 1)
    n = len(next(iter(a.values())))
    x = np.zeros((early + count + 1, n))
    slope = np.zeros_like(x)
    for k in range(early + 1):
        x[k] = past(t[k])
        slope[k] = (past(t[k] + 1e-6) - past(t[k] - 1e-6)) / 2e-6
    right = slope.copy()  # at the start of a step; left of a kink the slope is another

    def rate(time, now, late):
        out = sum(m @ (now if lag == 0 else late[lag]) for lag, m in a.items())
        return out + sum(m @ u(time - lag) for lag, m in b.items())

    for k in range(early, early + count):
        shift = {lag: round(lag / h) for lag in a if lag > 0}
        begin = {lag: x[k - d] for lag, d in shift.items()}
        end = {lag: x[k - d + 1] for lag, d in shift.items()}
        half = {
            lag: 0.5 * (x[k - d] + x[k - d + 1]) + h / 8 * (right[k - d] - slope[k - d + 1])
            for lag, d in shift.items()
        }
        inside = 1e-9 * h  # inputs are taken on this step's side of their jumps
        k1 = rate(t[k] + inside, x[k], begin)
        k2 = rate(t[k] + h / 2, x[k] + h / 2 * k1, half)
        k3 = rate(t[k] + h / 2, x[k] + h / 2 * k2, half)
        k4 = rate(t[k] + h - inside, x[k] + h * k3, end)
        x[k + 1] = x[k] + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        right[k] = k1
        slope[k + 1] = rate(t[k] + h - inside, x[k + 1], end)
    return t[early:], x[early:].T


def reduced_state(plant_a, plant_b, a, t, x, u, points=300):
    """z(t) by Simpson's rule: x and u functions of one instant."""
    z = np.array(x(t), dtype=float)
    for matrices, signal in ((plant_a, x), (plant_b, u)):
        for lag, m in matrices.items():
            if lag == 0:
                continue
            tau = np.linspace(t - lag, t, points + 1)
            values = np.array([expm(a * (t - lag - s)) @ m @ signal(s) for s in tau])
            z += simpson(values, x=tau, axis=0)
    return z


def mu_of_scalars(m, points=120):
    """mu of a complex matrix for independent complex scalars (3 at most): spectral radius over all phases."""
    turns = np.exp(2j * np.pi * np.arange(points) / points)
    phases = [np.ones(1)] + [turns] * (len(m) - 1)
    grid = np.stack([g.ravel() for g in np.meshgrid(*phases)], axis=1)
    return np.abs(np.linalg.eigvals(m * grid[:, None, :])).max()
