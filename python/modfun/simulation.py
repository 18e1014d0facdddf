"""Simulated records, Fourier coefficients of records and the regressors made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .arguments import public, real, reals, whole
from .errors import DataError, SpecError
from .expressions import evaluate, sources
from .lti import LTI
from .masking import refuse_own_noise
from .nonlinear import NonlinearModel
from .options import MOST
from .propagate import intersample_kinds, respond
from .records import Record
from .samples import MOST_SAMPLES
from .signals import Signals
from .structures import TransferFunction
from .timelag import DelaySystem

__all__ = [
    "Coefficients",
    "Experiment",
    "Regressors",
    "coefficients",
    "experiment",
    "regressors",
    "simulate",
    "spectrum",
]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]
RULES = ("staircase", "trapezoid", "parabolic", "gregory")


# Simulated records -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Experiment:
    """A noise-free response from rest and what noise and initial states are scaled by.

    Attributes
    ----------
    system : LTI, NonlinearModel or DelaySystem
    dt : float
        Sampling interval, s.
    u : ndarray, shape (input, time)
        Input samples.
    y : ndarray, shape (output, time)
        Response from rest; of equations, which need not rest at zero, from a given state.
    rms : ndarray, shape (output,)
        Root mean square of `y`.
    state_rms : ndarray, shape (states,)
        Root mean square of the states of the response from rest: of a transfer function y, y', …
        (less what the input feeds through to them at once), of a state space its own states.
    free : ndarray, shape (states, output, time)
        Response to each state at 1 at t = 0, without input; of equations none, (0, output, time).
    inputs : tuple of Source
        Inputs of equations as given.
    kinds : tuple of str
        What inputs do between samples.
    start : ndarray, shape (states,), or None
        State of equations at t = 0 of `y`.
    names : tuple of str, or None
        Of the inputs, where `Signals` name them.
    """

    system: LTI | NonlinearModel | DelaySystem
    dt: float
    u: F64
    y: F64
    rms: F64
    state_rms: F64
    free: F64
    inputs: tuple[Any, ...] = ()
    kinds: tuple[str, ...] = ()
    start: F64 | None = None
    names: tuple[str, ...] | None = None

    def response(self, state: F64) -> F64:
        """Noise-free outputs from another state at t = 0."""
        if isinstance(self.system, LTI):
            return np.asarray(self.y + np.tensordot(state, self.free, axes=1))
        grid: F64 = np.arange(float(self.y.shape[1])) * self.dt
        return self.system.respond(self.inputs, grid, state, self.kinds)


def experiment(
    sys: LTI | NonlinearModel | DelaySystem,
    *,
    input: Any = None,
    duration: float | None = None,
    intervals: int | None = None,
    intersample: str | Sequence[str] | None = None,
    start: ArrayLike | None = None,
) -> Experiment:
    """Noise-free response from rest to an input; arguments as in `simulate`.

    `start` is the state from which the response of equations is taken.
    """
    if not isinstance(sys, LTI | NonlinearModel | DelaySystem):
        raise SpecError(
            f"simulate: the system is a {type(sys).__name__}; give mf.tf(num, den), mf.ss(A, B, C, D), "
            "mf.Equation(...).model({name: value}), fit.model or mf.timelag.DelaySystem(...)"
        )
    names = None
    if isinstance(input, Signals):
        input.agree("simulate", duration=duration, intervals=intervals, intersample=intersample)
        input = input.arranged("simulate", getattr(sys, "inputs", None), sys.shape[1])
        duration, intervals, intersample = input.duration, input.intervals, input.intersample
        names = input.inputs
    if duration is None or intervals is None:
        raise SpecError(
            "simulate: give duration= in s and intervals=, or input= of mf.signals, which have both"
        )
    if not real("simulate", "duration", duration) > 0:
        raise SpecError(f"simulate: duration={duration!r} must be a time in seconds above 0")
    count = whole("simulate", "intervals", intervals, 1, MOST_SAMPLES)
    dt = float(duration) / count
    given = sources(input, sys.shape[1])
    kinds = intersample_kinds("smooth" if intersample is None else intersample, len(given))
    t: F64 = np.arange(count + 1.0) * dt
    u = np.reshape([evaluate(source, t) for source in given], (len(given), t.size))
    if not isinstance(sys, LTI):
        state = np.zeros(len(sys.states)) if start is None else reals("simulate", "start", start)
        y, x = sys.trajectory(given, t, state, kinds)
        size = np.sqrt(np.mean(x**2, axis=1))
        none = np.zeros((0, *y.shape))
        return Experiment(
            sys, dt, u, y, np.sqrt(np.mean(y**2, axis=1)), size, none, tuple(given), kinds, state, names
        )
    y = sys.respond(given, dt, count, None, kinds)
    a, b, _, _, scale = sys.scaled()
    n = scale.size
    states = (
        respond(
            (a, b, np.eye(n), np.zeros((n, len(given)))), np.zeros(n), given, dt, count, kinds, sys.delays
        )
        / scale[:, None]
    )
    silence = np.zeros_like(u)
    free = [sys.respond(list(silence), dt, count, unit, "zoh") for unit in np.eye(n)]
    return Experiment(
        system=sys,
        dt=dt,
        u=u,
        y=y,
        rms=np.sqrt(np.mean(y**2, axis=1)),
        state_rms=np.sqrt(np.mean(states.reshape(n, t.size) ** 2, axis=1)),  # a gain has no states
        free=np.array(free).reshape(n, *y.shape),
        kinds=kinds,
        names=names,
    )


@public
def simulate(
    sys: LTI | NonlinearModel | DelaySystem,
    *,
    input: Any = None,
    duration: float | None = None,
    intervals: int | None = None,
    nsr: float = 0.0,
    initial_state: str | ArrayLike = "zero",
    intersample: str | Sequence[str] | None = None,
    seed: int = 0,
    replicate: int = 0,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
) -> Record:
    """A simulated record: the response, exact of linear systems, with white noise on the output if asked for.

    Parameters
    ----------
    sys : LTI, NonlinearModel or DelaySystem
        The system.
    input : Signals, str, array_like, callable, or a list of these, optional
        Input: `mf.signals`, which bring their duration, sampling, form between samples and names; or, one
        an input of the system, text such as ``"sin(t**2/5)"``, a function of t, or intervals + 1 samples.
        Seen through a delay before t = 0, text and functions are evaluated at negative times, samples hold
        their first value. None for a system without inputs.
    duration : float
        Length T of the record, s; that of `mf.signals` where they are the input.
    intervals : int
        Number of sampling intervals N; the record has N + 1 samples. As `duration`.
    nsr : float, default 0
        Standard deviation of the noise over the root mean square of the noise-free response from rest,
        output by output; of equations, which need not rest at zero, the response from `initial_state`.
    initial_state : "zero", "random" or array_like, default "zero"
        State at t = 0, of a delay system also before it. "random": normal, each state with the root mean
        square that it has in the response from rest. An array: the states, of a transfer function y, y', … of
        the free response, of equations in the order of `NonlinearModel.states`.
    intersample : {"smooth", "zoh", "foh"} or a sequence of them, optional
        What the input does between its samples; text and functions taken as smooth are exact. Default:
        "smooth", or what `mf.signals` do.
    seed, replicate : int
        Address of the noise and of the random initial state: the same numbers for the same address,
        whatever the level of the noise.
    outputs, inputs : sequence of str, optional
        Names of the record's channels.

    Returns
    -------
    Record

    Raises
    ------
    SpecError, DataError
        Arguments that do not fit each other.

    Examples
    --------
    >>> import modfun as mf
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1)
    >>> rec.intervals
    256
    """
    if not real("simulate", "nsr", nsr) >= 0:
        raise SpecError(
            f"simulate: nsr={nsr!r} must be a number of at least 0 (noise sd over rms of the output)"
        )
    for name, value in (("seed", seed), ("replicate", replicate)):
        whole("simulate", name, value, 0, 2**64 - 1)
    fixed = None if isinstance(initial_state, str) else initial_state
    found = experiment(
        sys, input=input, duration=duration, intervals=intervals, intersample=intersample, start=fixed
    )
    state = _initial_state(initial_state, found, seed, replicate)
    random = isinstance(initial_state, str) and initial_state == "random"
    still = not isinstance(sys, LTI) and not random
    y = found.y if still else found.response(state)
    if nsr > 0:
        if not np.all(found.rms > 0):
            raise DataError(
                "simulate: the response from rest is zero, so that nsr, noise relative to it, says nothing; "
                "give an input that moves every output, or nsr=0 and add noise of your own"
            )
        y = y + nsr * found.rms[:, None] * np.array(
            [_core.normals(seed, "noise_y", k, replicate, 0, y.shape[1]) for k in range(y.shape[0])]
        )
    return Record(
        y=y,
        u=found.u if len(found.u) else None,
        dt=found.dt,
        outputs=getattr(sys, "outputs", None) if outputs is None else outputs,
        inputs=(found.names or getattr(sys, "inputs", None)) if inputs is None else inputs,
        intersample=list(found.kinds),
    )


def _initial_state(given: str | ArrayLike, found: Experiment, seed: int, replicate: int) -> F64:
    n = found.state_rms.size
    if isinstance(given, str):
        if given == "zero":
            return np.zeros(n)
        if given == "random":
            return found.state_rms * _core.normals(seed, "initial_state", 0, replicate, 0, n)
        raise SpecError(f"simulate: initial_state={given!r} is unknown; give 'zero', 'random' or {n} numbers")
    state = reals("simulate", "initial_state", given)
    if state.shape != (n,) or not np.all(np.isfinite(state)):
        raise SpecError(
            f"simulate: initial_state has shape {state.shape}, the system {n} states; give that many "
            "finite numbers (of a transfer function y, y', …)"
        )
    return state


# Fourier coefficients ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Fourier coefficients of a record over [0, T], report, eqs. (8) and (21).

    Attributes
    ----------
    omega : ndarray, shape (harmonic,)
        m·2π/T in rad/s, m = 0, 1, …
    y : ndarray of complex, shape (output, harmonic)
    u : ndarray of complex, shape (input, harmonic)
    """

    omega: F64
    y: C128
    u: C128


