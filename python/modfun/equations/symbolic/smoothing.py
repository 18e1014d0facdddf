"""Derivatives of noisy signals where a product leaves no exact form (Property 2 of the report)."""

from __future__ import annotations

import numpy as np

from ..._core import noise_level
from ...base.arrays import F64
from ...errors import DataError

__all__ = ["smoothed"]

DEGREE = 5
# The widest window whose residuals exceed the noise of the upper harmonics by no more than this.
EXCESS = 1.05


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
    from scipy.signal import savgol_coeffs, savgol_filter

    steps = np.diff(t)
    dt = float(np.mean(steps))
    if np.ptp(steps) > 1e-6 * dt:
        raise DataError(
            "fitting an equation: a product without exact form needs a smoothed derivative, and the record's "
            "steps are uneven; resample it"
        )
    window = _window(values)
    if gain:
        weight = savgol_coeffs(window, DEGREE, deriv=order, delta=dt)[window // 2]
        return np.full(t.size, float(weight))
    return np.asarray(savgol_filter(values, window, DEGREE, deriv=order, delta=dt, mode="interp"))


def _window(values: F64) -> int:
    from scipy.signal import savgol_coeffs, savgol_filter

    level = float(noise_level(np.ascontiguousarray(values[None]), 2)[0])
    least = best = DEGREE + 2 - DEGREE % 2 + 1
    most = max(least, values.size // 4)
    window = least
    while window <= most:
        left = values - savgol_filter(values, window, DEGREE, mode="interp")
        share = 1 - savgol_coeffs(window, DEGREE)[window // 2]
        if float(np.sqrt(np.mean(left**2) / share)) <= EXCESS * level:
            best = window
        elif window > 4 * best:
            break
        window = int(window * 1.15) + 2
        window += 1 - window % 2
    return best
