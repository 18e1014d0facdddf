"""Estimates while samples arrive: a window that slides along a stream, or several that are forgotten."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, gcd
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
from ..fitting.fit import Estimator
from ..fitting.prepared import Prepared, prepare_stream, refuse_standing
from ..fitting.single import fit_quietly
from ..models.layout import Layout
from ..models.noise import Noise
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from .forgetting import loss, unweighted, weights_of
from .forms import Forms
from .samples import FEWEST, LONGEST, block_of, channels_of, intervals_of, refuse_record, seconds
from .track import Track, joined

__all__ = ["Stream"]

_WORDS = np.array(STATUS)
LOOKS = 8  # a window at its samples, whether they show another form
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
        How the inputs go between samples, as in `Record`. "auto" decides by the samples of the first full
        window in which the input moves and, where these leave it open, by a fit of it as in `fit`; and anew
        when later samples look otherwise. Or it takes what the record that is followed declares.
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
        self.dt = seconds("dt", dt)
        self._begin = self._t0 = real("Stream", "t0", t0)
        length = seconds("window", window if window is not None else forgetting)
        self._intervals = intervals_of(length, self.dt)
        self.window = self._intervals * self.dt
        self.weights = weights_of(
            self.window, None if forgetting is None else seconds("forgetting", forgetting)
        )
        self.outputs = channels_of(model, "outputs", outputs, "y")
        self.inputs = channels_of(model, "inputs", inputs, "u")
        self._forms = Forms(intersample_of(intersample, self.inputs), estimator)
        self._looked = self._gone = 0  # samples when the forms were looked at, and left out of the core
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
        words = self._forms.said if self._forms.undecided else self._forms.words
        refuse_record(rec, self.outputs, self.inputs, self.dt, words)
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
            if self._forms.undecided and self._forms.told_by(rec._slice(0, min(total, self._samples))):
                self._renew()
            for at in range(0, total, AT_ONCE):
                found.append(self._followed(block[:, at : at + AT_ONCE], int(every)))
                report(min(at + AT_ONCE, total), total)
        return joined(found)

    def clear(self) -> None:
        """Forget all samples; time begins at `t0` again."""
        with self._lock:
            self._latest = None
            self._core.clear()
            self._forms.clear()
            self._looked = self._gone = 0
            self._begin = self._t0

    # What comes out ------------------------------------------------------------------------------

    @property
    def intersample(self) -> tuple[str, ...]:
        """One word an input; where "auto" was given, "smooth" until it moves in a full window."""
        self._look(now=True)
        return self._forms.words

    @property
    def count(self) -> int:
        """Samples taken."""
        return self._gone + int(self._core.count)

    @property
    def t(self) -> float:
        """Time of the last sample, s."""
        return self._begin + max(int(self._core.count) - 1, 0) * self.dt

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
        with self._lock:
            self._look(now=True)
            return self._windows()[0]

    def fit(self) -> Fit:
        """The estimate of this moment with all that a Fit can do; its data is the windows it saw.

        Raises
        ------
        DataError
            Before the first window is full, or where a channel does not move.
        """
        with self._lock:
            self._look(now=True)
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
        self._look(now=True)
        past = f"window {self.window:g} s"
        if len(self.weights) > 1:
            past += f", {len(self.weights)} of them, each weighted {self.weights[1]:.2g} of the next"
        filled = "ready" if self.ready else f"{self.count} of {self._samples} samples"
        line = f"Stream({self.estimator!r}, {past}, step {self.dt:g} s): {filled}"
        return "\n".join((line, *self._forms.notes))

    # Inside --------------------------------------------------------------------------------------

    def _take(self, block: F64) -> None:
        with self._lock:
            self._latest = None
            self._core.push(block)

    def _prepare(self) -> None:
        """Make the core of fits that coefficients are carried on for."""
        names = (self.outputs, self.inputs, self._forms.words)
        model, options = self.estimator.model, self.estimator.options
        self._made = prepare_stream(model, options, names, self._intervals, self.dt, self.weights)
        self._core = self._made.core

    def _look(self, *, now: bool = False) -> None:
        """Read the inputs anew where their samples look otherwise; if not now, then a few times a window."""
        with self._lock:
            since = self.count - self._looked
            if not self.ready or not since:
                return
            if now or self._forms.waiting or since >= self._intervals // LOOKS:
                self._looked, samples = self.count, self._core.past()
                if self._forms.differ(samples[len(self.outputs) :]) and self._forms.taken(
                    self._record(samples, self._begin, read=False)
                ):
                    self._renew()

    def _renew(self) -> None:
        """Samples that are remembered go into a new core, which reads the inputs by their words of now."""
        self._latest = None
        if self._made is not None:
            past, before = self._core.past(), int(self._core.count)
            self._prepare()
            if past.size:
                self._core.push(past)
            left = before - past.shape[1]
            self._gone, self._begin = self._gone + left, self._begin + left * self.dt

    def _followed(self, block: F64, every: int) -> Track:
        if self._made is not None:
            self._latest = None
            return self._noted(self._core.follow(np.ascontiguousarray(block), gcd(every, self._gone)), every)
        parts = [self._nothing()]
        for k in range(block.shape[1]):
            self._take(block[:, k : k + 1].copy())
            if self.ready and self.count % every == 0:
                parts.append(self._estimate())
        return joined(parts)

    def _estimate(self) -> Track:
        """The estimate of this moment as a track of one."""
        with self._lock:
            self._look()
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

    def _noted(self, found: dict[str, Any], every: int = 1) -> Track:
        """What the core noted, of every so many samples of the stream."""
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
        own = (found["count"] + self._gone) % every == 0
        words = _WORDS[found["status"]]
        return self._track(t[own], params[own], errors[own], words[own], found["nit"][own])

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
            begin = self._begin + (int(self._core.count) - have + end - self._samples) * self.dt
            made.append(self._record(samples[:, end - self._samples : end], begin))
        return tuple(made)

    def _record(self, samples: F64, begin: float, *, read: bool = True) -> Record:
        q = len(self.outputs)
        rec = Record(
            y=samples[:q],
            u=samples[q:] if self.inputs else None,
            dt=self.dt,
            t0=begin,
            outputs=self.outputs,
            inputs=self.inputs,
            intersample=self._forms.said,
            units=self._units,
        )
        return self._forms.read(rec) if read else rec


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
