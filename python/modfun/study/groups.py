"""Noise-free signals of each system, input and initial state of a study, and the records made of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._core import normals
from ..base.arrays import F64
from ..base.callables import source
from ..base.samples import numbered
from ..equations.nonlinear import NonlinearModel
from ..equations.state_space import StateSpace
from ..errors import DataError, SpecError
from ..experiments.driven import Driven, driven, measured
from ..experiments.simulation import Experiment, experiment
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..systems.lti import LTI
from .axes import Axis
from .functions import Failed, attempt, generator, refuse_unlike, series

__all__ = ["Group", "groups"]

HEARD = 20  # replicates whose noise is measured
SURELY, FAR = 6.0, 0.05  # Student's t with 19 degrees of freedom is beyond 6 once in 100,000 times


@dataclass(frozen=True, eq=False)
class Group:
    """System, input, initial state and kind of noise of some cells.

    Attributes
    ----------
    index : int
        Place among the groups.
    address : int
        Of random numbers: that of system, input and initial state, which kinds of noise share.
    system : LTI or NonlinearModel
    rest : Experiment
        Response from rest and what noise and random states are scaled by.
    y : ndarray, shape (output, time)
        Noise-free outputs with the fixed part of the initial state.
    start : ndarray, shape (states,)
        That state, of a linear system.
    free : ndarray, shape (states, output, time)
        Response to one standard deviation of each random state; no rows if none is random.
    intersample : tuple of str
    state, noise : callable or None
        Functions of the user that draw the initial state and the noise.
    drawn : bool
        Whether equations are integrated from a random state in each replicate.
    driven : Driven or None
        What noise in the system adds to each replicate.
    process_noise : float, tuple of float or ProcessNoise
        Its levels.
    noise_sd : float
        Standard deviation of the user's noise where its first draws contradict 1, else 1.
    """

    index: int
    address: int
    system: LTI | NonlinearModel
    rest: Experiment
    y: F64
    start: F64
    free: F64
    intersample: tuple[str, ...]
    state: Callable[..., Any] | None = None
    noise: Callable[..., Any] | None = None
    drawn: bool = False
    driven: Driven | None = None
    process_noise: Any = 0.0
    noise_sd: float = 1.0

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        if self.rest.names is not None:
            return self.rest.names
        return self.system.inputs or numbered("u", self.system.shape[1])

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.system.outputs or numbered("y", self.system.shape[0])

    @property
    def made(self) -> bool:
        """Whether Python makes its records: functions of the user, equations integrated, process noise."""
        return self.state is not None or self.noise is not None or self.drawn or self.driven is not None

    @property
    def scale(self) -> float:
        """What the noise levels of the core are in units of: of one output its root mean square, else 1."""
        return float(self.rest.rms[0]) if len(self.y) == 1 else 1.0

    @property
    def unit(self) -> F64:
        """Unit of the noise of each output: nsr refers to the root mean square of the response from rest."""
        return np.ones(1) if len(self.y) == 1 else self.rest.rms

    def names(self, structure: Any) -> tuple[str, ...]:
        """Names of a structure's parameters."""
        inputs = self.inputs
        if isinstance(self.process_noise, ProcessNoise) and not isinstance(structure, TransferFunction):
            inputs += self.process_noise.names  # which such a structure may have
        return tuple(structure.param_names(inputs, self.outputs))

    def truth(self, structure: Any) -> F64:
        """True parameters of a structure; nan where it does not hold the system.

        Those of equations go by their names, those of a state space by their places in its matrices.
        """
        if isinstance(self.system, LTI) and isinstance(structure, TransferFunction | StateSpace):
            try:
                return structure.theta(self.system)
            except SpecError:
                # A wrong number of inputs is a mistake, not a misfit: the names tell.
                return np.full(len(self.names(structure)), np.nan)
        alike = isinstance(self.system, NonlinearModel) and not isinstance(structure, TransferFunction)
        values = self.system.params if alike else {}  # type: ignore[union-attr]
        return np.array([values.get(name, np.nan) for name in self.names(structure)])

    def record(self, y: F64) -> Record:
        """A record with this group's input."""
        return Record(
            y=y,
            u=self.rest.u if len(self.rest.u) else None,
            dt=self.rest.dt,
            outputs=self.outputs,
            inputs=self.inputs,
            intersample=list(self.intersample),
        )

    def begin(self, seed: int, replicate: int) -> F64:
        """State at t = 0 of a replicate; `Failed` as `records`."""
        if self.state is not None:
            rng = generator("initial_state", seed, replicate, self.address)
            drawn = attempt("initial_state", self.state, rng)
            return series(drawn, "initial_state", self.rest.state_rms.shape, "the states at t = 0")
        if self.drawn or len(self.free):
            z = normals(seed, "initial_state", 0, replicate, self.address, self.rest.state_rms.size)
            return np.asarray(z * self.rest.state_rms)
        return self.start

    def clean(self, seed: int, replicate: int) -> F64:
        """Outputs of a replicate without noise, from its initial state; `Failed` as `records`."""
        if self.state is not None or self.drawn:
            return np.asarray(attempt("response", self.rest.response, self.begin(seed, replicate)))
        if len(self.free):
            z = normals(seed, "initial_state", 0, replicate, self.address, len(self.free))
            return np.asarray(self.y + np.tensordot(z, self.free, 1))
        return self.y

    def records(self, seed: int, replicate: int, sigma: Sequence[float]) -> list[Record]:
        """The records of a replicate at each noise level, from their address.

        Raises
        ------
        Failed
            A function of the user failed.
        """
        y = self.clean(seed, replicate)
        if self.driven is not None:
            y = y + self.driven.response(seed, replicate, self.address)
        if self.noise is not None:
            noise = self._drawn(seed, replicate, y)
        else:
            noise = np.array(
                [normals(seed, "noise_y", k, replicate, self.address, y.shape[1]) for k in range(len(y))]
            )
        return [self.record(y + s * self.unit[:, None] * noise) for s in sigma]

    def _drawn(self, seed: int, replicate: int, y: F64) -> F64:
        """Noise by the user's function; `Failed` where it failed."""
        assert self.noise is not None
        rng = generator("noise", seed, replicate, self.address)
        given = y[0].copy() if len(y) == 1 else y.copy()
        drawn = attempt("noise", self.noise, rng, given, self.rest.dt)
        return series(drawn, "noise", given.shape, "noise of unit standard deviation for each sample")

    def heard(self, seed: int) -> Group:
        """The group with the standard deviation of the user's noise, as the first replicates draw it.

        It counts where the mean square is `SURELY` standard errors, by its scatter between replicates, and
        `FAR` from 1: noise with heavy tails, or that goes with the signal, has no level that is known well.

        Raises
        ------
        SpecError
            Functions draw otherwise when they are called again.
        """
        if self.functions:
            self._refuse_other_numbers(seed)
        if self.noise is None:
            return self
        try:
            squares = [np.mean(self._drawn(seed, r, self.clean(seed, r)) ** 2) for r in range(HEARD)]
        except (Failed, SpecError):  # the replicates say so
            return self
        mean, error = float(np.mean(squares)), float(np.std(squares, ddof=1)) / HEARD**0.5
        sd = mean**0.5
        return replace(self, noise_sd=sd) if abs(mean - 1) > SURELY * error and abs(sd - 1) > FAR else self

    def _refuse_other_numbers(self, seed: int) -> None:
        """Refuse functions that draw from elsewhere than the generator they are given."""
        try:
            one, two = (self.clean(seed, 0) for _ in range(2))
            noises = [self._drawn(seed, 0, one) for _ in range(2)] if self.noise is not None else []
        except (Failed, SpecError):  # the replicates say so
            return
        refuse_unlike("initial_state", one, two)
        if noises:
            refuse_unlike("noise", *noises)

    @property
    def functions(self) -> dict[str, Any]:
        """Functions of the user by what they are."""
        given = {"initial_state": self.state, "noise": self.noise}
        return {name: call for name, call in given.items() if call is not None}

    def described(self) -> list[Any]:
        """All that its records depend on, noise levels aside."""
        calls = {name: source(call) for name, call in self.functions.items()}
        arrays = [self.y, self.rest.u, self.free] + ([self.rest.free] if self.state is not None else [])
        own = [] if isinstance(self.system, LTI) else [repr(self.system)]
        if self.driven is not None:
            arrays += [self.driven.first, self.driven.held, self.driven.system.A, self.driven.system.C]
        return [[self.index, self.rest.dt, self.intersample, calls, *own], *arrays]


