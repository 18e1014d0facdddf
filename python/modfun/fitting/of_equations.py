"""Fits of equations: from records to the core's formulas, and the result as a `Fit`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, nan
from typing import Any, Never

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import TermsFitter
from ..base.arguments import reals
from ..base.student import root
from ..equations.layout import EquationLayout, layout_of
from ..errors import DataError, SpecError
from ..models.noise import Noise
from ..models.options import Options
from ..records.batches import Batch
from ..records.record import Record
from ..results.fit import Fit
from ..results.prediction import InitialState
from .gaps import bridged, variances

__all__ = ["EquationFit", "batch_of", "fit_equation", "prepare_equation"]

F64 = NDArray[np.float64]
IGNORED = 1e8  # variance of a sample that counts for nothing, over the others'


@dataclass(frozen=True, eq=False, repr=False)
class EquationFit(Fit):
    """A fitted `Equation` or `StateSpace`: a `Fit` whose model need not be linear.

    Attributes
    ----------
    levels : (noisy channel,) array
        Standard deviation of the noise that weighed the lines: given, or seen in the unused high band.
    df_hc3 : (p,) array
        Degrees of freedom of each HC3 standard error (Satterthwaite): few where few lines carry a parameter.
    """

    layout: EquationLayout  # type: ignore[assignment]  # what a Fit asks of it is there
    levels: F64 = field(default_factory=lambda: np.empty(0))
    df_hc3: F64 = field(default_factory=lambda: np.empty(0))

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
        from ..equations.symbolic.varying import basis

        instants = np.atleast_1d(reals("varying", "t", t))
        names, values, held = basis(self.layout.compiled, name, instants)
        place = [self.param_names.index(own) for own in names]
        cov = self.cov_params()[np.ix_(place, place)]
        return self.params[place] @ values + held, root(np.einsum("it,ij,jt->t", values, cov, values))

    @property
    def degrees(self) -> Any:
        """Degrees of freedom of the intervals: of HC3 one a parameter."""
        return self.df_hc3 if self.cov_type == "HC3" else self.df_resid

    @property
    def message(self) -> str:
        """The status in words, with the cure."""
        if self.status == "rank":
            return (
                "The samples cannot tell the parameters apart: hold one, or take a record that moves more or "
                "longer. fit.structure.identifiable() says what no record could tell apart."
            )
        if self.status == "maxiter" and self.nit < self.options.maxiter:
            return (
                f"Stopped after {self.nit} iterations where no step lowers the cost any more, and not at a "
                "minimum: give starts and bounds with mf.Free, or a narrower band."
            )
        if self.status == "maxiter":
            return (
                f"Not settled after {self.nit} iterations: raise maxiter, hold a parameter or take a "
                "narrower band."
            )
        if self.status == "nonfinite":
            return (
                "The numbers left the range of floating point: look for samples at which a signal has no "
                "value (log or sqrt of what noise makes negative, 1/0), or that are absurdly large."
            )
        return super().message

    @property
    def has_poles(self) -> bool:
        """Whether the model is linear, as that of a `StateSpace` is."""
        return bool(self.structure.linear)

    @property
    def row_names(self) -> tuple[str, ...]:
        """What the rows of the residuals belong to: the equations."""
        return tuple(f"equation {k}" for k in range(1, len(self.layout.orders) + 1))

    @property
    def high_band_levels(self) -> F64:
        """Noise level of each output as seen in the unused high band; nan where it was given."""
        given = isinstance(self.options.noise, Noise) or not self.layout.formulas.needs_levels
        outputs = len(self.outputs)
        return np.full(outputs, np.nan) if given else self.levels[:outputs]

    @property
    def chi2(self) -> float:
        """Cost in units of the noise levels: about `df_resid` if all is well; nan without known levels."""
        weighted = self.options.method in ("awls", "ml") and self.options.noise != "equation"
        known = isinstance(self.options.noise, Noise) or self.layout.formulas.needs_levels
        return self.df_resid * self.noise_scale if weighted and known else float("nan")

    def _at(self, k: int, size: float) -> Any:
        params = self.params.copy()
        params[k] += size
        return self.structure.model(dict(zip(self.param_names, params.tolist(), strict=True)))

    def _gradient(self, of: Any) -> Any:
        """Values of a function of the linear model, and central differences over the parameters."""
        value, slopes = of(self.model), []
        for k, (own, error) in enumerate(zip(self.params, self.bse, strict=True)):
            step = float(np.cbrt(np.finfo(float).eps)) * (max(abs(own), float(np.nan_to_num(error))) or 1.0)
            slopes.append((of(self._at(k, step)) - of(self._at(k, -step))) / (2 * step))
        return value, np.array(slopes)

    def _poles(self, output: int) -> Any:
        self._need_linear("poles")
        found = np.asarray(self.model.poles())

        def near(model: Any) -> Any:
            """Poles of a model close by, in the order of the estimate's."""
            left = list(model.poles())
            return np.array([left.pop(int(np.argmin(np.abs(np.array(left) - pole)))) for pole in found])

        value, slopes = self._gradient(near)
        return value, slopes.T

    def _need_linear(self, what: str) -> None:
        if not self.has_poles:
            raise SpecError(
                f"a fit of an Equation, linear or not, is not asked for its {what}; fit a TransferFunction "
                "or a StateSpace, or see what it does by fit.model.simulate(...) and fit.predict()"
            )

    def _response(self, omega: F64) -> Any:
        self._need_linear("frequency response")
        return self._gradient(lambda model: np.asarray(model.frequency_response(omega).response))

    def polynomials(self, output: int = 0) -> Never:
        """Not for equations: their coefficients have names of their own."""
        raise SpecError(
            "polynomials: the parameters of equations are no coefficients of a transfer function; "
            "use fit.params, or fit.model"
        )

    def path_model(self, output: int | str = 0) -> Never:
        """Not for equations; see `model`."""
        raise SpecError("path_model: equations have no path from one input to one output; use fit.model")

    def simulate(self, rec: Record, initial_state: Any = None) -> tuple[F64, InitialState]:
        """Simulated outputs for a record with the initial state and trend that `predict` takes."""
        from ..results.initial_state import simulate_fit

        if initial_state is not None:
            return simulate_fit(self, rec, initial_state)
        kept = self.__dict__.get("_simulated")  # errors, scores and plots ask for the same again
        if kept is None or kept[0] is not rec:
            kept = rec, simulate_fit(self, rec, None)
            self.__dict__["_simulated"] = kept
        found: tuple[F64, InitialState] = kept[1]
        return found

    def _observed(self, rec: Record, eigenvalues: Any) -> Never:
        raise SpecError('initial_state: an observer is for transfer functions; use method="lstsq"')


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
    structure: Any,
    options: Options,
    data: Batch | Sequence[Record],
    uneven: Sequence[F64 | None] = (None,),
    levels: list[float] | None = None,
) -> PreparedEquation:
    """What fits of equations share whatever the samples.

    Raises
    ------
    DataError, SpecError
        As in `fit`.
    """
    first: Batch | Record
    if isinstance(data, Batch):
        first = data
        sampling: list[tuple[int, Any]] = [(data.y.shape[2], data.dt)]
    else:
        first = data[0]
        sampling = [(rec.y.shape[1], rec.t if rec.dt is None else rec.dt) for rec in data]
    layout = layout_of(structure, options, first.outputs, first.inputs, first.intersample)
    trend = structure.trend if options.trend == "auto" else options.trend
    core = TermsFitter(
        [samples for samples, _ in sampling],
        [step for _, step in sampling],
        list(uneven),
        **layout.formulas.words,
        flat=options.noise == "equation",
        levels=levels or _levels(options.noise, len(first.outputs), len(first.inputs)),
        **{**options.core(), "trend": trend, "intersample": []},
    )
    late = layout.longest_delay
    intervals = tuple(samples - 1 - (ceil(late / step - 1e-9) if late else 0) for samples, step in sampling)
    return PreparedEquation(core, layout, intervals)


