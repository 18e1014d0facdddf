"""What a Monte Carlo study is made of: axes, noise-free signals of each group, estimators made ready."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import DataError, SpecError
from .estimation import Estimator
from .lti import LTI
from .options import WORDS, Options
from .prepared import channels
from .records import Record
from .simulation import Experiment, experiment
from .structures import TransferFunction
from .tables import nearest

__all__ = ["Axis", "Contender", "Group", "Plan", "axis", "contenders", "groups", "levels"]

F64 = NDArray[np.float64]
Rule = Callable[[Record, np.random.Generator], Any]


@dataclass(frozen=True)
class Axis:
    """One axis of the grid; `given` tells whether the user made it one (a dict, or a list of numbers)."""

    name: str
    labels: tuple[Any, ...]
    given: bool

    def index(self, label: Any) -> int:
        """Position of a label."""
        for k, own in enumerate(self.labels):
            if own == label:
                return k
        raise SpecError(f"{self.name}={label!r} is not in the study; {nearest(label, self._texts())}")

    def _texts(self) -> list[str]:
        return [str(label) for label in self.labels]


def axis(name: str, given: Any) -> tuple[Axis, tuple[Any, ...]]:
    """An axis and its values from a dict of names, or a single value."""
    if not isinstance(given, Mapping):
        return Axis(name, ("",), False), (given,)
    if not given:
        raise SpecError(f"MonteCarlo: {name}={{}} is an empty axis; give at least one name and value")
    for label in given:
        if not isinstance(label, str) or not label.strip():
            raise SpecError(f"MonteCarlo: {name} has the name {label!r}; names of an axis are texts")
    return Axis(name, tuple(given), True), tuple(given.values())


def levels(nsr: Any) -> Axis:
    """The axis of noise levels from a number or a list of them."""
    try:
        values = np.asarray(nsr, dtype=np.float64)
        if isinstance(nsr, str | bytes | bool):
            raise TypeError
    except (TypeError, ValueError):
        raise SpecError(
            f"MonteCarlo: nsr={nsr!r} must be a number or a list of numbers (noise sd over rms of the output)"
        ) from None
    if values.ndim > 1 or values.size == 0:
        raise SpecError(f"MonteCarlo: nsr has shape {values.shape}; give a number or a flat list of them")
    flat = tuple(float(v) for v in np.atleast_1d(values))
    for v in flat:
        if not (np.isfinite(v) and v >= 0):
            raise SpecError(
                f"MonteCarlo: nsr holds {v}; noise levels are finite and at least 0, .1 being 10 %"
            )
    if len(set(flat)) < len(flat):
        raise SpecError("MonteCarlo: nsr names a level twice; give each once")
    return Axis("nsr", flat, values.ndim == 1)


# Groups ------------------------------------------------------------------------------------------


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
    y : ndarray, shape (time,)
        Noise-free output with the fixed part of the initial state.
    free : ndarray, shape (states, time)
        Response to one standard deviation of each random state; no rows if none is random.
    intersample : tuple of str
    """

    index: int
    system: LTI
    rest: Experiment
    y: F64
    free: F64
    intersample: tuple[str, ...]

    def record(self, y: F64) -> Record:
        """A record with this group's input."""
        return Record(y=y, u=self.rest.u, dt=self.rest.dt, intersample=list(self.intersample))

    def outputs(self, seed: int, replicate: int, sigma: Sequence[float]) -> list[F64]:
        """Noisy outputs of a replicate at each noise level, from their address."""
        y = self.y
        if len(self.free):
            z = _core.normals(seed, "initial_state", 0, replicate, self.index, len(self.free))
            y = y + z @ self.free
        noise = _core.normals(seed, "noise_y", 0, replicate, self.index, y.size)
        return [y + s * noise for s in sigma]


