"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings."""

from .channels import record, signals, sinusoids, spectrum, track
from .fits import poles, residuals, response
from .frequency import bode, reduction
from .tables import comparison, cross_validation, order, study

__all__ = [
    "bode",
    "comparison",
    "cross_validation",
    "order",
    "poles",
    "record",
    "reduction",
    "residuals",
    "response",
    "signals",
    "sinusoids",
    "spectrum",
    "study",
    "track",
]
