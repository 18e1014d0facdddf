"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings."""

from ..inference.comparison import comparison, cross_validation
from ..inference.order import order
from ..results.drawing import bode, correlation, harmonics, poles, residual_tests, residuals, response
from ..study.drawing import study
from .channels import record, signals, sinusoids, spectrum, track
from .frequency import reduction

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
