"""How well a simulation follows a measured output: signal to error, per cent, R² and Theil's coefficient."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import DataError
from .regression import rms

__all__ = ["fit_percent", "r2", "signal_to_error", "theil"]

F64 = NDArray[np.float64]


def _pair(y: F64, simulated: F64) -> tuple[F64, F64]:
    y, simulated = np.asarray(y, float), np.asarray(simulated, float)
    if y.shape != simulated.shape or y.ndim != 1 or y.size < 2:
        raise DataError(
            f"Scoring needs two series of equal length (2 samples at least), got shapes {y.shape} and "
            f"{simulated.shape}; give one output at a time, measured and simulated on the same samples."
        )
    return y, simulated


def signal_to_error(y: F64, simulated: F64) -> float:
    """Signal-to-error ratio in dB, 20 log10(RMS(y - mean y) / RMS(y - simulated)).

    The RMS of the signal is taken about its mean: an angle that stands at 20 degrees would flatter the
    ratio (report, section 4.7, takes it about zero). 16 dB is a very good fit; above 30 dB the eye
    sees no difference.

    Parameters
    ----------
    y, simulated : (time,) arrays
        Measured and simulated output.

    Returns
    -------
    float
        dB; inf for a perfect simulation, -inf or nan for an output that does not move.
    """
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(20 * np.log10(np.divide(rms(y - y.mean()), rms(y - simulated))))


def fit_percent(y: F64, simulated: F64) -> float:
    """100 (1 - RMS(y - simulated) / RMS(y - mean y)): 100 is perfect, 0 no better than the mean."""
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(100 * (1 - np.divide(rms(y - simulated), rms(y - y.mean()))))


def r2(y: F64, simulated: F64) -> float:
    """Coefficient of determination, 1 - mean square error / variance of y."""
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(1 - np.divide(rms(y - simulated), rms(y - y.mean())) ** 2)


def theil(y: F64, simulated: F64) -> float:
    """Theil's inequality coefficient, RMS(y - simulated) / (RMS(y) + RMS(simulated)): 0 perfect, 1 worst.

    Flight-test practice takes values below .25 to .3 for a good model.
    """
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.divide(rms(y - simulated), rms(y) + rms(simulated)))
