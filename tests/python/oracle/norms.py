"""Norms of systems by plain formulas: impulse responses, Hamiltonians, Kronecker products."""

import numpy as np


def h2(a, b, c):
    """√tr(C P Cᵀ) with the Lyapunov equation as one linear system."""
    n = a.shape[0]
    eye = np.eye(n)
    p = np.linalg.solve(np.kron(eye, a) + np.kron(a, eye), -(b @ b.T).ravel()).reshape(n, n)
    return np.sqrt(np.trace(c @ p @ c.T))


def hinf(a, b, c, d, tol=1e-10):
    """Bisection on the least γ whose Hamiltonian has no eigenvalue on the axis."""

    def crossed(gamma):
        r = gamma**2 * np.eye(d.shape[1]) - d.T @ d
        s = gamma**2 * np.eye(d.shape[0]) - d @ d.T
        f = a + b @ np.linalg.solve(r, d.T @ c)
        top = np.hstack([f, b @ np.linalg.solve(r, b.T)])
        bottom = np.hstack([-(gamma**2) * c.T @ np.linalg.solve(s, c), -f.T])
        values = np.linalg.eigvals(np.vstack([top, bottom]))
        return np.any(np.abs(values.real) < 1e-8 * np.abs(values).max())

    low, high = np.linalg.norm(d, 2), 1.0
    while crossed(high):
        high *= 2
    while high - low > tol * high:
        middle = (low + high) / 2
        low, high = (middle, high) if crossed(middle) else (low, middle)
    return high


def largest_gain(a, b, c, d, omega):
    """The largest singular value of the response over some frequencies."""
    s = 1j * omega[:, None, None] * np.eye(a.shape[0])
    gains = c @ np.linalg.solve(s - a, np.broadcast_to(b, (omega.size, *b.shape))) + d
    return np.linalg.norm(gains, 2, axis=(1, 2)).max()


def hankel(a, b, c):
    """Square roots of the eigenvalues of the product of the Gramians, descending."""
    n = a.shape[0]
    eye = np.eye(n)
    reach = np.linalg.solve(np.kron(eye, a) + np.kron(a, eye), -(b @ b.T).ravel()).reshape(n, n)
    watch = np.linalg.solve(np.kron(eye, a.T) + np.kron(a.T, eye), -(c.T @ c).ravel()).reshape(n, n)
    return np.sort(np.sqrt(np.abs(np.linalg.eigvals(reach @ watch))))[::-1]
