"""Initial state of a record under linear equations: all responses are exact and their sum is linear."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from ..records.mask import sample_weights
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.propagate import respond
from .prediction import InitialState

__all__ = ["linear_state"]

F64 = NDArray[np.float64]


def linear_state(
    system: LTI, rec: Record, terms: int, algebraic: Sequence[int], state: F64 | None
) -> tuple[F64, InitialState]:
    """The initial state, and a trend of each equation, with which a linear system follows a record best.

    Parameters
    ----------
    system : LTI
        A state space without delays.
    rec : Record
        Evenly sampled.
    terms : int
        Unknowns of each equation: 0, 1 (a constant) or 2 (and a drift).
    algebraic : sequence of int
        Outputs that have an equation of their own, y = Cx + Du, beside those of the states.
    state : (states,) array, optional
        The initial state, where it is known.

    Returns
    -------
    simulated : (output, time) array
    initial : InitialState
        `trend`, of the states' equations and then of the outputs', stands on the side of the derivative.

    Raises
    ------
    DataError
        A response that overflows.
    """
    assert system.matrices is not None
    assert rec.dt is not None
    a, b, c, d = system.matrices
    n, outputs = a.shape[0], c.shape[0]
    none = np.zeros((n, 0))
    words = (rec.dt, rec.intervals)

    def free(x0: F64) -> F64:
        return respond((a, none, c, np.zeros((outputs, 0))), x0, [], *words, (), ())

    def pushed(equation: int, u: F64) -> F64:
        column = np.eye(n)[:, [equation]]
        return respond((a, column, c, np.zeros((outputs, 1))), np.zeros(n), [u], *words, ("foh",), (0.0,))

    forced = respond((a, b, c, d), np.zeros(n), list(rec.u), *words, rec.intersample, (0.0,) * len(rec.u))
    columns = [free(x0) for x0 in np.eye(n)] if state is None else []
    if state is not None:
        forced = forced + free(state)
    shapes = [rec.t**power for power in range(terms)]
    columns += [-pushed(equation, u) for equation in range(n) for u in shapes]
    columns += [-np.eye(outputs)[:, [i]] * u for i in algebraic for u in shapes]
    if not columns:
        return forced, InitialState(np.asarray(state), np.zeros((n, n)), np.zeros(0))
    own = sample_weights(rec.mask, rec.sigma, rec.y.shape)
    left, regressors = rec.y - forced, np.array(columns)
    if not (np.all(np.isfinite(left)) and np.all(np.isfinite(regressors))):
        raise DataError(
            f"simulating the fit: the response overflows within {rec.duration:g} s, the model is unstable; "
            "look at the fit's parameters, or predict a shorter piece with rec.window(start, stop)"
        )
    weight = own / np.maximum(np.std(rec.y, axis=1), 1e-300)[:, None]
    for _ in range(1 + (outputs > 1)):
        rows = (regressors * weight).reshape(len(columns), -1).T
        size = np.linalg.norm(rows, axis=0)
        size = np.where(size > 0, size, 1.0)
        z = np.linalg.lstsq(rows / size, (left * weight).ravel(), rcond=None)[0] / size
        simulated = np.tensordot(z, regressors, 1)
        e = own * (left - simulated)
        used = weight
        level = np.sqrt(np.sum(e**2, axis=1) / np.count_nonzero(own, axis=1))
        weight = own / np.maximum(level, 1e-9 * np.abs(rec.y).max())[:, None]
    freedom = max(int(np.count_nonzero(own)) - z.size, 1)
    scale = float(np.sum((used * (left - simulated)) ** 2)) / freedom
    cov = scale * np.linalg.pinv((rows / size).T @ (rows / size)) / np.outer(size, size)
    if state is not None:
        return forced + simulated, InitialState(state, np.zeros((n, n)), z)
    return forced + simulated, InitialState(z[:n], cov[:n, :n], z[n:])