def groups(
    systems: Sequence[Any],
    inputs: Sequence[Any],
    states: Sequence[Any],
    nsr: Axis,
    noises: Sequence[Callable[..., Any] | None],
    process_noise: Any,
    *,
    duration: float | None,
    intervals: int | None,
    intersample: str | Sequence[str] | None,
) -> tuple[Group, ...]:
    """Simulate every combination of system, input and initial state, each once for all kinds of noise."""
    found: list[Group] = []
    unmoved = not isinstance(process_noise, ProcessNoise) and not np.any(np.asarray(process_noise))
    for system in systems:
        if not isinstance(system, LTI | NonlinearModel):
            raise SpecError(
                f"MonteCarlo: system is a {type(system).__name__}; give mf.tf(num, den), mf.ss(A, B, C, D), "
                "mf.Equation(...).model({name: value}), fit.model, or a dict of them (an axis with names)"
            )
        linear, whole = isinstance(system, LTI), system
        system = measured(whole, process_noise, "MonteCarlo")
        for given in inputs:
            rest: Experiment | None = None
            for state in states:
                if rest is None or not linear:
                    start = None if linear or callable(state) or isinstance(state, str) else state
                    rest = experiment(
                        system,
                        input=given,
                        duration=duration,
                        intervals=intervals,
                        intersample=intersample,
                        start=start,
                    )
                if not np.all(rest.rms > 0) and any(nsr.labels):
                    raise DataError(
                        "MonteCarlo: the response from rest of an output is zero, so that nsr, noise "
                        f"relative to it, says nothing; {_moving(rest)}"
                    )
                added = None
                if not unmoved:
                    added = driven(whole, process_noise, rest.dt, rest.y.shape[1] - 1, "MonteCarlo")
                fixed, free = _state("zero" if callable(state) else state, rest)
                drawn = not linear and isinstance(state, str) and state == "random"
                group = Group(
                    index=0,
                    address=len(found) // len(noises),
                    system=system,
                    rest=rest if drawn or callable(state) else replace(rest, inputs=()),
                    intersample=rest.kinds,
                    start=fixed,
                    free=free,
                    y=np.ascontiguousarray(rest.response(fixed) if linear else rest.y),
                    state=state if callable(state) else None,
                    drawn=drawn,
                    driven=added,
                    process_noise=process_noise,
                )
                found += [replace(group, index=len(found) + k, noise=one) for k, one in enumerate(noises)]
    return tuple(found)


