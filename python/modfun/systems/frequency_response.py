"""Frequency responses as data: measured by `frf`, computed by `frequency_response`, or brought by users."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import html
from ..base.arguments import complexes, public, reals
from ..base.arrays import C128, F64
from ..base.optional import optional
from ..base.samples import band_edges, frequencies, numbered
from ..base.student import confidence
from ..base.tables import Table
from ..errors import DataError, SpecError
from .drawing import curves_of, draw_bode, draw_levels, span

__all__ = ["FrequencyResponse"]


@public
@dataclass(frozen=True, eq=False, repr=False, init=False)
class FrequencyResponse:
    """Complex gains at angular frequencies, with their uncertainty where it is known.

    Parameters
    ----------
    omega : array_like, shape (omega,)
        Angular frequencies, rad/s.
    response : array_like of complex, shape (output, input, omega), optional
        Gains; a one-dimensional array is treated as one output and one input.
    magnitude_db, phase_deg : array_like, optional
        Points of a Bode diagram instead of `response`, in the same shape: 20 log₁₀|G| and the angle in
        degrees.
    bse : array_like, same shape, optional
        Standard errors √E|Ĝ − G|² of independent gains; or
    cov : array_like of complex, shape (omega, path, path), optional
        their covariance E[(Ĝ − G)(Ĝ − G)*], paths output after output.
    noise_cov : array_like of complex, shape (omega, output, output), optional
        Covariance of the noise on a line of the outputs.
    degrees : array_like, shape (omega,), optional
        Complex degrees of freedom of the covariances; one number stands for all.
    coherence : array_like, shape (output, omega), optional
        Share of the power of each output that the inputs explain; that of `modfun.frf` agrees with `bse`.
    halfwidth : array_like of int, shape (omega,), optional
        Lines on each side that each gain was made of.
    reach : array_like, shape (omega,), optional
        Half the distance in rad/s beyond which gains have errors of their own: those made of the same lines
        err alike.
    drift, drift_bse : array_like, same shape as `response`, optional
        Change of the gains over the record, and its standard error.
    distortion : array_like, same shape as `response`, optional
        Standard deviation of what nonlinearity adds to the gains of one realisation of the inputs.
    outputs, inputs : sequence of str, optional
        Names of the channels; by default y, y1, … and u, u1, ….
    source : str, optional
        How the gains were had, in a few words.
    between : sequence of str, optional
        How each input went between the samples that the gains were made of, and what told it: "zoh",
        "smooth (seen)", "zoh (by the fit)".
    notes : sequence of str, optional
        What is doubtful about the gains, in sentences.

    Raises
    ------
    DataError
        Shapes that do not fit, frequencies that are not finite.
    SpecError
        Both or neither of `response` and Bode points, or of `cov` and `bse`.

    See Also
    --------
    modfun.frf : Measures it from records.
    modfun.reduce : Fits models of lower order to it.
    modfun.plot.bode : Draws it.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.9; J. Schoukens, R. Pintelon, System
    Identification: A Frequency Domain Approach, IEEE Press, 2012.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> omega = np.array([0.5, 1.0, 2.0])
    >>> response = mf.FrequencyResponse(omega, 1 / (1j * omega + 1))
    >>> fit = mf.fit(response, mf.TransferFunction(poles=1, zeros=0))
    >>> print(fit.params.round(6))
    [1. 1.]
    """

    omega: F64
    response: C128
    cov: C128 | None
    noise_cov: C128 | None
    degrees: F64 | None
    coherence: F64 | None
    halfwidth: NDArray[np.int64] | None
    reach: F64 | None
    drift: C128 | None
    drift_bse: F64 | None
    distortion: F64 | None
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    source: str
    between: tuple[str, ...]
    notes: tuple[str, ...]

    def __init__(
        self,
        omega: ArrayLike,
        response: ArrayLike | None = None,
        *,
        magnitude_db: ArrayLike | None = None,
        phase_deg: ArrayLike | None = None,
        bse: ArrayLike | None = None,
        cov: ArrayLike | None = None,
        noise_cov: ArrayLike | None = None,
        degrees: ArrayLike | None = None,
        coherence: ArrayLike | None = None,
        halfwidth: ArrayLike | None = None,
        reach: ArrayLike | None = None,
        drift: ArrayLike | None = None,
        drift_bse: ArrayLike | None = None,
        distortion: ArrayLike | None = None,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
        source: str = "",
        between: Sequence[str] = (),
        notes: Sequence[str] = (),
    ) -> None:
        where = frequencies(omega, "FrequencyResponse").copy()
        gains = _gains(response, magnitude_db, phase_deg)
        if gains.ndim != 3 or gains.shape[2] != where.size:
            raise DataError(
                f"FrequencyResponse: {where.size} frequencies and a response of shape {gains.shape}; "
                "give (output, input, omega), or (omega,) for one output and one input"
            )
        several = (gains.shape[0], gains.shape[1], where.size)
        paths = gains.shape[0] * gains.shape[1]
        if cov is not None and bse is not None:
            raise SpecError("FrequencyResponse: give the covariance cov or the standard errors bse, not both")
        spread = None if cov is None else _shaped("cov", cov, (where.size, paths, paths), complex)
        if bse is not None:
            errors = _shaped("bse", bse, several, float)
            spread = np.zeros((where.size, paths, paths), complex)
            with np.errstate(over="ignore", under="ignore"):
                spread[:, range(paths), range(paths)] = errors.reshape(paths, -1).T ** 2
        put = {
            "omega": where,
            "response": gains,
            "cov": spread,
            "noise_cov": _optional(
                "noise_cov", noise_cov, (where.size, gains.shape[0], gains.shape[0]), complex
            ),
            "degrees": _optional("degrees", degrees, where.shape, float),
            "coherence": _optional("coherence", coherence, (gains.shape[0], where.size), float),
            "halfwidth": _optional("halfwidth", halfwidth, (where.size,), int),
            "reach": _optional("reach", reach, (where.size,), float),
            "drift": _optional("drift", drift, several, complex),
            "drift_bse": _optional("drift_bse", drift_bse, several, float),
            "distortion": _optional("distortion", distortion, several, float),
        }
        for name, array in put.items():
            if array is not None:
                array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "outputs", _names("outputs", outputs, gains.shape[0], "y"))
        object.__setattr__(self, "inputs", _names("inputs", inputs, gains.shape[1], "u"))
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "between", tuple(between))
        object.__setattr__(self, "notes", tuple(notes))

    @property
    def magnitude_db(self) -> F64:
        """20 log₁₀ of the magnitudes, (output, input, omega)."""
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(np.abs(self.response)))

    @property
    def phase_deg(self) -> F64:
        """Angles in degrees, (output, input, omega), without jumps of 360 from one frequency to the next."""
        return np.degrees(np.unwrap(np.angle(self.response), axis=2))

    @property
    def bse(self) -> F64 | None:
        """Standard errors √E|Ĝ − G|², (output, input, omega); None where no covariance is known.

        Real and imaginary part have 1/√2 of it each.
        """
        if self.cov is None:
            return None
        return _root(np.einsum("kii->ik", self.cov).real).reshape(self.response.shape)

    def radius(self, level: float = 0.95) -> F64 | None:
        """Radius of the circles about the gains that hold them with this confidence, (output, input, omega).

        `|Ĝ − G|²` over its variance is distributed as F with 2 and 2 `degrees` degrees of freedom where the
        noise is normal; as χ²/2 where `degrees` is not known. None where no covariance is known.

        Parameters
        ----------
        level : float, default 0.95

        Raises
        ------
        SpecError
            A level that is not between 0 and 1.
        """
        level = confidence("radius", level)
        bse = self.bse
        if bse is None:
            return None
        free = self.degrees
        # Quantiles of F(2, 2q): q((1 − level)^(−1/q) − 1), and its limit −log(1 − level).
        factor = -np.log1p(-level) if free is None else free * ((1 - level) ** (-1 / free) - 1)
        return np.asarray(np.sqrt(factor) * bse)

    def select(self, band: float | tuple[float, float]) -> FrequencyResponse:
        """The gains up to a frequency, or between two, ends included.

        Parameters
        ----------
        band : float or (float, float)
            Upper edge, or both, rad/s.

        Raises
        ------
        DataError
            No frequency between them.
        """
        low, high = (0.0, 0.0) if band is None else band_edges("FrequencyResponse.select", band)
        keep = np.flatnonzero((self.omega >= low) & (self.omega <= high))
        if not keep.size:
            raise DataError(
                f"FrequencyResponse.select: no frequency lies between {low:g} and {high:g} rad/s; there are "
                f"{self.omega.size} from {np.min(self.omega):g} to {np.max(self.omega):g}"
            )
        return self.take(keep)

    def take(self, keep: NDArray[Any]) -> FrequencyResponse:
        """The gains at these positions of `omega`.

        Parameters
        ----------
        keep : array_like of int or bool, or slice
            Positions, counted from 0.

        Raises
        ------
        SpecError
            Positions that are not there.
        """
        try:
            where = self.omega[keep]
        except IndexError as error:
            raise SpecError(
                f"FrequencyResponse.take: {error}; there are {self.omega.size} frequencies, counted from 0"
            ) from None

        def last(array: Any) -> Any:
            return None if array is None else array[..., keep]

        def first(array: Any) -> Any:
            return None if array is None else array[keep]

        return FrequencyResponse(
            where,
            last(self.response),
            cov=first(self.cov),
            noise_cov=first(self.noise_cov),
            degrees=first(self.degrees),
            coherence=last(self.coherence),
            halfwidth=first(self.halfwidth),
            reach=first(self.reach),
            drift=last(self.drift),
            drift_bse=last(self.drift_bse),
            distortion=last(self.distortion),
            outputs=self.outputs,
            inputs=self.inputs,
            source=self.source,
            between=self.between,
            notes=self.notes,
        )

    def _told(self, **changes: tuple[str, ...]) -> FrequencyResponse:
        """The same with other words."""
        return FrequencyResponse(**{**{f.name: getattr(self, f.name) for f in fields(self)}, **changes})

    def table(self) -> Table:
        """One row a path and frequency: input, output, omega, magnitude_db, phase_deg, and bse,
        distortion and coherence where they are known.
        """
        size = self.omega.size
        paths = [(o, i) for o in range(len(self.outputs)) for i in range(len(self.inputs))]
        columns: dict[str, Any] = {
            "input": [self.inputs[i] for _, i in paths for _ in range(size)],
            "output": [self.outputs[o] for o, _ in paths for _ in range(size)],
            "omega": np.tile(self.omega, len(paths)),
            "magnitude_db": self.magnitude_db.reshape(-1),
            "phase_deg": self.phase_deg.reshape(-1),
        }
        if self.bse is not None:
            columns["bse"] = self.bse.reshape(-1)
        if self.distortion is not None:
            columns["distortion"] = self.distortion.reshape(-1)
        if self.coherence is not None:
            columns["coherence"] = np.concatenate([self.coherence[o] for o, _ in paths])
        return Table(columns, units={"omega": "rad/s", "magnitude_db": "dB", "phase_deg": "deg"})

    def plot(self, *, ax: Any = None, hz: bool = False) -> Any:
        """Draw dB and degrees over frequency, with 95 % bands (extra ``plot``); returns Axes.

        Where distortion is known, dots show its level below the gain, and ticks the standard error.

        Parameters
        ----------
        ax : sequence of two matplotlib Axes, optional
            For magnitude and phase; None makes a figure.
        hz : bool, default False
            Frequencies in Hz instead of rad/s.
        """
        low, high = span(self.omega[self.omega > 0].tolist())
        curves = curves_of(self.omega, self.response, self.radius(), self.outputs, self.inputs)
        axes = draw_bode([(c.path or "FrequencyResponse", c) for c in curves], low, high, hz=hz, ax=ax)
        if self.distortion is not None:
            levels = {"distortion": (self.distortion, ".")}
            if self.bse is not None:
                levels["standard error"] = (self.bse, "_")
            draw_levels(axes[0], self.omega, levels, hz=hz)
        return axes

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain values: complex arrays as {"re": …, "im": …}."""
        return {f.name: _plain(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> FrequencyResponse:
        """What `to_dict` returned."""
        return cls(**{name: _unplain(value) for name, value in values.items()})

    def to_control(self) -> Any:
        """The same as a `control.FrequencyResponseData` with the same names (extra ``control``)."""
        control = optional("control", "control", "FrequencyResponse.to_control")
        return control.frd(self.response, self.omega, inputs=list(self.inputs), outputs=list(self.outputs))

    def facts(self) -> list[tuple[str, str]]:
        """What is said of it in a few lines: names and texts."""
        low, high = (np.min(self.omega), np.max(self.omega)) if self.omega.size else (0.0, 0.0)
        words = [f" {word}" for word in self.between] or [""] * len(self.inputs)
        facts = [
            ("inputs", ", ".join(name + word for name, word in zip(self.inputs, words, strict=True))),
            ("outputs", ", ".join(self.outputs)),
            ("frequencies", f"{self.omega.size} from {low:.4g} to {high:.4g} rad/s"),
        ]
        if self.source:
            facts.append(("from", self.source))
        if self.halfwidth is not None and self.halfwidth.size:
            few, many = int(self.halfwidth.min()), int(self.halfwidth.max())
            facts.append(("half-width", f"{few} lines" if few == many else f"{few} to {many} lines"))
        bse = self.bse
        if bse is not None and bse.size:
            with np.errstate(divide="ignore", invalid="ignore"):
                relative = bse / np.abs(self.response)
            known = relative[np.isfinite(relative)]
            if known.size:
                facts.append(("median standard error", f"{100 * np.median(known):.3g} % of the gain"))
            if known.size < relative.size:
                facts.append(("without answer", f"{relative.size - known.size} of {relative.size} gains"))
        if self.coherence is not None and self.coherence.size:
            facts.append(("median coherence", f"{np.median(self.coherence):.4f}"))
        facts += [("note", text) for text in self.notes]
        return facts

    def __repr__(self) -> str:
        facts = self.facts()
        width = max(len(name) for name, _ in facts)
        return "FrequencyResponse\n" + "\n".join(f"  {name:<{width}}  {text}" for name, text in facts)

    def _repr_html_(self) -> str:
        return html.table([], self.facts(), title="FrequencyResponse")


def _gains(response: ArrayLike | None, magnitude_db: ArrayLike | None, phase_deg: ArrayLike | None) -> Any:
    bode = magnitude_db is not None or phase_deg is not None
    if (response is None) != bode or (magnitude_db is None) != (phase_deg is None):
        raise SpecError(
            "FrequencyResponse: give response=, or both magnitude_db= and phase_deg= of a Bode diagram"
        )
    if response is not None:
        gains = complexes("FrequencyResponse", "response", response, DataError).copy()
    else:
        decibels = reals("FrequencyResponse", "magnitude_db", magnitude_db, DataError)
        degrees = reals("FrequencyResponse", "phase_deg", phase_deg, DataError)
        if decibels.shape != degrees.shape:
            raise DataError(
                f"FrequencyResponse: magnitude_db has shape {decibels.shape}, phase_deg {degrees.shape}; "
                "give one of each a frequency"
            )
        with np.errstate(all="ignore"):  # of decibels without bound, refused below
            gains = np.asarray(10 ** (decibels / 20) * np.exp(1j * np.radians(degrees)), dtype=np.complex128)
        if not np.all(np.isfinite(gains)):
            raise DataError("FrequencyResponse: magnitude_db and phase_deg must make finite gains")
    return gains[None, None, :] if gains.ndim == 1 else gains


def _shaped(name: str, given: ArrayLike, shape: tuple[int, ...], kind: type) -> Any:
    read = complexes if kind is complex else reals
    array: NDArray[Any] = read("FrequencyResponse", name, given, DataError)
    if kind is int and not np.all(np.abs(array) < 1e9):
        raise DataError(f"FrequencyResponse: {name} must hold whole numbers")
    array = array.astype(kind)
    if array.ndim == 0 and len(shape) == 1:  # one for all frequencies
        array = np.full(shape, array)
    if array.ndim == 1 and shape == (1, 1, array.size):
        array = array.reshape(shape)
    if array.shape != shape:
        raise DataError(f"FrequencyResponse: {name} has shape {array.shape}; it must be {shape}")
    return array


def _optional(name: str, given: ArrayLike | None, shape: tuple[int, ...], kind: type) -> Any:
    return None if given is None else _shaped(name, given, shape, kind)


def _names(what: str, given: Sequence[str] | None, count: int, letter: str) -> tuple[str, ...]:
    if given is None:
        return numbered(letter, count)
    names = tuple(given)
    if len(names) != count:
        raise DataError(f"FrequencyResponse: {len(names)} names of {what} {list(names)}, there are {count}")
    return names


def _root(square: F64) -> F64:
    return np.sqrt(np.maximum(square, 0.0, where=~np.isnan(square), out=square.copy()))


def _plain(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return list(value) if isinstance(value, tuple) else value
    if value.dtype == np.complex128:
        return {"re": value.real.tolist(), "im": value.imag.tolist()}
    return value.tolist()


def _unplain(value: Any) -> Any:
    if isinstance(value, dict):
        return np.array(value["re"], dtype=float) + 1j * np.array(value["im"], dtype=float)
    return value
