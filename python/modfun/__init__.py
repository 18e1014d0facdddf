"""Identification of continuous-time systems from short, noisy, transient records.

Units are seconds and rad/s, arrays are (channel, time).
"""

from . import plot, signals
from ._core import __version__
from .bounds import crlb
from .errors import DataError, FitError, InternalError, ModfunError, ModfunWarning, SpecError
from .lti import LTI, ss, tf
from .records import Batch, Record
from .response import FrequencyResponse
from .simulation import coefficients, regressors, simulate
from .structures import TransferFunction
from .tables import Table

__all__ = [
    "LTI",
    "Batch",
    "DataError",
    "FitError",
    "FrequencyResponse",
    "InternalError",
    "ModfunError",
    "ModfunWarning",
    "Record",
    "SpecError",
    "Table",
    "TransferFunction",
    "__version__",
    "coefficients",
    "crlb",
    "plot",
    "regressors",
    "signals",
    "simulate",
    "ss",
    "tf",
]
