"""Initial state by a Luenberger observer run backwards in time (report, section 4.7).

The free response of a model is x' = A x, y = C x + trend. From the last sample to the first the observer

    x(k) <- F x(k+1) + M (y(k) - C F x(k+1)),      F = exp(-A dt)

pulls a state towards the measured outputs; M puts the eigenvalues of its error where they are wanted. It is
exact on sampled data, whatever the step. It begins at the state to which its own answer leads at the last
sample, so that no guess enters, however short the record.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import complexes
from ..base.arrays import C128, F64
from ..errors import FitError, SpecError

__all__ = ["Observed", "default_eigenvalues", "observe"]

DECAY = 1.0  # least decay of the error over the record, in time constants; more costs accuracy
APART = 0.02  # repeated eigenvalues are set apart by so much of themselves: one output cannot place them
FASTEST = 15.0  # time constants in a step that can be followed backwards


@dataclass(frozen=True, eq=False)
class Observed:
    """What an observer found.

    Attributes
    ----------
    state : (n,) array
        At the first sample.
    cov : (n, n) array
        Covariance of the state, the noise taken as white; its level is that of what the state and trend
        leave of each output.
    trend : (output, 0 to 2) array
        Offset, and slope over the whole record.
    eigenvalues : (n + terms of trend,) complex array
        Of the error backwards in time, rad/s.
    """

    state: F64
    cov: F64
    trend: F64
    eigenvalues: C128


def observe(
    a: F64, c: F64, y: F64, dt: float, *, trend: int = 0, eigenvalues: ArrayLike | None = None
) -> Observed:
    """Initial state of x' = A x from samples of y = C x + trend.

    Parameters
    ----------
    a : (n, n) array
    c : (output, n) array
    y : (output, time) array
        Measured outputs less the response to the inputs from rest.
    dt : float
        Sampling interval, s.
    trend : {0, 1, 2}
        Unknown terms of each output: none, an offset, offset and slope.
    eigenvalues : (n,) array_like, optional
        Of the error backwards in time, rad/s, with negative real parts (those of A - LC mirrored); default:
        `default_eigenvalues`. Those of trends are always chosen so.

    Raises
    ------
    SpecError
        Eigenvalues that are not n, not in conjugate pairs, or do not decay.
    FitError
        A state that the outputs do not show, or modes too fast for the samples.
    """
    from scipy.linalg import expm, matrix_balance

    n, outputs, samples = a.shape[0], c.shape[0], y.shape[1]
    duration = (samples - 1) * dt
    unit = np.sqrt(np.mean(y**2, axis=1))
    unit[unit == 0] = 1.0
    a, balance = matrix_balance(a, permute=False)
    wide, seen = _with_trend(a, c @ balance / unit[:, None], trend, duration)
    size = wide.shape[0]
    modes = np.linalg.eigvals(wide).astype(np.complex128)
    if np.max(np.abs(modes)) * dt > FASTEST:
        raise FitError(
            f"the observer cannot follow a mode of {np.max(np.abs(modes)):.3g} rad/s backwards over steps of "
            f'{dt:.3g} s; use method="lstsq", or sample faster'
        )
    own = default_eigenvalues(modes, duration)
    if eigenvalues is not None:
        own = _apart(np.concatenate([_given(eigenvalues, n), _slowest(modes, duration, size - n)]))
    back, forth = expm(-wide * dt), expm(wide * dt)
    gain = _gain(back, seen, np.exp(own * dt))
    keep = np.eye(size) - gain @ seen
    step = keep @ back
    level = y / unit[:, None]
    answer, start = np.zeros(size), keep  # what the observer is told, and how its beginning enters
    weights = np.empty((samples, size, outputs))
    weight = gain
    for k in range(samples):
        weights[k] = weight
        answer += weight @ level[:, k]
        if k < samples - 1:
            weight, start = step @ weight, step @ start
    closed = np.eye(size) - start @ np.linalg.matrix_power(forth, samples - 1)
    found = np.linalg.solve(closed, answer)
    if not np.all(np.isfinite(found)):
        raise FitError('the observer overflows on this model; use method="lstsq"')
    rest = level - _simulated(found, forth, seen, samples)
    noise = np.sum(rest**2, axis=1) / max(samples - size / outputs, 1)
    weights = np.linalg.solve(closed, weights)
    spread = np.einsum("kio,o,kjo->ij", weights, noise, weights)
    terms = found[n:].reshape(outputs, trend) * unit[:, None]
    return Observed(balance @ found[:n], balance @ spread[:n, :n] @ balance.T, terms, own)


def default_eigenvalues(modes: C128, duration: float) -> C128:
    """Eigenvalues of the error backwards in time, rad/s, for the modes of a model.

    Each keeps the frequency of its mode and decays as fast as the mode does forwards, which is what a
    Kalman filter would do on a long record; but at least by `DECAY` time constants over the record, and
    that much faster than any mode grows.
    """
    slowest = max(float(modes.real.max()), 0.0) + DECAY / duration
    return _apart(-np.maximum(-modes.real, slowest) + 1j * modes.imag)


def _slowest(modes: C128, duration: float, count: int) -> C128:
    return np.full(count, -max(float(modes.real.max()), 0.0) - DECAY / duration, complex)


def _apart(values: C128) -> C128:
    """Set repeated eigenvalues apart."""
    made = values.astype(complex)
    for i in range(len(made)):
        while np.any(np.abs(made[:i] - made[i]) < APART / 2 * np.abs(made[i])):
            made[i] *= 1 + APART
    return made


def _given(eigenvalues: ArrayLike, n: int) -> C128:
    values = complexes("initial_state", "eigenvalues", eigenvalues).reshape(-1)
    paired = bool(np.isfinite(values).all()) and np.allclose(
        np.sort_complex(values), np.sort_complex(values.conj())
    )
    if values.shape != (n,) or not paired or not np.all(values.real < 0):
        raise SpecError(
            f"initial_state: eigenvalues={eigenvalues!r} must be {n} values in rad/s, complex ones in "
            "conjugate pairs, all with negative real parts (decay backwards in time)"
        )
    return values


def _with_trend(a: F64, c: F64, trend: int, duration: float) -> tuple[F64, F64]:
    """The model with offset (and slope) of each output as states."""
    n, outputs = a.shape[0], c.shape[0]
    drift = np.eye(trend, k=1) / duration
    size = n + outputs * trend
    wide, seen = np.zeros((size, size)), np.zeros((outputs, size))
    wide[:n, :n], seen[:, :n] = a, c
    for i in range(outputs if trend else 0):
        at = n + i * trend
        wide[at : at + trend, at : at + trend] = drift
        seen[i, at] = 1.0
    return wide, seen


def _gain(back: F64, seen: F64, wanted: C128) -> F64:
    """M that gives (I - M C) F the wanted eigenvalues."""
    from scipy.signal import place_poles

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a gain that is not the most robust one serves as well
            placed = place_poles(back.T, (seen @ back).T, wanted, rtol=1e-2, maxiter=100)
        gain = np.asarray(placed.gain_matrix, dtype=np.float64).T
    except ValueError:
        gain = np.full((back.shape[0], seen.shape[0]), np.nan)
    reached = np.full(wanted.size, np.nan)
    if np.all(np.isfinite(gain)):
        reached = np.abs(np.linalg.eigvals(back - gain @ seen @ back))
    if not np.allclose(np.sort(reached), np.sort(np.abs(wanted)), atol=1e-3):
        raise FitError(
            "the observer cannot be placed: the outputs do not show all states of the model, or not apart "
            'from the trend; use method="lstsq"'
        )
    return gain


def _simulated(state: F64, forth: F64, seen: F64, samples: int) -> F64:
    out = np.empty((seen.shape[0], samples))
    for k in range(samples):
        out[:, k] = seen @ state
        state = forth @ state
    return out
