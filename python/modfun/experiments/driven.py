"""Responses of linear systems to white noise that drives them, exact at the samples."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .._core import normals
from ..base.arguments import reals
from ..base.arrays import F64
from ..errors import SpecError
from ..models.process import ProcessNoise
from ..systems.lti import LTI, state_space
from ..systems.making import tf

__all__ = ["driven", "measured"]


def driven(sys: Any, given: Any, dt: float, intervals: int, seed: int, replicate: int) -> F64:
    """The response (output, time) to noise of levels `given`, as `simulate` describes them.

    A sample of the state follows from the one before with noise of the covariance that the density has over
    dt (C. F. Van Loan, IEEE Trans. Automatic Control 23, 1978).
    """
    if isinstance(given, ProcessNoise):
        a, c, enters = _through_inputs(sys, given)
        levels = np.ones(enters.shape[1])
    else:
        levels = np.atleast_1d(reals("simulate", "process_noise", given))
        a, c, enters = _by_equation(sys)
    if levels.ndim != 1 or levels.size not in (1, enters.shape[1]) or not np.all(levels >= 0):
        raise SpecError(
            f"simulate: process_noise={given!r} must be a level of at least 0, one for all or one for each "
            f"of the {enters.shape[1]} equations of the system"
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


def measured(sys: Any, given: Any) -> Any:
    """The system without the inputs through which noise enters."""
    if not isinstance(given, ProcessNoise):
        return sys
    keep = [k for k, name in enumerate(_names(sys, given)) if name not in given.names]
    delays = tuple([sys.path_delays[0, k] for k in keep])
    known = state_space(sys.A, sys.B[:, keep], sys.C, sys.D[:, keep], delays)
    return replace(known, inputs=tuple([sys.inputs[k] for k in keep]), outputs=sys.outputs)


def _names(sys: Any, given: ProcessNoise) -> tuple[str, ...]:
    if not isinstance(sys, LTI) or sys.inputs is None:
        raise SpecError(
            "simulate: process_noise=ProcessNoise(...) names inputs of a linear system that has names, as "
            "StateSpace(...).model(values)"
        )
    missing = [name for name in given.names if name not in sys.inputs]
    if missing:
        raise SpecError(
            f"simulate: process_noise: {missing[0]!r} is not an input of the system; "
            f"it has {list(sys.inputs)}"
        )
    if np.any(sys.path_delays != sys.path_delays[0]):
        raise SpecError("simulate: process_noise=ProcessNoise(...) takes one delay an input, not a path")
    return sys.inputs


def _through_inputs(sys: Any, given: ProcessNoise) -> tuple[F64, F64, F64]:
    """The system behind the filters of its noise: A, C, and where white noise of unit density enters."""
    names = _names(sys, given)
    a, c = sys.A, sys.C
    columns: list[F64] = []
    for name, (num, den) in given.filters:
        at = names.index(name)
        if np.any(sys.D[:, at] != 0):
            raise SpecError(
                f"simulate: process_noise: {name} acts on an output directly: its variance is infinite"
            )
        shape = tf(num, den).to_ss()
        own, n, extra = sys.B[:, at : at + 1], len(a), len(shape.A)
        # Columns of noise that came before end at the states there were.
        columns = [np.concatenate([column, np.zeros(extra)]) for column in columns]
        into = np.zeros((n, 1))
        into[: len(own)] = own
        a = np.block([[a, into @ shape.C], [np.zeros((extra, n)), shape.A]])
        c = np.hstack([c, np.zeros((len(c), extra))])
        columns.append(np.concatenate([(into @ shape.D)[:, 0], shape.B[:, 0]]))
    return a, c, np.array(columns).T


def _root(cov: F64) -> F64:
    """A square root of a covariance, which may be singular."""
    values, vectors = np.linalg.eigh((cov + cov.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _by_equation(sys: Any) -> tuple[F64, F64, F64]:
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
                f"simulate: process_noise= drives A(p) y = B(p) u + w; the paths to output {k} have "
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
