"""Responses of linear systems to white noise that drives them, exact at the samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._core import normals
from ..base.arguments import reals
from ..base.arrays import F64
from ..errors import SpecError
from ..systems.lti import LTI, state_space

__all__ = ["driven"]


def driven(sys: Any, given: ArrayLike, dt: float, intervals: int, seed: int, replicate: int) -> F64:
    """The response (output, time) to noise of levels `given`, as `simulate` describes them.

    A sample of the state follows from the one before with noise of the covariance that the density has over
    dt (C. F. Van Loan, IEEE Trans. Automatic Control 23, 1978).
    """
    levels = np.atleast_1d(reals("simulate", "process_noise", given))
    a, c, enters = _matrices(sys)
    if levels.ndim != 1 or levels.size not in (1, enters.shape[1]) or not np.all(levels >= 0):
        raise SpecError(
            f"simulate: process_noise={given!r} must be a level of at least 0, one for all or one for each of "
            f"the {enters.shape[1]} equations of the system"
        )
    from scipy.linalg import expm, solve_continuous_lyapunov

    n = len(a)
    density = (enters * levels**2) @ enters.T
    whole = expm(np.block([[-a, density], [np.zeros((n, n)), a.T]]) * dt)
    step = whole[n:, n:].T
    draws = normals(seed, "noise_y", len(c), replicate, 0, n * (intervals + 2)).reshape(n, intervals + 2)
    noise = _root(step @ whole[:n, n:]) @ draws[:, 1:]
    stable = bool(np.all(np.linalg.eigvals(a).real < 0))
    start = _root(solve_continuous_lyapunov(a, -density)) @ draws[:, 0] if stable else np.zeros(n)
    # Noise of a step is an input held over it that leaves the state where the noise would.
    held = np.linalg.solve(expm(np.block([[a, np.eye(n)], [np.zeros((n, 2 * n))]]) * dt)[:n, n:], noise)
    return state_space(a, np.eye(n), c, np.zeros((len(c), n)), (0.0,) * n).respond(
        list(held), dt, intervals, start, "zoh"
    )


def _root(cov: F64) -> F64:
    """A square root of a covariance, which may be singular."""
    values, vectors = np.linalg.eigh((cov + cov.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _matrices(sys: Any) -> tuple[F64, F64, F64]:
    """A, C, and where the noise of each equation enters: A(p) y = B(p) u + w, or x' = A x + B u + w."""
    if not isinstance(sys, LTI):
        raise SpecError(
            "simulate: process_noise= is for linear systems, mf.tf and mf.ss; of others add noise to an input"
        )
    if sys.matrices is not None:
        return sys.A, sys.C, np.eye(len(sys.A))
    orders, blocks = [], []
    for k, row in enumerate(sys.polynomials()[1]):
        if any(not np.array_equal(row[0], own) for own in row[1:]):
            raise SpecError(
                f"simulate: process_noise= drives the equation A(p) y = B(p) u + w; the paths to output {k} have "
                "denominators of their own. Give the system with one denominator an output, or as mf.ss"
            )
        den = np.asarray(row[0], dtype=np.float64)
        blocks.append(den[1:] / den[0])
        orders.append(den.size - 1)
    n = sum(orders)
    a, c, enters = np.zeros((n, n)), np.zeros((len(orders), n)), np.zeros((n, len(orders)))
    first = 0
    for k, (order, own) in enumerate(zip(orders, blocks, strict=True)):
        place = np.arange(first, first + order)
        a[place[:-1], place[1:]] = 1.0
        a[place[-1], place] = -own[::-1]
        c[k, first], enters[place[-1], k] = 1.0, 1.0
        first += order
    return a, c, enters
