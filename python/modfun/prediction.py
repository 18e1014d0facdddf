"""Simulating a fitted model against a record: forced response, initial state, trend."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError, SpecError
from .observer import observe
from .records import Record
from .validation import free_response, regress, trend_columns

if TYPE_CHECKING:
    from .results import Fit

__all__ = ["InitialState", "observe_fit", "simulate_fit"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class InitialState:
    """Initial state of a record under a fitted model.

    Attributes
    ----------
    state : (n,) array
        y, y', ... of the free response at the first sample.
    cov : (n, n) array
        Covariance, from the residuals taken as white; zeros if the state was given.
    trend : array
        Offset, or offset and slope over the whole record, of the output (empty without a trend).
    """

    state: F64
    cov: F64
    trend: F64

    @property
    def bse(self) -> F64:
        """Standard errors of the state."""
        return np.sqrt(np.diag(self.cov))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> F64:
        return np.array(self.state, dtype=dtype)

    def __len__(self) -> int:
        return self.state.size

    def __repr__(self) -> str:
        parts = [f"{x:.5g} (standard error {s:.2g})" for x, s in zip(self.state, self.bse, strict=True)]
        trend = f", trend {np.array2string(self.trend, precision=5)}" if self.trend.size else ""
        return f"InitialState({', '.join(parts)}{trend})"


def simulate_fit(
    fit: Fit, rec: Record, initial_state: str | ArrayLike | InitialState | None
) -> tuple[F64, InitialState]:
    """Output of a fitted model for a record, with the initial state and trend that suit it best.

    Parameters
    ----------
    fit : Fit
    rec : Record
        With the channels of the fit.
    initial_state : None, "zero" or array
        None: estimated by least squares on the free response, together with the trend.

    Returns
    -------
    simulated : (1, time) array
    initial : InitialState
    """
    den, _ = fit.polynomials()
    n = fit.order
    measured = rec.y[0]
    forced = _forced(fit, rec)
    free = free_response(den, rec.t)
    trend = trend_columns(rec.t, fit.trend)
    if initial_state is None:
        found = regress(measured - forced, np.vstack([free, trend]))
        state, cov, offsets = found.coefficients[:n], found.covariance[:n, :n], found.coefficients[n:]
        fitted = found.fitted
    else:
        state = _given(initial_state, n)
        cov = np.zeros((n, n))
        start = state @ free
        found = regress(measured - forced - start, trend)
        offsets, fitted = found.coefficients, start + found.fitted
    simulated = forced + fitted
    if not np.all(np.isfinite(simulated)):
        raise DataError(
            f"simulating the fit: the output overflows within {rec.duration:g} s, the model is unstable; "
            "predict a shorter piece with rec.window(start, stop)"
        )
    return simulated[None], InitialState(state, cov, offsets)


def observe_fit(fit: Fit, rec: Record, eigenvalues: ArrayLike | None) -> InitialState:
    """Initial state of a fitted model by an observer run backwards in time, the trend beside it."""
    if rec.dt is None:
        raise DataError(
            "initial_state: an observer needs even sampling, and this record's steps are uneven; "
            'use method="lstsq"'
        )
    den, _ = fit.polynomials()
    n = fit.order
    companion = np.vstack([np.eye(n, k=1)[:-1], -den[:0:-1]])
    left = (rec.y[0] - _forced(fit, rec))[None]
    terms = len(trend_columns(rec.t, fit.trend))
    found = observe(companion, np.eye(n)[:1], left, rec.dt, trend=terms, eigenvalues=eigenvalues)
    return InitialState(found.state, found.cov, found.trend.ravel())


def _given(initial_state: str | ArrayLike | InitialState, n: int) -> F64:
    if isinstance(initial_state, str):
        if initial_state != "zero":
            raise SpecError(f'predict: initial_state={initial_state!r} must be "zero", an array, or left out')
        return np.zeros(n)
    try:
        state = np.asarray(initial_state, dtype=float)
    except (TypeError, ValueError):
        raise SpecError(
            f'predict: initial_state must be "zero" or {n} numbers, got {initial_state!r}'
        ) from None
    if state.shape != (n,) or not np.all(np.isfinite(state)):
        raise SpecError(
            f"predict: initial_state has shape {state.shape}, the model has {n} states: give y, y', ... "
            "of the free response at the first sample, as finite numbers"
        )
    return state


def _forced(fit: Fit, rec: Record) -> F64:
    """Response from rest to the record's inputs."""
    if not rec.inputs:
        return np.zeros(rec.t.size)
    if rec.dt is not None:
        return np.asarray(
            fit.model.simulate(u=list(rec.u), dt=rec.dt, intersample=rec.intersample), dtype=float
        ).reshape(-1)
    if any(fit.delays):
        raise DataError(
            f"simulating the fit: delays of {fit.delays} s need even sampling and this record's steps are "
            "uneven; resample it first"
        )
    return _forced_uneven(fit, rec)


def _forced_uneven(fit: Fit, rec: Record) -> F64:
    """Uneven steps, one exact transition each; smooth inputs are taken as straight between samples."""
    from scipy.linalg import expm

    a, b, c, d, _ = fit.model.scaled()
    n, inputs = b.shape
    step = np.diff(rec.t)
    block = np.zeros((n + 2 * inputs, n + 2 * inputs))
    block[:n, :n], block[:n, n : n + inputs] = a, b
    # The slope enters as a state that is constant over the step: du/h, so its row is not scaled by h.
    blocks = block * step[:, None, None]
    blocks[:, n : n + inputs, n + inputs :] = np.eye(inputs)
    transition = expm(blocks)
    rise = np.where(np.array(rec.intersample)[:, None] == "zoh", 0.0, np.diff(rec.u))
    drive = np.einsum("kij,jk->ki", transition[:, :n, n : n + inputs], rec.u[:, :-1])
    drive += np.einsum("kij,jk->ki", transition[:, :n, n + inputs :], rise)
    x = np.zeros(n)
    y = np.empty(rec.t.size)
    y[0] = 0.0
    for k, move in enumerate(transition[:, :n, :n]):
        x = move @ x + drive[k]
        y[k + 1] = (c @ x)[0]
    return np.asarray(y + (d @ rec.u)[0], dtype=float)
