"""Cramér–Rao bounds by fourth-order differences of sampled responses, made without modfun.

A held input goes through x' = A x + B u exactly, by the matrix exponential of one sample; any other system is
a function of the unknowns that the caller gives.
"""

import numpy as np
from scipy.linalg import expm


def held(a, b, c, d, u, dt, x0):
    """Output (output, time) of a state space to inputs (input, time) held over each sample."""
    n, k = b.shape
    block = np.zeros((n + k, n + k))
    block[:n, :n], block[:n, n:] = a * dt, b * dt
    step = expm(block)
    x = np.array(x0, dtype=float)
    y = np.empty((len(c), u.shape[1]))
    for i in range(u.shape[1]):
        y[:, i] = c @ x + d @ u[:, i]
        x = step[:n, :n] @ x + step[:n, n:] @ u[:, i]
    return y


def bound(response, unknowns, count, cov, terms=0, seen=None, spread=None):
    """Covariance of the first `count` unknowns.

    `response(unknowns)` is (output, time); the others are nuisance, as are `terms` powers of time an output.
    `cov` is that of the outputs' noise, `seen` marks samples that count, `spread` is their relative noise.
    """
    z = np.asarray(unknowns, dtype=float)
    columns = []
    for k in range(z.size):
        h = 1e-3 * (abs(z[k]) or 1.0)
        moved = []
        for step in (-2, -1, 1, 2):
            point = z.copy()
            point[k] += step * h
            moved.append(response(point))
        columns.append((moved[0] - 8 * moved[1] + 8 * moved[2] - moved[3]) / (12 * h))
    q, samples = columns[0].shape
    for i in range(q):
        for power in range(terms):
            column = np.zeros((q, samples))
            column[i] = np.linspace(0, 1, samples) ** power
            columns.append(column)
    s = np.array(columns)
    information = np.zeros((len(s), len(s)))
    for t in range(samples):
        good = np.arange(q) if seen is None else np.flatnonzero(seen[:, t])
        scale = np.ones(q) if spread is None else spread[:, t]
        noise = (cov * np.outer(scale, scale))[np.ix_(good, good)]
        rows = s[:, good, t]
        information += rows @ np.linalg.solve(noise, rows.T)
    size = np.sqrt(np.diag(information))
    return (np.linalg.inv(information / np.outer(size, size)) / np.outer(size, size))[:count, :count]
