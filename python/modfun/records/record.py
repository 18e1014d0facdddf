"""Records: samples of outputs and inputs, checked once, here, and never changed afterwards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.between import AUTO, decided
from ..base.names import nearest
from ..base.samples import (
    FEWEST,
    Names,
    apart,
    channels_of,
    intersample_of,
    names_of,
    refuse_duplicates,
    refuse_nonfinite,
    times_of,
)
from ..base.tables import Findings, Table
from ..errors import DataError, SpecError
from ..files.delimited import write_delimited
from ..signals.signals import Signals
from ..signals.spectrum import Spectrum
from . import drawing, labelled, spectra
from .check import check_record
from .conversion import converted
from .functions import functions_of, is_function, sampled, texts_of
from .lost_rows import completed
from .mask import filled, mask_of, refuse_scarce, sigma_of
from .samples import Samples
from .uneven_rows import even

__all__ = ["Record"]


@public
class Record(Samples):
    """Sampled outputs and inputs of one manoeuvre, test or simulation.

    Everything about the samples is checked when the record is made. A record cannot be changed;
    `window`, `split`, `select` and `assign` return new ones.

    Parameters
    ----------
    y : array_like, shape (time,) or (channel, time), or dict of name to samples
        Measured outputs.
    u : array_like, shape (time,) or (channel, time), dict of name to samples, or Signals, optional
        Inputs; none: free motion. `mf.signals` bring their names, dt and intersample. An input that is known
        at all times is text in t, ``"sin(t**2/5)"``, as in `mf.simulate`, or a function of an array of times;
        several are a list or a dict, beside samples of others. Fits then take its integrals in place of sums
        over samples, and what it was before the first sample; parts of the record keep it.
    dt : float, optional
        Sampling interval in seconds. Exactly one of `dt`, `fs` and `t` is needed.
    fs : float, optional
        Sampling rate in hertz.
    t : array_like, shape (time,), optional
        Times in seconds, increasing. Uneven steps are allowed; times on an even grid but for 1e-6 of a
        step, or for their rounded decimals, count as even. So do times on a grid of which up to a fifth is
        missing, and no more than a tenth in a row: rows that a logger lost come back with their outputs
        masked and their inputs filled in as they go between samples, and `check` reports them.
    axis : {-1, 0, 1}, default -1
        Axis of time in 2-D `y` and `u`: last, or 0 for arrays (time, channel).
    outputs, inputs : str or sequence of str, optional
        Names of the channels. Default ``y`` or ``y1, y2, ...`` and ``u`` or ``u1, u2, ...``.
    units : mapping of str to str, optional
        Units by channel name, for labels only: nothing is converted.
    intersample : {"auto", "smooth", "zoh", "foh"} or a sequence or mapping of them, default "auto"
        How the inputs go between samples: smoothly (band-limited), held, or in straight lines; one word
        for all inputs, one per input, or words by input name (inputs left out are "auto"). "auto" takes
        the word from the samples: stretches of equal values between jumps are held, lines between corners are
        straight, and all else is smooth, coarsely rounded measurements included. Where the samples look the
        same held and smooth, `fit` reads them as it fits better. A command that changes at every sample and
        follows something smooth, such as a sweep, looks smooth even if it was held: declare it "zoh".
        Printing the record shows the words, `check` says which are doubtful.
    keep : mapping of str to array_like, optional
        Further channels to carry along, such as an event marker for `split`.
    mask : array_like of bool, shape (time,) or (output, time), optional
        True where a sample of the outputs counts, False where it is left out (an outlier, a dropout); one
        row for all outputs or one per output. What `y` holds there, nan included, is replaced by straight
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
    functions : dict of str to str or callable
        Inputs that are known at all times.
    intersample : tuple of str
        One word an input: "smooth", "zoh" or "foh". Parts of a record keep its words; `assign` decides
        anew on inputs that were not declared. Records that are fitted together agree: what one of them
        declares holds for all, else the word of the record in which the input moves most.
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

    See Also
    --------
    modfun.read : Records from files and frames.
    modfun.Batch : Many records of one experiment.
    modfun.simulate : Simulated records.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, eq. (8).

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

    __slots__ = ("__dict__",)  # answers about the samples, which fits ask for again

    def __init__(
        self,
        y: ArrayLike | Mapping[str, ArrayLike],
        u: Any = None,
        *,
        dt: float | None = None,
        fs: float | None = None,
        t: ArrayLike | None = None,
        axis: int = -1,
        outputs: Names = None,
        inputs: Names = None,
        units: Mapping[str, str] | None = None,
        intersample: str | Sequence[str] | Mapping[str, str] = AUTO,
        keep: Mapping[str, ArrayLike] | None = None,
        mask: ArrayLike | None = None,
        sigma: ArrayLike | None = None,
        t0: float = 0.0,
    ) -> None:
        if isinstance(u, Signals):
            _refuse_beside(u, dt=dt, fs=fs, t=t, inputs=inputs)
            if intersample not in (AUTO, u.intersample):
                raise SpecError(
                    f"Record: intersample={intersample!r} beside signals that are "
                    f"{', '.join(u.intersample)}; leave it out, or give signals.u"
                )
            dt, inputs, intersample = u.dt, u.inputs, u.intersample
            u = u.u if axis != 0 else u.u.T
        y_samples, outputs = apart(y, outputs, "y", "outputs")
        ys = channels_of(y_samples, "y", axis)
        if ys.shape[0] == 0:
            raise DataError("Record: y has no channel; give at least one output")
        rows, u_axis = functions_of(u), axis
        if rows is not None:
            instants, u_axis = times_of(ys.shape[1], dt, fs, t, t0)[0], -1
            made = [sampled(row, instants) for row in rows]
            u = dict(zip(u, made, strict=True)) if isinstance(u, Mapping) else made
        u_samples, inputs = apart(u, inputs, "u", "inputs")
        us = np.empty((0, ys.shape[1])) if u is None else channels_of(u_samples, "u", u_axis)
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
                raise SpecError(
                    f"Record: units names {name!r}, which is not a channel; {nearest(name, known)}"
                )
        declared = intersample_of(intersample, in_names)
        told = zip(in_names, declared, rows or [None] * len(us), strict=True)
        functions = {n: row for n, word, row in told if is_function(row) and word in (AUTO, "smooth")}
        declared = tuple("smooth" if n in functions else w for n, w in zip(in_names, declared, strict=True))
        words, forms = decided(declared, us, None if step else times, ys)
        fields: dict[str, Any] = {
            "y": ys,
            "u": us,
            "t": times,
            "dt": step,
            "outputs": out_names,
            "inputs": in_names,
            "intersample": words,
            "mask": good,
            "sigma": sigma_of(sigma, good, times, ys.shape, axis),
            "source": None,
            "_timed": dt is not None,
            "_units": {str(name): str(unit) for name, unit in (units or {}).items()},
            "_keep": {name: values[0] for name, values in kept.items()},
            "_seen": {in_names[k]: form for k, form in forms.items()},
            "_functions": functions,
        }
        fields = completed(fields)
        for name, row in functions.items():  # also at times that were missing
            fields["u"][in_names.index(name)] = sampled(row, fields["t"])
        self._set(**fields)

    def convert(self, units: Mapping[str, str] | None = None, /, **others: str) -> Record:
        """Return a record with channels in other units.

        Known are angles, rates, lengths, speeds, accelerations, masses, forces, moments, pressures, powers,
        voltages, currents and temperatures, in SI and in the units of aircraft, and products, quotients and
        powers of them: ``"deg/s"``, ``"ft/s^2"``, ``"kt"``, ``"lbf ft"``, ``"°C"``. The extra ``units`` adds
        those of pint: ``"gal/min"``.

        Parameters
        ----------
        units : mapping of str to str, optional
            New unit by channel name. The present unit is that of the attribute `units`.
        **others : str
            The same for names that Python takes, ``q="rad/s"``.

        Returns
        -------
        Record

        Raises
        ------
        SpecError
            A channel that does not exist or has no unit, or a unit that is not known or of another kind.

        Examples
        --------
        >>> import numpy as np
        >>> rec = Record(y=np.arange(9.0), dt=0.1, outputs="q", units={"q": "deg/s"})
        >>> radians = rec.convert(q="rad/s")
        >>> bool(radians["q"][-1] == np.deg2rad(8.0)), radians.units
        (True, {'q': 'rad/s'})
        """
        return converted(self, {**(units or {}), **others})

    def resample(self, dt: float) -> Record:
        """Return the record on an even grid, as delays need it, of samples at uneven times.

        Each sample moves to the nearest instant of the grid. At all others inputs go as `intersample` says,
        held, straight or smooth, and outputs are masked: fits then use no value that was not measured.
        Where a row was written only when a value had changed, as `check` reports, no row means no change: in
        gaps of more than a twentieth of the record a few values on the lines between the outputs count, too.

        Parameters
        ----------
        dt : float
            Step in seconds, from the first sample on. It rounds times by half of it at most: a tenth of the
            mean step will do, and much finer grids make fits slow and may lead them astray. Of several
            samples at one instant the last is kept.

        Returns
        -------
        Record

        Raises
        ------
        SpecError
            A step that is not positive, or makes too many samples; a record that is even already.
        DataError
            A step that leaves fewer than 8 samples.

        Warns
        -----
        ModfunWarning
            Rows were written only when a value had changed, which standard errors do not count.

        Examples
        --------
        >>> import numpy as np
        >>> t = np.array([0.0, 1.1, 2.0, 2.9, 4.1, 5.0, 6.2, 6.9])
        >>> rec = Record(y=t**2, u=t > 2.5, t=t, intersample="zoh").resample(0.1)
        >>> rec.dt, len(rec.t), int(rec.mask.sum()), round(float(rec.t[np.argmax(rec["u"])]), 9)
        (0.1, 70, 8, 2.9)
        """
        return even(self, dt)

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
        lines between their neighbours carry little noise. Of uneven samples, and of fewer than 23 at
        order 1 or 27 at order 2, it is what each is beside the polynomials through two and through
        three neighbours on each side, whichever is less.

        Parameters
        ----------
        order : int, default 2
            Order of the model to be fitted.

        Returns
        -------
        Table
            ``channel``, ``unit``, ``noise_sd``, ``rms`` (about the mean), ``percent`` (of rms).
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

    def plot(self, ax: Any = None, *, beside: Sequence[Record] = ()) -> Any:
        """Draw every channel over time, with other records beside it; see `modfun.plot.record`."""
        if isinstance(ax, Samples):
            raise SpecError("Record.plot: give other records by name, rec.plot(beside=[other])")
        return drawing.records([self, *beside], ax) if beside else drawing.record(self, ax)

    def to_csv(self, path: str | Path) -> None:
        """Write times and channels as a file of comma separated values, to the last bit.

        The first column is ``t``, in seconds; masked samples are written nan. Where units of channels are
        known, a line of units follows that of the names. Roles and the form of inputs between samples are
        not in it: say them again in `modfun.read`. Of inputs that are known as functions it has samples.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        ModfunError
            It cannot be written; a file that was there before is still whole.

        Warns
        -----
        ModfunWarning
            An input is known as a function of time: `assign` it again to what is read.
        """
        texts_of(self, "to_csv", text=False)
        columns = [self.t, *(self._shown(name) for name in self.channels)]
        units = ["s", *(self._units.get(name, "") for name in self.channels)] if self._units else None
        write_delimited("to_csv", path, ["t", *self.channels], columns, units=units)

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame of all channels with the times as index ``t`` (extra ``pandas``).

        Masked samples are nan, sigma stands in columns ``name_sigma``. `modfun.read` makes the same record
        of the frame, or of the .parquet file it was written to: ``frame.attrs`` holds the rest.
        """
        return labelled.to_pandas(self)

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset of all channels over ``t`` (extra ``xarray``).

        Masked samples are nan, sigma stands in variables ``name_sigma``; units, roles and the form of
        inputs between samples are attributes. `modfun.read` makes the same record of it.
        """
        return labelled.to_xarray(self)


def _refuse_beside(signals: Signals, **given: Any) -> None:
    """What `Signals` bring themselves is not said twice."""
    if said := [name for name, value in given.items() if value is not None]:
        raise SpecError(
            f"Record: {said[0]}= beside signals, which have dt={signals.dt:g} s and the names "
            f"{', '.join(signals.inputs)}; leave it out, resample or rename them, or give signals.u"
        )
