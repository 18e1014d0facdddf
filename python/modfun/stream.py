"""Estimates while samples arrive: a window that slides along a stream, or several that are forgotten."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, exp, isfinite, log
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import DataError, SpecError
from .estimation import Estimator, _answered, _fit
from .many import STATUS
from .noise import Noise
from .prepared import prepare_stream, refuse_standing
from .progress import Progress
from .records import Record
from .results import Fit
from .samples import Names, intersample_of, names_of
from .structures import TransferFunction
from .track import Track

__all__ = ["Stream"]

F64 = NDArray[np.float64]
_WORDS = np.array(STATUS)
FEWEST = 8  # intervals of a window
LEAST = 0.01  # weight of a window that is no longer remembered
MOST = 50  # windows remembered
AT_ONCE = 4096  # samples of a record between two looks at Ctrl-C


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
        Length of the window, s, rounded to whole intervals.
    forgetting : float, optional
        Time constant, s: windows before the last one count as well, each by exp(-age/forgetting), until that
        is below 1 %. Without `window` they are as long as this.
    outputs, inputs : str or sequence of str, optional
        Names of the channels. Default: those of an equation or state space; else ``y`` and ``u``, numbered
        if the structure has several.
    intersample : {"smooth", "zoh", "foh"}, or a sequence or mapping of them, default "smooth"
        How the inputs go between samples, as in `Record`.
    units : mapping of str to str, optional
        Units by channel name, for labels.

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
        intersample: str | Sequence[str] | Mapping[str, str] = "smooth",
        units: Mapping[str, str] | None = None,
    ) -> None:
        if not isinstance(estimator, Estimator):
            raise SpecError(
                f"Stream: the estimator is a {type(estimator).__name__}; give a structure with its options, "
                "mf.Estimator(model, band=...)"
            )
        if estimator.options.band is None and estimator.options.harmonics is None:
            raise SpecError(
                "Stream: the estimator has no band, and a stream keeps the coefficients of fixed lines; give "
                "mf.Estimator(model, band=...), say the fit.band of a record like it"
            )
        if window is None and forgetting is None:
            raise SpecError("Stream: say how much of the past counts, window= or forgetting= in seconds")
        model = estimator.model
        self.estimator = estimator
        self.dt = _seconds("dt", dt)
        length = _seconds("window", window if window is not None else forgetting)
        self._intervals = round(length / self.dt)
        if self._intervals < FEWEST:
            raise SpecError(
                f"Stream: a window of {length:g} s holds {self._intervals} intervals of {self.dt:g} s; at "
                f"least {FEWEST} are needed"
            )
        self.window = self._intervals * self.dt
        self.weights = (
            (1.0,) if forgetting is None else _weights(self.window, _seconds("forgetting", forgetting))
        )
        self.outputs = _names(model, "outputs", outputs, "y")
        self.inputs = _names(model, "inputs", inputs, "u")
        self.intersample = intersample_of(intersample, self.inputs)
        self._units = dict(units or {})
        lead = 0
        self._core: Any = None
        if isinstance(model, TransferFunction):
            layout = model.layout(self.outputs, self.inputs)
            lead = ceil(layout.longest_delay / self.dt - 1e-9)
            if _slides(layout.free_delays, estimator.options.noise):
                channels = (self.outputs, self.inputs, self.intersample)
                factors = [weight**0.5 for weight in self.weights]
                self._made = prepare_stream(
                    model, estimator.options, channels, self._intervals, self.dt, factors
                )
                self._core = self._made.core
        if self._core is None and len(self.weights) > 1:
            raise SpecError(
                "Stream: forgetting= takes a TransferFunction with known delays and white noise; give "
                "window= for this estimator"
            )
        self.param_names = tuple(model.param_names(self.inputs, self.outputs))
        self._samples = self._intervals + 1 + lead
        remembered = self._samples + (len(self.weights) - 1) * self._intervals
        self._past = _Past(len(self.outputs) + len(self.inputs), remembered)
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
        self._take(self._block(y, u))

    def follow(self, rec: Record, *, every: int = 1, progress: str | bool = "auto") -> Track:
        """Push a record and note the estimates on the way.

        Parameters
        ----------
        rec : Record
            With the channels and the step of the stream; it goes on where the stream stands.
        every : int, default 1
            Samples from one estimate to the next.
        progress : {"auto", True, False}
            A line on standard error for work that takes a while.

        Returns
        -------
        Track
            None of its moments is earlier than the first full window.

        Raises
        ------
        DataError
            A record with other channels, another step or masked samples.
        """
        self._refuse(rec)
        if isinstance(every, bool) or not isinstance(every, int | np.integer) or every < 1:
            raise SpecError(f"Stream.follow: every={every!r} must be a whole number of samples from 1 on")
        block = np.vstack([rec.y, rec.u])
        total, found = block.shape[1], [self._nothing()]
        with Progress(progress, "following", "samples") as report:
            for at in range(0, total, AT_ONCE):
                found.append(self._followed(block[:, at : at + AT_ONCE], int(every)))
                report(min(at + AT_ONCE, total), total)
        return Track.joined(found)

    def clear(self) -> None:
        """Forget all samples; time goes on from 0."""
        self._past.clear()
        self._latest = None
        if self._core is not None:
            self._core.clear()

    # What comes out ------------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Samples taken."""
        return self._past.count

    @property
    def t(self) -> float:
        """Time of the last sample, s; the first one's is 0."""
        return max(self._past.count - 1, 0) * self.dt

    @property
    def ready(self) -> bool:
        """Whether the first window is full."""
        return self._past.count >= self._samples

    @property
    def params(self) -> F64:
        """The estimate of this moment, (p,); nan where the numbers allow none."""
        params: F64 = self._estimate().params[-1]
        return params

    @property
    def bse(self) -> F64:
        """Its standard errors of the estimator's `cov_type`, (p,)."""
        bse: F64 = self._estimate().bse[-1]
        return bse

    @property
    def status(self) -> str:
        """Its outcome: "ok", "maxiter", "rank" or "nonfinite"."""
        return str(self._estimate().status[-1])

    def record(self) -> Record:
        """The last window as a record, with the times of the stream.

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
        records = self._windows()
        if self._core is None:
            return _fit(records, self.estimator.model, self.estimator.options)
        refuse_standing(self._made.layout, [rec.y for rec in records], [rec.u for rec in records])
        made = self._made.for_windows(len(records))
        return _answered(self._core.fit(), made, records, self.estimator.model, self.estimator.options)

    def __repr__(self) -> str:
        past = f"window {self.window:g} s"
        if len(self.weights) > 1:
            past += f", {len(self.weights)} of them, each weighted {self.weights[1]:.2g} of the next"
        filled = "ready" if self.ready else f"{self.count} of {self._samples} samples"
        return f"Stream({self.estimator!r}, {past}, step {self.dt:g} s): {filled}"

    # Inside --------------------------------------------------------------------------------------

    def _block(self, y: ArrayLike, u: ArrayLike | None) -> F64:
        """What was given as (channel, time), outputs first."""
        q, k = len(self.outputs), len(self.inputs)
        if isinstance(y, float) and isinstance(u, float) and q == k == 1 and isfinite(y) and isfinite(u):
            return np.array([[y], [u]])  # the most frequent case, four times as fast
        above = _rows("y", y, q)
        block = np.empty((q + k, above.shape[1]))
        block[:q] = above
        if k or u is not None:
            below = _rows("u", () if u is None else u, k)
            if below.shape[1] != above.shape[1]:
                raise DataError(
                    f"Stream.push: {above.shape[1]} samples of y, {below.shape[1]} of u; give as many of both"
                )
            block[q:] = below
        if not np.isfinite(block).all():
            row, column = np.argwhere(~np.isfinite(block))[0]
            raise DataError(
                f"Stream.push: {(*self.outputs, *self.inputs)[row]!r} is {block[row, column]} at sample "
                f"{self.count + column}; nothing was taken: give its last good value, or clear() and begin "
                "again"
            )
        return block

    def _take(self, block: F64) -> None:
        if self._core is not None:
            self._core.push(block)
        self._past.push(block)
        self._latest = None

    def _followed(self, block: F64, every: int) -> Track:
        if self._core is not None:
            found = self._core.follow(np.ascontiguousarray(block), every)
            self._past.push(block)
            self._latest = None
            return self._noted(found)
        parts = [self._nothing()]
        for k in range(block.shape[1]):
            self._take(block[:, k : k + 1])
            if self.ready and self.count % every == 0:
                parts.append(self._estimate())
        return Track.joined(parts)

    def _estimate(self) -> Track:
        """The estimate of this moment as a track of one."""
        if self._latest is None:
            self._latest = self._of_now()
        return self._latest

    def _of_now(self) -> Track:
        if self._core is not None and self.ready:
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
        errors = found["bse_hc3" if self.estimator.options.cov_type == "HC3" else "bse_nonrobust"]
        t = (found["count"] - 1) * self.dt
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
        q, samples = len(self.outputs), self._past.samples
        made = []
        for end in range(samples.shape[1], self._samples - 1, -self._intervals):
            own = samples[:, end - self._samples : end]
            begin = (self.count - samples.shape[1] + end - self._samples) * self.dt
            made.append(
                Record(
                    y=own[:q],
                    u=own[q:] if self.inputs else None,
                    dt=self.dt,
                    t0=begin,
                    outputs=self.outputs,
                    inputs=self.inputs,
                    intersample=self.intersample,
                    units=self._units,
                )
            )
        return tuple(made)

    def _refuse(self, rec: Record) -> None:
        if (rec.outputs, rec.inputs) != (self.outputs, self.inputs):
            raise DataError(
                f"Stream.follow: the record has outputs {list(rec.outputs)}, inputs {list(rec.inputs)}, the "
                f"stream {list(self.outputs)} and {list(self.inputs)}; select them, or name the stream's"
            )
        if rec.dt is None or abs(rec.dt - self.dt) > 1e-6 * self.dt:
            have = "uneven steps" if rec.dt is None else f"a step of {rec.dt:g} s"
            raise DataError(f"Stream.follow: the record has {have}, the stream one of {self.dt:g} s")
        if rec.mask is not None or rec.sigma is not None:
            raise DataError("Stream.follow: masked samples and sigma are for records; fill them first")


class _Past:
    """The last samples (channel, time) of a stream, in a buffer twice as long so that they lie together."""

    def __init__(self, channels: int, size: int) -> None:
        self._buffer = np.zeros((channels, 2 * size))
        self._size, self._end, self.count = size, 0, 0

    def push(self, block: F64) -> None:
        more, size = block.shape[1], self._size
        self.count += more
        if more >= size:
            self._buffer[:, :size], self._end = block[:, more - size :], size
            return
        if self._end + more > 2 * size:
            keep = size - more
            self._buffer[:, :keep] = self._buffer[:, self._end - keep : self._end]
            self._end = keep
        self._buffer[:, self._end : self._end + more] = block
        self._end += more

    @property
    def samples(self) -> F64:
        have = min(self.count, self._size)
        return self._buffer[:, self._end - have : self._end]

    def clear(self) -> None:
        self._end = self.count = 0


def _slides(free_delays: Sequence[Any], noise: Any) -> bool:
    """Whether the coefficients of fixed lines are all that a fit needs."""
    if isinstance(noise, Noise):
        levels = [
            one for given in (noise.y, noise.u) for one in (given if isinstance(given, tuple) else (given,))
        ]
        return not free_delays and not any(callable(level) for level in levels)
    return not free_delays and noise in ("output", "equation")


def _weights(window: float, forgetting: float | None) -> tuple[float, ...]:
    """Weights of windows back in time, down to LEAST."""
    if forgetting is None:
        return (1.0,)
    forgetting = _seconds("forgetting", forgetting)
    count = ceil(-log(LEAST) * forgetting / window)
    if count > MOST:
        raise SpecError(
            f"Stream: forgetting={forgetting:g} s would keep {count} windows of {window:g} s, at most {MOST} "
            "are kept; give longer windows"
        )
    return tuple(exp(-k * window / forgetting) for k in range(count))


def _names(model: Any, which: str, given: Names, letter: str) -> tuple[str, ...]:
    if not isinstance(model, TransferFunction):
        own: tuple[str, ...] = getattr(model, which)
        return own if given is None else names_of(given, len(own), letter, which)
    count = model.n_outputs if which == "outputs" else model.n_inputs
    if count is None:
        count = 1 if given is None or isinstance(given, str) else len(given)
    return names_of(given, count, letter, which)


def _rows(name: str, given: ArrayLike, channels: int) -> F64:
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise DataError(f"Stream.push: {name} holds no numbers; give a sample or a block of them") from None
    if values.ndim == 0:
        values = values.reshape(1, 1)
    elif values.ndim == 1:
        values = values[None] if channels == 1 else values[:, None]
    if values.ndim != 2 or values.shape[0] != channels:
        raise DataError(
            f"Stream.push: {name} has shape {np.shape(given)}, the stream {channels} channel(s) of it; give "
            "(channel,) for one sample or (channel, time) for a block"
        )
    return values


def _seconds(name: str, given: Any) -> float:
    if isinstance(given, bool) or not isinstance(given, int | float | np.number):
        raise SpecError(f"Stream: {name}={given!r} must be a number of seconds")
    if not (isfinite(given) and given > 0):
        raise SpecError(f"Stream: {name}={given!r} must be a positive number of seconds")
    return float(given)
