"""How well a simulation follows what was measured: signal to error, per cent, R² and Theil's coefficient."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.tables import Table
from ..errors import DataError
from ..records.record import Record
from .estimates import Estimates
from .regression import rms

__all__ = ["UNITS", "fit_percent", "of_response", "r2", "score", "signal_to_error", "theil"]

UNITS = {"signal_to_error": "dB", "fit_percent": "%"}


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

    In flight tests, values below 0.25 to 0.3 indicate a good model. Offsets count: on records far from zero
    it is small whatever the model, and the signal-to-error ratio is the better score.
    """
    y, simulated = _pair(y, simulated)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.divide(rms(y - simulated), rms(y) + rms(simulated)))


def score(fit: Estimates, rec: Record | int | None = None, initial_state: Any = None) -> Table:
    """Scores of the outputs of a fit, of a record or all of its own; see `Fit.score`."""
    if rec is None and fit.records is not None and len(fit.records) > 1:
        parts = [(i, score(fit, i, initial_state)) for i in range(len(fit.records))]
        columns: dict[str, list[Any]] = {"record": [i for i, part in parts for _ in range(len(part))]}
        for name in parts[0][1].columns:
            columns[name] = [value for _, part in parts for value in part[name].tolist()]
        return Table(columns, units=UNITS)
    record = fit.record_of(rec, "score")
    return of_response(record, fit.simulate(record, initial_state)[0])


def of_response(record: Record, simulated: F64) -> Table:
    """Scores of simulated outputs (output, time) of a record, masked samples left out."""
    pairs = list(zip(record.y, simulated, strict=True))
    if record.mask is not None:
        pairs = [(y[good], own[good]) for (y, own), good in zip(pairs, record.mask, strict=True)]
    figures = (signal_to_error, fit_percent, r2, theil)
    of_each = {figure.__name__: [figure(*pair) for pair in pairs] for figure in figures}
    return Table({"output": list(record.outputs), **of_each}, units=UNITS)