@public
def coefficients(rec: Record, harmonics: int, rule: str = "gregory") -> Coefficients:
    """Fourier coefficients V(m) = (1/T) ∫ v(t) exp(−i m 2π t/T) dt of a record, m = 0 … harmonics.

    Parameters
    ----------
    rec : Record
    harmonics : int
        Highest harmonic, at most half the number of intervals.
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature of the outputs and of smooth inputs, report, eq. (21); held and linearly interpolated
        inputs are integrated exactly.

    Returns
    -------
    Coefficients
    """
    _check_rule(rule)
    top = whole("coefficients", "harmonics", harmonics, 0, MOST)
    y, u = spectrum(rec, top, rule)
    return Coefficients(omega=np.arange(top + 1.0) * (2 * np.pi / rec.duration), y=y, u=u)


def spectrum(
    rec: Record, top: int, rule: str, delays: Sequence[float] | None = None, lead: int = 0
) -> tuple[C128, C128]:
    """Coefficients 0 … `top` of outputs and inputs (channel, line), the inputs late by `delays`, s.

    Raises
    ------
    DataError
        Too few samples.
    """
    intervals = rec.intervals - lead
    if 2 * top > intervals:
        raise DataError(
            f"the record has {intervals} sampling intervals"
            + (f" after the {lead} that the delays take" if lead else "")
            + f", so harmonics go up to {intervals // 2}, not {top}: lower harmonics, or sample faster"
        )
    kinds = [rule if k == "smooth" else k for k in rec.intersample]
    late = [d / rec.dt if rec.dt else 0.0 for d in delays or (0.0,) * len(rec.inputs)]
    t = None if rec.dt else rec.t - rec.t[0]
    y = _core.coefficients(rec.y, top, [rule] * len(rec.outputs), [0.0] * len(rec.outputs), lead, t)
    return y, _core.coefficients(rec.u, top, kinds, late, lead, t)


