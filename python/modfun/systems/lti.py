"""Linear time-invariant systems with numbers: transfer functions and state spaces in continuous time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arguments import public, real, reals, whole
from ..base.arrays import C128, F64
from ..base.between import AUTO
from ..base.samples import MOST_SAMPLES, frequencies, frozen, steps_of
from ..errors import DataError, SpecError
from ..signals import Signals
from ..signals.sources import is_samples, sources
from .arithmetic import Arithmetic
from .frequency_response import FrequencyResponse
from .gains import gains
from .interop import labelled, matrices_to_control, polynomials_to_control, refuse_late, to_scipy
from .latex import in_fractions, in_matrices
from .polynomials import Polynomials, all_equal, by_modulus, fractions, roots
from .propagate import intersample_kinds, respond
from .realization import observable, transfer

__all__ = ["LTI", "Delays", "state_space"]

Matrices = tuple[F64, F64, F64, F64]
Delays = tuple[float, ...] | tuple[tuple[float, ...], ...]


@public
@dataclass(frozen=True, eq=False, repr=False)
class LTI(Arithmetic):
    """A continuous-time linear system with numbers; made by `mf.tf` or `mf.ss`.

    It is either a transfer function matrix or a state space x' = Ax + Bu(t − delay), y = Cx + Du(t − delay).
    A transfer function may have a delay per path; a state space has one per input.
    Systems are equal if they have the same form, numbers and names; a state space does not equal its transfer
    function. Equal systems have equal hashes.

    Attributes
    ----------
    numerators, denominators : tuple of tuples of ndarray, or None
        Polynomials (output, input) in descending powers of s, denominators monic; None for a state space.
    matrices : tuple of ndarray, or None
        A, B, C, D; None for a transfer function.
    delays : tuple of float, or tuple of tuples of float
        Delay of each input, s; where an input is late by different times to different outputs, the delay of
        each path (output, input).
    inputs, outputs : tuple of str or None
        Names where they were given, as those of a fit's record: `mf.signals` go to the inputs of their
        names, and `simulate` and `to_control` keep them.

    See Also
    --------
    modfun.tf : Makes one of polynomials.
    modfun.ss : Makes one of matrices.
    modfun.reduce : A model of lower order.

    References
    ----------
    T. Kailath, Linear Systems, Prentice-Hall, 1980.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> print(system.poles().round(3))
    [-1.5-2.398j -1.5+2.398j]
    """

    numerators: Polynomials | None
    denominators: Polynomials | None
    matrices: Matrices | None
    delays: Delays
    inputs: tuple[str, ...] | None = None
    outputs: tuple[str, ...] | None = None

    # What it is ------------------------------------------------------------------------------

    def __eq__(self, other: object) -> bool:
        return self._value == other._value if isinstance(other, LTI) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._value)

    @property
    def _value(self) -> tuple[Any, ...]:
        """All of it in tuples."""
        parts = []
        for table in (self.numerators, self.denominators, self.matrices and (self.matrices,)):
            parts += [(m.shape, *m.ravel().tolist()) for row in table or () for m in row]
        return self.shape, tuple(parts), self.delays, self.inputs, self.outputs

    @property
    def shape(self) -> tuple[int, int]:
        """Number of outputs and of inputs."""
        if self.matrices is not None:
            return self.matrices[3].shape[0], self.matrices[3].shape[1]
        assert self.numerators is not None
        return len(self.numerators), len(self.numerators[0])

    @property
    def order(self) -> int:
        """Number of states of `to_ss`."""
        return int(self.scaled()[0].shape[0])

    @property
    def num(self) -> Any:
        """Numerator in descending powers of s: an array, or nested tuples (output, input) if several."""
        table = self.polynomials()[0]
        return table[0][0] if self.shape == (1, 1) else table

    @property
    def den(self) -> Any:
        """Monic denominator in descending powers of s: an array where it is common to all paths."""
        table = self.polynomials()[1]
        return table[0][0] if all_equal(table) else table

    @property
    def delay(self) -> Any:
        """Delay in seconds: a float, a tuple with several inputs, or tuples (output, input)."""
        alone = len(self.delays) == 1 and not isinstance(self.delays[0], tuple)
        return self.delays[0] if alone else self.delays

    @property
    def path_delays(self) -> F64:
        """Delay of each path in seconds, (output, input)."""
        return np.broadcast_to(np.asarray(self.delays, dtype=np.float64), self.shape)

    def poles(self) -> C128:
        """Poles in rad/s, by increasing modulus: eigenvalues of A, or the roots of the denominators."""
        if self.matrices is not None:
            found = np.linalg.eigvals(self.matrices[0]) if self.matrices[0].size else np.zeros(0)
        else:
            assert self.denominators is not None
            paths = [d for row in self.denominators for d in row]
            if all_equal(self.denominators):
                paths = paths[:1]
            found = np.concatenate([roots(d) for d in paths])
        return by_modulus(found)

    def zeros(self) -> Any:
        """Zeros in rad/s: an array, or nested tuples of arrays a path (output, input) if several."""
        table = tuple(tuple(by_modulus(roots(n)) for n in row) for row in self.polynomials()[0])
        return table[0][0] if self.shape == (1, 1) else table

    @property
    def is_stable(self) -> bool:
        """True if every pole lies in the open left half plane."""
        return bool(np.all(self.poles().real < 0))

    def dcgain(self) -> Any:
        """Gain at s = 0: a float, or an array (output, input); inf or nan with a pole at 0."""
        num, den = self.polynomials()
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.array(
                [[n[-1] / d[-1] for n, d in zip(*rows, strict=True)] for rows in zip(num, den, strict=True)]
            )
        return float(gain[0, 0]) if self.shape == (1, 1) else gain

    # What it does ----------------------------------------------------------------------------

    def __call__(self, s: ArrayLike) -> Any:
        """Transfer function G(s), delays included; infinite at a pole.

        Parameters
        ----------
        s : complex array_like
            Complex frequencies, rad/s.

        Returns
        -------
        complex or ndarray
            Shape of `s`; of several channels (output, input) + shape of `s`.

        Examples
        --------
        >>> import modfun as mf
        >>> print(mf.tf([5], [1, 3, 8])(1).round(4))
        (0.4167+0j)
        """
        at = np.asarray(s, dtype=np.complex128)
        g = self._at(at.ravel()).reshape(self.shape + at.shape)
        return g if self.shape != (1, 1) else g[0, 0][()]

    def frequency_response(self, omega: ArrayLike) -> FrequencyResponse:
        """Frequency response G(iω), delays included.

        Parameters
        ----------
        omega : array_like
            Angular frequencies, rad/s.

        Returns
        -------
        FrequencyResponse
            ``.response`` is (output, input, omega); infinite where ω is a pole.
        """
        w = frequencies(omega, "frequency_response")
        g = self._at(np.asarray(1j * w, dtype=np.complex128))
        return FrequencyResponse(omega=w, response=g, outputs=self.outputs, inputs=self.inputs)

    def simulate(
        self,
        *,
        u: Any,
        dt: float | None = None,
        initial_state: ArrayLike | None = None,
        intersample: str | Sequence[str] | None = None,
        intervals: int | None = None,
    ) -> F64:
        """Exact response to a sampled or given input.

        Parameters
        ----------
        u : array_like, str, callable, or a list of these, or Signals
            Input: samples (time,) or (input, time), or signals as text or functions of t, one per input; or
            `mf.signals`, which bring dt and intersample.
            Before t = 0 (seen through a delay) samples were zero, while text and functions are evaluated
            at negative times.
        dt : float
            Sampling interval, s.
        initial_state : array_like, shape (states,), optional
            State at t = 0; for a transfer function with n poles y, y', … y⁽ⁿ⁻¹⁾ of the free response
            (output after output). Default: zero.
        intersample : {"auto", "smooth", "zoh", "foh"} or a sequence of them, default "auto"
            What the input does between samples; "auto": as its samples say, see `modfun.Record`, and
            smooth for text and functions.
        intervals : int, optional
            Number of sampling intervals, needed only when no input is an array.

        Returns
        -------
        ndarray, shape (time,) or (output, time)
            Output at 0, dt, …; one-dimensional for one output.

        Raises
        ------
        SpecError, DataError
            Input or state of the wrong size, or dt not positive.
        """
        outputs, inputs = self.shape
        if isinstance(u, Signals):
            u.agree("simulating", dt=dt, intervals=intervals, intersample=intersample)
            u = u.arranged("simulating", self.inputs, inputs)
            dt, intervals, intersample = u.dt, u.intervals, u.intersample
        if dt is None:
            raise SpecError("simulating: give dt=, the sampling interval in s")
        given = sources(u, inputs)
        lengths = {np.size(s) for s in given if is_samples(s) and np.ndim(s)}  # type: ignore[arg-type]
        if intervals is None:
            if not lengths:
                raise SpecError("simulating a signal of time: say how long, intervals=N for N + 1 samples")
            intervals = max(lengths) - 1
        y = self.respond(given, dt, intervals, initial_state, AUTO if intersample is None else intersample)
        return y[0] if outputs == 1 else y

    def respond(
        self,
        inputs: Sequence[Any],
        dt: float,
        intervals: int,
        x0: ArrayLike | None,
        intersample: str | Sequence[str],
        held: bool = False,
    ) -> F64:
        """`simulate` of a list, output always (output, time); `held`: before t = 0 at its first value."""
        dt, intervals = steps_of(dt, intervals)
        a, b, c, d, scale = self.scaled()
        start = np.zeros(a.shape[0]) if x0 is None else reals("simulating", "initial_state", x0)
        if start.shape != scale.shape or not np.all(np.isfinite(start)):
            raise SpecError(
                f"simulating: initial_state has shape {start.shape}, the system has {scale.size} states; "
                "give that many finite numbers (of a transfer function y, y', …, output after output)"
            )
        kinds = intersample_kinds(intersample, inputs)
        begin, y = np.ascontiguousarray(start * scale), np.empty((len(c), intervals + 1))
        for late, rows in self.alike():
            own = a, b, np.ascontiguousarray(c[rows]), np.ascontiguousarray(d[rows])
            y[rows] = respond(own, begin, inputs, dt, intervals, kinds, late, held)
        if not np.all(np.isfinite(y)):
            raise DataError(
                f"simulating: the response overflows within {intervals * dt:g} s "
                f"(fastest growing pole {self.poles().real.max():g} rad/s); simulate a shorter time"
            )
        return y

    def step(self, duration: float, intervals: int = 500) -> tuple[F64, F64]:
        """Unit step response.

        Parameters
        ----------
        duration : float
            Length in seconds.
        intervals : int
            Number of sampling intervals; the response is exact for any.

        Returns
        -------
        t : ndarray, shape (time,)
        y : ndarray, shape (time,), or (output, input, time) with several channels
        """
        intervals = whole("step", "intervals", intervals, 1, MOST_SAMPLES)
        if not real("step", "duration", duration) > 0:
            raise DataError(f"step: duration is {duration}; give seconds, above 0")
        outputs, inputs = self.shape
        y = np.empty((outputs, inputs, intervals + 1))
        for j in range(inputs):
            u: list[Any] = [(lambda t, on=(j == k): np.where(t >= 0, float(on), 0.0)) for k in range(inputs)]
            y[:, j] = self.respond(u, duration / intervals, intervals, None, "zoh")
        t: F64 = np.arange(intervals + 1.0) * (duration / intervals)
        return t, y[0, 0] if self.shape == (1, 1) else y

    def impulse(self, duration: float, intervals: int = 500) -> tuple[F64, F64]:
        """Unit impulse response; a direct path adds an impulse at its delay, which is not in it.

        Parameters
        ----------
        duration : float
            Length in seconds.
        intervals : int
            Number of sampling intervals; the response is exact for any.

        Returns
        -------
        t : ndarray, shape (time,)
        y : ndarray, shape (time,), or (output, input, time) with several channels
        """
        a, b, c, _, _ = self.scaled()  # y' of the step response has the output c(ax + bu)
        rate = replace(self, numerators=None, denominators=None, matrices=(a, b, c @ a, c @ b))
        return rate.step(duration, intervals)

    def without_delays(self) -> LTI:
        """The same system with all delays 0."""
        return replace(self, delays=(0.0,) * self.shape[1])

    # Other forms -----------------------------------------------------------------------------

    def to_ss(self) -> LTI:
        """State space with, for a transfer function, the states y, y', … of the free response.

        That is the observable companion form: C picks y, A shifts to the next derivative, B holds the
        Markov parameters. Several outputs, and paths with denominators of their own, stand one after
        the other.

        Raises
        ------
        SpecError
            A delay differs from output to output: a state has one delay per input.
        """
        if self.matrices is not None:
            return self
        late = self.input_delays("to_ss")
        a, b, c, d, scale = self.scaled()
        made = state_space(a / scale[:, None] * scale, b / scale[:, None], c * scale, d, late)
        return replace(made, inputs=self.inputs, outputs=self.outputs)

    @property
    def A(self) -> F64:
        """State matrix of `to_ss`."""
        return self.to_ss()._state()[0]

    @property
    def B(self) -> F64:
        """Input matrix of `to_ss`."""
        return self.to_ss()._state()[1]

    @property
    def C(self) -> F64:
        """Output matrix of `to_ss`."""
        return self.to_ss()._state()[2]

    @property
    def D(self) -> F64:
        """Feedthrough matrix of `to_ss`."""
        return self.to_ss()._state()[3]

    def polynomials(self) -> tuple[Polynomials, Polynomials]:
        """Numerators and monic denominators, each (output, input), in descending powers of s."""
        if self.matrices is None:
            assert self.numerators is not None
            assert self.denominators is not None
            return self.numerators, self.denominators
        return transfer(*self.matrices)

    def to_control(self, pade: int | None = None) -> Any:
        """The same as a python-control object with the same names of channels (extra ``control``).

        Parameters
        ----------
        pade : int, optional
            Order of the Padé approximation of the delays, at least 1; needed if there are any. It is good
            up to about pade/delay rad/s.

        Raises
        ------
        SpecError
            There is a delay and `pade` is not given, or is not a whole number above 0; or no input.
        """
        if self.shape[1] == 0:
            raise SpecError("to_control: a free motion has no input, and systems of python-control need one")
        if self.matrices is not None:
            made = matrices_to_control(self.matrices, self.input_delays("to_control"), pade)
        else:
            made = polynomials_to_control(*self.polynomials(), self.delays, pade)
        return labelled(made, self.inputs, self.outputs)

    def to_scipy(self) -> Any:
        """The same as a `scipy.signal.lti` object; delays are refused, SciPy has none."""
        refuse_late(self.delays)
        single = self.matrices is None and self.shape == (1, 1)
        return to_scipy((self.num, self.den) if single else self.to_ss()._state())

    # In print --------------------------------------------------------------------------------

    def __repr__(self) -> str:
        if self.matrices is not None:
            parts = [f"{n} =\n{m}" for n, m in zip("ABCD", self.matrices, strict=True)]
            waiting = f"\ndelay = {self.delay} s" if any(self.delays) else ""
            return "LTI state space\n" + "\n".join(parts) + waiting
        return fractions(*self.polynomials(), self.path_delays)

    def _repr_latex_(self) -> str:
        if self.matrices is not None:
            return in_matrices(self.matrices, self.delays)
        return in_fractions(*self.polynomials(), self.path_delays)

    # Inside ----------------------------------------------------------------------------------

    def _at(self, s: C128) -> C128:
        """G at complex frequencies (s,), as (output, input, s)."""
        g = np.empty((*self.shape, s.size), dtype=np.complex128)
        if self.matrices is None:
            assert self.numerators is not None
            assert self.denominators is not None
            with np.errstate(all="ignore"):
                for i, (nums, dens) in enumerate(zip(self.numerators, self.denominators, strict=True)):
                    for j, (n, d) in enumerate(zip(nums, dens, strict=True)):
                        top, bottom = np.polyval(n, s), np.polyval(d, s)
                        g[i, j] = np.where((bottom == 0) & (top != 0), np.inf, top / bottom)
        else:
            g[:] = gains(*self.matrices, s).transpose(1, 2, 0)
        with np.errstate(over="ignore", invalid="ignore"):
            g *= np.exp(-s * self.path_delays[:, :, None])
        return g

    def alike(self) -> list[tuple[tuple[float, ...], list[int]]]:
        """Delays of the inputs, and the outputs that see them so late."""
        found: dict[tuple[float, ...], list[int]] = {}
        for output, late in enumerate(map(tuple, self.path_delays.tolist())):
            found.setdefault(late, []).append(output)
        return list(found.items())

    def states_of(self, rows: Sequence[int]) -> NDArray[np.intp]:
        """Positions of the states of `scaled` that belong to outputs: of a state space all."""
        if self.matrices is not None:
            return np.arange(len(self.matrices[0]))
        leads = self.scaled()[2].T  # the first state of each block is an output's y
        blocks = np.cumsum(leads.any(axis=1)) - 1
        outputs = np.argmax(leads[leads.any(axis=1)], axis=1)
        return np.flatnonzero(np.isin(outputs[blocks], rows))

    def input_delays(self, what: str) -> tuple[float, ...]:
        """Delay of each input, s, for what has no delay per path."""
        found = self.alike()
        if len(found) > 1:
            raise SpecError(
                f"{what}: delays differ from output to output, {self.delays} s; a state space has one per "
                "input; take a Padé form, mf.ss(system.to_control(pade=3)), or the outputs of a fit one by "
                "one, fit.path_model(output)"
            )
        return found[0][0] if found else ()

    def _state(self) -> Matrices:
        assert self.matrices is not None
        return self.matrices

    def scaled(self) -> tuple[F64, F64, F64, F64, F64]:
        """A, B, C, D for computing, and the factors from the public states to its states.

        A companion matrix of a fast or slow system holds powers of its frequency; counting time in
        units of that frequency keeps the entries near 1.
        """
        if self.matrices is not None:
            return (*self.matrices, np.ones(self.matrices[0].shape[0]))
        return observable(*self.polynomials())


def state_space(a: F64, b: F64, c: F64, d: F64, delays: Delays) -> LTI:
    """A state space of matrices that fit each other."""
    if not all(np.all(np.isfinite(m)) for m in (a, b, c, d)):
        raise SpecError("mf.ss: a matrix holds nan or inf; all entries must be finite")
    matrices = (frozen(np.array(a)), frozen(np.array(b)), frozen(np.array(c)), frozen(np.array(d)))
    return LTI(None, None, matrices, delays)
