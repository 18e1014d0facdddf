"""Established estimators to compare with, on SciPy: continuous output error, discrete prediction error, ARX.

Each is made from a structure and called with a record; it returns its parameters by name and raises
`FitError` where it finds none, so that a Monte Carlo study can count the failures.
"""

from .continuous import OutputError, output_error
from .discrete import ARX, PredictionError, arx, pem
from .likelihood import OutputErrorFit

__all__ = ["ARX", "OutputError", "OutputErrorFit", "PredictionError", "arx", "output_error", "pem"]
