"""What users give to a `TransferFunction`: numbers, rows and tables of them, checked and as tuples."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from numbers import Integral
from typing import Any

import numpy as np

from ..base.arguments import is_sequence, real
from ..errors import SpecError
from .free import Free, bounds_meant

__all__ = [
    "MOST_POLES",
    "Delay",
    "degree_of",
    "delay_of",
    "depth",
    "improper",
    "nested",
    "order_of",
    "params_of",
    "plain",
    "table_of",
]

MOST_POLES = 100
Delay = float | Free


def depth(value: Any) -> int:
    """0 of a number for all, 1 of a row (one per input), 2 of a table [output][input]."""
    return 0 if not isinstance(value, tuple) else 2 if any(isinstance(one, tuple) for one in value) else 1


def nested(name: str, value: Any, one: Callable[[Any], Any]) -> Any:
    """A number, a row or a table of what `one` accepts, as tuples."""
    if not is_sequence(value):
        return one(value)
    rows = [is_sequence(item) for item in value]
    if not rows:
        raise SpecError(f"TransferFunction: {name}=[] names no input; give one number, or one per input")
    if any(rows) and not all(rows):
        raise SpecError(
            f"TransferFunction: {name}={value!r} mixes numbers and lists; give a list an output, each with a "
            "number an input"
        )
    if not any(rows):
        return tuple(one(item) for item in value)
    if any(len(row) == 0 or any(is_sequence(item) for item in row) for row in value):
        raise SpecError(f"TransferFunction: {name}={value!r} must be nested as [output][input], no deeper")
    return tuple(tuple(one(item) for item in row) for row in value)


def table_of(value: Any, outputs: int, inputs: int) -> tuple[tuple[Any, ...], ...]:
    """[output][input] from what may be given for all, an input or a path."""
    if depth(value) == 2:
        return tuple(value)
    row = value if isinstance(value, tuple) else (value,) * inputs
    return (row,) * outputs


def plain(value: Any) -> Any:
    """Nested tuples as the lists that a user would write."""
    if not isinstance(value, tuple):
        return value
    return [plain(one) for one in value]


def _is_count(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool | np.bool_)


def order_of(value: Any) -> int:
    """A number of poles."""
    if not _is_count(value) or value < 1:
        raise SpecError(f"TransferFunction: poles={value!r} must be a whole number of at least 1")
    if value > MOST_POLES:
        raise SpecError(
            f"TransferFunction: poles={value} is more than {MOST_POLES}; no record determines so many"
        )
    return int(value)


def degree_of(value: Any, poles: int) -> int | None:
    """A number of zeros; None: no path."""
    if value is None:
        return None
    if not _is_count(value) or value < 0:
        raise SpecError(
            f"TransferFunction: zeros holds {value!r}; give whole numbers of at least 0, or None for an "
            "input without a path"
        )
    if value > poles:
        raise SpecError(
            f"TransferFunction: {value} zeros with {poles} poles; a system that can be sampled has at most "
            f"as many zeros as poles: {improper(poles, int(value))}"
        )
    return int(value)


def improper(poles: int, zeros: int) -> str:
    """What to do about more zeros than poles, with the equation that has derivatives of the input."""
    left = [f"{f'a{k}*' if k else ''}y{_primes(poles - k)}" for k in range(poles + 1)]
    right = [f"b{k}*u{_primes(zeros - k)}" for k in range(zeros + 1)]
    return (
        "lower zeros= or raise poles=; where the output does follow derivatives of the input, write the "
        f'equation: mf.Equation("{" + ".join(left)} = {" + ".join(right)}")'
    )


def _primes(order: int) -> str:
    return "'" * order


def delay_of(value: Any) -> float | Free:
    """A delay in s, known or to be estimated."""
    if isinstance(value, Free):
        if not (isfinite(value.max) and value.max > 0):
            raise SpecError(
                f"TransferFunction: delay={value!r} needs a max, in s: the window starts so much later; as "
                "mf.Free(0.1, min=0, max=0.5)"
            )
        if isfinite(value.min) and value.min < 0:
            raise SpecError(f"TransferFunction: delay={value!r} must not be below 0 s: raise its min")
        return value
    try:
        late = real("TransferFunction", "delay", value, finite=False)
    except SpecError:
        raise SpecError(
            f"TransferFunction: delay={value!r} is not a number; give delays in seconds, or mf.Free(...)"
        ) from None
    if not (np.isfinite(late) and late >= 0):
        raise SpecError(f"TransferFunction: delay={value!r} s must be finite and at least 0")
    return late


def params_of(given: Any) -> tuple[tuple[str, float | Free], ...]:
    """Parameters that are held or bounded, as pairs."""
    if given is None:
        return ()
    if isinstance(given, tuple) and all(isinstance(pair, tuple) and len(pair) == 2 for pair in given):
        given = dict(given)  # as the structure keeps them
    if not isinstance(given, Mapping):
        raise SpecError(f'TransferFunction: params={given!r} must map names to values, as {{"a2": 0.0}}')
    found: list[tuple[str, float | Free]] = []
    for name, value in given.items():
        if isinstance(value, Free):
            found.append((str(name), value))
            continue
        try:
            if isinstance(value, bool | str):
                raise TypeError
            number = float(value)
        except (TypeError, ValueError):
            raise SpecError(
                f"TransferFunction: params[{name!r}]={value!r} must be a number (held there) or "
                f"mf.Free(...){bounds_meant(value)}"
            ) from None
        if not isfinite(number):
            raise SpecError(f"TransferFunction: params[{name!r}]={value!r} must be finite")
        found.append((str(name), number))
    return tuple(found)
