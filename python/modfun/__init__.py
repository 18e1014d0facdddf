"""Identification of continuous-time systems from short, noisy, transient records.

Units are seconds and rad/s, arrays are (channel, time).
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

from ._core import __version__
from .errors import DataError, FitError, InternalError, ModfunError, ModfunWarning, SpecError

if TYPE_CHECKING:
    from . import plot, rivals, signals, timelag
    from .base.tables import Table
    from .equations.equation import Equation
    from .equations.nonlinear import NonlinearModel
    from .equations.series import through
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
    from .inference.term_selection import TermSelection
    from .inference.terms import select_terms
    from .models.free import Free
    from .models.noise import Noise
    from .models.process import Numerator, ProcessNoise, dryden
    from .models.transfer_function import TransferFunction
    from .records.batches import Batch
    from .records.reading import columns, read
    from .records.record import Record
    from .reduction.reduction import Reduction, reduce
    from .responses.coefficients import coefficients, regressors
    from .responses.frf import frf
    from .results.collinearity import Collinearity
    from .results.fit import Fit
    from .results.many import FitMany
    from .streams.stream import Stream
    from .streams.track import Track
    from .study.loading import load
    from .study.monte_carlo import MonteCarlo
    from .study.results import Results
    from .systems.frequency_response import FrequencyResponse
    from .systems.lti import LTI
    from .systems.making import ss, tf, zpk
    from .systems.sampling import c2d, d2c
    from .tones.results import Sinusoids, SinusoidsMany
    from .tones.search import sinusoids

# Public names load when they are asked for (PEP 562): the names of each module, which types above repeat.
_NAMES = {
    ".base.tables": ("Table",),
    ".equations.equation": ("Equation",),
    ".equations.nonlinear": ("NonlinearModel",),
    ".equations.state_space": ("StateSpace",),
    ".experiments.bound": ("crlb",),
    ".experiments.simulation": ("simulate",),
    ".fitting.fit": ("Estimator", "fit", "fit_many"),
    ".inference.bootstrap": ("bootstrap",),
    ".inference.collinearity": ("collinearity",),
    ".inference.common_poles": ("CommonPoles", "common_poles"),
    ".inference.comparison": ("Comparison", "CrossValidation", "compare", "cross_validate"),
    ".inference.order": ("OrderSelection", "select_order"),
    ".inference.rank": ("rank_test",),
    ".inference.term_selection": ("TermSelection",),
    ".inference.terms": ("select_terms",),
    ".models.free": ("Free",),
    ".models.noise": ("Noise",),
    ".models.process": ("Numerator", "ProcessNoise", "dryden"),
    ".equations.series": ("through",),
    ".models.transfer_function": ("TransferFunction",),
    ".records.batches": ("Batch",),
    ".records.reading": ("columns", "read"),
    ".records.record": ("Record",),
    ".reduction.reduction": ("Reduction", "reduce"),
    ".responses.coefficients": ("coefficients", "regressors"),
    ".responses.frf": ("frf",),
    ".results.collinearity": ("Collinearity",),
    ".results.fit": ("Fit",),
    ".results.many": ("FitMany",),
    ".streams.stream": ("Stream",),
    ".streams.track": ("Track",),
    ".study.loading": ("load",),
    ".study.monte_carlo": ("MonteCarlo",),
    ".study.results": ("Results",),
    ".systems.frequency_response": ("FrequencyResponse",),
    ".systems.lti": ("LTI",),
    ".systems.making": ("ss", "tf", "zpk"),
    ".systems.sampling": ("c2d", "d2c"),
    ".tones.results": ("Sinusoids", "SinusoidsMany"),
    ".tones.search": ("sinusoids",),
}
_PLACES = {name: place for place, names in _NAMES.items() for name in names}
_MODULES = ("plot", "rivals", "signals", "timelag")

__all__ = [  # noqa: RUF022, in the order of dir()
    "Batch", "Collinearity", "CommonPoles", "Comparison", "CrossValidation", "DataError", "Equation",
    "Estimator", "Fit", "FitError", "FitMany", "Free", "FrequencyResponse", "InternalError", "LTI",
    "ModfunError", "ModfunWarning", "MonteCarlo", "Noise", "NonlinearModel", "Numerator", "OrderSelection",
    "ProcessNoise", "Record", "Reduction", "Results", "Sinusoids", "SinusoidsMany", "SpecError",
    "StateSpace", "Stream", "Table", "TermSelection", "Track", "TransferFunction", "__version__",
    "bootstrap", "c2d", "coefficients", "collinearity", "columns", "common_poles", "compare", "crlb",
    "cross_validate", "d2c", "dryden", "fit", "fit_many", "frf", "load", "plot", "rank_test", "read",
    "reduce", "regressors", "rivals", "select_order", "select_terms", "signals", "simulate", "sinusoids",
    "ss", "tf", "through", "timelag", "zpk",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__


if not TYPE_CHECKING:  # type checkers read the imports above

    def __getattr__(name: str) -> object:
        if name in _MODULES:
            return import_module(f".{name}", __name__)
        if name not in _PLACES:
            # With name and obj, Python itself adds what may have been meant.
            here = import_module(".base.elsewhere", __name__).PACKAGE.get(name)
            text = f"module {__name__!r} has no attribute {name!r}" + (
                f": use {here}, see docs/migration.md" if here else ""
            )
            raise AttributeError(text, name=name, obj=sys.modules[__name__])
        value = globals()[name] = getattr(import_module(_PLACES[name], __name__), name)
        return value
