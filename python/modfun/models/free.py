"""Parameters that are estimated within bounds."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

from ..base.arguments import public, real
from ..errors import SpecError

__all__ = ["Free", "from_plain", "to_plain"]


@public
@dataclass(frozen=True, init=False)
class Free:
    """A parameter to be estimated, with a start and bounds: ``Free(0.1, min=0, max=0.5)``.

    Parameters
    ----------
    start : float, optional
        Tried besides the starts that are found without it. A parameter that enters the equations linearly
        needs none, and pays no heed to it.
    min, max : float, optional
        Least and most; default: unbounded. An estimate at a bound has no standard error of its own. A
        delay needs `max`: the window starts so much later.

    Raises
    ------
    SpecError
        No number, or bounds that are crossed or do not hold the start.
    """

    start: float | None
    min: float
    max: float

    def __init__(self, start: float | None = None, *, min: float = -inf, max: float = inf) -> None:
        first = None if start is None else _number("start", start)
        low, high = _number("min", min), _number("max", max)
        if not low < high:
            raise SpecError(f"Free: min={min!r} must lie below max={max!r}; a fixed parameter is a number")
        if first is not None and not (isfinite(first) and low <= first <= high):
            raise SpecError(
                f"Free: start={start!r} must be finite and lie between min={min!r} and max={max!r}"
            )
        object.__setattr__(self, "start", first)
        object.__setattr__(self, "min", low)
        object.__setattr__(self, "max", high)

    def __repr__(self) -> str:
        words = [] if self.start is None else [f"{self.start:g}"]
        words += [] if self.min == -inf else [f"min={self.min:g}"]
        words += [] if self.max == inf else [f"max={self.max:g}"]
        return f"Free({', '.join(words)})"


def _number(name: str, value: Any) -> float:
    number = real("Free", name, value, finite=False)
    if number != number:
        raise SpecError(f"Free: {name}={value!r} is not a number")
    return number


def to_plain(value: Any) -> Any:
    """A value, or tuples of values, as JSON takes it: `Free` as a mapping, tuples as lists."""
    if isinstance(value, Free):
        return {"start": value.start, "min": value.min, "max": value.max}
    return [to_plain(one) for one in value] if isinstance(value, tuple) else value


def from_plain(value: Any) -> Any:
    """What `to_plain` was given, tuples as lists; limits may be texts, "inf"."""
    if isinstance(value, dict):
        return Free(value["start"], min=float(value["min"]), max=float(value["max"]))
    return [from_plain(one) for one in value] if isinstance(value, list) else value
