"""Fitting structures to records: `fit`, the same kept as an `Estimator`, and `fit_many`."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from typing import Any, Never, Unpack

from numpy.typing import ArrayLike

from ..base.arguments import public, whole
from ..base.waiting import Waiting
from ..equations.layout import layout_of
from ..equations.written import Written
from ..errors import DataError, ModfunWarning, SpecError
from ..models.noise import Noise
from ..models.options import MOST_THREADS, Choices, Options
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from ..records.batches import Batch
from ..records.conversion import agreeing
from ..records.forms import agreed, forms_of
from ..records.record import Record
from ..records.spectra import too_short
from ..records.uneven_rows import refuse_gap
from ..results.fit import Fit
from ..results.many import FitMany
from ..systems.frequency_response import FrequencyResponse
from ..systems.lti import LTI
from .by_response import by_response
from .by_samples import ends_at_samples
from .kinks import bent
from .many import fit_batch, fit_each
from .of_equations import fit_equation
from .of_gains import fit_response
from .prepared import counts_start, fits_alone
from .signs import signs_open
from .single import fit_ended, fit_quietly, fit_whole
from .undeclared import fit_as_read, read_alike

__all__ = [
    "Estimator",
    "fit",
    "fit_many",
    "records_of",
    "structure_of",
    "threads_of",
]

FEW_LINES = "real equations for"  # what the core says of a band that is too narrow


@public
def fit(
    data: Record | Sequence[Record] | FrequencyResponse,
    model: TransferFunction | Written,
    *,
    method: str = "ml",
    band: float | tuple[float, float] | None = None,
    harmonics: int | None = None,
    trend: str | None = "auto",
    noise: str | Noise | ProcessNoise = "output",
    cov_type: str = "spectral",
    output_weights: ArrayLike | None = None,
    correct: bool = True,
    rule: str = "gregory",
    extended: bool = True,
    tol: float = 1e-9,
    maxiter: int = 50,
    stable: bool = False,
    initial_state: str | ArrayLike = "unknown",
    robust: bool = False,
    reference: str | Sequence[str] | None = None,
    **unknown: Never,
) -> Fit:
    """Estimate the parameters of a structure from one record, or from several as one problem.

    The record's Fourier coefficients satisfy the model's equation on every harmonic up to a polynomial
    that holds the end conditions (report, section 4.1, in an equivalent form); its coefficients are
    eliminated, so initial states never enter and no detrending is needed.

    Parameters
    ----------
    data : Record or sequence of Record, or FrequencyResponse
        Lengths, rates and trims may differ between records, channels may not. A `TransferFunction` takes all
        outputs and inputs; those that an `Equation` or `StateSpace` does not name are left out, as are those
        that a fit does not have where it predicts or is scored. Channels that are only kept are never
        used. Each record has a noise level
        of its own, estimated with the parameters (`Fit.noise_levels`) unless `noise` or ``Record(sigma=)``
        tells it. Gains of a frequency response are weighted by the inverse of their covariance; of the
        options band, tol and maxiter mean something then.
    model : TransferFunction, Equation or StateSpace
        What is to be fitted.
    method : {"ml", "awls", "wls", "ls"}
        "ml" is consistent and reaches the Cramer-Rao bound of the band; "awls" iterates the weights of
        the report's section 4.4; "wls" and "ls" (report, eq. (19)) are one-shot and biased by noise.
    band : float or (float, float), optional
        Upper edge, or lower and upper edge, in rad/s.
    harmonics : int, optional
        The highest modulating index M instead of a band; line M + n is the highest used. With neither,
        "ml" and "awls" choose the narrowest band whose standard errors are within 1 % of those of a wide
        one (of equations, with 8 degrees of freedom where samples allow it), "ls" and "wls" take M = 3 times
        the number of parameters and trend terms (report, eq. (20)).
    trend : {"auto", "constant", "linear", None}
        Offset (and slope) of each output of each record; of equations, a constant (and slope) in each, no
        offset of what enters nonlinearly, ``(y - c)``. "auto": "constant", None of an `Equation` (``+ c``).
    noise : {"output", "process", "equation", "coloured", "errors-in-variables", "log-normal"} or object
        What the residuals are weighted by. "output": white on the samples of the outputs, their covariance
        unknown (of several outputs estimated in full, by alternation); "process": white noise drives each
        equation as well, as turbulence or load do, and all levels are estimated (`Fit.process_noise`; for
        transfer functions of one output with known delays and for linear equations and state spaces of which
        every state is measured, by "ml"); "equation": white in the equations alone;
        "coloured": an autoregression for each output, of an order chosen by BIC, fitted to the residuals
        by alternation (not for nonlinear equations); "errors-in-variables": white on outputs and inputs,
        levels from the harmonics that the signals leave empty; "log-normal": white on the logarithms of
        the outputs (equations only);
        `Noise`: known up to a common factor. Equations take the levels of several outputs, and of what noise
        adds to nonlinear signals, from the unused harmonics or from `Noise`.
    cov_type : {"spectral", "HC3", "nonrobust"}
        Standard errors for noise of any smooth spectrum, which is estimated from the residual lines;
        without an assumption on its colour, line by line; or classical ones for white noise. "spectral" also
        allows for a level that changes over the record, in fits by "ml" and "awls" with ``noise="output"`` or
        `Noise` of the outputs, of even records without mask, sigma and known start; the others assume a
        constant level unless ``Record(sigma=)`` gives it. None allows for noise that drives several equations
        at once, as a gust does: that is ``noise=ProcessNoise(...)``.
    output_weights : (output,) or (output, output) array_like, optional
        Of several outputs: 1/variance of the noise of each, or the inverse of its covariance, instead of the
        estimated one.
    correct : bool
        Take out of nonlinear signals what noise adds to them on average (equations only).
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature of the output and of smooth inputs (report, eqs. (21a) to (21c)).
    extended : bool
        Indices from -floor(n/2), which loses no information, or the report's 0..M.
    tol : float
        Relative change of the parameters at which the iteration ends.
    maxiter : int
        Most iterations; a fit whose last step was longer than 1e-5, in units as `tol`, is "maxiter".

    stable : bool, default False
        Whether an unstable estimate of a transfer function gives way to the nearest stable model,
        `Fit.stable`. Beside free delays it does so in any case where one is nearly as likely.
    initial_state : {"unknown", "zero", "rest", "periodic"} or array_like (state,) or (record, state)
        What is known of the state at the first sample of each record. "rest": all was steady under the
        inputs' first values, as before a step test; the offset of the output is free where `trend` says
        so. "zero": the response begins at zero, and the inputs act from the first sample on, as deviations
        from the operating point before it. "periodic": the
        record holds whole periods of a steady response, the first and the last sample in one phase.
        Numbers: y, y', … of the free response at the first sample, as `Fit.initial_state` has them, beside
        the response that begins at zero. The transient then follows from the parameters, or there is none,
        which makes standard errors on steps and short records up to five times smaller. A fit warns where
        the record contradicts it, or where the output of a transfer function drifts: ``trend="linear"`` is
        beside "rest" and "zero" a drift of transfer functions from the first sample on. "periodic" is for
        transfer functions of one output in white noise, numbers for these, a `StateSpace` (in the order of
        its states) and a linear `Equation` (y, y', … of each output, then of hidden signals,
        `NonlinearModel.states`); others begin at "rest" or "zero". Equations, state spaces, masks,
        ``Record(sigma=)`` and drifts have samples of the state before the first one put there
        (`Fit.with_past`), by "ml" or "awls" in noise of the outputs.
    robust : bool, default False
        Whether samples are weighted by Student's t distribution, for spikes and heavy tails: its degrees of
        freedom (`Fit.tail`) and scale are estimated with the parameters, and the records of the fit hold the
        relative noise of each sample (`Record.sigma`). Where the residuals are no heavier than normal ones,
        this is the plain fit.
    reference : str or sequence of str, optional
        Kept channels (``Record(keep=)``) or inputs that no noise reaches, such as the command of a control
        loop that feeds the noise of the sensors back to the inputs. The part of the inputs that they explain
        is the instrument, so noise in the rest biases nothing (`Fit.instrumented`). For transfer functions.

    Returns
    -------
    Fit
        With `success` False and a `message` where the numbers do not allow an answer.

    Raises
    ------
    DataError
        Records that do not fit together, or are too short for the structure.
    SpecError
        An unknown option or word, a structure that does not suit the record.

    Warns
    -----
    ModfunWarning
        At most one, where the data contradict the model or a default beyond doubt, with the first cure to
        try; `fit.check()` says everything that is doubtful.

    See Also
    --------
    modfun.fit_many : Many records, each by itself.
    modfun.Estimator : A structure with its options.
    modfun.select_order : How many poles.

    Notes
    -----
    With a delay the window starts ceil(delay/dt) samples late, so that no input before the record is
    needed. Over a band that is given, "ml" and "awls" start from the lowest lines, too, and keep the better
    end.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4; J. G. MacKinnon, H. White, J.
    Econometrics 29, 1985 (HC3).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> print(fit.params.round(2))
    [3.07 8.11 5.04]
    """
    options = Options.checked(
        "fit",
        method=method,
        band=band,
        harmonics=harmonics,
        trend=trend,
        noise=noise,
        cov_type=cov_type,
        output_weights=output_weights,
        correct=correct,
        rule=rule,
        extended=extended,
        tol=tol,
        maxiter=maxiter,
        stable=stable,
        initial_state=initial_state,
        robust=robust,
        reference=reference,
        **unknown,
    )
    return _fitted(data, structure_of(model, "fit"), options)


@public
class Estimator:
    """A structure with a method and its options: `est(rec)` is `fit(rec, model, **options)`.

    Parameters
    ----------
    model : TransferFunction, Equation or StateSpace
    **options
        Those of `fit`, checked at once.

    See Also
    --------
    modfun.fit : The same at once.
    modfun.MonteCarlo : Studies of estimators.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.

    Examples
    --------
    >>> Estimator(TransferFunction(poles=2, zeros=0), method="awls", band=8.0)
    Estimator(TransferFunction(poles=2, zeros=0), method='awls', band=(0.0, 8.0))
    """

    __slots__ = ("model", "options")

    model: Any
    options: Options

    def __init__(self, model: TransferFunction | Written, **options: Unpack[Choices]) -> None:
        object.__setattr__(self, "model", structure_of(model, "Estimator"))
        object.__setattr__(self, "options", Options.checked("Estimator", **options))

    def __call__(self, data: Record | Sequence[Record] | FrequencyResponse) -> Fit:
        """Fit the structure to a record, several as one problem, or a frequency response."""
        return _fitted(data, self.model, self.options)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an Estimator cannot be changed ({name}); make a new one")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"an Estimator cannot be changed ({name}); make a new one")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Estimator):
            return NotImplemented
        return (self.model, self.options) == (other.model, other.options)

    def __hash__(self) -> int:
        return hash((self.model, self.options))

    def __reduce__(self) -> tuple[Any, ...]:
        return _estimator, (self.model, self.options)

    def __repr__(self) -> str:
        words = "".join(f", {name}={value!r}" for name, value in self.options.given().items())
        return f"Estimator({self.model!r}{words})"


@public
def fit_many(
    data: Batch | Sequence[Record],
    model: TransferFunction | Written,
    *,
    threads: int | None = None,
    progress: str | bool = "auto",
    **options: Unpack[Choices],
) -> FitMany:
    """Fit every replicate of a batch, or every record of a list, by itself.

    Parameters
    ----------
    data : Batch or sequence of Record
        Replicates sampled alike run in the compiled core; records that differ in length, rate or
        intersample are fitted one after the other, with the band of the first, and so are all of `stable`
        and `reference`, and of `robust` with bands of their own. Where nobody declared how an
        input goes between samples, fits of the first four (of equations the first) that look alike decide
        for these, as in `fit`; `FitMany.notes` says so.
    model : TransferFunction, Equation or StateSpace
    threads : int, optional
        Default: MODFUN_NUM_THREADS, else the cores this process may use. The numbers do not depend on it.
    progress : {"auto", True, False}
        On standard error; "auto": from two seconds on.
    **options
        Those of `fit`. With neither `band` nor `harmonics` the first record's serves all, but if `robust`.

    Returns
    -------
    FitMany

    Raises
    ------
    DataError, SpecError
        As in `fit`. A FitError only if it ends every fit; else such records have no estimate, and so have
        replicates of a batch that one by one raise a DataError (`FitMany.notes`).

    See Also
    --------
    modfun.fit : One record, or several as one problem.
    modfun.MonteCarlo : Studies with a known truth.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.3.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> chirp = mf.signals.chirp("u", band=(0.1, 0.8), dt=0.04, duration=10.0)
    >>> records = [mf.simulate(system, input=chirp, nsr=0.1, seed=seed) for seed in range(3)]
    >>> found = mf.fit_many(records, mf.TransferFunction(poles=2, zeros=0))
    >>> found.params.shape
    (3, 3)
    """
    checked = Options.checked("fit_many", ("threads", "progress"), **options)
    structure = structure_of(model, "fit_many")
    count = threads_of(threads)
    few = ends_at_samples(structure, checked)
    given = data if isinstance(data, Batch) else records_of(data, "fit_many", together=False, simulated=few)
    read, notes = read_alike(given, structure, checked, fit_quietly)
    known = checked.initial_state != "unknown"
    past = known and not counts_start(structure, checked, read if isinstance(read, Batch) else read[:1])
    alone = past or fits_alone(read, structure, checked) or _bends(read, structure, checked)
    alone = alone or _signs_open(read, structure, checked) or _short(read, structure, checked)
    if not alone and (read.sigma is None if isinstance(read, Batch) else _alike(read)):
        return fit_batch(read, structure, checked, fit_ended, count, progress, notes)
    return fit_each(read, structure, checked, fit_ended, progress, notes)


def _bends(data: Batch | tuple[Record, ...], structure: Any, options: Options) -> bool:
    """Whether held inputs bend the fits of records by equations; batches of arrays are taken as they are."""
    if isinstance(data, Batch) or isinstance(structure, TransferFunction):
        return False
    return bool("zoh" in data[0].intersample or data[0].functions) and bent(
        fit_equation(data[:1], structure, options)
    )


def _short(data: Batch | tuple[Record, ...], structure: Any, options: Options) -> bool:
    """Whether equations have records too short to see noise levels in, which the fit of each finds."""
    if isinstance(structure, TransferFunction) or options.drives:
        return False
    own: Any = data if isinstance(data, Batch) else structure.own_channels(data[0])
    layout = layout_of(structure, options, own.outputs, own.inputs, forms_of((own,)))
    return layout.formulas.needs_levels and too_short(own.y.shape[-1], max(layout.orders))


def _signs_open(data: Batch | tuple[Record, ...], structure: Any, options: Options) -> bool:
    """Whether equations leave signs open, which each record by itself tells."""
    if isinstance(structure, TransferFunction) or options.drives:
        return False
    own = data if isinstance(data, Batch) else structure.own_channels(data[0])
    return signs_open(structure, own.outputs, own.inputs)


def _alike(records: tuple[Record, ...]) -> bool:
    """Whether records can go into the compiled core together."""
    uneven = any(rec.dt is None or rec.mask is not None or rec.sigma is not None for rec in records)
    kinds = {(rec.y.shape[1], rec.dt, rec.intersample) for rec in records}
    known = any(rec.functions for rec in records)
    return not uneven and not known and len(kinds) == 1


# The way to the core -----------------------------------------------------------------------------


def _fitted(data: Any, structure: Any, options: Options) -> Fit:
    """A fit of what users give, with its warnings."""
    with Waiting("fit: estimating") as waiting:
        try:
            if isinstance(data, FrequencyResponse):
                result: Fit = fit_response(data, structure, options)
            else:
                records = records_of(data, simulated=ends_at_samples(structure, options))
                result = by_response(fit_as_read(records, structure, options, fit_whole))
        except DataError as error:
            if options.band is None or FEW_LINES not in str(error):
                raise
            edge = options.band[1]
            raise DataError(
                f"{error}; band= is in rad/s: {edge:.4g} Hz would be {2 * math.pi * edge:.4g} rad/s"
            ) from None
        waiting.what = "fit: looking at what the model leaves"
        remarks = result.remarks()
    for text in remarks:
        warnings.warn(text, ModfunWarning, stacklevel=4)
    return result


def structure_of(model: Any, what: str) -> Any:
    """What is to be fitted, as a user gave it."""
    if isinstance(model, TransferFunction | Written):
        return model
    if isinstance(model, LTI):
        raise SpecError(
            f"{what}: a system with numbers was given where a structure is needed; "
            "use TransferFunction.from_system(system), or TransferFunction(poles=..., zeros=...)"
        )
    raise SpecError(
        f"{what}: model is {type(model).__name__!r}; give a structure such as "
        'TransferFunction(poles=2, zeros=0) or Equation("y\' + a*y = b*u")'
    )


def records_of(
    data: Any, what: str = "fit", *, together: bool = True, simulated: bool = False
) -> tuple[Record, ...]:
    """One record or several of the same channels, `together` of one problem, `simulated` at few samples."""
    if isinstance(data, Record):
        refuse_gap(what, data, simulated)
        return (data,)
    if isinstance(data, Batch):
        raise SpecError(f"{what}: a Batch holds separate replicates; use fit_many(batch, model)")
    if not isinstance(data, Sequence) or isinstance(data, str | bytes):
        raise SpecError(
            f"{what}: data is {type(data).__name__!r}; make a Record(y=..., u=..., dt=...) or "
            "read one from a file"
        )
    records = tuple(data)
    if not records:
        raise DataError(f"{what}: the list of records is empty; give at least one Record")
    for k, rec in enumerate(records):
        if not isinstance(rec, Record):
            raise SpecError(f"{what}: item {k} of data is {type(rec).__name__!r}, not a Record")
    if together and len({rec.inputs for rec in records}) == 1 < len({rec.intersample for rec in records}):
        records = agreed(records)
    first = records[0]
    for k, rec in enumerate(records):
        _refuse_unlike(first, rec, k, what)
        agreeing(f"{what}: record {k}", rec, first.units, "record 0")
        refuse_gap(f"{what}: record {k}", rec, simulated)
    return records


def _refuse_unlike(first: Record, rec: Record, k: int, what: str) -> None:
    for name in ("outputs", "inputs"):
        mine, theirs = getattr(first, name), getattr(rec, name)
        if mine != theirs:
            raise DataError(
                f"{what}: record 0 has {name} {list(mine)}, record {k} has {list(theirs)}; records of one "
                "problem need the same channels in the same order (rec.select(outputs=..., inputs=...))"
            )


def threads_of(given: int | None) -> int:
    """How many threads, as a user gave it; by default as the environment says, or as there are cores."""
    if given is None:
        text = os.environ.get("MODFUN_NUM_THREADS", "").strip()
        if not text:
            return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        if not text.isdecimal() or int(text) < 1:
            raise SpecError(f"MODFUN_NUM_THREADS={text!r} must be a whole number from 1 on")
        return int(text)
    return whole("running", "threads", given, 1, MOST_THREADS)


def _estimator(model: Any, options: Options) -> Estimator:
    made = object.__new__(Estimator)
    object.__setattr__(made, "model", model)
    object.__setattr__(made, "options", options)
    return made
