"""What a fit found: parameters with their uncertainty, the model they make, and how it went."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import Any, Self

import numpy as np

from ..base.arguments import whole
from ..base.arrays import C128, F64, geometric_mean
from ..base.between import MIXED
from ..base.cached import cached_property
from ..base.elsewhere import FIT, Elsewhere
from ..base.named import Named
from ..base.names import nearest
from ..base.student import confidence, root, student_interval
from ..base.words import USABLE
from ..errors import DataError, FitError, SpecError
from ..models.layout import Layout
from ..models.noise import Noise
from ..models.options import Options
from ..models.process import with_inputs
from ..models.transfer_function import system_of
from ..records.conversion import agreeing
from ..records.forms import forms_of, functions_alone, in_common
from ..records.record import Record
from ..records.spectra import high_band_level
from ..systems.lti import LTI
from ..systems.making import named, ss
from ..systems.polynomials import companion
from . import gradients, prediction
from .prediction import InitialState
from .sample_levels import beside_samples, square_beside

__all__ = ["COVARIANCES", "Estimates"]

# Fields that are in the core's answer by the same name.
COVARIANCES = ("cov_nonrobust", "cov_hc3", "cov_spectral")
ANSWERED = (
    *COVARIANCES, "df_spectral", "cost", "df_resid", "status", "nit", "gram", "condition_bound", "band_rule",
)  # fmt: skip
LEVELS = ("process_levels", "cov_process_levels", "process_shares")


@dataclass(frozen=True, eq=False, repr=False)
class Estimates(Elsewhere):
    """What the core answered, what was asked of it, and the numbers that follow; `Fit` tells the fields.

    All that is said, drawn and kept of a fit is made from this.
    """

    _elsewhere = FIT

    structure: Any
    layout: Layout
    options: Options
    units: dict[str, str]
    intersample: tuple[str, ...]
    params: Named
    cov_nonrobust: F64
    cov_hc3: F64
    cov_spectral: F64
    df_spectral: F64
    cost: float
    noise_cov: F64
    df_resid: int
    status: str
    nit: int
    lines: tuple[tuple[int, int], ...]
    omega0: tuple[float, ...]
    intervals: tuple[int, ...]
    steps: tuple[float | None, ...]
    gram: F64
    band_rule: dict[str, float] | None
    pieces: tuple[C128, ...]
    at_bound: tuple[str, ...] = ()
    noise_scale: float = nan
    records: tuple[Record, ...] | None = None
    condition_bound: float = inf
    known_level: F64 | None = None
    window_weights: tuple[float, ...] = ()
    df_hc3: F64 | None = None
    spectrum: tuple[F64, F64, F64] | None = None
    record_levels: F64 | None = None
    stability_cost: float = nan
    free_cost: float = nan
    process_levels: tuple[F64, F64, F64] | None = None
    tail: float = inf
    unlike: str = ""
    begun: tuple[float, ...] = ()
    instrumented: tuple[Record, ...] | None = None
    with_past: tuple[Record, ...] | None = None
    again: Callable[..., Any] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "params", Named(self.params, self.param_names))

    @classmethod
    def of_core(
        cls,
        found: Mapping[str, Any],
        structure: Any,
        layout: Any,
        options: Options,
        records: tuple[Record, ...] | None,
        intervals: Sequence[int],
        **own: Any,
    ) -> Self:
        """The core's answer as a fit; `own` are fields that are had in another way, or that its kind has."""
        noise, bounded = found.get("noise"), found.get("at_bound", ())
        known = isinstance(options.noise, Noise) or options.noise == "errors-in-variables"
        fields = {name: found[name] for name in ANSWERED} | {
            "params": Named(found["theta"], layout.param_names),
            "noise_cov": np.array([[found["sigma"] ** 2]]) if noise is None else noise,
            "noise_scale": found["scale"] if known else nan,
            "record_levels": found.get("record_levels"),
            # With noise inside the system the spectrum is that of its levels.
            "spectrum": None if LEVELS[0] in found else found.get("noise_spectrum"),
            "process_levels": tuple([found[name] for name in LEVELS]) if LEVELS[0] in found else None,
            "free_cost": nan if found.get("free_cost") is None else found["free_cost"],
            "lines": tuple(found["lines"]),
            "omega0": tuple(found["omega0"]),
            "pieces": tuple([np.atleast_2d(piece) for piece in found["residuals"]]),
            "at_bound": tuple([n for n, on in zip(layout.param_names, bounded, strict=False) if on]),
            "units": records[0].units if records else {},
            "intersample": in_common(forms_of(records)) if records else (),
            "intervals": tuple(intervals),
            "steps": tuple([rec.dt for rec in records or ()]),
            "records": records,
        }
        # Defaults are the class's; to set forty fields one by one would take longer than all else here.
        made = object.__new__(cls)
        made.__dict__.update(fields, structure=structure, layout=layout, options=options, **own)
        return made

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.layout.outputs

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.layout.inputs

    @property
    def param_names(self) -> tuple[str, ...]:
        """Names of what was estimated."""
        return self.layout.param_names

    @property
    def sigma(self) -> Any:
        """Noise standard deviation on a sample of the output; of several outputs an array, (output,).

        Of several records the geometric mean; `noise_levels` has each.
        """
        levels = np.sqrt(np.diag(self.noise_cov))
        return float(levels[0]) if levels.size == 1 else levels

    @property
    def noise_levels(self) -> F64:
        """Noise standard deviation on a sample of each output in each record, (record, output)."""
        return np.asarray(self.level_ratios * np.sqrt(np.diag(self.noise_cov)))

    @property
    def level_ratios(self) -> F64:
        """The same over `sigma`, (record, output)."""
        over = np.ones(len(self.lines)) if self.record_levels is None else self.record_levels
        return np.broadcast_to(
            over[:, None] if over.ndim == 1 else over, (len(self.lines), len(self.outputs))
        )

    # Estimates and their uncertainty ------------------------------------------------------------

    def __getitem__(self, name: str) -> float:
        return float(self.params[name])

    @property
    def cov_type(self) -> str:
        """Which covariance `bse`, `conf_int` and everything derived use."""
        return self.options.cov_type

    @property
    def bse(self) -> Named:
        """Standard errors of the parameters; by name, too: ``fit.bse["a1"]``; nan for one on its bound."""
        bound = [name in self.at_bound for name in self.param_names]
        return Named(np.where(bound, np.nan, self.spread), self.param_names, "se")

    @property
    def spread(self) -> F64:
        """Standard errors, 0 for a parameter on its bound: for what compares estimates or steps by them."""
        return root(np.diag(self.cov_params()))

    def cov_params(self, cov_type: str | None = None) -> F64:
        """Covariance matrix of the parameters: "spectral", "HC3" or "nonrobust" (default: the fit's)."""
        kind = (
            self.cov_type if cov_type is None else Options.checked("cov_params", cov_type=cov_type).cov_type
        )
        all = {"spectral": self.cov_spectral, "HC3": self.cov_hc3, "nonrobust": self.cov_nonrobust}
        return all[kind].copy()

    def correlation(self) -> F64:
        """Correlation matrix of the estimates, (p, p), of the fit's `cov_type`; nan beside a bound."""
        self.need_numbers("correlation")
        errors = self.bse
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.cov_params() / np.outer(errors, errors))

    def conf_int(self, level: float = 0.95) -> F64:
        """Confidence intervals, (p, 2), from Student's t with `degrees`; nan for a parameter on its bound.

        Parameters
        ----------
        level : float, default 0.95
            Between 0 and 1.
        """
        level = confidence("conf_int", level)
        return np.column_stack(self.interval(self.params, self.bse, level, self.degrees))

    @property
    def degrees(self) -> Any:
        """Degrees of freedom of the intervals, one for all or one per parameter."""
        if self.cov_type == "spectral":
            return self.df_spectral
        return self.df_hc3 if self.df_hc3 is not None and self.cov_type == "HC3" else self.df_resid

    def interval(self, values: F64, errors: F64, level: float = 0.95, degrees: Any = None) -> tuple[F64, F64]:
        """Lower and upper limits of estimates with these standard errors (Student's t)."""
        level = confidence("interval", level)
        if (least := np.fmin.reduce(np.ravel(errors), initial=0.0)) < 0:
            raise SpecError(f"interval: standard errors are not negative, these go down to {least:.4g}")
        return student_interval(values, errors, self._fewest_degrees() if degrees is None else degrees, level)

    def _fewest_degrees(self, which: Any = slice(None)) -> float:
        """Degrees of freedom of what several parameters determine: the fewest that one of them has."""
        own = np.broadcast_to(self.degrees, self.params.shape)[which]
        own = own[np.isfinite(own)]
        return float(own.min()) if own.size else float(self.df_resid)

    def estimates(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.param_names, self.params.tolist(), strict=True))

    @cached_property
    def high_band_levels(self) -> F64:
        """Noise level of each output, (output,), from harmonics the fit does not use; nan without such."""
        if self.known_level is not None:
            return self.known_level
        levels, order = [], max(self.layout.orders)
        for rec, intervals, (_, hi) in zip(self.records or (), self.intervals, self.lines, strict=False):
            intervals = min(intervals, rec.intervals)  # a past is no part of the record
            few = hi > intervals // 4 or intervals < 8 * (order + 4)
            if few or rec.dt is None or rec.mask is not None or rec.sigma is not None:
                return np.full(len(self.outputs), np.nan)
            # The response to held inputs has kinks, and so power at all frequencies.
            if self.usable and not {"zoh", "foh"}.isdisjoint(rec.intersample):
                rec = rec._like(y=prediction.unexplained(self, rec))
            levels.append(high_band_level(rec, rec.intervals - intervals, order))
        return geometric_mean(levels, self.rows) if levels else np.full(len(self.outputs), np.nan)

    @property
    def high_band_sigma(self) -> Any:
        """As `high_band_levels`; of one output a float."""
        levels = self.high_band_levels
        return float(levels[0]) if levels.size == 1 else levels

    # How it went --------------------------------------------------------------------------------

    @property
    def success(self) -> bool:
        """Whether the estimate can be used (status "ok")."""
        return self.status == "ok"

    @property
    def message(self) -> str:
        """The status in words, with the cure."""
        if self.status == "ok":
            one_shot = self.options.method in ("ls", "wls")
            return "One-shot estimate." if one_shot else f"Converged in {self.nit} iterations."
        if self.status == "maxiter":
            several = ", of which maxiter limits those with one weighting"
            return (
                f"Not settled after {self.nit} iterations{several if self.nit > self.options.maxiter else ''}"
                ": raise maxiter, take fewer poles or zeros, or a narrower band "
                f"than {self.band[1]:.4g} rad/s."
            )
        if self.status == "rank":
            return (
                "The samples cannot tell the parameters apart: take fewer poles or zeros, or a record in "
                "which the input moves more or longer."
            )
        return (
            "The numbers left the range of floating point: look for samples that are absurdly large, a "
            "structure of too high an order, or a record without any signal."
        )

    @property
    def usable(self) -> bool:
        """Whether there are numbers, settled or not."""
        return self.status in USABLE and all(map(isfinite, self.params.tolist()))

    @property
    def cond(self) -> float:
        """Condition number of the whitened, column-scaled regressors (transient projected out)."""
        if not np.all(np.isfinite(self.gram)):
            return float("inf")
        if not self.params.size:
            return 1.0
        eigenvalues = np.linalg.eigvalsh(self.gram)
        return float(np.sqrt(eigenvalues[-1] / eigenvalues[0])) if eigenvalues[0] > 0 else float("inf")

    @cached_property
    def chi2(self) -> float:
        """Cost in units of the noise variance seen in the unused high band: about `df_resid` if all is well.

        With noise that was given, or seen for errors in variables: the cost in units of that noise. nan where
        no level is available, or the method does not weight by it. Uneven samples show it beside neighbours.
        """
        if self.options.method not in ("awls", "ml"):
            return float("nan")
        if isinstance(self.options.noise, Noise) or self.options.noise == "errors-in-variables":
            return self.df_resid * self.noise_scale
        if beside_samples(self):
            return self.df_resid * square_beside(self)
        levels = self.high_band_levels
        if self.options.noise != "output" or not np.all(levels > 0):
            return float("nan")
        return float(self.df_resid * np.mean(self.noise_cov.diagonal() / levels**2))

    @property
    def aic(self) -> float:
        """Akaike information criterion: `bic` with 2 p for p log N; `mf.compare` puts models on one band."""
        return float(self.bic + self.params.size * (2 - np.log(self.df_resid + self.params.size)))

    @property
    def bic(self) -> float:
        """Bayesian information criterion N log(cost/N) + p log N, N the equations less transient and trend.

        Where the noise covariance of several outputs was fitted, the cost is N less the parameters whatever
        the model: then N/outputs times the logarithm of that covariance's determinant takes its place, the
        same for one output. To compare models, put them on one band with `mf.compare`.
        """
        rows, outputs = self.df_resid + self.params.size, len(self.outputs)
        penalty = self.params.size * np.log(rows)
        if outputs == 1 or not self.options.fits_covariance:
            with np.errstate(divide="ignore"):
                return float(rows * np.log(self.cost / rows) + penalty)
        _, size = np.linalg.slogdet(self.noise_cov * (self.df_resid / rows))
        return float(rows / outputs * size + penalty)

    @property
    def trend(self) -> str | None:
        """Trend fitted beside the model: None, "constant" or "linear"."""
        return self.options.fitted_trend

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest frequency used, rad/s (over all records)."""
        pairs = [(lo * w, hi * w) for (lo, hi), w in zip(self.lines, self.omega0, strict=True)]
        return min(p[0] for p in pairs), max(p[1] for p in pairs)

    @property
    def harmonics(self) -> int:
        """M, the highest modulating index: the highest line less the order n (largest over the records)."""
        return max(hi for _, hi in self.lines) - self.order

    @property
    def has_poles(self) -> bool:
        """Whether the model is linear."""
        return True

    @property
    def rows(self) -> list[int]:
        """Real equations of each record and output."""
        return [2 * (hi - lo + 1) - (lo == 0) for lo, hi in self.lines]

    @property
    def exact_lines(self) -> bool:
        """Whether no line has a quadrature error: a transfer function, even samples, inputs held or known."""
        held = {"smooth", MIXED}.isdisjoint(self.intersample) or functions_alone(self.records or ())
        return self.layout.rational and bool(self.inputs) and held and None not in self.steps

    @property
    def row_names(self) -> tuple[str, ...]:
        """What the rows of the residuals belong to: the outputs."""
        return self.outputs

    @property
    def order(self) -> int:
        """Number of poles n (of separate denominators the largest)."""
        return max(self.layout.orders)

    @property
    def residuals(self) -> C128:
        """Whitened residuals over the lines m: variance one in Re and in Im.

        (lines,), of several outputs (output, lines). Several records follow one another; `lines` says how
        many lines each has.
        """
        rows = np.concatenate(self.pieces, axis=1)
        return rows[0] if len(rows) == 1 else rows

    def own_values(self) -> dict[str, Any]:
        """What is kept of it besides what all fits have, as plain values."""
        return {}

    # The model ----------------------------------------------------------------------------------

    @property
    def model(self) -> LTI:
        """The fitted transfer function as an LTI system, with the names of the channels."""
        self.need_numbers("model")
        if self.inputs:
            return named(system_of(self.layout, self.params), self.outputs, self.inputs)
        # Free motion: companion forms without inputs.
        blocks = [companion(self.polynomials(i)[0]) for i in range(len(self.outputs))]
        size = sum(self.layout.orders)
        a, c = np.zeros((size, size)), np.zeros((len(blocks), size))
        at = 0
        for i, block in enumerate(blocks):
            n = len(block)
            a[at : at + n, at : at + n], c[i, at] = block, 1.0
            at += n
        return named(ss(a, np.zeros((size, 0)), c), self.outputs, ())

    def path_model(self, output: int | str = 0) -> LTI:
        """The transfer functions to one output, by name or position, with the delays of their own."""
        if isinstance(output, str):
            if output not in self.outputs:
                raise SpecError(f"path_model: no output {output!r}; {nearest(output, self.outputs)}")
            output = self.outputs.index(output)
        output = whole("path_model", "output", output, 0, len(self.outputs) - 1)
        return prediction.path_model(self.layout, self.params, output)

    def polynomials(self, output: int = 0) -> tuple[F64, list[F64]]:
        """Denominator (monic) and one numerator an input of an output, descending powers; no path: [0]."""
        return self.layout.polynomials(self.params, output)

    def denominators(self) -> list[tuple[str, int]]:
        """Name and number of an output for each denominator of its own; the name is empty if there is one."""
        return [("", 0)] if self.layout.common else [(name, i) for i, name in enumerate(self.outputs)]

    def pole_gradients(self, output: int = 0) -> tuple[C128, C128]:
        """Poles of an output and their derivatives to the parameters, (pole, p)."""
        return gradients.pole_gradients(self.layout, self.params, output)

    def response_gradients(self, omega: F64) -> tuple[C128, C128]:
        """Response (output, input, f) and its derivatives to the parameters (p, output, input, f)."""
        return gradients.response_gradients(self.layout, self.params, omega)

    # Against records ----------------------------------------------------------------------------

    def simulate(self, rec: Record, initial_state: Any = None) -> tuple[F64, InitialState]:
        """Simulated outputs for a record with the initial state and trend that `predict` takes."""
        # Records of the fit begin as it was told, where it was.
        told = self.options.initial_state
        own = next((k for k, one in enumerate(self.records or ()) if rec == one), None)
        if initial_state is None and own is not None and told not in ("unknown", "periodic"):
            initial_state = told if isinstance(told, str) else self.options.states(len(self.lines))[own]
        return prediction.simulate_paths(self.layout, self.params, self.trend, rec, initial_state)

    def record_of(self, rec: Record | int | None, what: str) -> Record:
        """The record that is meant, with the fit's channels alone; or one of its own by its index."""
        self.need_numbers(what)
        own = self.records
        if isinstance(rec, Record):
            rec = agreeing(what, with_inputs(rec, self.options.noise), self.units, "the fit")
            if not {*self.outputs} <= {*rec.outputs} or not {*self.inputs} <= {*rec.inputs}:
                raise DataError(
                    f"{what}: the record has outputs {list(rec.outputs)} and inputs {list(rec.inputs)}, "
                    f"the fit needs {list(self.outputs)} and {list(self.inputs)}; select them"
                )
            if (rec.outputs, rec.inputs) != (self.outputs, self.inputs):
                rec = rec.select(outputs=self.outputs, inputs=self.inputs)
            return rec._read_like(self.intersample) if self.intersample else rec  # gains tell of none
        if rec is not None and (isinstance(rec, bool) or not isinstance(rec, int | np.integer)):
            raise SpecError(f"{what}: expected a Record or the index of one, got {type(rec).__name__}")
        if own is None:
            raise FitError(f"{what}: this fit was loaded without samples; give the record, fit.{what}(rec)")
        if rec is None:
            if len(own) > 1:
                raise SpecError(f"{what}: the fit has {len(own)} records; say which, as fit.{what}(0)")
            return own[0]
        if not -len(own) <= rec < len(own):
            raise SpecError(
                f"{what}: the fit has {len(own)} record(s), there is no record {rec}; "
                f"give an index from 0 to {len(own) - 1}, or a Record"
            )
        return own[int(rec)]

    def need_numbers(self, what: str) -> None:
        """Refuse what has no answer without finite parameters."""
        if not np.all(np.isfinite(self.params)):
            raise FitError(
                f"{what}: the fit has no finite parameters (status {self.status!r}). {self.message}"
            )