def fit_equation(records: tuple[Record, ...], structure: Any, options: Options) -> EquationFit:
    """One fit of equations, without its warnings."""
    first = records[0]
    layout = layout_of(structure, options, first.outputs, first.inputs, first.intersample)
    whole = [(rec, *bridged(rec)) for rec in records]
    order = max(layout.orders)
    uneven = [variances(rec, off, order) for rec, _, off in whole]
    capped = [None if v is None else _relative(v) for v in uneven]
    seen = _seen(records, layout) if not isinstance(options.noise, Noise) else None
    made = prepare_equation(structure, options, records, [_all_noisy(layout, v) for v in capped], seen)
    rows = [layout.formulas.rows(y, rec.u, rec.t) for rec, y, _ in whole]
    _refuse_not_finite(layout, rows)
    found = made.core.fit(rows)
    levels, outputs = found["levels"], len(layout.outputs)
    known = levels[:outputs]
    return EquationFit(
        structure=structure,
        layout=layout,
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
        # Levels read between gaps are too rough to judge residuals by.
        noise_scale=found["scale"] if seen is None else nan,
        records=records,
        levels=levels,
        df_hc3=found["df_hc3"],
    )


def _relative(variance: F64) -> F64:
    """Variances of samples over the median of their channel; what tells nothing has a large one."""
    usual = np.array([np.median(row[np.isfinite(row)]) for row in variance])[:, None]
    return np.asarray(np.minimum(variance / usual, IGNORED))