# Regressors --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Regressors:
    """The modulated regression target ≈ gamma @ theta, report, eqs. (14) to (18).

    Attributes
    ----------
    gamma : ndarray, shape (row, parameter)
        Columns Δⁿ of −sⁿ⁻ⁱY for a1 … an and of s^k U for the numerators; the real parts of the rows, then
        the imaginary parts.
    target : ndarray, shape (row,)
        Δⁿ of sⁿY.
    param_names : tuple of str
    index : ndarray of int
        Modulating index m of the complex rows.
    """

    gamma: F64
    target: F64
    param_names: tuple[str, ...]
    index: NDArray[np.int64]
    _differences: tuple[F64, F64]
    _s: C128
    _order: int
    _unit: float

    def differenced(self, lines: C128) -> F64:
        """Rows of further terms, given on the lines 0 … M + n: (term, line) becomes (row, term)."""
        re, im = self._differences
        return np.concatenate([re @ lines.real.T, im @ lines.imag.T])

    def covariance(self, theta: ArrayLike) -> F64:
        """Covariance of the rows under white output noise of variance 1 at the samples.

        The noise enters the lines as A(s)E, independent with variance |A|² Σw²/N², a half of it in Re
        and in Im (all in Re at m = 0); Δⁿ then correlates the rows.

        Parameters
        ----------
        theta : array_like, shape (parameter,)
            Parameters; only a1 … an matter.

        Returns
        -------
        ndarray, shape (row, row)
        """
        values = np.asarray(theta, dtype=np.float64)
        if values.shape != (len(self.param_names),):
            raise SpecError(
                f"covariance: {values.size} numbers for the parameters {', '.join(self.param_names)}"
            )
        a = np.polyval(np.concatenate([[1.0], values[: self._order]]), self._s)
        variance = self._unit * np.abs(a) ** 2
        variance[1:] /= 2
        re, im = ((d * variance) @ d.T for d in self._differences)
        rows = self.target.size
        full = np.zeros((rows, rows))
        full[: len(re), : len(re)] = re
        full[len(re) :, len(re) :] = im
        return full


