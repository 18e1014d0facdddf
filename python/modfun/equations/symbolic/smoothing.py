"""Derivatives of noisy signals where a product leaves no exact form (Property 2 of the report)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from ..._core import noise_level
from ...base.arrays import F64
from ...errors import DataError

__all__ = ["smoothed"]

DEGREE = 5
# The widest window whose residuals exceed the noise of the upper harmonics by no more than this.
EXCESS = 1.05
KEPT = 64  # windows and orders, of which a search tries some twenty
SIGNALS = 16  # of equations, several of whose derivatives are asked for in turn


def smoothed(values: F64, t: F64, order: int, *, gain: bool = False) -> F64:
    """A derivative of a signal by local polynomials, or the share of a sample's own noise in it.

    The window is the widest that leaves no more than the noise that the upper harmonics show.

    Parameters
    ----------
    values, t : (time,) arrays
        Evenly spaced.
    order : int
        Of the derivative; 0 smooths.
    gain : bool
        Return the filter's weight of the sample itself, as a constant series.

    Raises
    ------
    DataError
        Uneven samples.
    """
    steps = np.diff(t)
    dt = float(np.mean(steps))
    if np.ptp(steps) > 1e-6 * dt:
        raise DataError(
            "fitting an equation: a product without exact form needs a smoothed derivative, and the record's "
            "steps are uneven; resample it"
        )
    window = _window(values.tobytes())
    if gain:
        return np.full(t.size, _weights(window, order)[window // 2] / dt**order)
    return _filtered(values, window, order) / dt**order


@lru_cache(maxsize=SIGNALS)
def _window(samples: bytes) -> int:
    values = np.frombuffer(samples)
    level = float(noise_level(values[None], 2)[0])
    least = best = DEGREE + 2 - DEGREE % 2 + 1
    most = max(least, values.size // 4)
    window = least
    while window <= most:
        left = values - _filtered(values, window, 0)
        share = 1 - _weights(window, 0)[window // 2]
        if float(np.sqrt(np.mean(left**2) / share)) <= EXCESS * level:
            best = window
        elif window > 4 * best:
            break
        window = int(window * 1.15) + 2
        window += 1 - window % 2
    return best


def _filtered(values: F64, window: int, order: int) -> F64:
    """The derivative per sample; the first and last half windows take the polynomials of the ends."""
    half = window // 2
    _, basis, slopes = _local(window, order)
    out = np.empty(values.size)
    out[half:-half] = np.convolve(values, _weights(window, order)[::-1], "valid")
    out[:half] = slopes[:half] @ (values[:window] @ basis)
    out[-half:] = slopes[-half:] @ (values[-window:] @ basis)
    return out


def _weights(window: int, order: int) -> F64:
    """Of the samples of a window, in the derivative at its middle."""
    return _local(window, order)[0]


@lru_cache(maxsize=KEPT)
def _local(window: int, order: int) -> tuple[F64, F64, F64]:
    """Weights at the middle; orthonormal polynomials over a window, and their derivatives at its samples."""
    half = window // 2
    place = np.arange(-half, half + 1) / half
    derived = legendre.legder(np.eye(DEGREE + 1), order)
    slopes = legendre.legvander(place, max(DEGREE - order, 0)) @ derived / half**order
    basis, triangle = np.linalg.qr(legendre.legvander(place, DEGREE))
    slopes = np.linalg.solve(triangle.T, slopes.T).T
    return basis @ slopes[half], basis, slopes
