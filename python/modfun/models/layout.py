"""A structure for named channels: its coefficients, which are estimated, how they make polynomials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar

import numpy as np

from ..base.arrays import F64
from ..base.cached import cached_property
from .free import Free

__all__ = ["Layout", "Path", "routes"]

Delay = float | Free


@dataclass(frozen=True)
class Path:
    """An input with a delay that paths to outputs may share: position of the input, delay, its name."""

    input: int
    delay: Delay
    name: str


@dataclass(frozen=True, eq=True)
class Layout:
    """Coefficients of a structure for the channels of a record.

    Attributes
    ----------
    outputs, inputs : tuple of str
    orders : tuple of int
        Poles of each output.
    common : bool
        Whether all outputs share the denominator of the first.
    numerators : tuple of tuple of int or None
        Degree [output][input]; None without a path.
    paths : tuple of Path
        Inputs with their delays.
    routes : tuple of tuple of int
        Which path [output][input] takes.
    names : tuple of str
        Of all coefficients, fixed ones included.
    fixed : tuple of float or None
        Value of each coefficient that is not estimated.
    bounds : tuple of (float, float)
        Of each coefficient.
    beforehand : tuple of (float, float) or None
        Mean and standard deviation of each coefficient, where these are known.
    rational : bool
        Whether parameters are coefficients of polynomials: yes, unlike those of an `EquationLayout`.
    """

    rational: ClassVar[bool] = True

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    orders: tuple[int, ...]
    common: bool
    numerators: tuple[tuple[int | None, ...], ...]
    paths: tuple[Path, ...]
    routes: tuple[tuple[int, ...], ...]
    names: tuple[str, ...]
    fixed: tuple[float | None, ...]
    bounds: tuple[tuple[float, float], ...]
    beforehand: tuple[tuple[float, float] | None, ...]

    @cached_property
    def plain(self) -> bool:
        """One output with free, unbounded coefficients and known delays: what the fastest path fits."""
        return (
            len(self.outputs) == 1
            and all(value is None for value in self.fixed)
            and all(pair == (-inf, inf) for pair in self.bounds)
            and not self.free_delays
            and not self.priors
        )

    @cached_property
    def free(self) -> tuple[int, ...]:
        """Positions of the coefficients that are estimated."""
        return tuple(k for k, value in enumerate(self.fixed) if value is None)

    @cached_property
    def free_delays(self) -> tuple[int, ...]:
        """Positions of the paths whose delay is estimated."""
        return tuple(k for k, path in enumerate(self.paths) if isinstance(path.delay, Free))

    @cached_property
    def param_names(self) -> tuple[str, ...]:
        """Names of what is estimated: coefficients, then delays."""
        return tuple(self.names[k] for k in self.free) + tuple(self.paths[k].name for k in self.free_delays)

    @cached_property
    def positions(self) -> tuple[int | None, ...]:
        """Position of each coefficient among the parameters; None where it is fixed."""
        found: list[int | None] = [None] * len(self.names)
        for at, k in enumerate(self.free):
            found[k] = at
        return tuple(found)

    @cached_property
    def places(self) -> tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]:
        """First coefficient of each output's denominator, and of each numerator [output][input]."""
        dens: list[int] = []
        nums: list[tuple[int, ...]] = []
        at = self.orders[0] if self.common else 0
        for order, row in zip(self.orders, self.numerators, strict=True):
            if self.common:
                dens.append(0)
            else:
                dens.append(at)
                at += order
            own = []
            for degree in row:
                own.append(at)
                at += 0 if degree is None else degree + 1
            nums.append(tuple(own))
        return tuple(dens), tuple(nums)

    def coefficients(self, params: F64) -> F64:
        """All coefficients, fixed ones at their values."""
        if len(self.free) == len(self.names):
            return np.asarray(params[: len(self.names)])
        values = np.array([0.0 if value is None else value for value in self.fixed])
        values[list(self.free)] = params[: len(self.free)]
        return values

    def polynomials(self, params: F64, output: int = 0) -> tuple[F64, list[F64]]:
        """Denominator (monic) and one numerator an input of an output, descending powers; no path: [0]."""
        values = self.coefficients(params)
        dens, nums = self.places
        at, order = dens[output], self.orders[output]
        row = zip(self.numerators[output], nums[output], strict=True)
        numerators = [np.zeros(1) if degree is None else values[k : k + degree + 1] for degree, k in row]
        return np.concatenate([[1.0], values[at : at + order]]), numerators

    def denominators(self, params: F64) -> list[list[float]]:
        """Each denominator once (monic), descending powers."""
        values = self.coefficients(params).tolist()
        places = dict.fromkeys(zip(self.places[0], self.orders, strict=True))
        return [[1.0, *values[at : at + order]] for at, order in places]

    def delays(self, params: F64, output: int = 0) -> tuple[float, ...]:
        """Delay of each input on its way to an output, s; free ones kept in their range."""
        found = dict(zip(self.free_delays, params[len(self.free) :].tolist(), strict=True))
        given = ((k, self.paths[k].delay) for k in self.routes[output])
        return tuple(
            [
                min(max(found[k], own.min, 0.0), own.max) if isinstance(own, Free) else float(own)
                for k, own in given
            ]
        )

    @property
    def known_delays(self) -> list[tuple[str, float]]:
        """Inputs that are late by a known time, s."""
        each = [(self.inputs[p.input], p.delay) for p in self.paths if not isinstance(p.delay, Free)]
        return [(name, late) for name, late in dict.fromkeys(each) if late]

    @property
    def held(self) -> dict[str, float]:
        """Coefficients that are not estimated."""
        return {name: v for name, v in zip(self.names, self.fixed, strict=True) if v is not None}

    @cached_property
    def priors(self) -> tuple[tuple[int, float, float], ...]:
        """Estimated parameters of which something is known beforehand: position, mean, standard deviation."""
        delays = [self.paths[k].delay for k in self.free_delays]
        each = [*(self.beforehand[k] for k in self.free), *(d.prior for d in delays if isinstance(d, Free))]
        return tuple((k, *known) for k, known in enumerate(each) if known)

    @property
    def longest_delay(self) -> float:
        """The most that an input may be late, s."""
        return max((_most(path.delay) for path in self.paths), default=0.0)

    def core(self) -> dict[str, Any]:
        """Keywords of the compiled core."""
        numerators = []
        for row, route in zip(self.numerators, self.routes, strict=True):
            own: list[int | None] = [None] * len(self.paths)
            for degree, path in zip(row, route, strict=True):
                own[path] = degree
            numerators.append(own)
        return {
            "orders": list(self.orders),
            "common": self.common,
            "numerators": numerators,
            "paths": [(path.input, *_bounded(path.delay)) for path in self.paths],
            "fixed": list(self.fixed),
            "bounds": list(self.bounds),
            "priors": list(self.priors),
        }