@public
def regressors(
    rec: Record,
    model: TransferFunction,
    *,
    harmonics: int,
    rule: str = "gregory",
    extended: bool = True,
) -> Regressors:
    """Modulated regressors of a transfer function, for estimators of your own.

    Parameters
    ----------
    rec : Record
        One output.
    model : TransferFunction
        Order n, numerators and known delays; a delay makes the window start as many samples late.
    harmonics : int
        Highest modulating index M; Fourier coefficients up to M + n are used.
    rule : {"gregory", "parabolic", "trapezoid", "staircase"}
        Quadrature, see `coefficients`.
    extended : bool, default True
        Indices from −⌊n/2⌋, which loses no information, or the report's 0 … M.

    Returns
    -------
    Regressors

    Raises
    ------
    SpecError
        Not a TransferFunction, several outputs, or harmonics that are no whole number.
    DataError
        A delay with uneven samples, or one as long as the record.

    Examples
    --------
    The report's one-shot estimate, eq. (19):

    >>> import modfun as mf
    >>> import numpy as np
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> r = mf.regressors(rec, mf.TransferFunction(poles=2, zeros=0), harmonics=6)
    >>> np.linalg.lstsq(r.gamma, r.target, rcond=None)[0].round(3)
    array([3., 8., 5.])
    """
    if not isinstance(model, TransferFunction):
        raise SpecError(f"regressors: the model is a {type(model).__name__}; give a TransferFunction")
    if len(rec.outputs) != 1:
        raise SpecError(
            f"regressors: the record has {len(rec.outputs)} outputs; take one, rec.select(outputs=[...])"
        )
    refuse_own_noise(rec, "regressors", "take a piece without them, rec.window(start, stop)")
    _check_rule(rule)
    layout = model.plain_layout(rec.inputs, "regressors")
    n, degrees, delays = layout.orders[0], layout.numerators[0], layout.delays(np.zeros(0))
    top = whole("regressors", "harmonics", harmonics, 0, MOST) + n
    lead = 0
    if any(delays):
        if rec.dt is None:
            raise DataError("regressors: a delay needs even sampling; resample the record")
        lead = ceil(max(delays) / rec.dt - 1e-9)
        if lead >= rec.intervals:
            raise DataError(
                f"regressors: the delay of {max(delays):g} s leaves nothing of a record of {rec.duration:g} s"
            )
    y, u = spectrum(rec, top, rule, delays, lead)
    intervals = rec.intervals - lead
    length = rec.duration - lead * (rec.dt or 0.0)
    s = np.asarray(1j * np.arange(top + 1.0) * (2 * np.pi / length), dtype=np.complex128)
    columns = [s**n * y[0]] + [-(s ** (n - i)) * y[0] for i in range(1, n + 1)]
    for k, degree in enumerate(degrees):
        if degree is not None:
            columns += [s**power * u[k] for power in range(degree, -1, -1)]
    index = np.arange(-(n // 2) if extended else 0, top - n + 1)
    re, im = _differences(n, index, top)
    if extended and n % 2 == 0:
        im = im[1:]  # the row of m = −n/2 is real
    lines = np.array(columns)
    rows = np.concatenate([re @ lines.real.T, im @ lines.imag.T])
    weights = _core.quadrature_weights(rule, intervals, None if rec.dt else rec.t - rec.t[0])
    return Regressors(
        gamma=np.ascontiguousarray(rows[:, 1:]),
        target=np.ascontiguousarray(rows[:, 0]),
        param_names=layout.param_names,
        index=index,
        _differences=(re, im),
        _s=s,
        _order=n,
        _unit=float(np.sum(weights**2)) / intervals**2,
    )


def _differences(n: int, index: NDArray[np.int64], top: int) -> tuple[F64, F64]:
    """Δⁿ as matrices on the real and on the imaginary parts of the lines 0 … top.

    A line of negative index is the conjugate of its mirror image: its real part adds to the mirror's
    column, its imaginary part subtracts.
    """
    re, im = np.zeros((index.size, top + 1)), np.zeros((index.size, top + 1))
    for row, m in enumerate(index):
        for j in range(n + 1):
            factor = (-1.0) ** (n - j) * comb(n, j)
            re[row, abs(m + j)] += factor
            im[row, abs(m + j)] += factor * np.sign(m + j)
    return re, im


def _check_rule(rule: str) -> None:
    if rule not in RULES:
        raise SpecError(f"rule={rule!r} is unknown; choose among {', '.join(map(repr, RULES))}")