def _state(given: Any, rest: Experiment) -> tuple[F64, F64]:
    """Fixed initial state, and the free responses of the random one."""
    n = rest.state_rms.size
    none = np.zeros((0, *rest.y.shape))
    if isinstance(given, str):
        if given == "zero":
            return np.zeros(n), none
        if given == "random":
            free = np.ascontiguousarray(rest.state_rms[: len(rest.free), None, None] * rest.free)
            return np.zeros(n), free
        raise SpecError(
            f"MonteCarlo: initial_state={given!r} is unknown; give 'zero', 'random', {n} numbers or a "
            "function of rng: where the records begin. What an estimator knows of that is its own option, "
            "mf.Estimator(structure, initial_state='rest')"
        )
    try:
        state = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        state = np.full(n + 1, np.nan)
    if state.shape != (n,) or not np.all(np.isfinite(state)):
        raise SpecError(
            f"MonteCarlo: initial_state={given!r} for a system with {n} states; give that many "
            "finite numbers (of a transfer function y, y', …), 'zero', 'random' or a function of rng"
        )
    return state, none


def _moving(rest: Experiment) -> str:
    """What moves the outputs of a study."""
    if rest.inputs or isinstance(rest.system, LTI):
        return "give an input that moves the output"
    return (
        "the system has no input, so that its initial state moves it: give numbers, initial_state=[...], or "
        "make the records, generate=..."
    )
