"""The samples behind residual lines: which records, whether all count alike, and when they begin."""

from __future__ import annotations

from ..records.mask import hides_much
from ..records.record import Record
from .estimates import Estimates

__all__ = ["FILLED", "WEIGHED", "begins", "fitted", "measured_lines", "stationary", "unlike"]

FILLED, WEIGHED = "filled", "weighed"


def fitted(fit: Estimates) -> tuple[Record, ...]:
    """Records whose lines were fitted: those of the fit, or what references or a known past made of them."""
    return fit.instrumented or fit.with_past or fit.records or ()


def stationary(fit: Estimates) -> bool:
    """Whether all samples count alike, so that noise may be stationary."""
    return not fit.unlike and all(rec.mask is None and rec.sigma is None for rec in fitted(fit))


def measured_lines(fit: Estimates) -> bool:
    """Whether residual lines are of samples alone, not of what was put in the place of masked ones."""
    return fit.unlike != FILLED and not any(map(hides_much, fit.records or ()))


def unlike(fit: Estimates) -> str:
    """What a file has to tell of samples that it does not hold: "" where all count alike."""
    return "" if stationary(fit) else WEIGHED if measured_lines(fit) else FILLED


def begins(fit: Estimates) -> tuple[float, ...]:
    """Times of the first samples that were fitted, s; of files of old 0."""
    if records := fitted(fit):
        both = zip(records, fit.intervals, strict=True)
        return tuple([float(rec.t[rec.intervals - count]) for rec, count in both])
    return fit.begun or (0.0,) * len(fit.pieces)
