"""The result of a fit: parameters with their uncertainty, the model, and what follows from them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.arrays import C128, F64
from ..base.cached import cached_property
from ..base.names import nearest
from ..base.samples import frequencies
from ..base.tables import Findings, Table
from ..base.writing import write_text
from ..errors import SpecError
from ..pages.page import check_place, save
from ..records.record import Record
from . import check, derived, scores
from .bands import predicted
from .drawn import Drawn
from .noise_spectrum import noise_spectrum
from .page import page_of
from .page_records import Content, of_records
from .prediction import InitialState, observe_paths, states_of
from .process_noise import process_noise
from .stability import stable_neighbour
from .storage import fit_to_dict
from .summary import Summary, facts, one_line, parameters
from .uneven_noise import covariance

__all__ = ["Fit"]


@public
class Fit(Drawn):
    """A fitted transfer function, of one output or several.

    Made by `fit`, an `Estimator` or `load`. Methods that take a record use the fit's own when it is left
    out; where the fit has several, say which by its index (`fit.predict(1)`) or give any Record with the
    same channels.

    Attributes
    ----------
    params : (p,) array
        Estimates in the order of `param_names`: a1 ... an, then the numerator of each input in descending
        powers; by name, too: ``fit.params["a1"]``. Prints as a table.
    param_names : tuple of str
    cov_spectral, cov_hc3, cov_nonrobust : (p, p) arrays
        Covariance for noise of any smooth spectrum, with HC3 (nothing assumed about the noise colour), and
        with the classical formula (white noise). `cov_params()` and `bse` follow `cov_type`.
    df_spectral : (p,) array
        Degrees of freedom of each variance in `cov_spectral`: fewer where few lines carry a parameter.
    cost : float
        The minimised weighted sum of squares; for output noise in units of the output squared.
    noise_cov : (output, output) array
        Covariance of the noise on a sample of the outputs (of the equations, for equation noise).
    df_resid : int
        Real equations less unknowns (transient and trend included).
    free_cost : float
        The cost with free initial states, where `initial_state` says more of them; else nan.
    tail : float
        Degrees of freedom of Student's t where ``robust=True`` found heavy tails; else inf.
    instrumented, with_past : tuple of Record or None
        Records whose lines were fitted, where these are others: with references the explained part of the
        inputs, and outputs less the response to the rest; from rest with the steady state before them.
    status : str
        "ok", "maxiter", "rank" or "nonfinite".
    nit : int
        Iterations.
    lines : tuple of (int, int)
        Lowest and highest harmonic used, for each record.
    omega0 : tuple of float
        Line spacing 2 pi / T in rad/s, for each record.
    intervals, steps : tuples
        Sampling intervals used and their length in s (None: uneven), for each record.
    band_rule : dict or None
        Numbers of the default rule that chose the band; None where the band was given.
    structure : TransferFunction, Equation or StateSpace
        What was fitted.
    layout : Layout
        The structure for the record's channels: names, fixed values, how parameters make polynomials.
    noise_scale : float
        Variance of the noise over what was given (`Noise`) or seen (errors in variables); else nan.
    at_bound : tuple of str
        Parameters on a bound, or held by a search that did not settle: 0 in the covariance, so that the
        others' errors hold given them; nan in `conf_int` and `table`, as their own is not known.
    options : Options
        How it was fitted.
    records : tuple of Record or None
        The fit's own records; None after `load`.
    window_weights : tuple of float
        Of the squared residuals of each record, where a `Stream` forgets; else empty.
    condition_bound : float
        No less than `cond`, and computed at no cost; inf where not known.
    again : callable or None
        Fits records, a structure and options as this fit was made. None after `load`, and for gains.

    See Also
    --------
    modfun.fit : Makes it.
    modfun.load : Reads a saved one.
    modfun.bootstrap : Checks its standard errors.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4; J. G. MacKinnon, H. White, Some
    heteroskedasticity-consistent covariance matrix estimators, J. Econometrics 29, 1985 (HC3).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> print(fit.params.round(2))
    [3.07 8.11 5.04]
    >>> fit.conf_int().shape
    (3, 2)
    """

    # Estimates and their uncertainty ------------------------------------------------------------

    def derived(self, **expressions: str | Callable[[Mapping[str, float]], float]) -> Table:
        """Functions of the parameters with standard errors by the delta method.

        Parameters
        ----------
        **expressions : str or callable
            Name and expression, as ``wn="sqrt(a2)"`` or ``gain="b0[de]/a2"``: parameter names, numbers,
            + - * / ** and the functions of signal texts. Or a function of a mapping from name to value.

        Returns
        -------
        Table
            Columns name, value, bse, low and high (95 %).
        """
        self.need_numbers("derived")
        return derived.derived(self, expressions)

    def damp(self) -> Table:
        """Poles with natural frequency, damping ratio, time constant and standard errors.

        One row per complex pair (upper member) or real pole. omega in rad/s, time constants in s; standard
        errors by the delta method, dp/da_j = -p^(n-j)/A'(p). A repeated pole has no finite ones.
        """
        self.need_numbers("damp")
        return derived.damp(self)

    # How it went --------------------------------------------------------------------------------

    def check(self) -> Findings:
        """What is wrong or doubtful about the fit, in sentences with numbers and the first cure to try.

        What is beyond doubt comes first; the first of it is what `fit` warns of. Tests object where their
        p-value is below 0.01: residuals above the noise level of the high band (chi-square, which counts the
        scatter of that level) or below 1/1.5 of it, neighbouring lines correlated, not one level over the
        band. Further columns are tested one by one, at 0.01 over their number: a response to an input that
        the model lacks (neighbouring structures are fitted then, to name the one that lowers BIC most),
        powers of the simulated output, a system that changes, a drift, an event at one time; in linear
        equations a channel late or early (at 0.02, where BIC falls, too). With white noise each of these
        tests objects to about one right model in a hundred (neighbouring lines: up to two), and all together
        to about one in twenty. Besides: a pole with a real part above 0; fewer than 8 samples per period; a
        condition number above 10^6; two minima; a parameter on its bound; what `Record.check` finds in
        missing rows and the inputs. The note below them, which is no doubt, says how far one sample of a
        channel's time would move the estimates of linear equations, where that is more than 5 standard errors
        and the record leaves that time open.
        """
        return self._findings

    @cached_property
    def _findings(self) -> Findings:
        return check.check(self, one_line(self))

    def remarks(self) -> list[str]:
        """The one warning that the fit is made with, where the data contradict it beyond doubt."""
        return check.remarks(self)

    def facts(self) -> list[tuple[str, str]]:
        """What stands above the parameters in the summary: names and texts."""
        return facts(self)

    @property
    def state_names(self) -> list[str]:
        """What `initial_state` holds: y, y', … of each output."""
        return states_of(self.outputs, self.layout.orders)

    def table(
        self,
        level: float = 0.95,
        *,
        units: Mapping[str, str] | None = None,
        initial: bool = False,
        pvalues: bool = False,
    ) -> Table:
        """The parameters as a table for a report: `.to_pandas()`, `.to_dict()`.

        Parameters
        ----------
        level : float, default 0.95
            Of the confidence intervals.
        units : mapping of str to str, optional
            Units by parameter name, for a column of their own.
        initial : bool
            Rows for the initial state and the trend of each record as well, those that `initial_state` has.
            Their errors count those of the parameters.
        pvalues : bool
            A column p: the probability that noise alone makes a parameter whose true value is 0 this large
            (two-sided, Student's t).

        Returns
        -------
        Table
            Columns parameter, value, unit (where given), se (that of `cov_type`), t (value over standard
            error), p (on request) and both ends of the interval. A parameter on its bound has nan for all
            but its value, and the title says so.

        Raises
        ------
        SpecError
            If `units` names no parameter.
        """
        return parameters(self, level, units, initial, pvalues)

    def summary(self) -> Summary:
        """All of the fit on one page; prints, and shows as HTML in a notebook."""
        poles = self.damp() if self.usable and self.has_poles else None
        return Summary(self.facts(), self.table(), poles, self.check())

    # The model ----------------------------------------------------------------------------------

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
        self.need_numbers("frequency_response")
        response, gradient = self.response_gradients(frequencies(omega, "frequency_response"))
        return (response[0], gradient[:, 0]) if len(self.outputs) == 1 else (response, gradient)

    # Against records ----------------------------------------------------------------------------

    def predict(
        self, rec: Record | int | None = None, *, initial_state: Any = None, interval: str | None = None,
        level: float | None = None,
    ) -> Any:  # fmt: skip
        """Simulate a record from its inputs (never one step ahead).

        Initial state and trend are fitted to the record's output by linear least squares on the free
        response. Inputs with a delay are held at their first value before the record, so the first
        ceil(delay/dt) samples rest on a guess; the fit itself did not use them.

        Parameters
        ----------
        rec : Record or int, optional
            Any record with the fit's channels; an index means one of the fit's own.
        initial_state : "zero", array, mapping or InitialState, optional
            Instead of a fitted one, in the order of `state_names` or by them: y, y', ... of the free response
            at the first sample, or the states of equations. The trend is fitted all the same.
        interval : {"confidence", "prediction"}, optional
            Add an interval at each sample: of the noise-free response, by the errors of parameters, initial
            state and trend; or of a new sample, whose noise is as strong as the residuals here.
        level : float, optional
            Part of the intervals that hold the truth, default 0.95.

        Returns
        -------
        Record, or Prediction
            The same inputs and times, the simulated output. With `interval` the arrays `y`, `lower`, `upper`.
        """
        return predicted(self, self.record_of(rec, "predict"), interval, initial_state, level)

    def stable(self) -> Fit:
        """The nearest stable model: the fit of the same structure and band with all poles stable.

        It minimises the same criterion among models whose poles lie left of −0.01/T rad/s, T the duration of
        the longest record; `stability_cost` says by how much that raises −2 log likelihood. A pole at the
        margin is shown in `damp()`. Covariances are those of the free estimate. A stable fit is returned
        unchanged.

        Returns
        -------
        Fit

        Raises
        ------
        SpecError
            Of equations, state spaces, gains, free motion, or where coefficients of a denominator are held.
        FitError
            Where no stable model can be fitted.

        See Also
        --------
        modfun.select_order : Whether there are too many poles.

        References
        ----------
        L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999, section 10.1.

        Examples
        --------
        >>> import modfun as mf
        >>> light = mf.tf([1], [1, 0.02, 4])
        >>> rec = mf.simulate(light, input="sin(t**2/5)", duration=10.0, intervals=128, nsr=0.5, seed=2)
        >>> free = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
        >>> kept = free.stable()
        >>> [bool(fit["a1"] > 0) for fit in (free, kept)], round(kept.stability_cost, 2)
        ([False, True], 1.66)
        """
        return cast(Fit, stable_neighbour(self))

    def errors(self, rec: Record | int | None = None, *, initial_state: Any = None) -> F64:
        """Measured less simulated output in time, (output, time), as `predict`; nan where it is masked."""
        record = self.record_of(rec, "errors")
        errors = record.y - self.simulate(record, initial_state)[0]
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
            (report, section 4.7), accurate where modes are light.
        eigenvalues : array_like, optional
            Of the observer's error backwards in time, rad/s, one per pole, with negative real parts.
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
        record = self.record_of(rec, "initial_state")
        if method == "observer":
            return self._observed(record, eigenvalues)
        if eigenvalues is not None:
            raise SpecError('initial_state: eigenvalues belong to method="observer"')
        return self.simulate(record, None)[1]

    def score(self, rec: Record | int | None = None, *, initial_state: Any = None) -> Table:
        """How well the simulation ŷ follows each output y, with e = y - ŷ; masked samples are left out.

        ``signal_to_error`` is 20 log10(rms(y - mean(y)) / rms(e)) in dB, ``fit_percent``
        100 (1 - rms(e) / rms(y - mean(y))), ``r2`` 1 - mean(e²) / var(y), and ``theil``
        rms(e) / (rms(y) + rms(ŷ)), in which offsets count: it is small on records far from zero.

        Parameters
        ----------
        rec : Record or int, optional
            A record or the number of one of the fit's own; by default each of these has its rows.
        initial_state : "zero", array or InitialState, optional
            As of `predict`: instead of one fitted to the record, which flatters a validation a little.

        Returns
        -------
        Table
            One row per output (and record).
        """
        return scores.score(self, rec, initial_state)

    def _observed(self, rec: Record, eigenvalues: ArrayLike | None) -> InitialState:
        return observe_paths(self.layout, self.params, self.trend, rec, eigenvalues)

    def cov_params(self, cov_type: str | None = None) -> F64:
        """Covariance matrix of the parameters.

        Parameters
        ----------
        cov_type : {"spectral", "HC3", "nonrobust"}, optional
            Default: the fit's. "spectral" allows for a noise level that a test finds to change in time.
        """
        stationary = super().cov_params(cov_type)
        uneven = self._uneven if (cov_type or self.cov_type) == "spectral" else None
        return stationary if uneven is None else uneven.copy()

    @property
    def changing(self) -> bool:
        """Whether the standard errors allow for noise that changes over a record, as a test found."""
        return self.cov_type == "spectral" and self._uneven is not None

    _uneven = cached_property(covariance)

    # Its noise ---------------------------------------------------------------------------------

    def noise_spectrum(self, level: float = 0.95) -> Table:
        """Noise level over the band, which standard errors rest on; 1 in white noise."""
        return noise_spectrum(self, level)

    def process_noise(self, level: float = 0.95) -> Table:
        """Levels of noise="process" with intervals: of the samples, and of what drives the system."""
        return process_noise(self, level)

    # Keeping it ---------------------------------------------------------------------------------

    def to_dict(self) -> dict[str, Any]:
        """Everything but the samples, as plain Python values; numbers are kept exactly."""
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
        check_place(path, "report")
        return save(page_of(self, self.content(), title, command), path, "report")

    def content(self) -> Content:
        """What its page says of the data, and what is told and found."""
        return of_records(self, self.facts(), self.check())

    def without_samples(self) -> Self:
        """The same fit without the records it came from."""
        kept = self.cov_spectral if self._uneven is None else self._uneven
        own: dict[str, Any] = {"known_level": self.high_band_levels, "cov_spectral": kept}
        return replace(self, records=None, instrumented=None, with_past=None, **own)

    def __repr__(self) -> str:
        return one_line(self, check.doubts_in_line(self))

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()
