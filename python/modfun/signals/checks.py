"""What users give to the makers of signals, checked: names, times on samples, amplitudes, bands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import real, reals
from ..base.arrays import F64
from ..base.samples import MOST_SAMPLES, numbered
from ..errors import SpecError

__all__ = [
    "amplitudes_of",
    "band_of",
    "intervals_of",
    "names_of",
    "number",
    "one_input",
    "samples_of",
]


def number(what: str, value: Any, *, least: float = 0.0, strict: bool = True) -> float:
    """A finite number above `least` (or at least that)."""
    try:
        found = real(what, "", value)
    except SpecError:
        found = np.nan
    if not found >= least or (strict and found == least):
        raise SpecError(f"{what}={value!r} must be a number {'above' if strict else 'of at least'} {least:g}")
    return found


def names_of(what: str, given: str | int | Sequence[str]) -> tuple[str, ...]:
    """Names of inputs: one, several, or as many as a number says."""
    if isinstance(given, int | np.integer) and not isinstance(given, bool):
        if not 1 <= given <= 100:
            raise SpecError(f"{what}: inputs={given} must be 1 to 100 inputs, or their names")
        return numbered("u", int(given))
    given = given.tolist() if isinstance(given, np.ndarray) else given
    names = (given,) if isinstance(given, str) else tuple(given) if isinstance(given, Sequence) else ()
    if not names or not all(isinstance(name, str) and name.strip() for name in names):
        raise SpecError(
            f'{what}: inputs={given!r}; give a name, a list of names as ["de", "da"], or a number'
        )
    if len(set(names)) < len(names):
        raise SpecError(f"{what}: inputs={list(names)} names an input twice; names must differ")
    return names


def one_input(what: str, given: str | int | Sequence[str]) -> tuple[str, ...]:
    """The name of the input of a signal that is for one."""
    names = names_of(what, given)
    if len(names) > 1:
        raise SpecError(
            f'{what}: one input at a time; {what}("da", ...).then({what}("dr", ...)) is one after the other'
        )
    return names


def samples_of(what: str, seconds: Any, dt: float, *, least: float = 0.0, strict: bool = False) -> int:
    """A time that must be a whole number of sampling intervals, as that number."""
    time = number(what, seconds, least=least, strict=strict)
    if not time / dt <= MOST_SAMPLES:
        raise SpecError(f"{what}={time:g} s at dt={dt:g} s makes {time / dt:.3g} samples, too many; raise dt")
    count = round(time / dt)
    if abs(time - count * dt) > 1e-6 * dt or (strict and count == 0):
        near = max(count, 1 if strict else 0) * dt
        raise SpecError(
            f"{what}={time:g} s is {time / dt:g} sampling intervals of {dt:g} s and must be a whole number "
            f"of them: give {near:g} s, or another dt"
        )
    return count


def intervals_of(what: str, duration: Any, dt: Any, before: Any, after: Any) -> tuple[float, int, int, int]:
    """Sampling interval, and the number of intervals of rest before, of excitation, of rest after."""
    step = number(f"{what}: dt", dt)
    count = samples_of(f"{what}: duration", duration, step, strict=True)
    lead, tail = (samples_of(f"{what}: {k}", v, step) for k, v in (("before", before), ("after", after)))
    if count - lead - tail < 2:
        raise SpecError(
            f"{what}: before={before:g} s and after={after:g} s leave {(count - lead - tail) * step:g} s of "
            f"duration={duration:g} s, which includes them; raise duration"
        )
    return step, lead, count - lead - tail, tail


def amplitudes_of(what: str, given: ArrayLike, count: int) -> F64:
    """One amplitude an input (or a pulse), none of them zero."""
    head, _, name = what.rpartition(": ")
    values = reals(head, name, given)
    if values.ndim > 1 or values.size not in (1, count) or not np.all(np.isfinite(values) & (values != 0)):
        raise SpecError(
            f"{what}={given!r} must be one number that is not 0"
            + (f", or {count} of them" if count > 1 else "")
        )
    return np.broadcast_to(values.reshape(-1), (count,)).copy()


def band_of(what: str, given: Any, dt: float) -> tuple[float, float]:
    """Lower and upper edge in rad/s; one number is the upper edge, the lower one is then 0."""
    edges = reals(what, "band", given).reshape(-1)
    if edges.size == 1:
        edges = np.array([0.0, edges[0]])
    if edges.size != 2 or not np.all(np.isfinite(edges)) or not 0 <= edges[0] < edges[1]:
        raise SpecError(
            f"{what}: band={given!r} must be (lower, upper) or upper, in rad/s, 0 ≤ lower < upper"
        )
    if edges[1] >= np.pi / dt:
        raise SpecError(
            f"{what}: the band goes to {edges[1]:g} rad/s, and samples {dt:g} s apart end at "
            f"{np.pi / dt:.4g} rad/s; lower the band or dt (eight samples per period are good)"
        )
    return float(edges[0]), float(edges[1])
