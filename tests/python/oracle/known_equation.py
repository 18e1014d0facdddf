"""Output error of a Duffing equation from rest: Runge–Kutta steps and a general search by differences."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

PARTS = 4  # steps a sample


def respond(theta, u, dt):
    """Samples of y'' + a y' + b y + c y³ = d u from rest under a held input."""
    a, b, c, d = theta

    def slope(x, v):
        return np.array([x[1], d * v - a * x[1] - b * x[0] - c * x[0] ** 3])

    x, h, y = np.zeros(2), dt / PARTS, [0.0]
    for value in u[:-1]:
        for _ in range(PARTS):
            k1 = slope(x, value)
            k2 = slope(x + h / 2 * k1, value)
            k3 = slope(x + h / 2 * k2, value)
            k4 = slope(x + h * k3, value)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        y.append(x[0])
    return np.array(y)


def output_error(y, u, dt, start):
    """Estimates and standard errors of white noise."""
    found = least_squares(lambda theta: y - respond(theta, u, dt), start, x_scale=np.abs(start))
    level = 2 * found.cost / (y.size - len(start))
    return found.x, np.sqrt(level * np.diag(np.linalg.inv(found.jac.T @ found.jac)))
