"""Estimates while samples arrive: a window that slides along a stream, or several that are forgotten."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, isfinite
from threading import RLock
from typing import Any, Never

import numpy as np
from numpy.typing import ArrayLike

from .._core import Stream as CoreStream
from ..base.arguments import public, real
from ..base.arrays import F64
from ..base.between import AUTO
from ..base.progress import Progress
from ..base.samples import Names, intersample_of
from ..base.words import STATUS
from ..errors import DataError, SpecError
from ..fitting.fit import Estimator, fit_quietly
from ..fitting.prepared import Prepared, prepare_stream, refuse_standing
from ..models.layout import Layout
from ..models.noise import Noise
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from .forgetting import loss, unweighted, weights_of
from .samples import block_of, channels_of, refuse_record, words_of
from .track import Track, joined

__all__ = ["Stream"]

_WORDS = np.array(STATUS)
FEWEST = 8  # intervals of a window
LONGEST = 1 << 20  # samples remembered
AT_ONCE = 4096  # samples of a record between two looks at Ctrl-C


@public
class Stream:
    """Estimates from the last samples of a measurement that goes on.

    The Fourier coefficients of the window are carried on from sample to sample, a few operations a harmonic
    (report, eqs. (8) and (21), by recursion), with rounding errors that do not grow. The estimate of any
    moment is that of `fit` on the window as a record.

    Parameters
    ----------
    estimator : Estimator
        A structure with its options, among them `band` or `harmonics`: a stream keeps the coefficients of
        fixed lines. Coefficients are carried on for a `TransferFunction` with known delays and white noise.
        Other models, delays to be found, coloured noise and noisy inputs are fitted to the samples of the
        window when an estimate is asked for.
    dt : float
        Time between samples, s.
    window : float, optional
        Length of the window, s, rounded to whole intervals. With delays the samples of the longest one are
        kept before it.
    forgetting : float, optional
        Time constant, s: windows before the last one count as well, each by exp(-age/forgetting), until that
        is below 1 %; at most 50. Without `window` they are as long as this. For what coefficients are carried
        on for, with "wls", "awls" and "ml".
    outputs, inputs : str or sequence of str, optional
        Names of the channels. Default: those of an equation or state space; else ``y`` and ``u``, numbered
        if the structure has several.
    intersample : {"auto", "smooth", "zoh", "foh"}, or a sequence or mapping of them, default "auto"
        How the inputs go between samples, as in `Record`. "auto" decides when the first window is full, by
        its samples and, where these leave it open, by a fit of it as in `fit`; or takes what the record
        that is followed declares.
    units : mapping of str to str, optional
        Units by channel name, for labels.
    t0 : float, default 0.0
        Time of the first sample, s.

    Attributes
    ----------
    estimator : Estimator
    dt : float
    window : float
        Length of the window, s, in whole intervals.
    weights : tuple of float
        Of the squared residuals of the last window, of the one before it, ….
    outputs, inputs, param_names : tuple of str

    Raises
    ------
    SpecError
        No window, no band, options that do not go with a stream.
    DataError
        Lines that are too few for the parameters.

    See Also
    --------
    modfun.Track : Estimates over time.
    modfun.fit : One record at once.

    Notes
    -----
    Several threads may push and ask. A Stream cannot be copied or pickled.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.3, eqs. (8) and (21).

    Examples
    --------
    >>> import modfun as mf
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> est = mf.Estimator(mf.TransferFunction(poles=2, zeros=0), band=12.0)
    >>> live = mf.Stream(est, dt=rec.dt, window=6.0)
    >>> for y, u in zip(rec.y[0], rec.u[0]):
    ...     live.push(y=y, u=u)
    >>> live.ready, live.params.round(2)
    (True, array([3., 8., 5.]))
    """

    def __init__(
        self,
        estimator: Estimator,
        *,
        dt: float,
        window: float | None = None,
        forgetting: float | None = None,
        outputs: Names = None,
        inputs: Names = None,
        intersample: str | Sequence[str] | Mapping[str, str] = AUTO,
        units: Mapping[str, str] | None = None,
        t0: float = 0.0,
    ) -> None:
        if not isinstance(estimator, Estimator):
            raise SpecError(
                f"Stream: the estimator is a {type(estimator).__name__}; give a structure with its options, "
                "mf.Estimator(model, band=...)"
            )
        model, options = estimator.model, estimator.options
        if options.band is None and options.harmonics is None:
            raise SpecError(
                "Stream: the estimator has no band, and a stream keeps the coefficients of fixed lines; give "
                "mf.Estimator(model, band=...), say the fit.band of a record like it"
            )
        if window is None and forgetting is None:
            raise SpecError("Stream: say how much of the past counts, window= or forgetting= in seconds")
        self.estimator = estimator
        self.dt = _seconds("dt", dt)
        self._begin = self._t0 = real("Stream", "t0", t0)
        length = _seconds("window", window if window is not None else forgetting)
        self._intervals = _intervals(length, self.dt)
        self.window = self._intervals * self.dt
        self.weights = weights_of(
            self.window, None if forgetting is None else _seconds("forgetting", forgetting)
        )
        self.outputs = channels_of(model, "outputs", outputs, "y")
        self.inputs = channels_of(model, "inputs", inputs, "u")
        self._said = intersample_of(intersample, self.inputs)
        self._words = tuple("smooth" if word == AUTO else word for word in self._said)
        self._open = AUTO in self._said
        self._notes: tuple[str, ...] = ()
        self._units = dict(units or {})
        channels = len(self.outputs) + len(self.inputs)
        self._record(np.zeros((channels, FEWEST)), 0.0)  # checks names and units
        layout = model.layout(self.outputs, self.inputs) if isinstance(model, TransferFunction) else None
        late = 0.0 if layout is None else layout.longest_delay
        if late >= self.window:
            raise SpecError(
                f"Stream: a delay of {late:g} s beside a window of {self.window:g} s; take a longer window"
            )
        self._samples = self._intervals + 1 + ceil(late / self.dt - 1e-9)
        remembered = self._samples + (len(self.weights) - 1) * self._intervals
        if remembered > LONGEST:
            raise SpecError(
                f"Stream: {remembered} samples would be remembered, at most {LONGEST} are; take shorter "
                "windows or longer steps"
            )
        self._made: Prepared | None = None
        self._core: Any
        if layout is not None and _slides(layout, options):
            _refuse_options(options, len(self.weights))
            self._prepare()
        else:
            if len(self.weights) > 1:
                raise SpecError(
                    "Stream: forgetting= takes a TransferFunction with known delays and white noise; give "
                    "window= for this estimator"
                )
            self._core = CoreStream(channels, remembered, self._samples, self.dt, [])
        self.param_names = tuple(model.param_names(self.inputs, self.outputs))
        self._lock = RLock()  # pushing and asking from two threads
        self._latest: Track | None = None

    # What goes in --------------------------------------------------------------------------------

    def push(self, y: ArrayLike, u: ArrayLike | None = None) -> None:
        """Take one sample, or a block of them.

        Parameters
        ----------
        y, u : float, or array_like of shape (channel,), (time,) or (channel, time)
            Outputs and inputs. A 1-D array is one sample of each channel, or with one channel a block.

        Raises
        ------
        DataError
            Values that are not finite, or another number of channels; nothing has been taken then.
        """
        with self._lock:  # for the count, too
            self._take(block_of(y, u, self.outputs, self.inputs, self.count))

    def follow(self, rec: Record, *, every: int = 1, progress: str | bool = "auto") -> Track:
        """Push a record and note the estimates on the way.

        Parameters
        ----------
        rec : Record
            With the channels and the step of the stream; it goes on where the stream stands. A stream without
            samples takes the record's times.
        every : int, default 1
            Estimates are those after every `every`-th sample of the stream.
        progress : {"auto", True, False}
            On standard error; "auto": from two seconds on.

        Returns
        -------
        Track
            None of its moments is earlier than the first full window.

        Raises
        ------
        DataError
            A record with other channels, another step or masked samples.
        """
        refuse_record(rec, self.outputs, self.inputs, self.dt, self._said if self._open else self._words)
        whole = isinstance(every, int | np.integer) and not isinstance(every, bool)
        if not (whole and 1 <= every <= LONGEST):
            raise SpecError(
                f"Stream.follow: every={every!r} must be a whole number of samples from 1 to {LONGEST}"
            )
        block = np.vstack([rec.y, rec.u])
        total, found = block.shape[1], [self._nothing()]
        with self._lock, Progress(progress, "following", "samples") as report:
            if not self.count:
                self._begin = float(rec.t[0])
            if self._open:
                self._decide(rec._slice(0, min(total, self._samples)))
            for at in range(0, total, AT_ONCE):
                found.append(self._followed(block[:, at : at + AT_ONCE], int(every)))
                report(min(at + AT_ONCE, total), total)
        return joined(found)

    def clear(self) -> None:
        """Forget all samples; time begins at `t0` again."""
        with self._lock:
            self._latest = None
            self._core.clear()
            self._open, self._notes = AUTO in self._said, ()
            self._begin = self._t0

    # What comes out ------------------------------------------------------------------------------

    @property
    def intersample(self) -> tuple[str, ...]:
        """One word an input; where "auto" was given, "smooth" until the first window is full."""
        return self._words

    @property
    def count(self) -> int:
        """Samples taken."""
        return int(self._core.count)

    @property
    def t(self) -> float:
        """Time of the last sample, s."""
        return self._begin + max(self.count - 1, 0) * self.dt

    @property
    def ready(self) -> bool:
        """Whether the first window is full."""
        return self.count >= self._samples

    @property
    def params(self) -> F64:
        """The estimate of this moment, (p,); nan where the numbers allow none."""
        params: F64 = self._estimate().params[-1].copy()
        return params

    @property
    def bse(self) -> F64:
        """Its standard errors of the estimator's `cov_type`, (p,)."""
        bse: F64 = self._estimate().bse[-1].copy()
        return bse

    @property
    def status(self) -> str:
        """Its outcome: "ok", "maxiter", "rank" or "nonfinite"."""
        return str(self._estimate().status[-1])

    def record(self) -> Record:
        """The last window (and the longest delay before it) as a record, with the times of the stream.

        Raises
        ------
        DataError
            Before the first window is full.
        """
        return self._windows()[0]

    def fit(self) -> Fit:
        """The estimate of this moment with all that a Fit can do; its data is the windows it saw.

        Raises
        ------
        DataError
            Before the first window is full, or where a channel does not move.
        """
        with self._lock:
            records = self._windows()
            if self._made is None:
                return fit_quietly(records, self.estimator.model, self.estimator.options)
            refuse_standing(self._made.layout, [rec.y for rec in records], [rec.u for rec in records])
            found = self._core.fit()
        structure, options = self.estimator.model, self.estimator.options
        intervals = self._made.intervals * len(records)
        fit = Fit.of_core(found, structure, self._made.layout, options, records, intervals)
        return unweighted(fit, self.weights[: len(records)])

    def __setattr__(self, name: str, value: object) -> None:
        if name in self.__dict__ and not name.startswith("_"):
            raise AttributeError(f"a Stream cannot be changed ({name}); make a new one")
        object.__setattr__(self, name, value)

    def __reduce__(self) -> Never:
        raise TypeError(
            "a Stream cannot be copied or pickled; make another one and push it stream.record().y and .u"
        )

    def __repr__(self) -> str:
        past = f"window {self.window:g} s"
        if len(self.weights) > 1:
            past += f", {len(self.weights)} of them, each weighted {self.weights[1]:.2g} of the next"
        filled = "ready" if self.ready else f"{self.count} of {self._samples} samples"
        line = f"Stream({self.estimator!r}, {past}, step {self.dt:g} s): {filled}"
        return "\n".join((line, *self._notes))

    # Inside --------------------------------------------------------------------------------------

    def _take(self, block: F64) -> None:
        with self._lock:
            self._latest = None
            first = self._samples - self.count if self._open else 0
            if 0 < first <= block.shape[1]:
                self._core.push(np.ascontiguousarray(block[:, :first]))
                block = np.ascontiguousarray(block[:, first:])
                self._decide(self._record(self._core.past(), self._begin))
            if block.size:
                self._core.push(block)

    def _prepare(self) -> None:
        """Make the core of fits that coefficients are carried on for."""
        names = (self.outputs, self.inputs, self._words)
        model, options = self.estimator.model, self.estimator.options
        self._made = prepare_stream(model, options, names, self._intervals, self.dt, self.weights)
        self._core = self._made.core

    def _decide(self, rec: Record) -> None:
        """Take the words of a first window; samples that came already go into a new core."""
        words, self._notes = words_of(rec, self._said, self.estimator)
        self._open = False
        changed, self._words = words != self._words, words
        if changed and self._made is not None:
            past = self._core.past()
            self._prepare()
            if past.size:
                self._core.push(past)

    def _followed(self, block: F64, every: int) -> Track:
        if self._made is not None:
            self._latest = None
            return self._noted(self._core.follow(np.ascontiguousarray(block), every))
        parts = [self._nothing()]
        for k in range(block.shape[1]):
            self._take(block[:, k : k + 1].copy())
            if self.ready and self.count % every == 0:
                parts.append(self._estimate())
        return joined(parts)

    def _estimate(self) -> Track:
        """The estimate of this moment as a track of one."""
        with self._lock:
            if self._latest is None:
                self._latest = self._of_now()
            return self._latest

    def _of_now(self) -> Track:
        if self._made is not None and self.ready:
            return self._noted(self._core.now())
        p, t = len(self.param_names), np.array([self.t])
        try:
            fit = self.fit()
        except DataError:
            if not self.ready:
                raise
            # A channel stands: part of a stream, no fault of its caller.
            nothing = np.full((1, p), np.nan)
            return self._track(t, nothing, nothing, np.array(["rank"]), np.zeros(1, int))
        return self._track(t, fit.params[None], fit.bse[None], np.array([fit.status]), np.array([fit.nit]))

    def _noted(self, found: dict[str, Any]) -> Track:
        """What the core noted."""
        kind = self.estimator.options.cov_type
        errors = found[f"bse_{kind.lower()}"]
        t = self._begin + (found["count"] - 1) * self.dt
        if len(self.weights) > 1 and kind != "HC3":
            windows = 1 + (found["count"] - self._samples) // self._intervals
            factors = [loss(self.weights[: k + 1]) ** 0.5 for k in range(len(self.weights))]
            each = np.array(factors)[np.minimum(windows, len(factors)) - 1]
            errors = errors * each[:, None]
        shape = (t.size, len(self.param_names))  # of no moment, too
        params, errors = found["theta"].reshape(shape), errors.reshape(shape)
        return self._track(t, params, errors, _WORDS[found["status"]], found["nit"])

    def _nothing(self) -> Track:
        none = np.empty((0, len(self.param_names)))
        return self._track(np.empty(0), none, none, np.empty(0, "<U9"), np.empty(0, int))

    def _track(self, t: F64, params: F64, bse: F64, status: Any, nit: Any) -> Track:
        return Track(t, params, bse, status, nit, self.param_names, self.window)

    def _windows(self) -> tuple[Record, ...]:
        """The windows whose samples are all there, the last one first."""
        if not self.ready:
            raise DataError(
                f"Stream: {self.count} of the {self._samples} samples of the first window are there; ask "
                "when stream.ready"
            )
        samples = self._core.past()
        have, made = samples.shape[1], []
        for end in range(have, self._samples - 1, -self._intervals):
            begin = self._begin + (self.count - have + end - self._samples) * self.dt
            made.append(self._record(samples[:, end - self._samples : end], begin))
        return tuple(made)

    def _record(self, samples: F64, begin: float) -> Record:
        q = len(self.outputs)
        rec = Record(
            y=samples[:q],
            u=samples[q:] if self.inputs else None,
            dt=self.dt,
            t0=begin,
            outputs=self.outputs,
            inputs=self.inputs,
            intersample=self._said,
            units=self._units,
        )
        return rec if self._open else rec._read_as(self._words)


