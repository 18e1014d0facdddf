"""Output error of one output on its lines, what is known of parameters as rows: dense, with the transient."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from .coefficients import coefficients


def estimate(y, u, dt, lines, degrees, start, priors):
    """Least squares of Y − (BU + T)/A over lines (first, last), and (θ_k − mean) σ/sd for each prior.

    `degrees`: poles and zeros; a prior is (k, mean, sd). σ² is the sum of squares of the lines' rows over
    their degrees of freedom; rounds end where it stays. Returns parameters, their covariance and σ² of a row.
    """
    poles, zeros = degrees
    first, last = lines
    m = np.arange(first, last + 1)
    s = 2j * np.pi * m / ((y.size - 1) * dt)
    measured, driven = coefficients(y, last)[m], coefficients(u, last)[m]
    root = np.where(m == 0, 1.0, np.sqrt(2.0))
    p, size = len(start), np.abs(start)
    unit = np.max(np.abs(measured))

    def rows(x, level):
        theta, end = x[:p] * size, x[p:] * unit
        den = np.polyval([1.0, *theta[:poles]], s)
        num = np.polyval(theta[poles:], s) * driven + np.polyval(end, s / abs(s[-1])) * abs(s[-1]) ** poles
        e = root * (measured - num / den)
        known = [level * (theta[k] - mean) / sd for k, mean, sd in priors]
        parts = np.r_[e.real, e.imag[m > 0]] / unit
        return np.r_[parts, np.array(known) / unit]

    x, level = np.r_[np.asarray(start) / size, np.zeros(poles)], 0.0
    count = 2 * m.size - (first == 0)
    assert len(start) == poles + zeros + 1
    for _ in range(100):
        found = least_squares(
            rows, x, x_scale="jac", args=(level,), xtol=1e-15, ftol=1e-15, gtol=1e-15, jac="3-point"
        )
        x = found.x
        after = unit * np.sqrt(np.sum(found.fun[:count] ** 2) / (count - p - poles))
        done, level = abs(after - level) < 1e-9 * after, after
        if done:
            break
    cov = (level / unit) ** 2 * np.linalg.inv(found.jac.T @ found.jac)[:p, :p] * np.outer(size, size)
    return x[:p] * size, cov, level**2
