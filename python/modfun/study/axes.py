"""Axes of a study's grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose
from typing import Any

import numpy as np

from ..base.arguments import shown
from ..base.names import nearest
from ..errors import SpecError

__all__ = ["Axis", "axis", "levels"]


@dataclass(frozen=True)
class Axis:
    """One axis of the grid; `given` tells whether the user made it one (a dict, or a list of numbers)."""

    name: str
    labels: tuple[Any, ...]
    given: bool

    def index(self, label: Any) -> int:
        """Position of a label."""
        if isinstance(label, np.generic):
            label = label.item()
        if (
            isinstance(label, str | int | float) and label in self.labels
        ):  # an array would be compared by entries
            return self.labels.index(label)
        if isinstance(label, int | float):  # 0.1*3 is 0.3 to the reader
            near = [
                k for k, own in enumerate(self.labels) if isinstance(own, int | float) and isclose(own, label)
            ]
            if len(near) == 1:
                return near[0]
        meant = next((own for own in self.labels if str(own) == str(label)), None)
        if meant is not None:
            kinds = ("a text", "a number") if isinstance(label, str) else ("a number", "a text")
            raise SpecError(
                f"{self.name}={label!r} is {kinds[0]}, in the study it is {kinds[1]}; give "
                f"{self.name}={meant!r}"
            )
        known = nearest(label if isinstance(label, str) else shown(label), [str(own) for own in self.labels])
        raise SpecError(f"{self.name}={shown(label)} is not in the study; {known}")


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
                f"MonteCarlo: nsr holds {v}; noise levels are finite and at least 0, 0.1 being 10 %"
            )
    if len(set(flat)) < len(flat):
        raise SpecError("MonteCarlo: nsr names a level twice; give each once")
    return Axis("nsr", flat, values.ndim == 1)
