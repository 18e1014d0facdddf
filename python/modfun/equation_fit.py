"""Fits of equations: from records to the core's formulas, and the result as a `Fit`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import ceil
from typing import TYPE_CHECKING, Any, Never

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .errors import DataError, ModfunWarning, SpecError
from .gaps import bridged, variances
from .noise import Noise
from .options import Options
from .prediction import InitialState
from .records import Batch, Record
from .results import Fit

if TYPE_CHECKING:
    from .nonlinear import NonlinearModel
    from .symbolic.compiled import Compiled
    from .symbolic.formulas import Formulas

__all__ = ["EquationFit", "EquationLayout", "batch_of", "fit_equation", "prepare_equation"]

F64 = NDArray[np.float64]
KEPT = 32
IGNORED = 1e8  # variance of a sample that counts for nothing, over the others'


@dataclass(frozen=True, eq=False)
class EquationLayout:
    """Equations for the channels of a record: names, orders, what the core is told.

    Attributes
    ----------
    outputs, inputs, param_names : tuple of str
    orders : tuple of int
        Highest derivative of each equation.
    compiled : Compiled
    formulas : Formulas
    """

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    param_names: tuple[str, ...]
    orders: tuple[int, ...]
    compiled: Compiled
    formulas: Formulas

    @property
    def longest_delay(self) -> float:
        """The most that a signal may be late, s."""
        bounds = self.formulas.words["bounds"]
        late = [delay if k is None else bounds[k][1] for _, delay, k in self.formulas.words["signals"]]
        return max(late, default=0.0)


@dataclass(frozen=True, eq=False, repr=False)
class EquationFit(Fit):
    """A fitted `Equation` or `StateSpace`: a `Fit` whose model need not be linear.

    Attributes
    ----------
    levels : (noisy channel,) array
        Standard deviation of the noise that weighed the lines: given, or seen in the unused high band.
    """

    levels: F64 = field(default_factory=lambda: np.empty(0))

    @property
    def trend(self) -> str | None:
        """Constant and drift of each equation: None, "constant" or "linear"."""
        return self.structure.trend if self.options.trend == "auto" else self.options.trend

    @property
    def model(self) -> Any:
        """The equations with their estimates; of a linear `StateSpace` an `LTI`."""
        self._need_numbers("model")
        return self.structure.model(self.estimates())

    def varying(self, name: str, t: ArrayLike) -> tuple[F64, F64]:
        """A coefficient that varies with time, and its standard error.

        Parameters
        ----------
        name : str
            As in `varying=` of the equation.
        t : (time,) array_like
            Instants in s.

        Returns
        -------
        value, bse : (time,) arrays
        """
        from .symbolic.varying import basis

        instants = np.atleast_1d(np.asarray(t, dtype=float))
        names, values = basis(self.layout.compiled, name, instants, self.records)
        place = [self.param_names.index(own) for own in names]
        cov = self.cov_params()[np.ix_(place, place)]
        return self.params[place] @ values, np.sqrt(np.einsum("it,ij,jt->t", values, cov, values))

    def _linear(self, what: str) -> Any:
        model = self.model
        if not hasattr(model, "poles"):
            raise SpecError(
                f"{what}: the fitted equations are not linear, so they have no poles and no frequency response; "
                "fit.model.simulate(...) and fit.predict() show what they do"
            )
        return model

    def damp(self) -> Any:
        """Poles of a linear state space; see `LTI`."""
        from .derived import damp_of_model

        return damp_of_model(self, self._linear("damp"))

    def polynomials(self, output: int = 0) -> Never:
        """Not for equations: their coefficients have names of their own."""
        raise SpecError("polynomials: the parameters of equations are no coefficients of a transfer function; "
                        "use fit.params, or fit.model")

    def path_model(self, output: int | str = 0) -> Never:
        """Not for equations; see `model`."""
        raise SpecError("path_model: equations have no path from one input to one output; use fit.model")

    def simulate(self, rec: Record, initial_state: Any) -> tuple[F64, InitialState]:
        """Outputs for a record by integration, with the initial state that suits them best."""
        from .nonlinear import simulate_fit

        return simulate_fit(self, rec, initial_state)


@lru_cache(KEPT)
def _layout(structure: Any, options: Options, outputs: Any, inputs: Any, intersample: Any) -> EquationLayout:
    from .symbolic.formulas import formulas

    compiled = structure.compiled(outputs, inputs)
    noisy = list(outputs)
    if options.noise == "errors-in-variables" or (isinstance(options.noise, Noise) and options.noise.u is not None):
        noisy += inputs
    found = formulas(
        compiled, options.rule, intersample, noisy, options.noise == "log-normal", options.correct
    )
    return EquationLayout(
        tuple(outputs), tuple(inputs), tuple(compiled.parameters), tuple(compiled.orders), compiled, found
    )


def layout_of(structure: Any, options: Options, data: Record | Batch) -> EquationLayout:
    """The equations for the channels of a record or batch."""
    for name, plain, why in (
        ("noise", options.noise != "coloured", 'is for transfer functions; the standard errors are HC3, which '
         "hold whatever the colour"),
        ("output_weights", options.output_weights is None, "is for transfer functions; give noise=mf.Noise(y=...)"),
        ("extended", options.extended, "is for transfer functions; equations use all indices"),
    ):
        if not plain:
            raise SpecError(f"fit: {name}={getattr(options, name)!r} {why}")
    own = options.replace(
        band=None, harmonics=None, method="ml", trend=None, tol=1e-9, maxiter=50, cov_type="HC3"
    )
    if isinstance(own.noise, Noise):
        own = own.replace(noise=Noise(y=1.0, u=None if own.noise.u is None else 1.0))
    return _layout(structure, own, data.outputs, data.inputs, data.intersample)


def _levels(noise: Any, outputs: int, inputs: int) -> list[float] | None:
    if not isinstance(noise, Noise):
        return None
    found: list[float] = []
    for given, count, name in ((noise.y, outputs, "y"), (noise.u, inputs, "u")):
        if given is None:
            continue
        try:
            levels = np.broadcast_to(np.asarray(given, dtype=float), (count,))
        except (TypeError, ValueError):
            raise SpecError(
                f"fit: noise=Noise({name}=...) of equations takes standard deviations, one or one a channel "
                f"({count})"
            ) from None
        found += levels.tolist()
    return found


@dataclass(frozen=True, slots=True)
class PreparedEquation:
    """Equations with options for records of some lengths and steps; as `prepared.Prepared`."""

    core: Any
    layout: EquationLayout
    intervals: tuple[int, ...]


def prepare_equation(
    structure: Any, options: Options, data: Batch | Sequence[Record], uneven: Sequence[F64 | None] = (None,)
) -> PreparedEquation:
    """What fits of equations share whatever the samples.

    Raises
    ------
    DataError, SpecError
        As in `fit`.
    """
    first: Batch | Record
    if isinstance(data, Batch):
        first, sampling = data, [(data.y.shape[2], data.dt)]
    else:
        first = data[0]
        sampling = [(rec.y.shape[1], rec.t if rec.dt is None else rec.dt) for rec in data]
    layout = layout_of(structure, options, first)
    trend = structure.trend if options.trend == "auto" else options.trend
    core = _core.TermsFitter(
        [samples for samples, _ in sampling],
        [step for _, step in sampling],
        list(uneven),
        **layout.formulas.words,
        flat=options.noise == "equation",
        levels=_levels(options.noise, len(first.outputs), len(first.inputs)),
        **{**options.core(), "trend": trend, "intersample": []},
    )
    late = layout.longest_delay
    intervals = tuple(
        samples - 1 - (ceil(late / step - 1e-9) if late else 0) for samples, step in sampling
    )
    return PreparedEquation(core, layout, intervals)


def fit_equation(records: tuple[Record, ...], structure: Any, options: Options) -> EquationFit:
    """One fit of equations, without its warnings."""
    layout = layout_of(structure, options, records[0])
    whole = [(rec, *bridged(rec)) for rec in records]
    order = max(layout.orders)
    uneven = [variances(rec, off, order) for rec, _, off in whole]
    capped = [None if v is None else np.where(np.isfinite(v), v, IGNORED * _most(v)) for v in uneven]
    made = prepare_equation(structure, options, records, [_all_noisy(layout, v) for v in capped])
    rows = [layout.formulas.rows(y, rec.u, rec.t) for rec, y, _ in whole]
    _refuse_not_finite(layout, rows, options)
    found = made.core.fit(rows)
    levels, outputs = found["levels"], len(layout.outputs)
    known = levels[:outputs]
    first = records[0]
    return EquationFit(
        structure=structure,
        layout=layout,  # type: ignore[arg-type]  # what a Fit asks of it is there
        options=options,
        units=first.units,
        intersample=first.intersample,
        params=found["theta"],
        cov_nonrobust=found["cov_nonrobust"],
        cov_hc3=found["cov_hc3"],
        cost=found["cost"] * (known[0] ** 2 if levels.size == 1 else 1.0),
        noise_cov=np.diag(known**2 * found["scale"]),
        df_resid=found["df_resid"],
        status=found["status"],
        nit=found["nit"],
        lines=tuple(found["lines"]),
        omega0=tuple(found["omega0"]),
        intervals=made.intervals,
        steps=tuple(rec.dt for rec in records),
        gram=found["gram"],
        condition_bound=found["condition_bound"],
        band_rule=found["band_rule"],
        pieces=tuple(np.array(piece) for piece in found["residuals"]),
        at_bound=tuple(n for n, on in zip(layout.param_names, found["at_bound"], strict=True) if on),
        noise_scale=found["scale"],
        records=records,
        levels=levels,
    )


def _most(values: F64) -> float:
    return float(np.max(values[np.isfinite(values)], initial=1.0))


def _all_noisy(layout: EquationLayout, variance: F64 | None) -> F64 | None:
    """Variances of the outputs' samples, followed by ones for noisy inputs."""
    if variance is None:
        return None
    more = len(layout.formulas.noisy) - len(variance)
    return np.ascontiguousarray(np.vstack([variance, np.ones((more, variance.shape[1]))]))


