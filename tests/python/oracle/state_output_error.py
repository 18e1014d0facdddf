"""Output error of a linear state space by an integrator and a general search: nothing here is exact or fast.

x' = A(θ) x + B(θ) u, y = x + bias with straight inputs is integrated by SciPy's DOP853 from sample to sample;
Σ alternates with weighted least squares by SciPy's trust region and its differences.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares


def respond(a, b, x0, u, dt):
    """States (state, time) with an input (time,) that is straight between samples."""
    x = [np.asarray(x0, dtype=float)]
    for k in range(u.size - 1):
        slope = (u[k + 1] - u[k]) / dt
        found = solve_ivp(
            lambda t, z, k=k, slope=slope: a @ z + b * (u[k] + slope * t),
            (0.0, dt),
            x[-1],
            method="DOP853",
            rtol=1e-10,
            atol=1e-12,
        )
        x.append(found.y[:, -1])
    return np.array(x).T


def output_error(matrices, start, y, u, dt, rounds=6):
    """θ and Σ; `matrices(θ)` gives A and B, the first state and a bias of each output are estimated too."""
    count = len(start)
    unknowns = np.concatenate([start, y[:, 0], np.zeros(len(y))])

    def left(v):
        a, b = matrices(v[:count])
        return y - respond(a, b, v[count : count + len(y)], u, dt) - v[count + len(y) :][:, None]

    cov = np.diag(np.var(left(unknowns), axis=1))
    for _ in range(rounds):
        white = np.linalg.inv(np.linalg.cholesky(cov))
        found = least_squares(lambda v, w=white: (w @ left(v)).ravel(), unknowns, x_scale="jac")
        unknowns, residuals = found.x, left(found.x)
        cov = residuals @ residuals.T / residuals.shape[1]
    return unknowns[:count], cov
