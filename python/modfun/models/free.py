"""Parameters that are estimated, with what is known of them: start, bounds, a prior."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import Any

from ..base.arguments import public, real
from ..errors import SpecError

__all__ = ["Free", "bounds_meant", "from_plain", "priors_of", "refuse_priors", "to_plain"]


@public
@dataclass(frozen=True, init=False)
class Free:
    """A parameter to be estimated, with a start and bounds, or a prior: ``Free(0.1, min=0, max=0.5)``.

    Parameters
    ----------
    start : float, optional
        Tried besides the starts that are found without it. A parameter that enters the equations linearly
        needs none, and pays no heed to it.
    min, max : float, optional
        Least and most; default: unbounded. An estimate at a bound has no standard error of its own. A
        delay needs `max`: the window starts so much later.
    sd : float, optional
        Standard deviation of what is known of the parameter beforehand, from a data sheet or an earlier
        test: `start` is then its mean, and counts as one measurement more, ``Free(1.4, sd=0.1)``. Standard
        errors are those of record and prior together. By "ml" and "awls".

    Raises
    ------
    SpecError
        No number, bounds that are crossed or do not hold the start, or an `sd` without a start.

    See Also
    --------
    modfun.TransferFunction : Takes it in `params` and `delay`.
    modfun.Equation : Takes it in `params`.

    References
    ----------
    The guide docs/linear.md, "What is known, bounded, or late"; H. L. Van Trees, Detection, Estimation, and
    Modulation Theory, Part I, Wiley, 1968, section 2.4 (priors).

    Examples
    --------
    >>> import modfun as mf
    >>> late = mf.Free(min=0.0, max=0.5)
    >>> structure = mf.TransferFunction(poles=2, zeros=0, delay=late, params={"a1": mf.Free(min=0.0)})
    >>> structure.param_names()
    ('a1', 'a2', 'b0', 'delay')
    """

    start: float | None
    min: float
    max: float
    sd: float | None

    def __init__(
        self,
        start: float | None = None,
        *,
        min: float = -inf,
        max: float = inf,
        sd: float | None = None,
    ) -> None:
        first = None if start is None else _number("start", start)
        low, high = _number("min", min), _number("max", max)
        if not low < high:
            raise SpecError(f"Free: min={min!r} must lie below max={max!r}; a fixed parameter is a number")
        if first is not None and not (isfinite(first) and low <= first <= high):
            raise SpecError(
                f"Free: start={start!r} must be finite and lie between min={min!r} and max={max!r}"
            )
        width = None if sd is None else _number("sd", sd)
        if width is not None and not (isfinite(width) and width > 0):
            raise SpecError(
                f"Free: sd={sd!r} must be finite and above 0; a parameter that is certain is a number"
            )
        if width is not None and first is None:
            raise SpecError(f"Free: sd={sd!r} needs the mean, as Free(1.4, sd={width:g})")
        object.__setattr__(self, "start", first)
        object.__setattr__(self, "min", low)
        object.__setattr__(self, "max", high)
        object.__setattr__(self, "sd", width)

    @property
    def prior(self) -> tuple[float, float] | None:
        """Mean and standard deviation beforehand; None where nothing is known."""
        return None if self.sd is None or self.start is None else (self.start, self.sd)

    def __repr__(self) -> str:
        words = [] if self.start is None else [f"{self.start:g}"]
        words += [] if self.min == -inf else [f"min={self.min:g}"]
        words += [] if self.max == inf else [f"max={self.max:g}"]
        words += [] if self.sd is None else [f"sd={self.sd:g}"]
        return f"Free({', '.join(words)})"


def bounds_meant(value: Any) -> str:
    """How a pair of numbers is written where it was meant as bounds; else nothing."""
    match value:
        case (int() | float() as low, int() | float() as high) if low < high:
            return f", mf.Free(min={low:g}, max={high:g}) for bounds"
    return ""


def _number(name: str, value: Any) -> float:
    number = real("Free", name, value, finite=False)
    if number != number:
        raise SpecError(f"Free: {name}={value!r} is not a number")
    return number


def priors_of(structure: Any) -> dict[str, Free]:
    """Parameters of a structure that are known beforehand."""
    told = dict(structure.params)
    if isinstance(delay := getattr(structure, "delay", None), Free):
        told["delay"] = delay
    return {name: given for name, given in told.items() if isinstance(given, Free) and given.prior}


def refuse_priors(what: str, structure: Any) -> None:
    """Refuse a structure that knows parameters beforehand where that cannot count.

    Raises
    ------
    SpecError
    """
    for name, given in priors_of(structure).items():
        raise SpecError(f"{what}: the prior of {name} does not count here; leave sd= out of {given!r}")


def to_plain(value: Any) -> Any:
    """A value, or tuples of values, as JSON takes it: `Free` as a mapping, tuples as lists."""
    if isinstance(value, Free):
        own = {"start": value.start, "min": value.min, "max": value.max}
        return own if value.sd is None else own | {"sd": value.sd}
    return [to_plain(one) for one in value] if isinstance(value, tuple) else value


def from_plain(value: Any) -> Any:
    """What `to_plain` was given, tuples as lists; limits may be texts, "inf"."""
    if isinstance(value, dict):
        return Free(value["start"], min=float(value["min"]), max=float(value["max"]), sd=value.get("sd"))
    return [from_plain(one) for one in value] if isinstance(value, list) else value
