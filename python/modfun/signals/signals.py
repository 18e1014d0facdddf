"""Inputs of an experiment: samples, what they do in between, and what they are worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._core import coefficients
from ..base.arguments import public, reals
from ..base.arrays import F64
from ..base.samples import frozen
from ..base.tables import Table
from ..base.words import INTERSAMPLE
from ..errors import DataError, SpecError
from ..files.delimited import write_delimited
from . import drawing
from .checks import amplitudes_of, names_of, number
from .spectrum import Spectrum

__all__ = ["Signals"]

Function = Callable[[F64], F64]


@public
@dataclass(frozen=True, eq=False, repr=False, init=False)
class Signals:
    """Inputs of an experiment; made by the functions of `mf.signals`, or of samples of one's own.

    Parameters
    ----------
    u : array_like, shape (time,) or (input, time)
        Samples.
    dt : float
        Sampling interval, s.
    inputs : str, sequence of str or int, optional
        Names; default: u, or u1, u2, ….
    intersample : {"zoh", "foh", "smooth"} or a sequence of them, default "zoh"
        What inputs do between samples: steps are "zoh", ramps "foh", multisines and sweeps "smooth".
    functions : sequence of callable or None, optional
        Smooth inputs as functions of an array of times, which simulations take as exact between samples.

    Attributes
    ----------
    t : ndarray, shape (time,)
        Times, s, from 0.
    u : ndarray, shape (input, time)
    dt : float
    inputs : tuple of str
    intersample : tuple of str
        One word an input.

    See Also
    --------
    modfun.signals.multisine : Sums of sines.
    modfun.crlb : What an input is worth.

    References
    ----------
    V. Klein, E. A. Morelli, Aircraft System Identification, AIAA, 2006, chapter 9.

    Examples
    --------
    >>> import modfun as mf
    >>> de = mf.signals.doublet("de", width=0.5, dt=0.1, before=0.2, after=0.3)
    >>> de.u
    array([[ 0.,  0.,  1.,  1.,  1.,  1.,  1., -1., -1., -1., -1., -1.,  0.,
             0.,  0.,  0.]])
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input=de)
    >>> rec.inputs, rec.intersample, rec.duration
    (('de',), ('zoh',), 1.5)
    """

    u: F64
    dt: float
    inputs: tuple[str, ...]
    intersample: tuple[str, ...]
    functions: tuple[Function | None, ...]

    def __init__(
        self,
        u: ArrayLike,
        dt: float,
        inputs: str | int | Sequence[str] | None = None,
        intersample: str | Sequence[str] = "zoh",
        functions: Sequence[Function | None] | None = None,
    ) -> None:
        values = np.atleast_2d(reals("Signals", "u", u, DataError).copy())
        if values.ndim != 2 or values.shape[1] < 2 or not np.all(np.isfinite(values)):
            raise DataError(
                f"Signals: u has shape {values.shape}; give finite samples, (time) or (input, time)"
            )
        if values.shape[0] > values.shape[1]:
            raise DataError(
                f"Signals: u would be {values.shape[0]} inputs of {values.shape[1]} samples; time is "
                "the last axis, give u.T"
            )
        count = len(values)
        names = names_of("Signals", count if inputs is None else inputs)
        kinds = (intersample,) * count if isinstance(intersample, str) else tuple(intersample)
        if len(names) != count or len(kinds) != count or not set(kinds) <= set(INTERSAMPLE):
            raise SpecError(
                f"Signals: {count} rows of u, names {list(names)}, intersample {list(kinds)}; give one name "
                f"and one of {', '.join(INTERSAMPLE)} a row"
            )
        own = (None,) * count if functions is None else tuple(functions)
        for name, value in {
            "u": frozen(values), "dt": number("Signals: dt", dt), "inputs": names, "intersample": kinds,
            "functions": own,
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    # What they are -------------------------------------------------------------------------------

    @property
    def t(self) -> F64:
        """Times, s, from 0."""
        return np.arange(float(self.u.shape[1])) * self.dt

    @property
    def intervals(self) -> int:
        """Number of sampling intervals N; there are N + 1 samples."""
        return int(self.u.shape[1]) - 1

    @property
    def duration(self) -> float:
        """Length N·dt, s, rests included."""
        return self.intervals * self.dt

    @property
    def peak(self) -> F64:
        """Largest `|u|` of each input."""
        return np.asarray(np.abs(self.u).max(axis=1))

    @property
    def rms(self) -> F64:
        """Root mean square of each input while it moves, rests aside."""
        return np.array([np.sqrt(np.mean(row**2)) for row in self._moving()])

    @property
    def peak_factor(self) -> F64:
        """Relative peak factor of each input, (max − min)/(2√2 rms) while it moves: 1 for a sine."""
        spans = np.array([np.ptp(row) for row in self._moving()])
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(spans / (2 * np.sqrt(2) * self.rms))

    @property
    def energy(self) -> F64:
        """∫u² dt of each input, from its samples."""
        return np.asarray(np.sum(self.u[:, :-1] ** 2, axis=1) * self.dt)

    @property
    def rate(self) -> F64:
        """Largest change between samples over dt, of each input: what an actuator has to follow."""
        return np.asarray(np.abs(np.diff(self.u)).max(axis=1) / self.dt)

    def _moving(self) -> list[F64]:
        """Each input from its first to its last sample that is not 0, the last instant of all left out."""
        found = []
        for row in self.u[:, :-1]:
            on = np.flatnonzero(row)
            found.append(row[on[0] : on[-1] + 1] if on.size else row)
        return found

    def spectrum(self) -> Spectrum:
        """Amplitudes 2|U(m)| at m·2π/duration, held inputs with what holding does to them.

        Returns
        -------
        Spectrum
            ``spectrum().plot()`` draws it.
        """
        rules = ["trapezoid" if kind == "smooth" else kind for kind in self.intersample]
        top = self.intervals // 2
        lines = 2 * np.abs(coefficients(self.u, top, rules, [0.0] * len(self.inputs), 0, None)[:, 1:])
        omega = 2 * np.pi / self.duration * np.arange(1.0, top + 1)
        return Spectrum(frozen(omega), frozen(lines), self.inputs, {})

    def to_table(self) -> Table:
        """One row per input: peak, rms, peak factor, energy, rate, and the band of 90 % of its power."""
        spectrum = self.spectrum()
        low, high = [], []
        for row in spectrum.amplitude:
            share = np.cumsum(row**2) / max(np.sum(row**2), 1e-300)
            low.append(spectrum.omega[np.searchsorted(share, 0.05)] if share[-1] > 0 else np.nan)
            high.append(spectrum.omega[np.searchsorted(share, 0.95)] if share[-1] > 0 else np.nan)
        columns: dict[str, Any] = {
            "input": self.inputs, "between": self.intersample, "peak": self.peak, "rms": self.rms,
            "peak_factor": self.peak_factor, "energy": self.energy, "rate": self.rate,
            "omega_5%": low, "omega_95%": high,
        }  # fmt: skip
        title = f"Signals of {self.duration:g} s: {self.intervals + 1} samples, dt = {self.dt:g} s"
        return Table(columns, title=title, units={"omega_5%": "rad/s", "omega_95%": "rad/s"})

    def __repr__(self) -> str:
        return repr(self.to_table())

    def _repr_html_(self) -> str:
        return self.to_table()._repr_html_()

    def plot(self, ax: Any = None) -> Any:
        """Draw the inputs over time; see `modfun.plot.signals`."""
        return drawing.inputs(self.t, self.u, self.inputs, self.intersample, ax)

    # What can be made of them --------------------------------------------------------------------

    def then(self, other: Signals) -> Signals:
        """These signals, then others: inputs that one of them lacks rest meanwhile.

        Parameters
        ----------
        other : Signals
            At the same dt; begins where these end.

        Returns
        -------
        Signals

        Examples
        --------
        >>> import modfun as mf
        >>> da = mf.signals.doublet("da", width=0.5, dt=0.1, after=1.0)
        >>> both = da.then(mf.signals.doublet("dr", width=0.5, dt=0.1, after=1.0))
        >>> both.inputs, both.duration
        (('da', 'dr'), 4.0)
        """
        if not isinstance(other, Signals) or abs(other.dt - self.dt) > 1e-9 * self.dt:
            raise SpecError(
                f"then: the next signals are {type(other).__name__} at dt="
                f"{getattr(other, 'dt', None)} s after dt={self.dt:g} s; make both at one dt"
            )
        names = tuple(dict.fromkeys((*self.inputs, *other.inputs)))
        u = np.zeros((len(names), self.intervals + other.intervals + 1))
        kinds: list[str] = []
        functions: list[Function | None] = []
        for k, name in enumerate(names):
            parts = [s.inputs.index(name) if name in s.inputs else None for s in (self, other)]
            own = {s.intersample[i] for s, i in zip((self, other), parts, strict=True) if i is not None}
            if len(own) > 1:
                raise SpecError(
                    f"then: {name!r} goes {' and '.join(sorted(own))} between samples; an input does one "
                    "thing throughout: give steps a rate= or use signals of one kind"
                )
            first, last = parts
            if first is not None:
                u[k, : self.intervals] = self.u[first, :-1]
            if last is not None:
                u[k, self.intervals :] = other.u[last]
            kinds += own
            f, g = (
                s.functions[i] if i is not None else None for s, i in zip((self, other), parts, strict=True)
            )
            exact = (first is None or f is not None) and (last is None or g is not None)
            functions.append(_Joined(f, g, self.duration) if exact else None)
        return Signals(u, self.dt, names, kinds, functions)

    def scaled(self, factor: ArrayLike) -> Signals:
        """The same signals at other amplitudes.

        Parameters
        ----------
        factor : float or sequence of float
            What they are multiplied by, one for all or one per input; not 0.

        Returns
        -------
        Signals
        """
        sizes = amplitudes_of("scaled: factor", factor, len(self.inputs))
        functions = [
            None if f is None else _Scaled(f, float(k)) for f, k in zip(self.functions, sizes, strict=True)
        ]
        return Signals(sizes[:, None] * self.u, self.dt, self.inputs, self.intersample, functions)

    def resample(self, dt: float) -> Signals:
        """The same signals sampled at another dt.

        Parameters
        ----------
        dt : float
            Sampling interval, s; the duration must be a whole number of it, and so must be the instants of
            steps, and of the corners of ramps.

        Raises
        ------
        SpecError
            Steps or corners between the new samples; smooth samples whose function is not known.
        """
        step = number("resample: dt", dt)
        count = round(self.duration / step)
        if count < 1 or abs(count * step - self.duration) > 1e-6 * step:
            raise SpecError(
                f"resample: {self.duration:g} s are not a whole number of intervals of {step:g} s"
            )
        t: F64 = np.arange(count + 1.0) * step
        rows = []
        for name, row, kind, exact in zip(self.inputs, self.u, self.intersample, self.functions, strict=True):
            if exact is not None:
                _refuse_fewer(name, row, count)
                rows.append(exact(t))
                continue
            if kind == "smooth":
                raise SpecError(
                    f"resample: {name!r} is known by smooth samples only; make it anew at {step:g} s"
                )
            if kind == "zoh":
                corners = np.flatnonzero(np.diff(row)) + 1
                rows.append(row[np.minimum(np.floor(t / self.dt + 1e-6).astype(int), self.intervals)])
            else:
                bend = np.diff(row, 2)
                corners = np.flatnonzero(np.abs(bend) > 1e-9 * np.abs(row).max()) + 1
                rows.append(np.interp(t, self.t, row))
            off = corners * self.dt / step
            if bad := corners[np.abs(off - np.round(off)) > 1e-6].tolist():
                raise SpecError(
                    f"resample: {name!r} changes at {bad[0] * self.dt:g} s, no sample at dt={step:g} s; "
                    f"take a dt that divides {self.dt:g} s"
                )
        return Signals(rows, step, self.inputs, self.intersample, self.functions)

    def to_csv(self, path: str | Path) -> None:
        """Write times and samples as a file of comma separated values: t in seconds, then the inputs.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        ModfunError
            It cannot be written; a file that was there before is still whole.
        """
        write_delimited("to_csv", path, ["t", *self.inputs], [self.t, *self.u], digits=10)

    # What takes them -----------------------------------------------------------------------------

    def agree(
        self,
        what: str,
        *,
        dt: float | None = None,
        duration: float | None = None,
        intervals: int | None = None,
        intersample: str | Sequence[str] | None = None,
    ) -> None:
        """Refuse arguments beside these signals that say something else than they do."""
        kinds = (intersample,) * len(self.inputs) if isinstance(intersample, str) else intersample
        for name, given, own in (
            ("dt", dt, self.dt),
            ("duration", duration, self.duration),
            ("intervals", intervals, self.intervals),
        ):
            if given is not None and not abs(given - own) <= 1e-9 * own:
                raise SpecError(
                    f"{what}: {name}={given!r}, the signals have {own:g}; leave {name}= out, or change the "
                    "signals: .resample(dt), or rests before= and after="
                )
        if kinds is not None and tuple(kinds) != self.intersample:
            raise SpecError(
                f"{what}: intersample={intersample!r}, and the signals go {list(self.intersample)} between "
                "samples; leave intersample= out"
            )

    def arranged(self, what: str, names: Sequence[str] | None, count: int) -> Signals:
        """The signals in the order of a system's inputs: by name where it names them, else as they stand."""
        if len(self.inputs) != count:
            raise SpecError(
                f"{what}: {len(self.inputs)} signal(s), {', '.join(self.inputs)}, for a system with {count} "
                "input(s); give one per input"
            )
        if names is None or tuple(names) == self.inputs:
            return self
        if self.inputs == names_of(what, count):
            rows = list(range(count))
        elif set(names) == set(self.inputs):
            rows = [self.inputs.index(name) for name in names]
        else:
            raise SpecError(
                f"{what}: the signals are {', '.join(self.inputs)}, the inputs of the system "
                f"{', '.join(names)}; name the signals so"
            )
        kinds = [self.intersample[k] for k in rows]
        return Signals(self.u[rows], self.dt, tuple(names), kinds, [self.functions[k] for k in rows])

    def sources(self) -> list[Any]:
        """One source an input: the function that is exact between samples, or the samples."""
        return [row if exact is None else exact for row, exact in zip(self.u, self.functions, strict=True)]

    def __reduce__(self) -> tuple[Any, ...]:
        return Signals, (self.u, self.dt, self.inputs, self.intersample, self.functions)


def _refuse_fewer(name: str, row: F64, count: int) -> None:
    """Refuse samples too few for what a signal holds: more than 1e-4 of its energy above half their rate."""
    power = np.abs(np.fft.rfft(row[:-1])) ** 2
    above = power[count // 2 + 1 :]
    if above.sum() > 1e-4 * power.sum():
        raise SpecError(
            f"resample: {name!r} has {100 * above.sum() / power.sum():.2g} % of its energy above half the "
            f"rate of {count} samples; take a smaller dt"
        )


@dataclass(frozen=True)
class _Scaled:
    """A function times a factor."""

    function: Function
    factor: float

    def __call__(self, t: F64) -> F64:
        return self.factor * self.function(t)


@dataclass(frozen=True)
class _Joined:
    """One function until an instant, then another; none: zero."""

    first: Function | None
    then: Function | None
    at: float

    def __call__(self, t: F64) -> F64:
        early = t < self.at * (1 - 1e-12)
        u = np.zeros(t.shape)
        for where, function, start in ((early, self.first, 0.0), (~early, self.then, self.at)):
            if function is not None:
                u[where] = function(t[where] - start)
        return u