def groups(
    systems: Sequence[Any],
    inputs: Sequence[Any],
    states: Sequence[Any],
    nsr: Axis,
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
        if system.shape[0] != 1:
            raise SpecError(f"MonteCarlo: the system has {system.shape[0]} outputs; this version takes one")
        for given in inputs:
            rest = experiment(
                system, input=given, duration=duration, intervals=intervals, intersample=intersample
            )
            if not rest.rms[0] > 0 and any(nsr.labels):
                raise DataError(
                    "MonteCarlo: the response from rest is zero, so that nsr, noise relative to it, says "
                    "nothing; give an input that moves the output"
                )
            kinds = (intersample,) * len(rest.u) if isinstance(intersample, str) else tuple(intersample)
            for state in states:
                fixed, free = _state(state, rest)
                found.append(
                    Group(
                        index=len(found),
                        system=system,
                        rest=rest,
                        intersample=kinds,
                        free=free,
                        y=np.ascontiguousarray(rest.y[0] + fixed @ rest.free[:, 0]),
                    )
                )
    return tuple(found)


def _state(given: Any, rest: Experiment) -> tuple[F64, F64]:
    """Fixed initial state, and the free responses of the random one."""
    n = rest.state_rms.size
    none = np.zeros((0, rest.y.shape[1]))
    if isinstance(given, str):
        if given == "zero":
            return np.zeros(n), none
        if given == "random":
            return np.zeros(n), np.ascontiguousarray(rest.state_rms[:, None] * rest.free[:, 0])
        raise SpecError(
            f"MonteCarlo: initial_state={given!r} is unknown; give 'zero', 'random' or {n} numbers"
        )
    if callable(given):
        raise SpecError(
            "MonteCarlo: initial_state as a function comes in a later version; give 'zero', "
            "'random' or numbers"
        )
    try:
        state = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        state = np.full(n + 1, np.nan)
    if state.shape != (n,) or not np.all(np.isfinite(state)):
        raise SpecError(
            f"MonteCarlo: initial_state={given!r} for a system with {n} states; give that many "
            "finite numbers (of a transfer function y, y', …), 'zero' or 'random'"
        )
    return state, none


# Estimators --------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Contender:
    """An estimator of the study, made ready for each group.

    Attributes
    ----------
    name : str
    call : callable or None
        A user's estimator; None for one that runs in the compiled core.
    estimators : tuple of Estimator
        One a group, with the band settled; empty for a user's estimator.
    structures : tuple of TransferFunction
        What the parameters are, one a group.
    truth : tuple of ndarray
        True parameters, one a group; nan where the structure does not hold the system.
    """

    name: str
    call: Rule | None
    estimators: tuple[Estimator, ...]
    structures: tuple[TransferFunction, ...]
    truth: tuple[F64, ...]

    def names(self, group: Group) -> tuple[str, ...]:
        """Names of the parameters in a group."""
        return self.structures[group.index].param_names(_inputs(group))

    @property
    def trend(self) -> str | None:
        """Trend fitted beside the model (None for a user's estimator)."""
        return self.estimators[0].options.settled().trend if self.estimators else None

    def core(self, group: Group) -> dict[str, Any]:
        """Keywords of the compiled core for this group."""
        own = self.estimators[group.index]
        return {**_core_structure(own.model, group), **own.options.core()}


@dataclass(frozen=True, eq=False)
class Plan:
    """A study laid out: what its numbers depend on and its results are named by; it can go to any process.

    Attributes
    ----------
    axes : tuple of Axis
        System, input, initial state, nsr.
    groups : tuple of Group
    contenders : tuple of Contender
    seed : int
    """

    axes: tuple[Axis, ...]
    groups: tuple[Group, ...]
    contenders: tuple[Contender, ...]
    seed: int

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters of all structures: a1, a2, …, then the numerators input by input."""
        names = {name for g in self.groups for c in self.contenders for name in c.names(g)}

        def key(name: str) -> tuple[str, str, int]:
            letter, _, channel = name.partition("[")
            return letter[0], channel, int(letter[1:])

        return tuple(sorted(names, key=key))

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Sizes (group, level, estimator, parameter) of all figures."""
        return len(self.groups), len(self.axes[3].labels), len(self.contenders), len(self.parameters)

    def columns(self, contender: Contender, group: Group) -> list[int]:
        """Positions of an estimator's parameters among all."""
        return [self.parameters.index(name) for name in contender.names(group)]

    def sigma(self, group: Group) -> F64:
        """Noise standard deviation at each level of a group."""
        return np.array(self.axes[3].labels) * float(group.rest.rms[0])

    @cached_property
    def truth(self) -> F64:
        """True parameters (group, level, estimator, parameter), nan where unknown or not a parameter."""
        array = np.full(self.shape, np.nan)
        for g in self.groups:
            for k, c in enumerate(self.contenders):
                array[g.index, :, k, self.columns(c, g)] = c.truth[g.index][:, None]
        return array

    def generator(self, replicate: int, group: Group) -> np.random.Generator:
        """Random numbers for functions, addressed by seed, replicate and group."""
        bits = np.random.Philox(key=[self.seed, group.index], counter=[0, 0, replicate, 0])
        return np.random.Generator(bits)


def contenders(
    given: Any, options: Mapping[str, Any], model: TransferFunction | None, found: Sequence[Group]
) -> tuple[Contender, ...]:
    """Check the estimators of a study and make them ready for its groups."""
    words = WORDS["method"]
    if isinstance(given, str) or not isinstance(given, Mapping | Sequence) or not given:
        raise SpecError(
            f"MonteCarlo: estimators={given!r}; give a list of method names, as ['ls', 'ml'], or a dict from "
            "names to estimators"
        )
    if not isinstance(given, Mapping):
        for word in given:
            if not isinstance(word, str):
                raise SpecError(
                    f"MonteCarlo: estimators holds {word!r}; a list names methods ({', '.join(words)}); "
                    "estimators of your own need a name: give a dict"
                )
        if len(set(given)) < len(given):
            raise SpecError(
                f"MonteCarlo: estimators={list(given)!r} names a method twice; for two settings of "
                "one method give a dict from names to mf.Estimator(structure, method=…, …)"
            )
        given = {word: word for word in given}
    if options and not any(isinstance(value, str) for value in given.values()):
        raise SpecError(
            f"MonteCarlo: {', '.join(options)} would apply to method names, and there are none; write the "
            "options into mf.Estimator(structure, …)"
        )
    if model is not None and not isinstance(model, TransferFunction):
        raise SpecError(
            f"MonteCarlo: model is a {type(model).__name__}; give a structure, "
            "TransferFunction(poles=, zeros=)"
        )
    structures = tuple(TransferFunction.from_system(g.system) if model is None else model for g in found)
    made = []
    for name, value in given.items():
        if isinstance(value, str):
            if value not in words:
                raise SpecError(f"MonteCarlo: there is no method {value!r}; {nearest(value, words)}")
            checked = Options.checked("MonteCarlo", **{**options, "method": value})
            own = tuple(Estimator(s, **_choices(checked)) for s in structures)
        elif isinstance(value, Estimator):
            own = (value,) * len(found)
        elif callable(value) and not isinstance(value, type):
            truth = tuple(_truth(s, g) for s, g in zip(structures, found, strict=True))
            made.append(Contender(str(name), value, (), structures, truth))
            continue
        else:
            raise SpecError(
                f"MonteCarlo: the estimator {name!r} is a {type(value).__name__}; give a method name, an "
                "mf.Estimator, one of mf.rivals or a function of (record, rng)"
            )
        settled = tuple(_settled(e, g) for e, g in zip(own, found, strict=True))
        made.append(
            Contender(
                str(name),
                None,
                settled,
                tuple(e.model for e in own),
                tuple(_truth(e.model, g) for e, g in zip(own, found, strict=True)),
            )
        )
    return tuple(made)


def _truth(structure: TransferFunction, group: Group) -> F64:
    try:
        return structure.theta(group.system)
    except SpecError:
        structure.numerators(group.system.shape[1])  # a wrong number of inputs is a mistake, not a misfit
        return np.full(len(structure.param_names(_inputs(group))), np.nan)


def _settled(own: Estimator, group: Group) -> Estimator:
    """The estimator with its band chosen on the noise-free response, if none was given."""
    options = own.options
    if options.band is not None or options.harmonics is not None:
        return own
    core = _core_structure(own.model, group)
    y = np.ascontiguousarray(group.y[None])
    with np.errstate(all="ignore"):
        fitter = _core.Fitter([y.shape[1]], [group.rest.dt], **core, **options.core())
        found = fitter.fit([y], [group.rest.u])
    harmonics = int(found["lines"][0][1]) - own.model.poles
    return Estimator(own.model, **_choices(options.replace(harmonics=harmonics)))


def _core_structure(structure: TransferFunction, group: Group) -> dict[str, Any]:
    record = group.record(group.y)
    numerators, delays = channels(structure, record.outputs, record.inputs)
    return {
        "order": structure.poles,
        "numerators": numerators,
        "delays": delays,
        "intersample": list(group.intersample),
    }


def _choices(options: Options) -> Any:
    return options.given()


def _inputs(group: Group) -> tuple[str, ...]:
    count = group.system.shape[1]
    return ("u",) if count == 1 else tuple(f"u{k}" for k in range(1, count + 1))
