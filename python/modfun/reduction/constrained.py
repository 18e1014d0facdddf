"""Linear least squares under equations and bounds, for the steps of a rational fit."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64

__all__ = ["beyond", "constrained", "least_squares", "norms"]


def constrained(
    equal: list[tuple[F64, float]], size: int, moving: list[F64] | None = None, width: int = 0
) -> tuple[F64, F64, F64]:
    """Solutions of rows·c = value + moving·δ as offset + slope δ + free z with orthonormal free columns."""
    if not equal:
        return np.zeros(size), np.zeros((size, width)), np.eye(size)
    rows = np.array([row for row, _ in equal])
    norm = np.linalg.norm(rows, axis=1)
    norm[norm == 0] = 1.0
    u, s, vt = np.linalg.svd(rows / norm[:, None], full_matrices=True)
    rank = int(np.sum(s > 1e-12 * s[0])) if s[0] > 0 else 0
    inverse = (vt[:rank].T / s[:rank]) @ u[:, :rank].T / norm
    values = np.array([value for _, value in equal])
    slope = inverse @ np.array(moving) if moving else np.zeros((size, width))
    return inverse @ values, slope, vt[rank:].T


def norms(columns: F64) -> F64:
    """Of columns, 1 where one is zero: what to divide them by."""
    size: F64 = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    size[size == 0] = 1.0
    return size


def least_squares(columns: F64, target: F64) -> tuple[F64, F64]:
    """Orthonormal columns that span the given ones, and the solution; what depends on others is left out."""
    from scipy.linalg.lapack import dgeqp3, dorgqr, dtrtrs

    size = norms(columns)
    if columns.shape[1] == 0:
        return columns, np.zeros(0)
    # Without SciPy's own functions around them, which take longer than a fit's few columns.
    factors, order, tau, _, _ = dgeqp3(columns / size)
    diagonal = np.abs(np.diagonal(factors))
    rank = np.count_nonzero(diagonal > 1e-14 * diagonal[0]) if diagonal[0] > 0 else 0
    q = dorgqr(factors[:, : tau.size], tau)[0][:, :rank]
    found = np.zeros(columns.shape[1])
    if rank:
        found[order[:rank] - 1] = dtrtrs(factors[:rank, :rank], q.T @ target)[0]
    return q, found / size


def beyond(values: F64, bounds: list[tuple[float, float]]) -> tuple[int, float] | None:
    """The coefficient farthest out of its bounds and the bound, or None."""
    worst, found = 1e-12, None
    for k, (value, (low, high)) in enumerate(zip(values, bounds, strict=True)):
        out = max(low - value, value - high) / max(abs(value), 1e-300)
        if out > worst:
            worst, found = out, (k, low if value < low else high)
    return found
