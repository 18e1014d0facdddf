"""Simulated records: noise-free responses, noise and initial states by their addresses."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._core import normals
from ..base.arguments import by_name, public, real, reals, whole
from ..base.arrays import F64
from ..base.between import AUTO
from ..base.samples import MOST_SAMPLES
from ..equations.nonlinear import NonlinearModel
from ..errors import DataError, ModfunWarning, SpecError
from ..models.process import ProcessNoise
from ..records.record import Record
from ..signals import Signals
from ..signals.sources import Source, evaluate, is_samples, jump_of, sources
from ..systems.lti import LTI
from ..systems.making import linear
from ..systems.propagate import intersample_kinds, respond
from ..timelag.system import DelaySystem
from .driven import driven, measured

__all__ = ["Experiment", "doubtful_nsr", "experiment", "simulate"]

MOST_NOISE = 2.0  # relative to the response; above it a level is probably in other units


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
    read, jumps : tuple of str
        Sentences about texts and functions that are not taken as smooth, and that jump and are.
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
    read: tuple[str, ...] = ()
    jumps: tuple[str, ...] = ()

    def response(self, state: F64) -> F64:
        """Noise-free outputs from another state at t = 0."""
        if isinstance(self.system, LTI):
            return np.asarray(self.y + np.tensordot(state, self.free, axes=1))
        grid: F64 = np.arange(float(self.y.shape[1])) * self.dt
        return self.system.respond(self.inputs, grid, state, self.kinds)


def experiment(
    system: LTI | NonlinearModel | DelaySystem,
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
    if not isinstance(system, LTI | NonlinearModel | DelaySystem):
        raise SpecError(
            f"simulate: the system is of type {type(system).__name__}; give mf.tf(num, den), "
            "mf.ss(A, B, C, D), mf.Equation(...).model({name: value}), fit.model "
            "or mf.timelag.DelaySystem(...)"
        )
    names = None
    if isinstance(input, Signals):
        input.agree("simulate", duration=duration, intervals=intervals, intersample=intersample)
        input = input.arranged("simulate", getattr(system, "inputs", None), system.shape[1])
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
    given = sources(input, system.shape[1])
    t: F64 = np.arange(count + 1.0) * dt
    u = np.reshape([evaluate(source, t) for source in given], (len(given), t.size))
    kinds = intersample_kinds(AUTO if intersample is None else intersample, list(u))
    told = intersample not in (None, AUTO) or names is not None
    read, jumps = ((), ()) if told else _as_seen(given, u, t, kinds)
    if not isinstance(system, LTI):
        state = np.zeros(len(system.states)) if start is None else reals("simulate", "start", start)
        y, x = system.trajectory(given, t, state, kinds)
        size = np.sqrt(np.mean(x**2, axis=1))
        none = np.zeros((0, *y.shape))
        return Experiment(
            system,
            dt,
            u,
            y,
            np.sqrt(np.mean(y**2, axis=1)),
            size,
            none,
            tuple(given),
            kinds,
            state,
            names,
            read,
            jumps,
        )
    y = system.respond(given, dt, count, None, kinds)
    a, b, _, _, scale = system.scaled()
    n = scale.size
    states = np.zeros((n, t.size))
    for late, seen in system.alike():
        own = system.states_of(seen)
        if not own.size:  # a gain has none
            continue
        words = (a, b, np.eye(n)[own], np.zeros((own.size, len(given)))), np.zeros(n), given, dt, count, kinds
        states[own] = respond(*words, late) / scale[own, None]
    silence = np.zeros_like(u)
    free = [system.respond(list(silence), dt, count, unit, "zoh") for unit in np.eye(n)]
    return Experiment(
        system=system,
        dt=dt,
        u=u,
        y=y,
        rms=np.sqrt(np.mean(y**2, axis=1)),
        state_rms=np.sqrt(np.mean(states**2, axis=1)),
        free=np.array(free).reshape(n, *y.shape),
        kinds=kinds,
        names=names,
        read=read,
        jumps=jumps,
    )


def _as_seen(
    given: Sequence[Source], u: F64, t: F64, kinds: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What to say of texts and functions that are not taken as smooth, and of those that jump and are."""
    read, jumps = [], []
    for source, values, kind in zip(given, u, kinds, strict=True):
        if is_samples(source):
            continue
        name = (
            repr(source) if isinstance(source, str) else "from " + getattr(source, "__name__", "a function")
        )
        if kind != "smooth":
            how = "held from sample to sample" if kind == "zoh" else "straight between samples"
            read.append(f"The input {name} is {how} ({kind}), as its samples look.")
        elif (at := jump_of(source, values, t)) is not None:
            jumps.append(
                f"The input {name} jumps at about t = {at:.4g} s and is smooth elsewhere, which samples do "
                "not show: fits of its records are biased. With intersample='zoh' its samples are held."
            )
    return tuple(read), tuple(jumps)


