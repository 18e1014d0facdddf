"""A Luenberger observer backwards in time, integrated in continuous time with SciPy: naive, no trend.

In sigma = T - t the state of x' = A x obeys dx/dsigma = -A x; with L from the eigenvalues of -A + L C wanted,
dx^/dsigma = -A x^ - L (y - C x^), y interpolated by a cubic spline, from x^ = 0 at the end of the record.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.signal import place_poles


def initial_state(a, c, y, dt, eigenvalues):
    """x^ at the first sample."""
    duration = (y.shape[1] - 1) * dt
    gain = -place_poles(-a.T, c.T, eigenvalues).gain_matrix.T  # -A + L C has the eigenvalues
    signal = CubicSpline(np.arange(y.shape[1]) * dt, y, axis=1)
    found = solve_ivp(
        lambda sigma, x: -a @ x - gain @ (signal(duration - sigma) - c @ x),
        (0.0, duration),
        np.zeros(a.shape[0]),
        rtol=1e-10,
        atol=1e-12,
    )
    return found.y[:, -1]


def least_squares(a, c, samples, dt):
    """Columns of C exp(A t) stacked over samples and outputs: (sample * output, n)."""
    from scipy.linalg import expm

    return np.vstack([c @ expm(a * dt * k) for k in range(samples)])
