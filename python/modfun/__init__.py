"""Identification of continuous-time systems from short, noisy, transient records.

Units are seconds and rad/s, arrays are (channel, time).
"""

from importlib import import_module
from typing import TYPE_CHECKING

from ._core import __version__
from .errors import DataError, FitError, InternalError, ModfunError, ModfunWarning, SpecError

if TYPE_CHECKING:
    from . import plot, rivals, signals, timelag
    from .base.tables import Table
    from .equations.equation import Equation
    from .equations.nonlinear import NonlinearModel
    from .equations.state_space import StateSpace
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
    from .study.monte_carlo import MonteCarlo
    from .study.results import Results
    from .systems.frequency_response import FrequencyResponse
    from .systems.lti import LTI
    from .systems.making import ss, tf
    from .tones.results import Sinusoids, SinusoidsMany
    from .tones.search import sinusoids

# Public names load when they are asked for (PEP 562): the module each stands in.
_PLACES = {
    "Batch": ".records.batches",
    "Collinearity": ".results.collinearity",
    "CommonPoles": ".inference.common_poles",
    "Comparison": ".inference.comparison",
    "CrossValidation": ".inference.comparison",
    "Equation": ".equations.equation",
    "Estimator": ".fitting.fit",
    "Fit": ".results.fit",
    "Free": ".models.free",
    "FrequencyResponse": ".systems.frequency_response",
    "LTI": ".systems.lti",
    "MonteCarlo": ".study.monte_carlo",
    "Noise": ".models.noise",
    "NonlinearModel": ".equations.nonlinear",
    "OrderSelection": ".inference.order",
    "Record": ".records.record",
    "Reduction": ".reduction.reduction",
    "Results": ".study.results",
    "Sinusoids": ".tones.results",
    "SinusoidsMany": ".tones.results",
    "StateSpace": ".equations.state_space",
    "Stream": ".streams.stream",
    "Table": ".base.tables",
    "Track": ".streams.track",
    "TransferFunction": ".models.transfer_function",
    "bootstrap": ".inference.bootstrap",
    "coefficients": ".responses.coefficients",
    "collinearity": ".inference.collinearity",
    "columns": ".records.reading",
    "common_poles": ".inference.common_poles",
    "compare": ".inference.comparison",
    "crlb": ".experiments.bound",
    "cross_validate": ".inference.comparison",
    "fit": ".fitting.fit",
    "fit_many": ".fitting.fit",
    "frf": ".responses.frf",
    "load": ".study.loading",
    "plot": ".plot",
    "rank_test": ".inference.rank",
    "read": ".records.reading",
    "reduce": ".reduction.reduction",
    "regressors": ".responses.coefficients",
    "rivals": ".rivals",
    "select_order": ".inference.order",
    "signals": ".signals",
    "simulate": ".experiments.simulation",
    "sinusoids": ".tones.search",
    "ss": ".systems.making",
    "tf": ".systems.making",
    "timelag": ".timelag",
}

__all__ = [  # noqa: RUF022, in the order of dir()
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
    "LTI",
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


def __dir__() -> list[str]:
    return __all__


if not TYPE_CHECKING:  # type checkers read the imports above

    def __getattr__(name: str) -> object:
        if name not in _PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        place = import_module(_PLACES[name], __name__)
        value = place if _PLACES[name] == f".{name}" else getattr(place, name)
        globals()[name] = value
        return value
