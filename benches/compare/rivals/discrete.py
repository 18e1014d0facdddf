"""From a discrete-time model to continuous time: the logarithm of its poles, gains kept mode by mode.

Exact for an input held between samples ("zoh") and for one that runs straight between them ("smooth", the
nearest that discrete models come to a smooth input). The result has a numerator of degree n - 1, whatever the
structure; the coefficients of the structure's degree and below are kept.
"""

import numpy as np


def orders(problem):
    """(coefficients of B, delay of B in samples) of the discrete model that holds the problem exactly."""
    return (problem.poles, 1) if problem.hold == "zoh" else (problem.poles + 1, 0)


def continuous(b, f, problem):
    """θ from B(q) = b0 + b1 q⁻¹ + …, delay included, and F(q) = 1 + f1 q⁻¹ + …"""
    n, dt = problem.poles, problem.dt
    f = np.asarray(f, dtype=float)
    b = np.concatenate([np.asarray(b, dtype=float), np.zeros(n + 1 - len(b))])
    if not (np.all(np.isfinite(f)) and np.all(np.isfinite(b))):
        raise ArithmeticError("the discrete model is not finite")
    z = np.roots(f).astype(complex)
    if z.size < n or np.any((np.abs(z.imag) < 1e-12) & (z.real <= 0)):
        raise ArithmeticError("a pole of the discrete model has no logarithm")
    s = np.log(z) / dt
    held = (z - 1) / s  # ∫ exp(s t) over a sample
    late = (held - dt) / (s * dt)  # the same with the weight t/dt: what belongs to the later sample
    step = held if problem.hold == "zoh" else held - late + late * z
    rest = (b - b[0] * f)[1:]
    num = np.zeros(n, dtype=complex)
    for i in range(n):
        residue = np.polyval(rest, z[i]) / np.prod(z[i] - np.delete(z, i))
        num += residue / step[i] * np.poly(np.delete(s, i))
    return np.concatenate([np.poly(s).real[1:], num.real[n - 1 - problem.zeros :]])
