"""What a Monte Carlo study is made of, laid out so that any process can run any part of it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import cached_property
from ..models.free import priors_of
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .axes import Axis
from .contenders import Contender
from .generated import Generated
from .groups import Group

__all__ = ["Plan"]

COEFFICIENT = re.compile(r"([ab])(\d+)(\[.*\])?")


@dataclass(frozen=True, eq=False)
class Plan:
    """A study laid out: what its numbers depend on and its results are named by; it can go to any process.

    Attributes
    ----------
    axes : tuple of Axis
        System, input, initial state and kind of noise, or the axes of the user's grid; the last one is nsr.
    groups : tuple of Group or Generated
    contenders : tuple of Contender
    metrics : tuple of (str, callable)
        Functions of what an estimator found and the record.
    seed : int
    """

    axes: tuple[Axis, ...]
    groups: tuple[Group | Generated, ...]
    contenders: tuple[Contender, ...]
    metrics: tuple[tuple[str, Callable[[Any, Record], Any]], ...]
    seed: int

    @property
    def made(self) -> bool:
        """Whether records or fits are needed in Python, so that no estimator can run in the core's study.

        Noise levels for errors in variables are told by the records themselves; equations, and structures
        with priors, are fitted in batches, records of some estimators one by one.
        """
        seen = any(c.alone for c in self.contenders) or any(
            own.options.noise == "errors-in-variables"
            or not isinstance(own.model, TransferFunction)
            or bool(priors_of(own.model))
            for c in self.contenders
            for own in c.estimators
        )
        return bool(self.metrics) or seen or any(g.made for g in self.groups)

    @property
    def functions(self) -> list[tuple[str, Any]]:
        """Functions of the user and what they are."""
        found = [pair for g in self.groups for pair in g.functions.items()]
        found += [(f"the estimator {c.name!r}", c.call) for c in self.contenders if c.call is not None]
        return found + [(f"the metric {name!r}", call) for name, call in self.metrics]

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters: a1, a2, …, the numerators input by input, then names of the user's own."""
        names = list(dict.fromkeys(name for g in self.groups for c in self.contenders for name in c.names(g)))

        def key(name: str) -> tuple[str, str, int]:
            found = COEFFICIENT.fullmatch(name)
            return (found[1], found[3] or "", int(found[2])) if found else ("c", "", names.index(name))

        return tuple(sorted(names, key=key))

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Sizes (group, level, estimator, figure) of all sums; the figures are parameters, then metrics."""
        figures = len(self.parameters) + len(self.metrics)
        return len(self.groups), len(self.axes[-1].labels), len(self.contenders), figures

    def columns(self, contender: Contender, group: Group | Generated) -> list[int]:
        """Positions of an estimator's parameters among all."""
        return [self.parameters.index(name) for name in contender.names(group)]

    def sigma(self, group: Group | Generated) -> F64:
        """Noise standard deviation at each level of a group."""
        return np.array(self.axes[-1].labels) * group.scale

    @cached_property
    def truth(self) -> F64:
        """True parameters (group, level, estimator, figure), nan where unknown or not a parameter."""
        array = np.full(self.shape, np.nan)
        for g in self.groups:
            for k, c in enumerate(self.contenders):
                array[g.index, :, k, self.columns(c, g)] = c.truth[g.index][:, None]
        return array