def _most(delay: Delay) -> float:
    return delay.max if isinstance(delay, Free) else delay


def _bounded(delay: Delay) -> tuple[float, tuple[float, float] | None]:
    if not isinstance(delay, Free):
        return delay, None
    low = max(delay.min, 0.0)
    return (low if delay.start is None else delay.start), (low, delay.max)


def routes(
    table: Sequence[Sequence[Delay]], inputs: Sequence[str], outputs: Sequence[str], shared: bool
) -> tuple[tuple[Path, ...], tuple[tuple[int, ...], ...]]:
    """Distinct (input, delay) pairs and which of them each output and input takes.

    `table` holds delays [output][input]; `shared`: an estimated delay of an input is one for all outputs.
    Those of an output stand in the order of its inputs, as their numerators do: a pair before an earlier
    input's is taken again.
    """
    found: list[Path] = []
    taken = []
    for output, row in zip(outputs, table, strict=True):
        own: list[int] = []
        for k, delay in enumerate(row):
            channel = [output] if not shared and len(outputs) > 1 else []
            channel += [inputs[k]] if len(inputs) > 1 else []
            name = f"delay[{','.join(channel)}]" if channel else "delay"
            alike = [
                at
                for at, path in enumerate(found)
                if path.input == k
                and path.delay == delay
                and at > max(own, default=-1)
                and (not isinstance(delay, Free) or path.name == name)
            ]
            if not alike:
                found.append(Path(k, delay, name))
            own.append(alike[0] if alike else len(found) - 1)
        taken.append(tuple(own))
    return tuple(found), tuple(taken)
