"""The result of a fit: parameters with their uncertainty, the model, and what follows from them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import noise_level
from ..base.arguments import public, whole
from ..base.samples import frequencies
from ..base.student import probability, root, student_interval
from ..base.tables import Findings, Table, nearest
from ..errors import DataError, FitError, SpecError
from ..files.writing import write_text
from ..models.layout import Layout
from ..models.noise import Noise
from ..models.options import Options
from ..models.transfer_function import system_of
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.making import ss, tf
from ..systems.polynomials import companion
from . import check as doubts
from . import derived as derivations
from . import prediction
from . import scores as validation
from . import summary as explain
from .prediction import InitialState

__all__ = ["Fit"]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]


@public
@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """A fitted transfer function, of one output or several.

    Made by `fit`, an `Estimator` or `load`. Methods that take a record use the fit's own when it is left
    out; where the fit has several, say which by its index (`fit.predict(1)`) or give any Record with the
    same channels.

    Attributes
    ----------
    params : (p,) array
        Estimates in the order of `param_names`: a1 ... an, then the numerator of each input in descending
        powers.
    param_names : tuple of str
    cov_nonrobust, cov_hc3 : (p, p) arrays
        Covariance with the classical formula and with HC3, which assumes nothing about the noise colour.
        `cov_params()` and `bse` follow `cov_type`.
    cost : float
        The minimised weighted sum of squares, in units of the output squared where the weighting is that
        of output noise.
    noise_cov : (output, output) array
        Covariance of the noise on a sample of the outputs (of the equations, for equation noise).
    df_resid : int
        Real equations less unknowns (transient and trend included).
    status : str
        "ok", "maxiter", "rank" or "nonfinite".
    nit : int
        Iterations.
    lines : tuple of (int, int)
        Lowest and highest harmonic used, a record.
    omega0 : tuple of float
        Line spacing 2 pi / T in rad/s, a record.
    intervals, steps : tuples
        Sampling intervals used and their length in s (None: uneven), a record.
    band_rule : dict or None
        Numbers of the default rule that chose the band; None where the band was given.
    structure : TransferFunction, Equation or StateSpace
        What was fitted.
    layout : Layout
        The structure for the record's channels: names, fixed values, how parameters make polynomials.
    noise_scale : float
        Variance of the noise over what was given (`Noise`) or seen (errors in variables); else nan.
    at_bound : tuple of str
        Parameters that ended on a bound: 0 in the covariance, so that the others' errors hold given them;
        nan in `conf_int` and `table`, as their own is not known.
    options : Options
        How it was fitted.
    records : tuple of Record or None
        The fit's own records; None after `load`.
    window_weights : tuple of float
        Of the squared residuals of each record, where a `Stream` forgets; else empty.
    condition_bound : float
        No less than `cond`, and had for nothing; inf where not known.
    """

    structure: Any
    layout: Layout
    options: Options
    units: dict[str, str]
    intersample: tuple[str, ...]
    params: F64
    cov_nonrobust: F64
    cov_hc3: F64
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
        """Noise standard deviation on a sample of the output; of several outputs an array, (output,)."""
        levels = np.sqrt(np.diag(self.noise_cov))
        return float(levels[0]) if levels.size == 1 else levels

    # Estimates and their uncertainty ------------------------------------------------------------

    def __getitem__(self, name: str) -> float:
        if name not in self.param_names:
            raise SpecError(f"the fit has no parameter {name!r}; {nearest(name, self.param_names)}")
        return float(self.params[self.param_names.index(name)])

    @property
    def cov_type(self) -> str:
        """Which covariance `bse`, `conf_int` and everything derived use."""
        return self.options.cov_type

    @property
    def bse(self) -> F64:
        """Standard errors of the parameters."""
        return root(np.diag(self.cov_params()))

    def cov_params(self, cov_type: str | None = None) -> F64:
        """Covariance matrix of the parameters, "HC3" or "nonrobust" (default: the fit's)."""
        kind = (
            self.cov_type if cov_type is None else Options.checked("cov_params", cov_type=cov_type).cov_type
        )
        return (self.cov_hc3 if kind == "HC3" else self.cov_nonrobust).copy()

    def correlation(self) -> F64:
        """Correlation matrix of the estimates, (p, p), of the fit's `cov_type`; nan beside a bound."""
        self._need_numbers("correlation")
        errors = self.bse
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.cov_params() / np.outer(errors, errors))

    def conf_int(self, level: float = 0.95) -> F64:
        """Confidence intervals, (p, 2), from Student's t with `df_resid` degrees of freedom.

        nan for a parameter on its bound, whose error is not known.

        Parameters
        ----------
        level : float, default 0.95
            Between 0 and 1.
        """
        level = probability("conf_int", level)
        free = [name not in self.at_bound for name in self.param_names]
        errors = np.where(free, self.bse, np.nan)
        return np.column_stack(self.interval(self.params, errors, level, self.degrees))

    @property
    def degrees(self) -> Any:
        """Degrees of freedom of the intervals, one for all or one a parameter."""
        return self.df_resid

    def interval(self, values: F64, errors: F64, level: float = 0.95, degrees: Any = None) -> tuple[F64, F64]:
        """Lower and upper limits of estimates with these standard errors (Student's t)."""
        level = probability("interval", level)
        if np.any(np.asarray(errors) < 0):
            raise SpecError(
                f"interval: standard errors are not negative, these go down to {np.min(errors):.4g}"
            )
        return student_interval(values, errors, self.df_resid if degrees is None else degrees, level)

    def estimates(self) -> dict[str, float]:
        """Estimates by name."""
        return dict(zip(self.param_names, self.params.tolist(), strict=True))

    def derived(self, **expressions: str | Callable[[Mapping[str, float]], float]) -> Table:
        """Functions of the parameters with standard errors by the delta method.

        Parameters
        ----------
        **expressions : str or callable
            Name and expression, as ``wn="sqrt(a2)"`` or ``gain="b0[de]/a2"``: parameter names, numbers,
            + - * / ** and the functions of signal texts. Or a function of a mapping from parameter name to
            value.

        Returns
        -------
        Table
            Columns name, value, bse, low and high (95 %).
        """
        self._need_numbers("derived")
        return derivations.derived(self, expressions)

    def damp(self) -> Table:
        """Poles with natural frequency, damping ratio, time constant and standard errors.

        One row a complex pair (upper member) and one a real pole. omega in rad/s, time constants in s;
        standard errors by the delta method, dp/da_j = -p^(n-j)/A'(p). A repeated pole has no finite ones.
        """
        self._need_numbers("damp")
        return derivations.damp(self)

    @cached_property
    def high_band_levels(self) -> F64:
        """Noise level of each output, (output,), from harmonics the fit does not use; nan without such."""
        nothing = np.full(len(self.outputs), np.nan)
        if self.known_level is not None or self.records is None:
            return nothing if self.known_level is None else self.known_level
        variance = []
        order = max(self.layout.orders)
        for rec, intervals, (_, hi) in zip(self.records, self.intervals, self.lines, strict=True):
            if rec.dt is None or hi > intervals // 4 or intervals < 8 * (order + 4):
                return nothing
            if rec.mask is not None or rec.sigma is not None:
                return nothing
            window = np.ascontiguousarray(rec.y[:, rec.intervals - intervals :])
            variance.append(noise_level(window, order) ** 2)
        return np.asarray(np.sqrt(np.mean(variance, axis=0)))

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
        return explain.message(self)

    @property
    def cond(self) -> float:
        """Condition number of the whitened, column-scaled regressors (transient projected out)."""
        if not np.all(np.isfinite(self.gram)):
            return float("inf")
        if not self.params.size:
            return 1.0
        eigenvalues = np.linalg.eigvalsh(self.gram)
        return float(np.sqrt(eigenvalues[-1] / eigenvalues[0])) if eigenvalues[0] > 0 else float("inf")

    @property
    def chi2(self) -> float:
        """Cost in units of the noise variance seen in the unused high band: about `df_resid` if all is well.

        With noise that was given, or seen for errors in variables: the cost in units of that noise. nan where
        no level is available, or where the method does not weight by the noise.
        """
        if self.options.method not in ("awls", "ml"):
            return float("nan")
        if isinstance(self.options.noise, Noise) or self.options.noise == "errors-in-variables":
            return self.df_resid * self.noise_scale
        levels = self.high_band_levels
        if self.options.noise != "output" or not np.all(levels > 0):
            return float("nan")
        return float(self.df_resid * np.mean(np.diag(self.noise_cov) / levels**2))

    @property
    def bic(self) -> float:
        """Bayesian information criterion N log(cost/N) + p log N, N the equations less transient and trend.

        Where the noise covariance of several outputs was fitted, the cost is N less the parameters whatever
        the model: then N/outputs times the logarithm of that covariance's determinant takes its place, the
        same for one output. Comparable between fits of the same records over the same band only.
        """
        rows, outputs = self.df_resid + self.params.size, len(self.outputs)
        penalty = self.params.size * np.log(rows)
        known = self.options.output_weights is not None or isinstance(self.options.noise, Noise)
        if outputs == 1 or known or self.options.noise == "errors-in-variables":
            with np.errstate(divide="ignore"):
                return float(rows * np.log(self.cost / rows) + penalty)
        _, size = np.linalg.slogdet(self.noise_cov * (self.df_resid / rows))
        return float(rows / outputs * size + penalty)

    @property
    def trend(self) -> str | None:
        """Trend fitted beside the model: None, "constant" or "linear"."""
        return self.options.settled().trend

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

    def check(self) -> Findings:
        """What is wrong or doubtful about the fit, in sentences with numbers.

        Tests object where their p-value is below .01: residuals above the noise level of the high band
        (chi-square, which counts the scatter of that level) or below 1/1.5 of it, neighbouring lines
        correlated, not one level over the band, residuals that go with an input. With white noise each
        objects to about one right model in a hundred (neighbouring lines: up to two), and all together to
        about one in twenty.
        Besides: a pole with a real part above 0; HC3 and classical standard errors apart by a factor above
        2.5; fewer than 8 samples a period; a condition number above 10^6; two minima; a parameter on its
        bound.
        """
        return doubts.check(self)

    def standard_errors(self) -> dict[str, F64]:
        """The columns of standard errors of the summary."""
        return {
            "se HC3": root(np.diag(self.cov_hc3)),
            "se classical": root(np.diag(self.cov_nonrobust)),
        }

    def remarks(self) -> list[str]:
        """What deserves a warning when the fit is made."""
        return doubts.warnings_of(self)

    def facts(self) -> list[tuple[str, str]]:
        """What stands above the parameters in the summary: names and texts."""
        return explain.facts(self)

    def table(self, level: float = 0.95, *, units: Mapping[str, str] | None = None) -> Table:
        """The parameters as a table for a report: `.to_pandas()`, `.to_dict()`.

        Parameters
        ----------
        level : float, default 0.95
            Of the confidence intervals.
        units : mapping of str to str, optional
            Units by parameter name, for a column of their own.

        Returns
        -------
        Table
            Columns parameter, value, unit (where given), se HC3, se classical, t (value over standard
            error) and both ends of the interval; t and interval are those of `cov_type`. A parameter on its
            bound has nan for errors, t and interval, and the title says so.

        Raises
        ------
        SpecError
            If `units` names no parameter.
        """
        return explain.parameters(self, level, units)

    def summary(self) -> explain.Summary:
        """All of the fit on one page; prints, and shows as HTML in a notebook."""
        return explain.Summary(self)

    # The model ----------------------------------------------------------------------------------

    @property
    def model(self) -> LTI:
        """The fitted transfer function as an LTI system."""
        self._need_numbers("model")
        if self.inputs:
            return system_of(self.layout, self.params)
        blocks = []  # free motion: companion forms without inputs
        for i in range(len(self.layout.orders)):
            den, _ = self.polynomials(i)
            blocks.append(companion(den))
        size = sum(self.layout.orders)
        a, c = np.zeros((size, size)), np.zeros((len(blocks), size))
        at = 0
        for i, block in enumerate(blocks):
            n = len(block)
            a[at : at + n, at : at + n], c[i, at] = block, 1.0
            at += n
        return ss(a, np.zeros((size, 0)), c)

    def path_model(self, output: int | str = 0) -> LTI:
        """The transfer functions to one output, by name or position, with the delays of their own."""
        if isinstance(output, str):
            if output not in self.outputs:
                raise SpecError(f"path_model: no output {output!r}; {nearest(output, self.outputs)}")
            output = self.outputs.index(output)
        output = whole("path_model", "output", output, 0, len(self.outputs) - 1)
        den, nums = self.polynomials(output)
        return tf([nums], den, delay=self.layout.delays(self.params, output))

    def polynomials(self, output: int = 0) -> tuple[F64, list[F64]]:
        """Denominator (monic) and one numerator an input of an output, descending powers; no path: [0]."""
        return self.layout.polynomials(self.params, output)

    def frequency_response(self, omega: ArrayLike) -> tuple[C128, C128]:
        """Frequency response and its gradient with respect to the parameters.

        Parameters
        ----------
        omega : (f,) array_like
            rad/s.

        Returns
        -------
        response : (input, f) complex array, of several outputs (output, input, f)
        gradient : (p, input, f) complex array, of several outputs (p, output, input, f)
            With cov = fit.cov_params(), the standard error of a real function of the response follows by
            the delta method.
        """
        self._need_numbers("frequency_response")
        response, gradient = self._response(frequencies(omega, "frequency_response"))
        return (response[0], gradient[:, 0]) if len(self.outputs) == 1 else (response, gradient)

    # Against records ----------------------------------------------------------------------------

    def predict(
        self, rec: Record | int | None = None, *, initial_state: str | ArrayLike | InitialState | None = None
    ) -> Record:
        """Simulate a record from its inputs (never one step ahead).

        Initial state and trend are fitted to the record's output by linear least squares on the free
        response. Inputs with a delay are held at their first value before the record, so the first
        ceil(delay/dt) samples rest on a guess; the fit itself did not use them.

        Parameters
        ----------
        rec : Record or int, optional
            Any record with the fit's channels; an index means one of the fit's own.
        initial_state : "zero", array or InitialState, optional
            Instead of a fitted one: y, y', ... of the free response at the first sample. The trend is
            fitted all the same.

        Returns
        -------
        Record
            The same inputs and times, the simulated output.
        """
        record = self._record(rec, "predict")
        simulated, _ = self.simulate(record, initial_state)
        return record._like(y=simulated, mask=None, sigma=None)

    def errors(self, rec: Record | int | None = None) -> F64:
        """Measured less simulated output in time, (output, time); nan where the record is masked."""
        record = self._record(rec, "errors")
        errors = record.y - self.simulate(record, None)[0]
        return errors if record.mask is None else np.where(record.mask, errors, np.nan)

    def initial_state(
        self,
        rec: Record | int | None = None,
        method: str = "lstsq",
        *,
        eigenvalues: ArrayLike | None = None,
    ) -> InitialState:
        """Initial state (y, y', ... of the free response at the first sample), the trend fitted beside.

        Parameters
        ----------
        rec : Record or int, optional
        method : {"lstsq", "observer"}
            Least squares on the sampled free response; or a Luenberger observer run backwards in time
            (report, section 4.7), which is a few per cent less accurate at best.
        eigenvalues : array_like, optional
            Of the observer's error backwards in time, rad/s, one a pole, with negative real parts.
            Default: the frequencies of the poles, decaying as fast as these do forwards, and at least by
            one time constant over the record.

        Returns
        -------
        InitialState
            `.state`, `.cov`, `.bse`, `.trend`; usable as an array.

        Raises
        ------
        SpecError
            Eigenvalues that do not serve.
        FitError
            A state that the observer cannot find: not shown by the output, or too fast for the samples.
        """
        if method not in ("lstsq", "observer"):
            raise SpecError(
                f"initial_state: method={method!r} is not available; {nearest(method, ['lstsq', 'observer'])}"
            )
        record = self._record(rec, "initial_state")
        if method == "observer":
            return self._observed(record, eigenvalues)
        if eigenvalues is not None:
            raise SpecError('initial_state: eigenvalues belong to method="observer"')
        return self.simulate(record, None)[1]

    def score(self, rec: Record | int | None = None) -> Table:
        """How well the simulation fits: signal_to_error (dB), fit_percent, r2 and theil, an output.

        Masked samples are left out. See `modfun.results.scores` for the formulas.

        Parameters
        ----------
        rec : Record or int, optional
            A record or the number of one of the fit's own; left out, every record of the fit has its rows.

        Returns
        -------
        Table
            A row an output (and a record).
        """
        if rec is None and self.records is not None and len(self.records) > 1:
            parts = [(i, self.score(i)) for i in range(len(self.records))]
            columns: dict[str, list[Any]] = {"record": [i for i, part in parts for _ in range(len(part))]}
            for name in parts[0][1].columns:
                columns[name] = [value for _, part in parts for value in part[name].tolist()]
            return Table(columns)
        record = self._record(rec, "score")
        simulated, _ = self.simulate(record, None)
        pairs = list(zip(record.y, simulated, strict=True))
        if record.mask is not None:
            pairs = [(y[good], own[good]) for (y, own), good in zip(pairs, record.mask, strict=True)]
        return Table(
            {
                "output": list(record.outputs),
                "signal_to_error": [validation.signal_to_error(*pair) for pair in pairs],
                "fit_percent": [validation.fit_percent(*pair) for pair in pairs],
                "r2": [validation.r2(*pair) for pair in pairs],
                "theil": [validation.theil(*pair) for pair in pairs],
            }
        )

    def simulate(self, rec: Record, initial_state: Any = None) -> tuple[F64, InitialState]:
        """Simulated outputs for a record with the initial state and trend that `predict` takes."""
        return prediction.simulate_fit(self, rec, initial_state)

    def _observed(self, rec: Record, eigenvalues: ArrayLike | None) -> InitialState:
        return prediction.observe_fit(self, rec, eigenvalues)

    def _poles(self, output: int) -> tuple[C128, C128]:
        return derivations.poles(self, output)

    def _response(self, omega: F64) -> tuple[C128, C128]:
        return derivations.frequency_response(self, omega)

    def _record(self, rec: Record | int | None, what: str) -> Record:
        self._need_numbers(what)
        own = self.records
        if isinstance(rec, Record):
            if rec.outputs != self.outputs or rec.inputs != self.inputs:
                raise DataError(
                    f"{what}: the record has outputs {list(rec.outputs)} and inputs "
                    f"{list(rec.inputs)}, the fit "
                    f"{list(self.outputs)} and {list(self.inputs)}; name or select the record's channels so"
                )
            return rec
        if rec is not None and (isinstance(rec, bool) or not isinstance(rec, int | np.integer)):
            raise SpecError(
                f"{what}: expected a Record or the index of one of the fit's own, got {type(rec).__name__}"
            )
        if own is None:
            raise FitError(
                f"{what}: this fit was loaded without its samples; give the record, fit.{what}(rec)"
            )
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

    def _need_numbers(self, what: str) -> None:
        if not np.all(np.isfinite(self.params)):
            raise FitError(
                f"{what}: the fit has no finite parameters (status {self.status!r}). {self.message}"
            )

    # Plots --------------------------------------------------------------------------------------

    def plot_response(
        self, rec: Record | int | None = None, *, output: str | None = None, ax: Any = None
    ) -> Any:
        """Measured and simulated outputs with the errors below; see `modfun.plot.response`."""
        from .. import plot

        return plot.response(self, rec, ax=ax, output=output)

    def plot_bode(self, *, band: tuple[float, float] | None = None, hz: bool = False, ax: Any = None) -> Any:
        """Bode plot with a 95 % band; see `modfun.plot.bode`."""
        from .. import plot

        return plot.bode(self, band=band, hz=hz, ax=ax)

    def plot_residuals(self, *, output: str | None = None, ax: Any = None) -> Any:
        """Whitened residual lines and their autocorrelation; see `modfun.plot.residuals`."""
        from .. import plot

        return plot.residuals(self, ax=ax, output=output)

    def plot_residual_tests(self, *, output: str | None = None, ax: Any = None) -> Any:
        """Cumulated power and normal quantiles of the residual lines; see `modfun.plot.residual_tests`."""
        from .. import plot

        return plot.residual_tests(self, ax=ax, output=output)

    def plot_harmonics(self, rec: Record | int | None = None, *, hz: bool = False, ax: Any = None) -> Any:
        """Spectrum with the used harmonics shaded and the noise level; see `modfun.plot.harmonics`."""
        from .. import plot

        return plot.harmonics(self, rec, ax=ax, hz=hz)

    def plot_correlation(self, *, ax: Any = None) -> Any:
        """Correlations of the estimates as a matrix; see `modfun.plot.correlation`."""
        from .. import plot

        return plot.correlation(self, ax=ax)

    def plot_poles(self, *, ax: Any = None) -> Any:
        """Poles with 95 % confidence ellipses; see `modfun.plot.poles`."""
        from .. import plot

        return plot.poles(self, ax=ax)

    # Keeping it ---------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Everything but the samples, as plain Python values; numbers are kept exactly."""
        from .storage import fit_to_dict

        return fit_to_dict(self)

    def save(self, path: str | Path) -> None:
        """Write the fit (without the samples) as JSON; `modfun.load` reads it.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        SpecError
            There is no such folder.
        ModfunError
            It cannot be written; a file that was there before is still whole.
        """
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False)
        write_text("save", path, text + "\n")

    def report(
        self, path: str | os.PathLike[str], *, title: str | None = None, command: str | None = None
    ) -> Path:
        """Write a page about the fit: data, model, uncertainty, checks, provenance (extra ``report``).

        One HTML file that needs nothing else, and is written whole or not at all. A part that the fit does
        not allow, as the response of loaded samples, says why.

        Parameters
        ----------
        path : path
            Ends in .html; a page that is there is replaced.
        title : str, optional
            Default: what was fitted.
        command : str, optional
            The command line that made the fit, for the provenance; default: the call of `fit`.

        Returns
        -------
        Path
            Where it was written.

        Raises
        ------
        SpecError
            A place that cannot be written; the message says what to change.
        ImportError
            jinja2 or matplotlib is not installed.
        """
        from .page import write_fit

        return write_fit(self, path, title=title, command=command)

    def without_samples(self) -> Fit:
        """The same fit without the records it came from."""
        return replace(self, records=None, known_level=self.high_band_levels)

    def __repr__(self) -> str:
        return explain.one_line(self)

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()