@public
def simulate(
    system: LTI | NonlinearModel | DelaySystem,
    *,
    input: Any = None,
    duration: float | None = None,
    intervals: int | None = None,
    nsr: float = 0.0,
    process_noise: ArrayLike | ProcessNoise = 0.0,
    initial_state: str | ArrayLike | Mapping[str, float] = "zero",
    intersample: str | Sequence[str] | None = None,
    seed: int = 0,
    replicate: int = 0,
    outputs: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
) -> Record:
    """A simulated record: the response, exact of linear systems, with white noise on the output if asked for.

    Parameters
    ----------
    system : LTI, NonlinearModel or DelaySystem, or a system of python-control or SciPy
        The system.
    input : Signals, str, array_like, callable, or a list of these, optional
        Input: `mf.signals`, which bring their duration, sampling, form between samples and names; or, one
        an input of the system, text such as ``"sin(t**2/5)"``, a function of t, or intervals + 1 samples.
        Seen through a delay before t = 0, text and functions are evaluated at negative times; samples of a
        linear system were zero, those of equations and delay systems at their first value. None for a system
        without inputs.
    duration : float
        Length T of the record, s; that of `mf.signals` where they are the input.
    intervals : int
        Number of sampling intervals N; the record has N + 1 samples. As `duration`.
    nsr : float, default 0
        Standard deviation of the noise over the root mean square of the noise-free response from rest,
        output by output; of equations, which need not rest at zero, the response from `initial_state`.
    process_noise : float, sequence of float or ProcessNoise, default 0
        Level of white noise w that drives a linear system itself, as turbulence or load do: root of its power
        spectral density (two-sided, of hertz), as `Fit.process_noise` tells it. Of transfer functions on the
        right of A(p) y = B(p) u + w, one for all outputs or one per output; of state spaces on that of
        x' = A x + B u + w, one for all states or one per state; or ProcessNoise, through inputs of the system
        that `input` then leaves out. Its response is stationary where the system is stable, else it begins
        at zero.
    initial_state : "zero", "random", array_like or mapping, default "zero"
        State at t = 0, of a delay system also before it. "random": normal, each state with the root mean
        square that it has in the response from rest. An array: the states, of a transfer function y, y', … of
        the free response, of equations in the order of `NonlinearModel.states`, or by the names of these.
    intersample : {"auto", "smooth", "zoh", "foh"} or a sequence of them, optional
        What the input does between its samples; text and functions taken as smooth are exact. Default: what
        `mf.signals` do, else "auto": as the samples look, as in `Record`.
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

    Warns
    -----
    ModfunWarning
        Where nsr is above 2, as numbers in per cent or decibel are; where text or a function jumps and is
        taken as smooth.

    See Also
    --------
    modfun.signals : Inputs of experiments.
    modfun.MonteCarlo : Many records.
    modfun.LTI.simulate : A response to a record.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.3 (noise-to-signal ratio).

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
    if (doubt := doubtful_nsr("simulate", nsr)) is not None:
        warnings.warn(doubt, ModfunWarning, stacklevel=3)
    for name, value in (("seed", seed), ("replicate", replicate)):
        whole("simulate", name, value, 0, 2**64 - 1)
    entire = linear(system, "simulate")
    begin: Any = initial_state
    if isinstance(entire, NonlinearModel):
        begin = by_name("simulate", "initial_state", begin, entire.states)
    fixed = None if isinstance(begin, str) else begin
    system = measured(entire, process_noise)
    found = experiment(
        system, input=input, duration=duration, intervals=intervals, intersample=intersample, start=fixed
    )
    for text in found.jumps:
        warnings.warn(f"simulate: {text}", ModfunWarning, stacklevel=3)
    state = _initial_state(begin, found, seed, replicate)
    random = isinstance(initial_state, str) and initial_state == "random"
    still = not isinstance(system, LTI) and not random
    y = found.y if still else found.response(state)
    if isinstance(process_noise, ProcessNoise) or np.any(np.asarray(process_noise) != 0):
        y = y + driven(entire, process_noise, found.dt, found.y.shape[1] - 1).response(seed, replicate)
    if nsr > 0:
        if not np.all(found.rms > 0):
            raise DataError(
                "simulate: the response from rest is zero, so that nsr, noise relative to it, says nothing; "
                "give an input that moves every output, or nsr=0 and add noise of your own"
            )
        y = y + nsr * found.rms[:, None] * np.array(
            [normals(seed, "noise_y", k, replicate, 0, y.shape[1]) for k in range(y.shape[0])]
        )
    return Record(
        y=y,
        u=found.u if len(found.u) else None,
        dt=found.dt,
        outputs=getattr(system, "outputs", None) if outputs is None else outputs,
        inputs=(found.names or getattr(system, "inputs", None)) if inputs is None else inputs,
        intersample=list(found.kinds),
    )


def doubtful_nsr(what: str, nsr: float) -> str | None:
    """What to say of a noise level that was probably meant in per cent or decibel."""
    if nsr <= MOST_NOISE:
        return None
    return (
        f"{what}: nsr={nsr:g} is noise of {nsr:g} times the rms of the response; if {nsr:g} % is meant, give "
        f"nsr={nsr / 100:g}, if a signal {nsr:g} dB above the noise, nsr={10 ** (-nsr / 20):.3g}"
    )


def _initial_state(given: str | ArrayLike, found: Experiment, seed: int, replicate: int) -> F64:
    n = found.state_rms.size
    if isinstance(given, str):
        if given == "zero":
            return np.zeros(n)
        if given == "random":
            return found.state_rms * normals(seed, "initial_state", 0, replicate, 0, n)
        raise SpecError(f"simulate: initial_state={given!r} is unknown; give 'zero', 'random' or {n} numbers")
    state = reals("simulate", "initial_state", given)
    if state.shape != (n,) or not np.all(np.isfinite(state)):
        raise SpecError(
            f"simulate: initial_state has shape {state.shape}, the system {n} states; give that many "
            "finite numbers (of a transfer function y, y', …)"
        )
    return state
