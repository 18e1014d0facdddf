"""Integration by SciPy: stiff and delayed equations at tight tolerances, uneven samples by exponentials."""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm


def stiff(slopes, x0, t):
    """States (state, time) of x' = f(t, x)."""
    return solve_ivp(slopes, (t[0], t[-1]), x0, method="Radau", t_eval=t, rtol=1e-11, atol=1e-13).y


def delayed(slopes, x0, delay, t, breaks=()):
    """States (state, time) of x' = f(t, x, x(t − delay)), x = x0 before t[0], by the method of steps."""
    ends = np.unique(np.round([*np.arange(t[0], t[-1] + delay, delay), *breaks], 12))
    past, out = [], np.empty((len(x0), len(t)))

    def back(s):
        return next((dense(s) for end, dense in past if s <= end + 1e-12), np.asarray(x0)) if s > t[0] else x0

    x = np.asarray(x0, dtype=float)
    for a, b in pairwise(ends):
        middle = (a + b) / 2
        found = solve_ivp(
            lambda s, x, middle=middle: slopes(s, x, back(s - delay), middle),
            (a, b), x, method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True,
        )  # fmt: skip
        past.append((b, found.sol))
        inside = (t >= a - 1e-12) & (t <= b + 1e-12)
        out[:, inside] = found.sol(t[inside])
        x = found.y[:, -1]
    return out


def uneven(a, b, c, d, x0, u, held, t):
    """Outputs (output, time) of a linear system, each input held or straight between the samples."""
    n, p = b.shape
    x, y = np.asarray(x0, dtype=float), [c @ x0 + d @ u[:, 0]]
    for k, h in enumerate(np.diff(t)):
        slope = np.where(held, 0.0, u[:, k + 1] - u[:, k]) / h
        block = np.zeros((n + 2 * p, n + 2 * p))
        block[:n, :n], block[:n, n : n + p], block[n : n + p, n + p :] = a, b, np.eye(p)
        x = (expm(block * h) @ np.concatenate([x, u[:, k], slope]))[:n]
        y.append(c @ x + d @ u[:, k + 1])
    return np.array(y).T
