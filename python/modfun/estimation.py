"""Fitting structures to records: `fit`, the same kept as an `Estimator`, and `fit_many`."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from typing import Any, Never, Unpack

import numpy as np

from . import _core, explain
from .errors import DataError, ModfunWarning, SpecError
from .lti import LTI
from .many import FitMany, run_many
from .options import Choices, Options
from .records import Batch, Record
from .results import Fit
from .structures import TransferFunction

__all__ = ["Estimator", "fit", "fit_many"]

# What API words of later versions are answered with; anything else unknown gets the nearest names.
_LATER = {
    "output_weights": "weights of several outputs come with models of several outputs; fit one "
    "output at a time",
    "correct": "the bias correction belongs to equations with nonlinear signals, which come later",
}


def fit(
    data: Record | Sequence[Record],
    model: TransferFunction,
    *,
    method: str = "ml",
    band: float | tuple[float, float] | None = None,
    harmonics: int | None = None,
    trend: str | None = "auto",
    noise: str = "output",
    cov_type: str = "HC3",
    rule: str = "gregory",
    extended: bool = True,
    tol: float = 1e-9,
    maxiter: int = 50,
    **unknown: Never,
) -> Fit:
    """Estimate the parameters of a structure from one record, or from several as one problem.

    The record's Fourier coefficients satisfy the model's equation on every harmonic up to a polynomial
    that holds the end conditions (report, section 4.1, in an equivalent form); its coefficients are
    eliminated, so initial states never enter and no detrending is needed.

    Parameters
    ----------
    data : Record or sequence of Record
        One output; lengths, rates and trims may differ between records, channels may not.
    model : TransferFunction
        What is to be fitted.
    method : {"ml", "awls", "wls", "ls"}
        "ml" is consistent and reaches the Cramer-Rao bound of the band; "awls" iterates the weights of
        the report's section 4.4; "wls" and "ls" (report, eq. (19)) are one-shot and biased by noise.
    band : float or (float, float), optional
        Upper edge, or lower and upper edge, in rad/s.
    harmonics : int, optional
        The highest modulating index M instead of a band; line M + n is the highest used. With neither,
        "ml" and "awls" choose the narrowest band whose standard errors are within 1 % of those of a wide
        one, "ls" and "wls" take M = 3 times the number of unknowns (report, eq. (20)).
    trend : {"auto", "constant", "linear", None}
        Unknown offset (and slope) of the output, a record. "auto" is "constant".
    noise : {"output", "equation"}
        White noise on the samples of the output, or an equation error.
    cov_type : {"HC3", "nonrobust"}
        Standard errors without an assumption on the noise colour, or the classical ones.
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature of the output and of smooth inputs (report, eqs. (21a) to (21c)).
    extended : bool
        Indices from -floor(n/2), which loses no information, or the report's 0..M.
    tol : float
        Relative change of the parameters at which the iteration ends.
    maxiter : int
        Most iterations.

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
        Something about the result deserves a look; `fit.check()` says all.

    Notes
    -----
    With a delay the window starts ceil(delay/dt) samples late, so that no input before the record is
    needed.
    """
    options = _options(
        "fit",
        {
            "method": method,
            "band": band,
            "harmonics": harmonics,
            "trend": trend,
            "noise": noise,
            "cov_type": cov_type,
            "rule": rule,
            "extended": extended,
            "tol": tol,
            "maxiter": maxiter,
            **unknown,
        },
    )
    result = _fit(_records(data), _structure(model, "fit"), options)
    _warn(result)
    return result


class Estimator:
    """A structure with a method and its options: `est(rec)` is `fit(rec, model, **options)`.

    Parameters
    ----------
    model : TransferFunction
    **options
        Those of `fit`, checked at once.

    Examples
    --------
    >>> Estimator(TransferFunction(poles=2, zeros=0), method="awls", band=8.0)
    Estimator(TransferFunction(poles=2, zeros=0), method='awls', band=(0.0, 8.0))
    """

    __slots__ = ("model", "options")

    model: TransferFunction
    options: Options

    def __init__(self, model: TransferFunction, **options: Unpack[Choices]) -> None:
        object.__setattr__(self, "model", _structure(model, "Estimator"))
        object.__setattr__(self, "options", _options("Estimator", dict(options)))

    def __call__(self, data: Record | Sequence[Record]) -> Fit:
        """Fit the structure to a record, or to several as one problem."""
        result = _fit(_records(data), self.model, self.options)
        _warn(result)
        return result

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


def fit_many(
    data: Batch | Sequence[Record],
    model: TransferFunction,
    *,
    threads: int | None = None,
    progress: str | bool = "auto",
    **options: Unpack[Choices],
) -> FitMany:
    """Fit every replicate of a batch, or every record of a list, by itself.

    Parameters
    ----------
    data : Batch or sequence of Record
        Replicates sampled alike run in the compiled core; records that differ in length or rate are
        fitted one after the other, with the band of the first.
    model : TransferFunction
    threads : int, optional
        Default: MODFUN_NUM_THREADS, else the cores this process may use. The numbers do not depend on it.
    progress : {"auto", True, False}
        A line on standard error; "auto": on a terminal, for work that takes a while.
    **options
        Those of `fit`. With neither `band` nor `harmonics` the band is chosen once, on the first record.

    Returns
    -------
    FitMany

    Raises
    ------
    DataError, SpecError
        As in `fit`.
    """
    checked = _options("fit_many", dict(options))
    structure = _structure(model, "fit_many")
    if isinstance(progress, str) and progress != "auto":
        raise SpecError(f'fit_many: progress={progress!r} must be "auto", True or False')
    count = _threads(threads)
    if not isinstance(data, Batch):
        records = _records(data, "fit_many")
        data = (
            records if len({_sampling(r) for r in records}) > 1 or records[0].dt is None else _batch(records)
        )
    return run_many(data, structure, checked, count, progress, _fit)


# The way to the core -----------------------------------------------------------------------------


def _fit(records: tuple[Record, ...], structure: TransferFunction, options: Options) -> Fit:
    """One fit without its warnings."""
    first = records[0]
    inputs = len(first.inputs)
    numerators, delays = channels(structure, first)
    if all(np.ptp(rec.y) == 0 for rec in records):
        raise DataError(
            f"fit: output {first.outputs[0]!r} stands at {first.y[0][0]:g} throughout, so nothing "
            "can be learnt from it: "
            "take a record in which it moves"
        )
    for k, (name, degree) in enumerate(zip(first.inputs, numerators, strict=True)):
        if degree is not None and all(np.ptp(rec.u[k]) == 0 for rec in records):
            raise DataError(
                f"fit: input {name!r} stands at {first.u[k][0]:g} throughout, so nothing can be "
                "learnt from it: leave "
                "it out with rec.select(inputs=[...]), or take a record in which it moves"
            )
    if any(delays):
        for rec in records:
            if rec.dt is None:
                raise DataError(
                    f"fit: a delay of {max(delays):g} s needs even sampling, and the record's "
                    "steps are uneven; "
                    "resample it, or leave the delay out"
                )
            if max(delays) >= rec.duration / 2:
                raise DataError(
                    f"fit: the delay of {max(delays):g} s leaves less than half of the record of "
                    f"{rec.duration:g} s; "
                    "delays are in seconds"
                )
    found = _core.fit(
        [rec.y for rec in records],
        [rec.u for rec in records],
        [rec.t if rec.dt is None else rec.dt for rec in records],
        order=structure.poles,
        numerators=numerators,
        delays=delays,
        intersample=list(first.intersample),
        **options.core(),
    )
    leads = [
        0 if rec.dt is None else int(np.ceil(max(delays, default=0.0) / rec.dt - 1e-9)) for rec in records
    ]
    return Fit(
        structure=structure,
        options=options,
        outputs=first.outputs,
        inputs=first.inputs,
        units=first.units,
        intersample=first.intersample,
        numerators=tuple(numerators),
        delays=tuple(delays),
        param_names=structure.param_names(first.inputs)
        if inputs
        else tuple(f"a{k + 1}" for k in range(structure.poles)),
        params=np.asarray(found["theta"], float),
        cov_nonrobust=np.asarray(found["cov_nonrobust"], float),
        cov_hc3=np.asarray(found["cov_hc3"], float),
        cost=float(found["cost"]),
        sigma=float(found["sigma"]),
        df_resid=int(found["df_resid"]),
        status=str(found["status"]),
        nit=int(found["nit"]),
        lines=tuple((int(lo), int(hi)) for lo, hi in found["lines"]),
        omega0=tuple(float(w) for w in found["omega0"]),
        intervals=tuple(rec.intervals - lead for rec, lead in zip(records, leads, strict=True)),
        steps=tuple(rec.dt for rec in records),
        gram=np.asarray(found["gram"], float),
        high_band_sigma=_high_band(records, leads, found["lines"], structure.poles),
        band_rule=None
        if found["band_rule"] is None
        else {k: float(v) for k, v in found["band_rule"].items()},
        pieces=tuple(np.asarray(e, complex) for e in found["residuals"]),
        records=records,
    )


def _high_band(
    records: Sequence[Record], leads: Sequence[int], lines: Sequence[tuple[int, int]], order: int
) -> float:
    """Noise level of the output from harmonics the fit does not use; nan where there are none."""
    variance = []
    for rec, lead, (_, hi) in zip(records, leads, lines, strict=True):
        intervals = rec.intervals - lead
        if rec.dt is None or hi > intervals // 4 or intervals < 8 * (order + 4):
            return float("nan")
        variance.append(float(_core.noise_level(np.ascontiguousarray(rec.y[:, lead:]), order)[0]) ** 2)
    return float(np.sqrt(np.mean(variance)))


def channels(structure: TransferFunction, first: Record | Batch) -> tuple[list[int | None], list[float]]:
    """Numerator degrees and delays for the inputs of a record, checked."""
    if len(first.outputs) > 1:
        raise SpecError(
            f"fit: the record has {len(first.outputs)} outputs ({', '.join(first.outputs)}) and "
            "this version fits "
            f"one at a time; choose it with rec.select(outputs=[{first.outputs[0]!r}])"
        )
    inputs = len(first.inputs)
    if inputs == 0:
        if structure.n_inputs is not None:
            raise SpecError(
                f"fit: the structure has {structure.n_inputs} input(s), the record has none; free "
                "motion takes "
                f"TransferFunction(poles={structure.poles})"
            )
        return [], []
    return list(structure.numerators(inputs)), list(structure.delays(inputs))


def _warn(result: Fit) -> None:
    for text in explain.warnings_of(result):
        warnings.warn(text, ModfunWarning, stacklevel=3)


# What users give ----------------------------------------------------------------------------------


def _options(what: str, given: dict[str, Any]) -> Options:
    for name, reason in _LATER.items():
        if given.get(name) is not None:
            raise SpecError(f"{what}: {name}= is not available yet: {reason}")
    return Options.checked(what, **given)


def _structure(model: Any, what: str) -> TransferFunction:
    if isinstance(model, TransferFunction):
        return model
    if isinstance(model, LTI):
        raise SpecError(
            f"{what}: a system with numbers was given where a structure is needed; "
            "use TransferFunction.from_system(system), or TransferFunction(poles=..., zeros=...)"
        )
    raise SpecError(
        f"{what}: model is {type(model).__name__!r}; give a structure such as "
        "TransferFunction(poles=2, zeros=0)"
    )


def _records(data: Any, what: str = "fit") -> tuple[Record, ...]:
    if isinstance(data, Record):
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
        for name in ("outputs", "inputs", "intersample"):
            mine, theirs = getattr(records[0], name), getattr(rec, name)
            if mine != theirs:
                raise DataError(
                    f"{what}: record 0 has {name} {list(mine)}, record {k} has {list(theirs)}; "
                    "records of one "
                    "problem need the same channels in the same order (rec.select(outputs=..., inputs=...))"
                )
    return records


def _threads(given: int | None) -> int:
    if given is None:
        text = os.environ.get("MODFUN_NUM_THREADS", "").strip()
        if not text:
            return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        if not text.isdigit() or int(text) < 1:
            raise SpecError(f"MODFUN_NUM_THREADS={text!r} must be a whole number from 1 on")
        return int(text)
    if isinstance(given, bool) or not isinstance(given, int | np.integer) or given < 1:
        raise SpecError(f"threads={given!r} must be a whole number from 1 on, or None")
    return int(given)


def _sampling(rec: Record) -> tuple[int, float | None]:
    return rec.intervals, rec.dt


def _batch(records: tuple[Record, ...]) -> Batch:
    first = records[0]
    assert first.dt is not None
    return Batch(
        y=np.stack([rec.y for rec in records]),
        u=np.stack([rec.u for rec in records]) if first.inputs else None,
        dt=first.dt,
        outputs=first.outputs,
        inputs=first.inputs,
        intersample=first.intersample,
    )


def _estimator(model: TransferFunction, options: Options) -> Estimator:
    made = object.__new__(Estimator)
    object.__setattr__(made, "model", model)
    object.__setattr__(made, "options", options)
    return made
