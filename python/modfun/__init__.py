"""Identification of continuous-time systems from short, noisy, transient records.

Units are seconds and rad/s, arrays are (channel, time).
"""

from . import plot, rivals, signals, timelag
from ._core import __version__
from .base.tables import Table
from .equations.equation import Equation
from .equations.nonlinear import NonlinearModel
from .equations.state_space import StateSpace
from .errors import DataError, FitError, InternalError, ModfunError, ModfunWarning, SpecError
from .experiments.bound import crlb
from .experiments.simulation import simulate
from .fitting.fit import Estimator, fit, fit_many
from .inference.bootstrap import bootstrap
from .inference.collinearity import collinearity
from .inference.common_poles import CommonPoles, common_poles
from .inference.comparison import Comparison, CrossValidation, compare, cross_validate
from .inference.order import OrderSelection, select_order
from .inference.rank import rank_test
from .models.free import Free
from .models.noise import Noise
from .models.transfer_function import TransferFunction
from .records.batches import Batch
from .records.reading import columns, read
from .records.record import Record
from .reduction.reduction import Reduction, reduce
from .responses.coefficients import coefficients, regressors
from .responses.frf import frf
from .results.collinearity import Collinearity
from .results.fit import Fit
from .streams.stream import Stream
from .streams.track import Track
from .study.loading import load
from .study.monte_carlo import MonteCarlo, Results
from .systems.frequency_response import FrequencyResponse
from .systems.lti import LTI, ss, tf
from .tones.results import Sinusoids, SinusoidsMany
from .tones.search import sinusoids

__all__ = [
    "LTI",
    "Batch",
    "Collinearity",
    "CommonPoles",
    "Comparison",
    "CrossValidation",
    "DataError",
    "Equation",
    "Estimator",
    "Fit",
    "FitError",
    "Free",
    "FrequencyResponse",
    "InternalError",
    "ModfunError",
    "ModfunWarning",
    "MonteCarlo",
    "Noise",
    "NonlinearModel",
    "OrderSelection",
    "Record",
    "Reduction",
    "Results",
    "Sinusoids",
    "SinusoidsMany",
    "SpecError",
    "StateSpace",
    "Stream",
    "Table",
    "Track",
    "TransferFunction",
    "__version__",
    "bootstrap",
    "coefficients",
    "collinearity",
    "columns",
    "common_poles",
    "compare",
    "crlb",
    "cross_validate",
    "fit",
    "fit_many",
    "frf",
    "load",
    "plot",
    "rank_test",
    "read",
    "reduce",
    "regressors",
    "rivals",
    "select_order",
    "signals",
    "simulate",
    "sinusoids",
    "ss",
    "tf",
    "timelag",
]
