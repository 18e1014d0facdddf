"""Frequency responses of records without a model: local models around frequencies (report, section 4.9)."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._core import coefficients, local_responses
from ..base.arguments import public, reals, whole
from ..base.arrays import C128, F64
from ..base.progress import Progress
from ..base.samples import band_edges
from ..errors import DataError, ModfunWarning, SpecError
from ..models.options import MOST, MOST_THREADS, Options
from ..records.corners import driving
from ..records.record import Record
from ..systems.frequency_response import FrequencyResponse
from .coefficients import spectrum
from .coherence import agreeing, spoiled
from .fed_back import noise_alone
from .periodic import from_periods, repeated
from .undeclared import as_fits_prefer, doubts_of

__all__ = ["frf"]

METHODS = ("lrm", "lpm", "modulating", "periodic")
WEIGHTINGS = ("ls", "awls", "ml")
WIDTHS = (1.0, 1.4, 2.0, 2.8, 4.0, 5.6)  # half-widths tried, over the least
SPARE = 1.5  # lines in the narrowest neighbourhood, over its unknowns
SCORED = 4096  # frequencies on which half-widths are compared
AROUND = 31  # neighbours that choose together
MOST_DEGREE = 20  # of local polynomials, whose powers no longer differ beyond

Piece = tuple[float, C128, C128]  # line spacing, coefficients of the outputs and of the inputs


@public
def frf(
    data: Record | Sequence[Record],
    omega: ArrayLike | None = None,
    *,
    method: str = "lrm",
    degree: int = 2,
    halfwidth: int | None = None,
    weighting: str = "ls",
    windows: Sequence[float] | None = None,
    band: float | tuple[float, float] | None = None,
    trend: str | None = "constant",
    varying: bool = False,
    rule: str = "gregory",
    threads: int | None = None,
    progress: str | bool = "auto",
) -> FrequencyResponse:
    """Estimate the frequency response from inputs to outputs of records, whatever their initial state.

    Around each frequency the response, and what unknown initial and final states add to the Fourier
    coefficients, are smooth. On the lines m within `halfwidth` of it, at the distance r,
    A(r) Y(m) = Σ_j B_j(r) U_j(m) + T(r) with polynomials of low degree; the response is B(0) (report,
    section 4.9; THEORY, section 6). Neither periods nor windows that taper are needed.

    Half a sample of delay is as smooth as any response. Whether inputs that nobody declared were held is
    therefore decided by fits of transfer functions of one to four poles (`FrequencyResponse.between`).

    Parameters
    ----------
    data : Record or sequence of Record
        Records may differ in length and rate; all share the response, each has its own T.
    omega : array_like, optional
        Angular frequencies, rad/s, on lines of the record or between them. Default: all lines of the longest
        record (or window), within `band`.
    method : {"lrm", "lpm", "modulating", "periodic"}
        "lrm": A of the same degree as B, one per output: it follows resonances that are a few lines wide.
        "lpm": A = 1. "modulating", the report's: A = 1, and differences over m instead of T, not weighted by
        their covariance (which would be "lpm"). "periodic": quotients of spectra on the lines that the inputs
        excite, for whole periods of a steady response, the last sample of a record in the phase of its first;
        noise is told from nonlinear distortion (see Notes). Of the options only `band` means something then.
    degree : int
        Of B, T and A, default 2.
    halfwidth : int, optional
        Lines of the longest record on each side of a frequency. Default: at each frequency, of six sizes, the
        one that predicts the lines nearby best when each is left out ("modulating": the narrowest). This
        choice, on the same record, is not counted in the intervals: those of 95 % then hold 92 to 94 %, of
        one that is given 95 % unless it is too wide for the system.
    weighting : {"ls", "awls", "ml"}
        Of the rows of "lrm": none; by `1/|A|²` of the last of four estimates, which is less biased by noise
        in neighbourhoods wider than those chosen by default; or Gauss-Newton from there, the best with three
        times as many lines as unknowns, and erratic with fewer. Intervals of the last two are a tenth short.
    windows : sequence of float, optional
        Cut the records into windows of these durations, s, and stack their equations, which pays for a slowly
        varying system (report, section 4.9). Lines are then those of the longest window.
        Windows of several durations hold the same samples, and errors are those of one duration.
    band : float or (float, float), optional
        Upper, or lower and upper frequency, rad/s, of the default `omega`.
    trend : {"constant", None}
        Unknown offset of the outputs (line 0 is left out), or none.
    varying : bool
        Whether the response changes linearly over the record: it is then that of the middle, and
        ``.drift`` the change from beginning to end.
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature of the outputs and of smooth inputs.
    threads : int, optional
        Default: MODFUN_NUM_THREADS, else the cores this process may use. The numbers do not depend on it.
    progress : {"auto", True, False}
        On standard error; "auto": from two seconds on.

    Returns
    -------
    FrequencyResponse
        With covariance, noise, coherence and half-widths. NaN at frequencies where an input has no power of
        its own, or of a loop where only the noise that it feeds back is left.

    Raises
    ------
    DataError
        Records without inputs, uneven or masked, of different channels, or too short.
    SpecError
        An unknown word, or more unknowns than lines.

    Warns
    -----
    ModfunWarning
        Where an input has no power of its own, or moves at the ends of a record only; where nothing
        tells whether an input was held, and the gains would be others by more than their circles.

    See Also
    --------
    modfun.FrequencyResponse : What it returns.
    modfun.fit : Fits a structure to it.

    Notes
    -----
    "periodic" takes lists of records as realisations of the inputs with one period; with several inputs as
    many records in turn make one realisation. Scatter from period to period is noise. Scatter between
    realisations beyond that is nonlinear distortion, and their mean is the best linear approximation: with
    two or more the covariance is that of the mean. With one it counts the noise alone, and distortion is seen
    on lines that a single input leaves out (odd ones, where it has odd ones alone).

    Gains closer than the sum of their half-widths share lines, and errors. The covariance holds for the
    noise; where a neighbourhood is too wide for the system, what the polynomials cannot follow counts as
    noise, on average.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.9; J. Schoukens, R. Pintelon, System
    Identification: A Frequency Domain Approach, IEEE Press, 2012 (local models).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> response = mf.frf(rec, band=7.0)  # rad/s, which the sweep reaches
    >>> response.response.shape == (1, 1, response.omega.size)
    True
    """
    _word("method", method, METHODS)
    _word("weighting", weighting, WEIGHTINGS)
    _word("trend", trend, ("constant", None))
    degree = whole("frf", "degree", degree, 0, MOST_DEGREE)
    if threads is not None:
        whole("frf", "threads", threads, 1, MOST_THREADS)
    if method != "lrm" and weighting == "ml":
        raise SpecError(f'frf: weighting="ml" is for method="lrm", not {method!r}; leave it out')
    given = _records(data)
    if method == "periodic":
        if omega is not None or windows is not None or varying:
            raise SpecError(
                'frf: method="periodic" has lines of its own; leave omega, windows and varying out'
            )
        low, high = (0.0, np.inf) if band is None else band_edges("frf", band)
        records, left = as_fits_prefer(given, band)
        return _said(from_periods(records, low, high), records, left)
    _windows(given, windows)  # refuses what does not fit
    records, left = as_fits_prefer(given, band)
    parts = _windows(records, windows)
    parts.sort(key=lambda rec: -rec.duration)
    pieces = [_piece(rec, rule, varying, trend) for rec in parts]
    units = _units(pieces)
    where = _frequencies(omega, band, pieces, trend)
    # Windows of several durations hold the same samples so many times.
    copies = 1 if windows is None else np.size(windows)
    shape = _Neighbourhood(method, degree, weighting, trend is None, pieces, len(pieces[0][2]), copies)
    if halfwidth is None:
        widths = shape.widths()
    else:
        widths = [whole("frf", "halfwidth", halfwidth, 1, MOST)]
    with Progress(progress, "frequency response", "frequencies") as shown:
        chosen = np.full(where.size, widths[0])
        if len(widths) > 1:
            chosen = shape.choose(widths, where, threads, shown)
        found = shape.estimates(chosen, where, threads, shown)
    ends, loop = noise_alone(records, pieces, where, chosen, shape.ends, shape.half)
    made = _response(records[0], where, found, chosen, shape, varying, units, ends)
    # A loop asks for rest already.
    near = loop or spoiled(records, pieces, made, found["coherence"].T, shape.ends, shape.half)
    return _said(made, records, left, (*near, *repeated(method, records)))


class _Neighbourhood:
    """What describes the lines around a frequency."""

    def __init__(
        self,
        method: str,
        degree: int,
        weighting: str,
        zero: bool,
        pieces: list[Piece],
        inputs: int,
        copies: int,
    ) -> None:
        self.method, self.degree, self.zero = method, degree, zero
        self.weighting = weighting if method == "lrm" else "ls"
        self.pieces, self.copies = pieces, copies
        terms = degree + 1
        self.unknowns = (degree if method == "lrm" else 0) + terms * inputs
        self.terms = terms
        self.ends = degree * (2 if method == "lrm" else 1)  # what T over A follows

    def half(self, piece: Piece, halfwidth: int) -> int:
        """Lines a side of a record: as wide as those of the longest, but not fewer than T needs."""
        return max(round(halfwidth * self.pieces[0][0] / piece[0]), (self.terms + 1) // 2)

    def equations(self, halfwidth: int) -> int:
        """Lines around a frequency less transient terms, over all pieces."""
        return sum(2 * self.half(p, halfwidth) + 1 - self.terms for p in self.pieces)

    def lines(self, chosen: NDArray[np.int64]) -> F64:
        """Lines around each frequency, over all pieces."""
        return np.array([sum(2.0 * self.half(p, int(h)) + 1 for p in self.pieces) for h in chosen])

    def widths(self) -> list[int]:
        """Half-widths to choose from, narrowest first."""
        least = 1
        while self.equations(least) < SPARE * self.unknowns:
            least += 1
        if self.method == "modulating":
            return [least]
        top = min(p[1].shape[1] for p in self.pieces[:1])
        tried = sorted({round(least * by) for by in WIDTHS})
        return [h for h in tried if 4 * h + 2 <= top] or [least]

    def reach(self, halfwidth: NDArray[np.int64]) -> F64:
        """Half the distance, rad/s, at which errors are no more alike.

        A local polynomial of degree R weighs lines by a kernel of height Σ (k + ½) P_k(0)², P_k Legendre's,
        over half-widths; its autocorrelation sums to the inverse, as a triangle of that half-base does.
        """
        from scipy.special import eval_legendre

        k = np.arange(self.degree + 1)
        height = float(np.sum((k + 0.5) * eval_legendre(k, 0.0) ** 2))
        return np.asarray((halfwidth + 0.5) / (2 * height) * self.pieces[0][0])

    def run(
        self, halfwidth: int, omega: F64, threads: int | None, shown: Any, first: bool = False
    ) -> dict[str, Any]:
        """The core's estimates with one half-width; `first`: of the longest windows alone."""
        used = [p for p in self.pieces if not first or p[0] < 1.001 * self.pieces[0][0]]
        given = [(p[0], self.half(p, halfwidth), self.zero, p[1], p[2]) for p in used]
        return local_responses(
            given, np.ascontiguousarray(omega), self.method, self.degree, self.weighting, threads, shown
        )

    def choose(self, widths: list[int], omega: F64, threads: int | None, shown: Any) -> NDArray[np.int64]:
        """The half-width for each frequency that predicts the lines around it best."""
        from scipy.ndimage import uniform_filter1d

        spacing = self.pieces[0][0]
        low = max(round(float(omega.min()) / spacing) - AROUND // 2, 1)
        high = min(round(float(omega.max()) / spacing) + AROUND // 2, self.pieces[0][1].shape[1] - 1)
        every = max(1, (high - low) // SCORED)
        lines = np.arange(float(low), high + 1.0, every) * spacing
        scale = np.array([np.mean(np.abs(row) ** 2) or 1.0 for row in self.pieces[0][1]])
        # A sample that is there twice would predict itself.
        alone = self.copies > 1
        left = [self.run(h, lines, threads, shown, alone)["left_out"] / scale for h in widths]
        scores = np.array(left).sum(axis=2)
        # A line that cannot be predicted speaks against the width, but not for ever.
        scores = np.minimum(np.where(np.isfinite(scores), scores, np.inf), 1e6)
        smooth = uniform_filter1d(scores, max(3, AROUND // every), axis=1, mode="nearest")
        between = 0.5 * (lines[1:] + lines[:-1])
        best = np.argmin(smooth, axis=0)[np.searchsorted(between, omega)]
        chosen: NDArray[np.int64] = np.array(widths)[best]
        return chosen

    def estimates(
        self, chosen: NDArray[np.int64], omega: F64, threads: int | None, shown: Any
    ) -> dict[str, Any]:
        """Estimates at each frequency with its own half-width."""
        found: dict[str, Any] = {}
        for width in np.unique(chosen):
            own = np.flatnonzero(chosen == width)
            part = self.run(int(width), omega[own], threads, shown)
            freedom = part.pop("freedom")
            part["freedom"] = np.full((own.size, 1), freedom)
            for name, rows in part.items():
                found.setdefault(name, np.empty((omega.size, rows.shape[1]), rows.dtype))[own] = rows
        return found


def _response(
    record: Record,
    omega: F64,
    found: dict[str, Any],
    chosen: NDArray[np.int64],
    shape: _Neighbourhood,
    varying: bool,
    units: tuple[F64, F64],
    ends: NDArray[np.bool_],
) -> FrequencyResponse:
    outputs, inputs = len(record.outputs), shape.pieces[0][2].shape[0]
    unit = units[0][:, None] / units[1][None, :]
    gains = found["response"].reshape(-1, outputs, inputs).transpose(1, 2, 0) * unit[:, :, None]
    with np.errstate(over="ignore", invalid="ignore"):  # squares of absurd units
        square = np.multiply.outer(unit, unit) * shape.copies
        cov = found["cov"].reshape(-1, outputs, inputs, outputs, inputs) * square
        noise = found["noise"].reshape(-1, outputs, outputs) * np.outer(units[0], units[0])
    unknown = np.any(np.isnan(gains), axis=(0, 1))
    lines = shape.lines(chosen) / shape.copies
    coherence = agreeing(found["coherence"].T, gains, cov, lines, shape.degree)
    cov[unknown] = np.nan
    if np.any(unknown):
        warnings.warn(
            f"frf: at {np.sum(unknown)} of {omega.size} frequencies an input has no power of its own (it "
            "stands still there, or moves as another does), and the gains are nan: leave an input out with "
            "rec.select(inputs=[...]), or take a record in which they move apart.",
            ModfunWarning,
            stacklevel=4,
        )
    gains[:, :, ends] = cov[ends] = np.nan
    real = len(record.inputs)
    paths = outputs * real
    change: dict[str, Any] = {}
    if varying:
        spread = np.einsum("koioi->oik", cov[:, :, real:, :, real:]).real
        change = {"drift": gains[:, real:], "drift_bse": np.sqrt(spread)}
    words = f"{shape.method}, degree {shape.degree}"
    if shape.method == "lrm":
        words += f", {shape.weighting}"
    if len(shape.pieces) > 1:
        words += f", {len(shape.pieces)} records or windows"
    return FrequencyResponse(
        omega,
        gains[:, :real],
        cov=cov[:, :, :real, :, :real].reshape(-1, paths, paths),
        noise_cov=noise,
        degrees=found["freedom"][:, 0] / shape.copies,
        coherence=coherence,
        halfwidth=chosen,
        reach=shape.reach(chosen),
        outputs=record.outputs,
        inputs=record.inputs,
        source=words,
        **change,
    )


def _said(
    found: FrequencyResponse, records: list[Record], left: dict[str, float], more: tuple[str, ...] = ()
) -> FrequencyResponse:
    """The gains with how inputs go between samples, and warnings of what is open and matters, and of more."""
    words = zip(*(rec._between_words() for rec in records), strict=True)
    found = found._told(between=tuple(" or ".join(dict.fromkeys(own)) for own in words))
    notes = (*more, *doubts_of(left, float(records[0].dt or 0), found))
    for text in notes:
        warnings.warn(f"frf: {text}", ModfunWarning, stacklevel=4)
    return found._told(notes=notes)


def _units(pieces: list[Piece]) -> tuple[F64, F64]:
    """Powers of two near the size of each output and input; the pieces are divided by them."""
    both = []
    for side in (1, 2):
        rows: list[C128] = [piece[1] if side == 1 else piece[2] for piece in pieces]
        largest = np.max([np.max(np.abs(row), axis=1) for row in rows], axis=0)
        unit = np.ldexp(1.0, np.frexp(np.where(largest > 0, largest, 1.0))[1])
        for row in rows:
            row /= unit[:, None]
        both.append(unit)
    return both[0], both[1]


# What users give ----------------------------------------------------------------------------------


def _records(data: Record | Sequence[Record]) -> list[Record]:
    records = [data] if isinstance(data, Record) else list(data) if isinstance(data, list | tuple) else []
    if not records or not all(isinstance(rec, Record) for rec in records):
        raise SpecError("frf: give a Record, or a list of at least one")
    first = records[0]
    for k, rec in enumerate(records):
        if (rec.outputs, rec.inputs) != (first.outputs, first.inputs):
            raise DataError(
                f"frf: record {k} has outputs {list(rec.outputs)} and inputs {list(rec.inputs)}, record 0 "
                f"{list(first.outputs)} and {list(first.inputs)}; give records of the same channels"
            )
        if not rec.inputs:
            raise DataError("frf: the record has no input, and a frequency response needs one")
        if rec.dt is None:
            raise DataError("frf: the samples are uneven; resample the record to even steps")
        if rec.mask is not None or rec.sigma is not None:
            raise DataError(
                "frf: the record has masked samples, or noise that varies, which local models do not know; "
                "split it at the gaps (rec.window) and give the parts as a list"
            )
        for name in (*rec.outputs, *rec.inputs):
            if np.ptp(rec[name]) == 0:
                kind = "input" if name in rec.inputs else "output"
                raise DataError(
                    f"frf: {kind} {name!r} stands at {rec[name][0]:g} throughout; leave it out with "
                    f"rec.select({kind}s=[...]), or take a record in which it moves"
                )
    return records


def _windows(records: list[Record], durations: Sequence[float] | None) -> list[Record]:
    """The records, or their windows of each duration, one after the other."""
    if durations is None:
        return list(records)
    asked = _floats("windows", durations).tolist()
    if not asked or len(set(asked)) < len(asked):
        raise SpecError(
            f"frf: windows={durations!r} must hold durations in s, each once: windows of several durations "
            "use the same samples"
        )
    parts = []
    for duration in asked:
        for rec in records:
            steps = round(duration / rec.dt) if rec.dt and duration > 0 else 0
            if not 8 <= steps <= rec.intervals:
                raise SpecError(
                    f"frf: windows of {duration:g} s take {steps} of the {rec.intervals} intervals of a "
                    f"record of {rec.duration:g} s; give durations in seconds, of 8 intervals or more"
                )
            parts += [rec._slice(k, k + steps + 1) for k in range(0, rec.intervals - steps + 1, steps)]
    return parts


def _piece(rec: Record, rule: str, varying: bool, trend: str | None) -> Piece:
    if trend is not None:  # what end weights make of a large offset would reach other lines
        rec = rec._like(y=rec.y - rec.y.mean(axis=1, keepdims=True))
    y, u = spectrum(rec, rec.intervals // 2, rule)
    if varying:
        # An input times time, −½ to ½ over the record: report, section 4.8.
        along = np.linspace(-0.5, 0.5, rec.intervals + 1)
        kinds = [rule if kind == "smooth" else kind for kind in rec.intersample]
        late = np.ascontiguousarray(driving(rec._like(_functions={})) * along)
        more = coefficients(late, rec.intervals // 2, kinds, [0.0] * len(kinds), 0, None)
        u = np.concatenate([u, more])
    return 2 * np.pi / rec.duration, y, u


def _frequencies(
    omega: ArrayLike | None, band: float | tuple[float, float] | None, pieces: list[Piece], trend: str | None
) -> F64:
    spacing, y, _ = pieces[0]
    top = (y.shape[1] - 1) * spacing
    if omega is not None:
        if band is not None:
            raise SpecError("frf: give the frequencies omega or a band, not both")
        where = _floats("omega", omega)
        if not where.size:
            raise SpecError("frf: omega is empty; leave it out, and all lines are taken")
        if not np.all((where >= 0) & (where <= top * (1 + 1e-12))):
            raise SpecError(
                f"frf: omega must hold frequencies from 0 to {top:.6g} rad/s, half the sampling rate; got "
                f"{np.min(where):.6g} to {np.max(where):.6g}"
            )
        return where
    where = np.arange(0.0 if trend is None else 1.0, y.shape[1]) * spacing
    if band is not None:
        low, high = Options.checked("frf", band=band).band or (0.0, 0.0)
        where = where[(where >= low) & (where <= high)]
        if not where.size:
            raise SpecError(
                f"frf: no line lies in the band {low:g} to {high:g} rad/s; lines are {spacing:.6g} apart, up "
                f"to {top:.6g}"
            )
    return where


def _floats(name: str, given: Any) -> F64:
    values = np.atleast_1d(reals("frf", name, given))
    if values.ndim != 1:
        raise SpecError(f"frf: {name} has shape {values.shape}; give one list of numbers")
    return values


def _word(name: str, given: Any, words: Sequence[Any]) -> None:
    if given not in words:
        options = ", ".join(repr(w) for w in words)
        raise SpecError(f"frf: {name}={given!r} is none of {options}")