def _slides(layout: Layout, options: Options) -> bool:
    """Whether the coefficients of fixed lines are all that a fit needs."""
    noise, words = options.noise, ("output",) if options.method == "ml" else ("output", "equation")
    white = noise.white if isinstance(noise, Noise) else noise in words
    return white and not layout.free_delays


def _refuse_options(options: Options, windows: int) -> None:
    if options.rule == "parabolic":
        raise SpecError(
            'Stream: rule="parabolic" weighs a sample by whether it is odd or even, which changes as the '
            'window slides; use "gregory"'
        )
    if windows > 1 and options.method == "ls":
        raise SpecError('Stream: forgetting= goes with method="wls", "awls" and "ml", not with "ls"')


def _intervals(length: float, dt: float) -> int:
    if length / dt > LONGEST:
        raise SpecError(
            f"Stream: a window of {length:g} s holds {length / dt:.3g} intervals of {dt:g} s, at most "
            f"{LONGEST}; take a shorter window or longer steps"
        )
    intervals = round(length / dt)
    if intervals < FEWEST:
        raise SpecError(
            f"Stream: a window of {length:g} s holds {intervals} intervals of {dt:g} s; at least {FEWEST} "
            "are needed"
        )
    return intervals


def _seconds(name: str, given: Any) -> float:
    seconds = real("Stream", name, given, finite=False)
    if not (isfinite(seconds) and seconds > 0):
        raise SpecError(f"Stream: {name}={given!r} must be a positive number of seconds")
    return seconds