def _seen(records: Sequence[Record], layout: EquationLayout) -> list[float] | None:
    """Noise levels of masked records, which only their good samples show; None where none is masked."""
    if all(rec.mask is None for rec in records) or not layout.formulas.needs_levels:
        return None
    order = max(layout.orders)
    tables = [
        dict(zip(table["channel"], table["noise_sd"], strict=True))
        for table in (rec.noise_level(order) for rec in records)
    ]
    return [float(np.sqrt(np.mean([table[name] ** 2 for table in tables]))) for name in layout.formulas.noisy]


def _all_noisy(layout: EquationLayout, variance: F64 | None) -> F64 | None:
    """Variances of the outputs' samples, followed by ones for noisy inputs."""
    if variance is None:
        return None
    more = len(layout.formulas.noisy) - len(variance)
    return np.ascontiguousarray(np.vstack([variance, np.ones((more, variance.shape[1]))]))


def _refuse_not_finite(layout: EquationLayout, rows: Sequence[F64]) -> None:
    for k, values in enumerate(rows):
        for channel, row in zip(layout.formulas.channels, values, strict=True):
            bad = ~np.isfinite(row)
            if not bad.any():
                continue
            at = int(np.argmax(bad))
            if channel.kind == "log":
                raise DataError(
                    f'fit: noise="log-normal" takes the logarithm of {layout.outputs[channel.of]!r}, which '
                    f'is not positive at sample {at} of record {k}; use noise="output"'
                )
            raise DataError(
                f"fit: {channel.symbol} is not finite at sample {at} of record {k}; change the known "
                "function or the record there"
            )


def batch_of(made: PreparedEquation, data: Batch | tuple[Record, ...]) -> tuple[list[F64], F64]:
    """Channels of each record, and those that all share."""
    formulas = made.layout.formulas
    if isinstance(data, Batch):
        t = np.arange(data.y.shape[2], dtype=np.float64) * data.dt
        if len(data.u) == 1 or not data.inputs:
            u = data.u[0]
            return [formulas.rows(y, u, t, own=True) for y in data.y], formulas.rows(
                data.y[0], u, t, own=False
            )
        own = [formulas.rows(y, u, t) for y, u in zip(data.y, data.u, strict=True)]
        return own, np.empty((0, t.size))
    return [formulas.rows(r.y, r.u, r.t) for r in data], np.empty((0, data[0].t.size))
