"""Singular values of noise-whitened output columns, every matrix written out: the oracle of `rank_test`.

Real rows (Re and Im of each line m = 1..K) of s^j Y, j = 0..q; transient and s^j U projected out by P.
Noise enters column j as P D_j e, D_j the real matrix of multiplication by x^j, e white, so that its Gram
matrix is σ²/(2N) trace(D_i' P D_j) on average; the singular values are those of the columns times the
inverse Cholesky factor of that.
"""

import numpy as np

from .coefficients import coefficients


def singular_values(record, q, top, sigma):
    """Descending, of a single record."""
    intervals = record.y.size - 1
    x = 1j * np.arange(1, top + 1) / top
    y = coefficients(record.y, top, "gregory")[1:]
    u = [coefficients(v, top, "gregory")[1:] for v in record.u]
    blocks = [multiplication(x**j) for j in range(q + 1)]
    removed = [b @ real(np.ones(top)) for b in blocks[:q]]
    removed += [b @ real(v) for v in u for b in blocks]
    basis = np.linalg.qr(np.column_stack([c / np.linalg.norm(c) for c in removed]))[0]
    project = np.eye(2 * top) - basis @ basis.T
    columns = project @ np.column_stack([b @ real(y) for b in blocks])
    noise = np.array([[np.trace(a.T @ project @ b) for b in blocks] for a in blocks])
    noise *= sigma**2 / (2 * intervals)
    return np.linalg.svd(columns @ np.linalg.inv(np.linalg.cholesky(noise)).T, compute_uv=False)


def real(z):
    """Re of all lines, then Im."""
    return np.concatenate([np.real(z), np.imag(z)])


def multiplication(factor):
    """The real matrix that multiplies each line by its factor."""
    re, im = np.diag(factor.real), np.diag(factor.imag)
    return np.block([[re, -im], [im, re]])