def _refuse_not_finite(layout: EquationLayout, rows: Sequence[F64], options: Options) -> None:
    for k, values in enumerate(rows):
        for channel, row in zip(layout.formulas.channels, values, strict=True):
            bad = ~np.isfinite(row)
            if not bad.any():
                continue
            at = int(np.argmax(bad))
            if channel.kind == "log":
                raise DataError(
                    f"fit: noise=\"log-normal\" takes the logarithm of {layout.outputs[channel.of]!r}, which is "
                    f"not positive at sample {at} of record {k}; use noise=\"output\""
                )
            raise DataError(
                f"fit: {channel.symbol} is not finite at sample {at} of record {k}; change the known function "
                "or the record there"
            )


def batch_of(made: PreparedEquation, data: Batch | tuple[Record, ...]) -> tuple[list[F64], F64]:
    """Channels of each record, and those that all share."""
    formulas = made.layout.formulas
    if isinstance(data, Batch):
        t = np.arange(data.y.shape[2]) * data.dt
        if len(data.u) == 1 or not data.inputs:
            u = data.u[0]
            return [formulas.rows(y, u, t, own=True) for y in data.y], formulas.rows(data.y[0], u, t, own=False)
        own = [formulas.rows(y, u, t) for y, u in zip(data.y, data.u, strict=True)]
        return own, np.empty((0, t.size))
    return [formulas.rows(r.y, r.u, r.t) for r in data], np.empty((0, data[0].t.size))


def warn_of(fit: EquationFit) -> None:
    """The warnings of a fit."""
    from . import explain

    for text in explain.warnings_of(fit):
        warnings.warn(text, ModfunWarning, stacklevel=3)
