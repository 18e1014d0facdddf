"""Records: samples of outputs and inputs, checked once, here, and never changed afterwards."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import html
from ..base.arguments import public
from ..base.samples import (
    F64,
    FEWEST,
    Names,
    Origin,
    channels_of,
    frozen,
    intersample_of,
    listed,
    names_of,
    refuse_duplicates,
    refuse_nonfinite,
    times_of,
)
from ..base.tables import Findings, Table, nearest
from ..errors import DataError, ModfunWarning, SpecError
from ..files.delimited import write_delimited
from ..signals.signals import Signals
from . import spectra
from .check import check_record
from .cutting import SLACK, pieces_every, pieces_on
from .mask import Mask, filled, mask_of, refuse_scarce, scarce, sigma_of
from .spectra import Spectrum

__all__ = ["Record"]


@public
class Record:
    """Sampled outputs and inputs of one manoeuvre, test or simulation.

    Everything about the samples is checked when the record is made. A record cannot be changed;
    `window`, `split`, `select` and `assign` return new ones.

    Parameters
    ----------
    y : array_like, shape (time,) or (channel, time)
        Measured outputs.
    u : array_like, shape (time,) or (channel, time), or Signals, optional
        Inputs; none: free motion. `mf.signals` bring their names, dt and intersample.
    dt : float, optional
        Sampling interval in seconds. Exactly one of `dt`, `fs` and `t` is needed.
    fs : float, optional
        Sampling rate in hertz.
    t : array_like, shape (time,), optional
        Times in seconds, increasing. Uneven steps are allowed; times on an even grid but for 1e-6 of a
        step, or for their rounded decimals, count as even.
    axis : {-1, 0, 1}, default -1
        Axis of time in 2-D `y` and `u`: last, or 0 for arrays (time, channel).
    outputs, inputs : str or sequence of str, optional
        Names of the channels. Default ``y`` or ``y1, y2, ...`` and ``u`` or ``u1, u2, ...``.
    units : mapping of str to str, optional
        Units by channel name, for labels only: nothing is converted.
    intersample : {"smooth", "zoh", "foh"} or a sequence or mapping of them, default "smooth"
        How the inputs go between samples: smoothly (band-limited), held, or in straight lines; one word
        for all inputs, one an input, or words by input name (inputs left out are smooth).
    keep : mapping of str to array_like, optional
        Further channels to carry along, such as an event marker for `split`.
    mask : array_like of bool, shape (time,) or (output, time), optional
        True where a sample of the outputs counts, False where it is left out (an outlier, a dropout); one
        row for all outputs or one an output. What `y` holds there, nan included, is replaced by straight
        lines between the good samples on both sides, or the nearest good one at the ends, so that `y` is
        finite throughout; fits do not use these values. Inputs must be known everywhere.
    sigma : array_like, shape (time,) or (output, time), optional
        Relative noise of each sample of the outputs, positive: a standard deviation up to a factor an
        output, which is estimated. Default: the same for all samples.
    t0 : float, default 0.0
        Time of the first sample in seconds, with `dt` or `fs`.

    Attributes
    ----------
    y : ndarray, shape (channel, time)
    u : ndarray, shape (channel, time)
    t : ndarray, shape (time,)
    dt : float or None
        None where the steps are uneven.
    outputs, inputs : tuple of str
    intersample : tuple of str
        One word an input.
    mask : ndarray of bool, shape (output, time), or None
        None where every sample counts.
    sigma : ndarray, shape (output, time), or None
    source : Origin or None
        Name and SHA-256 of the file that `read` took it from; parts of a record keep it.

    Raises
    ------
    DataError
        If the samples cannot be used; the message says which and what to do about it.
    SpecError
        If names, units or options do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> t = 0.02 * np.arange(501)
    >>> rec = Record(y=np.sin(t), u=np.cos(t), dt=0.02, outputs="q", inputs="de")
    >>> rec.duration, rec.intervals
    (10.0, 500)
    >>> rec.window(2.0, 6.0).duration
    4.0
    """

    __slots__ = (
        "_keep", "_units", "dt", "inputs", "intersample", "mask", "outputs", "sigma", "source", "t", "u", "y",
    )  # fmt: skip

    y: F64
    u: F64
    t: F64
    dt: float | None
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    intersample: tuple[str, ...]
    mask: Mask | None
    sigma: F64 | None
    source: Origin | None
    _units: dict[str, str]
    _keep: dict[str, F64]

    def __init__(
        self,
        y: ArrayLike,
        u: ArrayLike | Signals | None = None,
        *,
        dt: float | None = None,
        fs: float | None = None,
        t: ArrayLike | None = None,
        axis: int = -1,
        outputs: Names = None,
        inputs: Names = None,
        units: Mapping[str, str] | None = None,
        intersample: str | Sequence[str] | Mapping[str, str] = "smooth",
        keep: Mapping[str, ArrayLike] | None = None,
        mask: ArrayLike | None = None,
        sigma: ArrayLike | None = None,
        t0: float = 0.0,
    ) -> None:
        if isinstance(u, Signals):
            _refuse_beside(u, dt=dt, fs=fs, t=t, inputs=inputs)
            if intersample not in ("smooth", u.intersample):
                raise SpecError(
                    f"Record: intersample={intersample!r} beside signals that are "
                    f"{', '.join(u.intersample)}; leave it out, or give signals.u"
                )
            dt, inputs, intersample = u.dt, u.inputs, u.intersample
            u = u.u if axis != 0 else u.u.T
        ys = channels_of(y, "y", axis)
        if ys.shape[0] == 0:
            raise DataError("Record: y has no channel; give at least one output")
        us = np.empty((0, ys.shape[1])) if u is None else channels_of(u, "u", axis)
        kept = {
            str(name): channels_of(values, f"kept channel {name!r}", -1)
            for name, values in (keep or {}).items()
        }
        out_names = names_of(outputs, ys.shape[0], "y", "outputs")
        in_names = names_of(inputs, us.shape[0], "u", "inputs")
        refuse_duplicates((*out_names, *in_names, *kept))
        count = ys.shape[1]
        for what, values in [("u", us), *((f"kept channel {name!r}", v) for name, v in kept.items())]:
            if values.shape[1] != count:
                raise DataError(
                    f"Record: y has {count} samples a channel and {what} has {values.shape[1]}; "
                    "all channels must be sampled at the same times: cut or resample one of them"
                )
        for name, values in kept.items():
            if values.shape[0] != 1:
                raise DataError(
                    f"Record: kept channel {name!r} has shape {values.shape}, it must be 1-D (time)"
                )
        if count < FEWEST:
            raise DataError(f"Record: {count} samples are too few; at least {FEWEST} are needed")
        times, step = times_of(count, dt, fs, t, t0)
        good = mask_of(mask, ys.shape, axis)
        refuse_scarce(good, out_names, "Record")
        ys = filled(ys, good, times)
        for names, values in [(out_names, ys), (in_names, us), *(((name,), v) for name, v in kept.items())]:
            refuse_nonfinite(names, values)
        known = (*out_names, *in_names, *kept)
        for name in units or {}:
            if name not in known:
                raise SpecError(f"Record: units names {name!r}, which is no channel; {nearest(name, known)}")
        self._set(
            y=ys,
            u=us,
            t=times,
            dt=step,
            outputs=out_names,
            inputs=in_names,
            intersample=intersample_of(intersample, in_names),
            mask=good,
            sigma=sigma_of(sigma, good, times, ys.shape, axis),
            source=None,
            _units={str(name): str(unit) for name, unit in (units or {}).items()},
            _keep={name: values[0] for name, values in kept.items()},
        )

    def _set(self, **fields: Any) -> None:
        for name in ("y", "u", "t", "mask", "sigma"):
            if fields[name] is not None:
                fields[name] = frozen(fields[name])
        fields["_keep"] = {name: frozen(values) for name, values in fields["_keep"].items()}
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def _like(self, **changes: Any) -> Record:
        """Return a record with some fields replaced, without the checks that its samples have passed."""
        record = object.__new__(Record)
        record._set(**{**self._fields(), **changes})
        return record

    def _fields(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(
            f"a Record cannot be changed ({name}); use assign, select or window for a new one"
        )

    def __delattr__(self, name: str) -> None:
        raise AttributeError(
            f"a Record cannot be changed ({name}); use assign, select or window for a new one"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (self._fields(),)

    # What it is ------------------------------------------------------------------------------

    @property
    def intervals(self) -> int:
        """Number of sampling intervals N; there are N+1 samples."""
        return len(self.t) - 1

    @property
    def duration(self) -> float:
        """Time T spanned by the samples, in seconds: N·dt."""
        return float(self.t[-1] - self.t[0]) if self.dt is None else self.intervals * self.dt

    @property
    def t0(self) -> float:
        """Time of the first sample in seconds."""
        return float(self.t[0])

    @property
    def units(self) -> dict[str, str]:
        """Units by channel name, where known (a copy)."""
        return dict(self._units)

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of further channels, neither outputs nor inputs."""
        return tuple(self._keep)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of all channels: outputs, inputs, kept ones."""
        return (*self.outputs, *self.inputs, *self._keep)

    def __getitem__(self, channel: str) -> F64:
        """Return the samples of a channel by name, shape (time,), read only."""
        if channel in self.outputs:
            row: F64 = self.y[self.outputs.index(channel)]
            return row
        if channel in self.inputs:
            row = self.u[self.inputs.index(channel)]
            return row
        if channel in self._keep:
            return self._keep[channel]
        raise SpecError(f"Record: no channel {channel!r}; {nearest(channel, self.channels)}")

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __iter__(self) -> Any:
        raise TypeError(
            "a Record is not a sequence; use rec.channels for the names, rec.y and rec.u for the samples"
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return (
            (self.dt, self.outputs, self.inputs, self.intersample, self._units, self.kept)
            == (other.dt, other.outputs, other.inputs, other.intersample, other._units, other.kept)
            and all(
                np.array_equal(getattr(self, name), getattr(other, name))  # None is equal to None alone
                for name in ("y", "u", "t", "mask", "sigma")
            )
            and all(np.array_equal(self._keep[name], other._keep[name]) for name in self._keep)
        )

    __hash__ = None  # type: ignore[assignment]

    # Parts and changes -----------------------------------------------------------------------

    def window(self, t0: float, t1: float) -> Record:
        """Return the samples from time `t0` to time `t1`, both included.

        Parameters
        ----------
        t0, t1 : float
            Times in seconds on the record's own clock (`t`), which is kept.

        Raises
        ------
        DataError
            If fewer than 8 samples lie in the window, or the mask leaves fewer of an output.
        """
        slack = SLACK * self.duration / self.intervals
        first = int(np.searchsorted(self.t, t0 - slack, side="left"))
        last = int(np.searchsorted(self.t, t1 + slack, side="right"))
        if last - first < FEWEST:
            raise DataError(
                f"window({t0:g}, {t1:g}) holds {max(last - first, 0)} samples, at least {FEWEST} are needed; "
                f"the record runs from {self.t[0]:g} to {self.t[-1]:g} s"
            )
        part = self._slice(first, last)
        refuse_scarce(part.mask, part.outputs, f"window({t0:g}, {t1:g})")
        return part

    def _slice(self, first: int, last: int) -> Record:
        part = slice(first, last)
        t, dt = self.t[part], self.dt
        if dt is None:  # a part of an uneven record may well be even
            t, dt = times_of(last - first, None, None, t, 0.0)
        keep = {name: values[part] for name, values in self._keep.items()}
        mask = None if self.mask is None or self.mask[:, part].all() else self.mask[:, part]
        sigma = None if self.sigma is None else self.sigma[:, part]
        return self._like(
            y=self.y[:, part], u=self.u[:, part], t=t, dt=dt, _keep=keep, mask=mask, sigma=sigma
        )

    def split(self, *, every: float | None = None, on: str | None = None) -> list[Record]:
        """Cut the record into several.

        Parameters
        ----------
        every : float, optional
            Length of the pieces in seconds. Neighbours share the sample between them, so each spans
            `every` exactly; a shorter rest at the end is left out.
        on : str, optional
            Name of a channel (such as an event marker carried along by `keep`): one record for each
            time it is on, that is, above the middle of its range. A counter, of three or more whole
            numbers from 0 on that last: one record for each stretch at a number that is not 0.

        Returns
        -------
        list of Record
            Without pieces too short or too much masked to be records, with a warning.

        Raises
        ------
        SpecError
            If not exactly one of `every` and `on` is given, or the channel does not exist.
        DataError
            If no piece would have 8 samples.
        """
        if (every is None) == (on is None):
            raise SpecError("split: give one of every= (seconds) and on= (name of a channel)")
        if on is not None:
            return self._pieces(*pieces_on(self.t, self[on], on))
        assert every is not None
        return self._pieces(*pieces_every(self.t, every))

    def _pieces(self, bounds: Sequence[tuple[int, int]], what: str) -> list[Record]:
        """Return the pieces of which the mask leaves enough."""
        pieces = [self._slice(first, last) for first, last in bounds]
        left = [piece for piece in pieces if not scarce(piece.mask).size]
        if not left:
            refuse_scarce(pieces[0].mask, self.outputs, what)
        if len(left) < len(pieces):
            warnings.warn(
                f"{what}: of {len(pieces) - len(left)} of {len(pieces)} pieces the mask leaves fewer than "
                f"{FEWEST} samples of an output; they are left out",
                ModfunWarning,
                stacklevel=4,
            )
        return left

    def select(self, outputs: Names = None, inputs: Names = None) -> Record:
        """Return a record with these channels as outputs and inputs; the others are dropped.

        Parameters
        ----------
        outputs, inputs : str or sequence of str, optional
            Names of any channels of the record, kept ones included; None: as they are. ``inputs=[]``
            leaves no input. Kept channels that are not named stay kept. A channel that becomes an
            output counts in all its samples.

        Raises
        ------
        SpecError
            If a channel does not exist or is named twice, or no output is left.
        DataError
            If an output with masked samples would become an input, which must be known everywhere.
        """
        outs = self.outputs if outputs is None else listed(outputs)
        ins = self.inputs if inputs is None else listed(inputs)
        if not outs:
            raise SpecError(f"select: a record needs an output; there are: {', '.join(self.channels)}")
        refuse_duplicates((*outs, *ins))
        for name in ins:
            if not self._good(name).all():
                raise DataError(
                    f"select: {name!r} has {int((~self._good(name)).sum())} masked samples, and an input "
                    "must be known everywhere; take a window without them, or assign it with the gaps filled"
                )
        count = len(self.t)
        good = np.array([self._good(name) for name in outs])
        sigma = None
        if self.sigma is not None:
            rows = dict(zip(self.outputs, self.sigma, strict=True))
            sigma = np.array([rows.get(name, np.ones(count)) for name in outs])
        words = dict(zip(self.inputs, self.intersample, strict=True))
        keep = {name: values for name, values in self._keep.items() if name not in (*outs, *ins)}
        return self._like(
            y=np.reshape([self[name] for name in outs], (len(outs), count)),
            u=np.reshape([self[name] for name in ins], (len(ins), count)),
            outputs=tuple(outs),
            inputs=tuple(ins),
            intersample=tuple(words.get(name, "smooth") for name in ins),
            mask=None if good.all() else good,
            sigma=sigma,
            _keep=keep,
            _units={name: unit for name, unit in self._units.items() if name in (*outs, *ins, *keep)},
        )

    def assign(
        self, *, units: Mapping[str, str] | None = None, **channels: ArrayLike | Callable[[Record], ArrayLike]
    ) -> Record:
        """Return a record with channels replaced or added.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units by channel name, for labels only; those not named stay as they are.
        **channels : array_like, shape (time,), or callable
            Samples by channel name, or a function of the record that returns them; all functions see
            the record as it was. A new name becomes a kept channel: `select` makes it an output or
            input. The unit of a channel that is replaced is forgotten, unless `units` says the new one;
            what is masked stays masked and may be nan.

        Raises
        ------
        DataError
            If samples are missing or not finite.
        SpecError
            If `units` names no channel.

        Examples
        --------
        >>> import numpy as np
        >>> rec = Record(y=np.arange(9.0), dt=0.1, outputs="q")
        >>> bool(rec.assign(q=lambda r: np.deg2rad(r["q"]))["q"][-1] == np.deg2rad(8.0))
        True
        """
        y, u, keep = self.y.copy(), self.u.copy(), dict(self._keep)
        for name, given in channels.items():
            values = channels_of(self._computed(name, given), f"channel {name!r}", -1)
            if values.shape != (1, len(self.t)):
                raise DataError(
                    f"assign({name}=...): shape {values.shape[1:] if len(values) == 1 else values.shape} "
                    f"where ({len(self.t)},) is needed, one value a sample"
                )
            if name in self.outputs:
                values = filled(values, self._good(name)[None], self.t)
            refuse_nonfinite((name,), values)
            if name in self.outputs:
                y[self.outputs.index(name)] = values[0]
            elif name in self.inputs:
                u[self.inputs.index(name)] = values[0]
            else:
                keep[name] = values[0]
        labels = {name: unit for name, unit in self._units.items() if name not in channels}
        for name, unit in (units or {}).items():
            if name not in (*self.outputs, *self.inputs, *keep):
                raise SpecError(
                    f"assign: units names {name!r}, which is no channel; "
                    f"{nearest(name, (*self.outputs, *self.inputs, *keep))}"
                )
            labels[str(name)] = str(unit)
        return self._like(y=y, u=u, _keep=keep, _units=labels)

    def _computed(self, name: str, given: ArrayLike | Callable[[Record], ArrayLike]) -> ArrayLike:
        if not callable(given):
            return given
        try:
            return given(self)
        except Exception as error:
            raise DataError(
                f"assign({name}=...): the function raised {type(error).__name__}: {error}"
            ) from error

    def weigh(self, mask: ArrayLike | None = None, sigma: ArrayLike | None = None) -> Record:
        """Return a record with samples of its outputs left out, or trusted less.

        Parameters
        ----------
        mask, sigma : array_like, shape (time,) or (output, time), optional
            As in `Record`. Samples already masked stay so; None leaves things as they are.

        Examples
        --------
        >>> import numpy as np
        >>> rec = Record(y=[0.0, 1, 2, 3, 99, 5, 6, 7, 8], dt=0.1, outputs="q")
        >>> rec.weigh(mask=rec["q"] < 50)["q"][4]
        np.float64(4.0)
        """
        more = mask_of(mask, self.y.shape)
        good = more if self.mask is None else self.mask if more is None else self.mask & more
        refuse_scarce(good, self.outputs, "weigh")
        weights = self.sigma if sigma is None else sigma_of(sigma, good, self.t, self.y.shape)
        return self._like(y=filled(self.y, good, self.t), mask=good, sigma=weights)

    # What it says ----------------------------------------------------------------------------

    def check(self) -> Findings:
        """Say in words what is wrong or doubtful about the samples.

        Returns
        -------
        Findings
            Prints as a list; false where there is nothing to say. Looked at: steps and gaps, masked
            samples, length and rate, channels that stand still, inputs that are not what they are declared
            between samples, codes for missing values, clipping, stale samples, outliers, drift and offsets,
            noise levels, inputs that move together.
        """
        return check_record(self)

    def noise_level(self, order: int = 2) -> Table:
        """Estimate each channel's noise from the upper harmonics, which the signals leave empty.

        With q = order + 2, the variance is N·mean|Δ^q V(m)|²/C(2q, q) over the upper half of the
        harmonics; the difference removes what the ends of the record leak there. Right for white noise
        only: on filtered records it is too low, and so it is where many samples are masked, since the
        lines between their neighbours carry little noise.

        Parameters
        ----------
        order : int, default 2
            Order of the model to be fitted.

        Returns
        -------
        Table
            ``channel``, ``unit``, ``noise_sd``, ``rms`` (about the mean), ``percent`` (of rms).

        Raises
        ------
        DataError
            If the record is uneven.
        """
        return spectra.noise_table(self, order)

    def spectrum(self) -> Spectrum:
        """Return the amplitude spectrum of every output and input.

        The mean is removed and a Hann window, (1 − cos 2πt/T)/2, put over the record, so that its ends
        do not cover the upper harmonics with leakage; amplitudes are those of sinusoids. Masked samples
        enter as the lines between their neighbours.

        Returns
        -------
        Spectrum
            At ω = m·2π/T, m = 1, 2, ... up to half the sampling rate (at most 512 for uneven records).
        """
        return spectra.spectrum_of(self)

    def plot(self, ax: Any = None) -> Any:
        """Draw every channel over time; see `modfun.plot.record`."""
        from .. import plot

        return plot.record(self, ax=ax)

    def to_csv(self, path: str | Path) -> None:
        """Write times and channels as a file of comma separated values, to the last bit.

        The first column is ``t``, in seconds; masked samples are written nan. Units, roles and the form of
        inputs between samples are not in it: say them again in `modfun.read`.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        ModfunError
            It cannot be written; a file that was there before is still whole.
        """
        columns = [self.t, *(self._shown(name) for name in self.channels)]
        write_delimited("to_csv", path, ["t", *self.channels], columns)

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame of all channels with the times as index ``t`` (extra ``pandas``).

        Masked samples are nan, sigma stands in columns ``name_sigma``. `modfun.read` makes the same record
        of the frame, or of the .parquet file it was written to: ``frame.attrs`` holds the rest.
        """
        from . import labelled

        return labelled.to_pandas(self)

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset of all channels over ``t`` (extra ``xarray``).

        Masked samples are nan, sigma stands in variables ``name_sigma``; units, roles and the form of
        inputs between samples are attributes. `modfun.read` makes the same record of it.
        """
        from . import labelled

        return labelled.to_xarray(self)

    def _good(self, channel: str) -> Mask:
        """Return where the samples of a channel count."""
        if self.mask is not None and channel in self.outputs:
            row: Mask = self.mask[self.outputs.index(channel)]
            return row
        return np.ones(len(self.t), dtype=np.bool_)

    def _shown(self, channel: str) -> F64:
        """Return the samples of a channel, nan where they are masked."""
        return np.where(self._good(channel), self[channel], np.nan)

    def _summary(self) -> tuple[str, list[tuple[str, str, str]]]:
        if self.dt is None:
            steps = np.diff(self.t)
            pace = f"uneven steps of {steps.min():.4g} to {steps.max():.4g} s"
        else:
            pace = f"dt = {self.dt:.6g} s"
        start = f" from t = {self.t0:g} s" if self.t0 else ""
        own = "" if self.sigma is None else ", own sigma"
        line = f"Record of {self.duration:.6g} s{start}: {len(self.t)} samples, {pace}{own}"
        roles = []
        for name in self.outputs:
            masked = int((~self._good(name)).sum())
            roles.append(f"output, {masked} masked" if masked else "output")
        roles += [f"input, {word}" for word in self.intersample] + ["kept"] * len(self._keep)
        rows = []
        for name, role in zip(self.channels, roles, strict=True):
            values = self[name]
            span = f"{values.min():.4g} to {values.max():.4g}"
            rows.append((name, role, f"{span} {self._units.get(name, '')}".rstrip()))
        return line, rows

    def __repr__(self) -> str:
        line, rows = self._summary()
        widths = [max(len(row[k]) for row in rows) for k in range(2)]
        return "\n".join([line, *(f"  {a.ljust(widths[0])}  {b.ljust(widths[1])}  {c}" for a, b, c in rows)])

    def _repr_html_(self) -> str:
        line, rows = self._summary()
        return html.table(("channel", "role", "range"), rows, title=line)


def _refuse_beside(signals: Signals, **given: Any) -> None:
    """What `Signals` bring themselves is not said twice."""
    if said := [name for name, value in given.items() if value is not None]:
        raise SpecError(
            f"Record: {said[0]}= beside signals, which have dt={signals.dt:g} s and the names "
            f"{', '.join(signals.inputs)}; leave it out, resample or rename them, or give signals.u"
        )


def _restore(fields: dict[str, Any]) -> Record:
    record = object.__new__(Record)
    record._set(**fields)
    return record
