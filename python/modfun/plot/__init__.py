"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings."""

from ..study.drawing import study
from .channels import record, signals, sinusoids, spectrum, track
from .diagnostics import correlation, harmonics, residual_tests, residuals
from .fits import poles, response
from .frequency import bode, reduction
from .tables import comparison, cross_validation, order

__all__ = [
    "bode",
    "comparison",
    "correlation",
    "cross_validation",
    "harmonics",
    "order",
    "poles",
    "record",
    "reduction",
    "residual_tests",
    "residuals",
    "response",
    "signals",
    "sinusoids",
    "spectrum",
    "study",
    "track",
]
