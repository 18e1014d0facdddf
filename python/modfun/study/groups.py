"""Noise-free signals of each system, input and initial state of a study, and the records made of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..callables import source
from ..errors import DataError, SpecError
from ..lti import LTI
from ..records import Record
from ..simulation import Experiment, experiment
from ..structures import TransferFunction
from .axes import Axis
from .functions import attempt, generator, series

__all__ = ["Group", "groups"]

F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Group:
    """System, input and initial state of some cells, which share their noise.

    Attributes
    ----------
    index : int
        Address of the noise.
    system : LTI
    rest : Experiment
        Response from rest and what noise and random states are scaled by.
    y : ndarray, shape (output, time)
        Noise-free outputs with the fixed part of the initial state.
    free : ndarray, shape (states, output, time)
        Response to one standard deviation of each random state; no rows if none is random.
    intersample : tuple of str
    state, noise : callable or None
        Functions of the user that draw the initial state and the noise.
    """

    index: int
    system: LTI
    rest: Experiment
    y: F64
    free: F64
    intersample: tuple[str, ...]
    state: Callable[..., Any] | None = None
    noise: Callable[..., Any] | None = None

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        count = self.system.shape[1]
        return ("u",) if count == 1 else tuple(f"u{k}" for k in range(1, count + 1))

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        count = self.system.shape[0]
        return ("y",) if count == 1 else tuple(f"y{k}" for k in range(1, count + 1))

    @property
    def made(self) -> bool:
        """Whether functions of the user make its records, so that the core cannot."""
        return self.state is not None or self.noise is not None

    @property
    def scale(self) -> float:
        """What the noise levels of the core are in units of: of one output its root mean square, else 1."""
        return float(self.rest.rms[0]) if len(self.y) == 1 else 1.0

    @property
    def unit(self) -> F64:
        """Unit of the noise of each output: nsr refers to the root mean square of the response from rest."""
        return np.ones(1) if len(self.y) == 1 else self.rest.rms

    def names(self, structure: TransferFunction | None) -> tuple[str, ...]:
        """Names of a structure's parameters."""
        assert structure is not None
        return structure.param_names(self.inputs, self.outputs)

    def truth(self, structure: TransferFunction | None) -> F64:
        """True parameters of a structure; nan where it does not hold the system."""
        assert structure is not None
        try:
            return structure.theta(self.system)
        except SpecError:
            # A wrong number of inputs is a mistake, not a misfit: the names tell.
            return np.full(len(self.names(structure)), np.nan)

    def record(self, y: F64) -> Record:
        """A record with this group's input."""
        return Record(
            y=y, u=self.rest.u, dt=self.rest.dt, outputs=self.outputs, intersample=list(self.intersample)
        )

    def records(self, seed: int, replicate: int, sigma: Sequence[float]) -> list[Record]:
        """The records of a replicate at each noise level, from their address.

        Raises
        ------
        Failed
            A function of the user failed.
        """
        y = self.y
        if self.state is not None:
            rng = generator("initial_state", seed, replicate, self.index)
            drawn = attempt("initial_state", self.state, rng)
            shape = self.rest.state_rms.shape
            start = series(drawn, "initial_state", shape, "the states at t = 0")
            y = y + np.tensordot(start, self.rest.free, 1)
        elif len(self.free):
            z = _core.normals(seed, "initial_state", 0, replicate, self.index, len(self.free))
            y = y + np.tensordot(z, self.free, 1)
        if self.noise is not None:
            rng = generator("noise", seed, replicate, self.index)
            given = y[0].copy() if len(y) == 1 else y.copy()
            drawn = attempt("noise", self.noise, rng, given, self.rest.dt)
            noise = series(drawn, "noise", given.shape, "noise of unit standard deviation for each sample")
        else:
            noise = np.array(
                [_core.normals(seed, "noise_y", k, replicate, self.index, y.shape[1]) for k in range(len(y))]
            )
        return [self.record(y + s * self.unit[:, None] * noise) for s in sigma]

    @property
    def functions(self) -> dict[str, Any]:
        """Functions of the user by what they are."""
        given = {"initial_state": self.state, "noise": self.noise}
        return {name: call for name, call in given.items() if call is not None}

    def described(self) -> list[Any]:
        """All that its records depend on, noise levels aside."""
        calls = {name: source(call) for name, call in self.functions.items()}
        arrays = [self.y, self.rest.u, self.free] + ([self.rest.free] if self.state is not None else [])
        return [[self.index, self.rest.dt, self.intersample, calls], *arrays]


def groups(
    systems: Sequence[Any],
    inputs: Sequence[Any],
    states: Sequence[Any],
    nsr: Axis,
    noise: Callable[..., Any] | None,
    *,
    duration: float,
    intervals: int,
    intersample: str | Sequence[str],
) -> tuple[Group, ...]:
    """Simulate every combination of system, input and initial state, each once."""
    found: list[Group] = []
    for system in systems:
        if not isinstance(system, LTI):
            raise SpecError(
                f"MonteCarlo: system is a {type(system).__name__}; give mf.tf(num, den), mf.ss(A, B, C, D), "
                "fit.model, or a dict of them (an axis with names)"
            )
        for given in inputs:
            rest = experiment(
                system, input=given, duration=duration, intervals=intervals, intersample=intersample
            )
            if not np.all(rest.rms > 0) and any(nsr.labels):
                raise DataError(
                    "MonteCarlo: the response from rest of an output is zero, so that nsr, noise "
                    "relative to it, says nothing; give an input that moves the output"
                )
            kinds = (intersample,) * len(rest.u) if isinstance(intersample, str) else tuple(intersample)
            for state in states:
                drawn = state if callable(state) else None
                fixed, free = _state("zero" if callable(state) else state, rest)
                found.append(
                    Group(
                        index=len(found),
                        system=system,
                        rest=rest,
                        intersample=kinds,
                        free=free,
                        y=np.ascontiguousarray(rest.y + np.tensordot(fixed, rest.free, 1)),
                        state=drawn,
                        noise=noise,
                    )
                )
    return tuple(found)


def _state(given: Any, rest: Experiment) -> tuple[F64, F64]:
    """Fixed initial state, and the free responses of the random one."""
    n = rest.state_rms.size
    none = np.zeros((0, *rest.y.shape))
    if isinstance(given, str):
        if given == "zero":
            return np.zeros(n), none
        if given == "random":
            return np.zeros(n), np.ascontiguousarray(rest.state_rms[:, None, None] * rest.free)
        raise SpecError(
            f"MonteCarlo: initial_state={given!r} is unknown; give 'zero', 'random', {n} numbers or a "
            "function of rng"
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
