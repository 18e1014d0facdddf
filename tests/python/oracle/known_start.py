"""Output error on the lines from a known initial state: every sample simulated, every coefficient summed."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares


def respond(den, num, u, dt, hold, state=()):
    """Samples of num/den from rest; steps or straight lines between the samples of u.

    `state`: y, y', … of the free response that is added.
    """
    den, num = np.asarray(den, float), np.asarray(num, float)
    n = den.size - 1
    num = np.r_[np.zeros(n + 1 - num.size), num]
    through, c = num[0], num[1:] - num[0] * den[1:]
    a = np.vstack([-den[1:], np.eye(n)[:-1]])  # states p^{n-1} z, …, z
    wide = np.zeros((n + 2, n + 2))
    wide[:n, :n], wide[0, n], wide[n, n + 1] = a, 1.0, 1.0 / dt
    step = expm(wide * dt)
    free, constant, ramp = step[:n, :n], step[:n, n], step[:n, n + 1]
    x, y = np.zeros(n), []
    for k, value in enumerate(u):
        y.append(c @ x + through * value)
        slope = u[k + 1] - value if hold == "foh" and k + 1 < len(u) else 0.0
        x = free @ x + constant * value + ramp * slope
    y = np.array(y)
    if len(state):
        lower = np.vstack([np.eye(n)[1:], -den[:0:-1]])  # of y, y', …
        once, x = expm(lower * dt), np.asarray(state, float)
        for k in range(len(y)):
            y[k] += x[0]
            x = once @ x
    return y


def coefficients(v, last):
    """Trapezoidal sums of the lines 0 to `last` over samples 0 … N."""
    n = v.size - 1
    w = np.r_[0.5, np.ones(n - 1), 0.5]
    k = np.arange(n + 1)
    return np.array([np.sum(w * v * np.exp(-2j * np.pi * m * k / n)) / n for m in range(last + 1)])


def estimate(y, u, dt, hold, orders, lines, start, state=()):
    """Least squares of Y − Ŷ over lines (first, last): parameters, standard errors, weighted cost.

    `orders`: poles and zeros; parameters are the denominator's below s^n and then the numerator's.
    """
    poles, zeros = orders
    first, last = lines
    measured = coefficients(y, last)[first:]

    def rows(theta):
        model = respond(np.r_[1.0, theta[:poles]], theta[poles:], u, dt, hold, state)
        e = measured - coefficients(model, last)[first:]
        weight = np.full(e.size, np.sqrt(2.0))
        if first == 0:
            weight[0] = 1.0
        parts = np.concatenate([weight * e.real, weight * e.imag])
        return parts

    scale = np.abs(start)
    found = least_squares(lambda x: rows(x * scale), start / scale, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    count = 2 * measured.size - (first == 0)
    level = 2 * found.cost / (count - len(start))
    cov = level * np.linalg.inv(found.jac.T @ found.jac) * np.outer(scale, scale)
    assert len(start) == poles + zeros + 1
    return found.x * scale, np.sqrt(np.diag(cov)), 2 * found.cost
