"""Refined instrumental variables on the lines, every equation written out and solved by a general solver."""

import numpy as np
from scipy.optimize import root

from .coefficients import weights


def lines(v, rule, last):
    """Coefficients of the lines 1 to `last` of samples, sums written out."""
    n = v.size - 1
    w, k = weights(rule, n), np.arange(n + 1)
    return np.array([np.sum(w * v * np.exp(-2j * np.pi * m * k / n)) / n for m in range(1, last + 1)])


def estimate(y, u, part, dt, orders, last, start):
    """Solve Re Σ z̄ (AY − BU − T)/A = 0 for A, B and T, z the slopes of the response to the instrument.

    `part`: the instrument of u, of which only the response's slopes are made; `orders`: poles and zeros; real
    T of degree below the poles. Returns the parameters and their covariance in white noise of the outputs:
    σ² (Z'Φ)⁻¹ Z'Z (Φ'Z)⁻¹, Φ the slopes of the residual itself.
    """
    n, zeros = orders
    duration = (y.size - 1) * dt
    s = 2j * np.pi / duration * np.arange(1, last + 1)
    yy, uu, vv = (lines(v, "gregory", last) for v in (y, u, part))
    unit = s / abs(s[-1])

    def real(x):
        return np.concatenate([x.real, x.imag], axis=-1)

    def slopes(theta, transient, given):
        a, b = np.polyval(np.r_[1.0, theta[:n]], s), np.polyval(theta[n:], s)
        response = (b * given + transient) / a
        rows = [-(s ** (n - k)) / a * response for k in range(1, n + 1)]
        rows += [s ** (zeros - k) / a * given for k in range(zeros + 1)]
        rows += [unit**k / a for k in range(n)]
        return real(np.array(rows))

    def residual(theta, transient):
        a, b = np.polyval(np.r_[1.0, theta[:n]], s), np.polyval(theta[n:], s)
        return real((a * yy - b * uu - transient) / a)

    p = n + zeros + 1
    size = np.r_[np.abs(start), np.full(n, np.abs(yy).max() * abs(s[-1]) ** n)]

    def equations(x):
        x = x * size
        transient = sum(c * unit**k for k, c in enumerate(x[p:]))
        return slopes(x[:p], transient, vv) @ residual(x[:p], transient)

    a, b = np.polyval(np.r_[1.0, start[:n]], s), np.polyval(start[n:], s)
    first = np.linalg.lstsq(real(np.array([unit**k for k in range(n)])).T, real(a * yy - b * uu), rcond=None)[
        0
    ]
    scale = np.abs(equations(np.r_[start, first] / size)) + 1e-300
    found = root(lambda x: equations(x) / scale, np.r_[start, first] / size, method="hybr", tol=1e-13)
    x = found.x * size
    assert np.max(np.abs(equations(found.x)) / scale) < 1e-6
    transient = sum(c * unit**k for k, c in enumerate(x[p:]))
    z, phi = slopes(x[:p], transient, vv), slopes(x[:p], transient, uu)
    e = residual(x[:p], transient)
    level = e @ e / (e.size - x.size)
    inverse = np.linalg.inv(z @ phi.T)
    return x[:p], (level * inverse @ (z @ z.T) @ inverse.T)[:p, :p]
