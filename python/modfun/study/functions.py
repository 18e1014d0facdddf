"""Functions of the user in a study: the random numbers they get, and what becomes of what they return.

What a function raises, and numbers that are not finite, may befall one replicate: they are counted, with a
text. What is wrong in kind (no Record, another shape, a name or an argument that is missing) would befall
every replicate and ends the run with a SpecError.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import signature
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.named import Named
from ..errors import SpecError
from ..records.record import Record
from ..results.fit import Fit
from ..rivals.common import Found

__all__ = [
    "Failed",
    "attempt",
    "generator",
    "number",
    "own_errors",
    "parameters",
    "record",
    "refuse_unlike",
    "series",
]

PURPOSES = ("estimator", "noise", "initial_state", "generate")
ERRORS = ("err", "error", "std", "sd", "stderr", "bse", "sigma")  # what standard errors are called elsewhere
LONGEST = 2000  # characters kept of one exception


class Failed(Exception):
    """A function failed in one replicate; the text says which and why."""


def generator(purpose: str, seed: int, replicate: int, group: int) -> np.random.Generator:
    """Random numbers addressed by what they are for, seed, replicate and group."""
    bits = np.random.Philox(key=[seed, group], counter=[0, 0, replicate, PURPOSES.index(purpose)])
    return np.random.Generator(bits)


def refuse_unlike(what: str, one: F64, two: F64) -> None:
    """Refuse a function that returned other numbers for the same replicate the second time.

    Raises
    ------
    SpecError
    """
    if not np.array_equal(one, two, equal_nan=True):
        raise SpecError(
            f"MonteCarlo: {what} called again for the same replicate returned other numbers, so that no "
            "replicate could be made again; draw from rng, the generator it is given, as "
            "rng.standard_normal(n), and from no other"
        )


def attempt(what: str, call: Callable[..., Any], *given: Any) -> Any:
    """Call a function of the user.

    Raises
    ------
    Failed
        It raised an exception; "<what>: " stands before its text, nothing for an empty `what`.
    SpecError
        It does not take so many arguments.
    """
    try:
        return call(*given)
    except Exception as error:
        if isinstance(error, TypeError) and not _takes(call, given):
            whose = what or getattr(call, "__name__", "a function")
            kinds = ", ".join(type(one).__name__ for one in given)
            raise SpecError(
                f"MonteCarlo: {whose} is called with {len(given)} arguments ({kinds}) and does not take "
                f"them: {error}; give it a parameter for each, in this order"
            ) from error
        text = f"{type(error).__name__}: {error}"
        raise Failed((f"{what}: {text}" if what else text)[:LONGEST]) from error


def _takes(call: Callable[..., Any], given: tuple[Any, ...]) -> bool:
    """Whether a function takes these arguments, as far as Python knows its signature."""
    try:
        signature(call).bind(*given)
    except TypeError:
        return False
    except ValueError:  # a signature that Python does not know
        pass
    return True


def series(value: Any, what: str, shape: tuple[int, ...], meaning: str) -> F64:
    """Finite numbers of a shape.

    Raises
    ------
    SpecError
        Something else than numbers, or another shape.
    Failed
        Numbers that are not finite.
    """
    found = _real(value)
    if found is None or found.shape != shape:
        raise SpecError(
            f"MonteCarlo: {what} returned {_said(value)}; return {meaning}, an array of shape {shape}"
        )
    if not np.all(np.isfinite(found)):
        raise Failed(f"{what}: {np.sum(~np.isfinite(found))} of {found.size} numbers are not finite")
    return found


def record(value: Any, first: tuple[tuple[str, ...], tuple[str, ...]] | None) -> Record:
    """A Record with the outputs and inputs of the first one.

    Raises
    ------
    SpecError
        No Record, or one with other channels.
    """
    if not isinstance(value, Record):
        raise SpecError(
            f"MonteCarlo: generate returned {_said(value)}; return an mf.Record(y=..., u=..., dt=...)"
        )
    if first is not None and (value.outputs, value.inputs) != first:
        raise SpecError(
            f"MonteCarlo: generate returned a record with outputs {list(value.outputs)} and inputs "
            f"{list(value.inputs)}, the first of its cell had {list(first[0])} and {list(first[1])}; return "
            "the same channels in every replicate"
        )
    return value


def number(value: Any, what: str) -> float:
    """A finite number.

    Raises
    ------
    SpecError
        Something else than a number.
    Failed
        A number that is not finite.
    """
    return float(series(value, what, (), "a number"))


def parameters(answer: Any, names: tuple[str, ...], who: str) -> F64:
    """What an estimator returned, in the order of the parameter names; nan is let through.

    Raises
    ------
    SpecError
        A name that is missing, another shape.
    """
    if isinstance(answer, Fit):
        answer = answer.estimates()
    given = _by_name(answer)
    if given is not None:
        missing = [name for name in names if name not in given]
        if missing:
            raise SpecError(
                f"MonteCarlo: the estimator {who!r} returned {', '.join(map(str, given)) or 'nothing'}; "
                f"{', '.join(missing)} of {', '.join(names)} is missing: return all, or give model="
            )
        words = (f"{name}_{word}" for name in names for word in ERRORS)
        odd = [word for word in words if word in given and word not in names]
        if odd:
            raise SpecError(
                f"MonteCarlo: the estimator {who!r} returned {odd[0]}; standard errors, from which coverage "
                f"is counted, have the name {odd[0].rpartition('_')[0]}_se"
            )
        answer = [given[name] for name in names]
    theta = _real(answer)
    if theta is None or theta.shape != (len(names),):
        raise SpecError(
            f"MonteCarlo: the estimator {who!r} returned {_said(answer)}; return a dict, an array of "
            f"{', '.join(names)}, or a Fit"
        )
    return theta


def own_errors(answer: Any, names: tuple[str, ...]) -> tuple[F64, str]:
    """Standard errors that an estimator returned beside its parameters, as a1_se; nan where it did not.

    Rivals' answers have them as an attribute, `bse`.

    With what is wrong with those that it returned, in words; "" where nothing is.
    """
    given = _by_name(answer) or {}
    if isinstance(answer, Found):
        given |= {f"{name}_se": se for name, se in answer.bse.items()}
    found = _real([given.get(f"{name}_se", np.nan) for name in names])
    if found is None or found.shape != (len(names),):
        found = np.full(len(names), np.nan)
    wrong = [
        name for name, se in zip(names, found, strict=True) if f"{name}_se" in given and not 0 <= se < np.inf
    ]
    said = ", ".join(f"{name}_se = {given[f'{name}_se']}" for name in wrong)
    found[[names.index(name) for name in wrong]] = np.nan
    return found, f"returned {said}, no standard error" if said else ""


def _by_name(answer: Any) -> dict[str, Any] | None:
    """What was returned under names, by a dict, a named vector or a pandas Series; None of an array."""
    if isinstance(answer, Named) and not answer.names:
        return None
    if not (isinstance(answer, Named | Mapping) or hasattr(answer, "keys")):
        return None
    found = dict(answer)
    return found if isinstance(answer, Mapping) or all(isinstance(key, str) for key in found) else None


def _real(value: Any) -> F64 | None:
    """Real numbers as an array; None for what is complex, text, ragged or nothing at all."""
    try:
        found = np.asarray(value)
        if found.dtype.kind in "cSU" or value is None:  # NumPy would drop imaginary parts and read text
            return None
        return found.astype(np.float64)
    except (TypeError, ValueError):
        return None


def _said(value: Any) -> str:
    try:
        found = np.asarray(value)
        shape, kind = found.shape, {"c": "complex ", "S": "text, ", "U": "text, "}.get(found.dtype.kind, "")
    except ValueError:  # ragged
        shape, kind = (), ""
    name = type(value).__name__
    return f"{kind}{name} of shape {shape}" if shape else f"{kind if kind[:1] == 'c' else ''}{name}"
