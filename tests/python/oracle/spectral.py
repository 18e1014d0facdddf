"""Covariance from a smooth noise spectrum: the oracle of spectral standard errors.

Whitened rows i of an estimate have residuals e_i, leverages h_i and influences g_i on θ.  The noise spectrum
is s = exp(Σ c_j T_j(x)), j = 0..5, x = 2 ln(1 + m)/ln(1 + M) - 1 averaged over bins of lines m in units of
the lowest resolving frequency, whose edges .5, ... grow by max(1, edge/8 rounded).  c maximises

    -½ Σ_bins [D ln s + E/s] - ½ Σ_j (c_j/sd_j)²,   E = Σ e², D = Σ (1 - h),   sd = inf, 4, 2, 1.5, 1, .7,

here handed to SciPy's minimize.  Then cov θ = Σ g gᵀ s, and the degrees of freedom of variance k are 2/var
with var = aᵀ(½ Σ D T Tᵀ + diag 1/sd²)⁻¹a, a = Σ g_k² s T/cov_kk.
"""

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.optimize import minimize

PRECISION = 1 / np.array([np.inf, 4.0, 2.0, 1.5, 1.0, 0.7]) ** 2


def spectral(estimator, e, left, place):
    """(covariance, degrees of freedom) of θ = estimator @ rows; `left` is 1 - h, `place` m of each row."""
    edges = [0.5]
    while edges[-1] <= place.max():
        edges.append(edges[-1] + max(1.0, round(edges[-1] / 8)))
    names, own = np.unique(np.searchsorted(edges, place, side="right"), return_inverse=True)
    lines = np.unique(np.column_stack([own, place]), axis=0)
    middle = [np.mean(np.log1p(lines[lines[:, 0] == k, 1])) for k in range(names.size)]
    terms = chebvander(2 * np.array(middle) / np.log1p(place.max()) - 1, 5)
    unit = e @ e / left.sum()
    square, freedom = np.bincount(own, e**2 / unit), np.bincount(own, left)

    def loss(c):
        log_s = terms @ c
        over = freedom - square * np.exp(-log_s)
        value = freedom @ log_s + square @ np.exp(-log_s) + PRECISION @ c**2
        return value / 2, (over @ terms) / 2 + PRECISION * c

    def curvature(c):
        return (terms.T * (square * np.exp(-terms @ c))) @ terms / 2 + np.diag(PRECISION)

    c = minimize(loss, np.zeros(6), jac=True, hess=curvature, method="trust-exact", options={"gtol": 1e-10}).x
    s = unit * np.exp(terms @ c)[own]
    cov = (estimator * s) @ estimator.T
    share = estimator**2 * s / np.diag(cov)[:, None] @ terms[own]
    inverse = np.linalg.inv((terms.T * freedom) @ terms / 2 + np.diag(PRECISION))
    return cov, np.maximum(2 / np.einsum("ka,ab,kb->k", share, inverse, share), 2)
