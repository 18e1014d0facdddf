"""A rational fit by plain formulas: polynomials in s, and a general minimiser on their coefficients."""

import numpy as np
from scipy.optimize import least_squares


def response(layout, theta, omega):
    """G(iω) of a structure, (output, input, omega)."""
    s = 1j * omega
    rows = []
    for i in range(len(layout.outputs)):
        den, nums = layout.polynomials(np.asarray(theta), i)
        late = layout.delays(np.asarray(theta), i)
        rows.append(
            [np.polyval(n, s) / np.polyval(den, s) * np.exp(-s * d) for n, d in zip(nums, late, strict=True)]
        )
    return np.array(rows)


def rows(layout, theta, omega, data, weight=None):
    """Whitened residuals, real parts then imaginary parts."""
    error = (data - response(layout, theta, omega)).reshape(-1, omega.size)
    if weight is None:
        white = error
    elif weight.shape == (omega.size, error.shape[0], error.shape[0]):
        factors = np.linalg.cholesky(weight).conj().transpose(0, 2, 1)
        white = np.einsum("kpq,qk->pk", factors, error)
    else:
        white = np.sqrt(np.broadcast_to(weight.reshape(-1, omega.size), error.shape)) * error
    return np.concatenate([white.real.ravel(), white.imag.ravel()])


def minimised(layout, start, omega, data, weight=None):
    """θ of the least sum of squares near a start."""
    found = least_squares(
        lambda theta: rows(layout, theta, omega, data, weight),
        start,
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    return found.x
