"""Systems in series, in parallel, in feedback and divided, by python-control; delays where they commute."""

from __future__ import annotations

import numbers
import operator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.optional import optional
from ..base.samples import frozen
from ..errors import SpecError
from .interop import polynomials_to_control
from .polynomials import Polynomials, strip

__all__ = ["Parts", "connected"]

WORDS = {"*": "series", "/": "quotient", "+": "sum", "-": "difference", "feedback": "feedback"}
OPERATORS = {"*": operator.mul, "/": operator.truediv, "+": operator.add, "-": operator.sub}


@dataclass(frozen=True)
class Parts:
    """What a connected system is made of; either polynomials or matrices."""

    numerators: Polynomials | None
    denominators: Polynomials | None
    matrices: tuple[F64, F64, F64, F64] | None
    delays: tuple[float, ...]
    inputs: tuple[str, ...] | None
    outputs: tuple[str, ...] | None


def connected(how: str, first: Any, second: Any, sign: int = -1) -> Parts:
    """Two systems connected: ``first * second`` lets the second act first, as in python-control.

    Parameters
    ----------
    how : {"*", "/", "+", "-", "feedback"}
        Quotients are transfer functions, and feedback around several channels is a state space.
    first, second : LTI, or a system of python-control, or a number or matrix
    sign : {-1, 1}
        Of the feedback.

    Raises
    ------
    SpecError
        Numbers of channels that do not fit, or delays that have no place in the result.
    ImportError
        python-control is not installed.
    """
    control = optional("control", "control", f"the {WORDS[how]} of systems")
    if sign not in (-1, 1):
        raise SpecError(f"feedback: sign={sign!r} must be -1 (negative feedback) or 1")
    late = _delay(how, first, second)
    several = how == "feedback" and any(max(getattr(one, "shape", (1,))) > 1 for one in (first, second))
    states = how != "/" and (several or any(_has_states(one) for one in (first, second)))
    one, two = (_to_control(given, states) for given in (first, second))
    try:
        if how == "feedback":
            made = control.feedback(one, two, sign)
        else:
            made = OPERATORS[how](one, two)
    except (ValueError, TypeError, NotImplementedError) as error:
        raise SpecError(f"the {WORDS[how]} of these systems does not exist: {error}") from None
    before = second if isinstance(first, numbers.Number) else first
    after = first if how == "feedback" or isinstance(second, numbers.Number) else second
    outputs, inputs = getattr(before, "outputs", None), getattr(after, "inputs", None)
    if how == "/":  # the inverse goes from outputs to inputs
        inputs = getattr(second, "outputs", None)
        outputs = getattr(second, "inputs", None) if before is second else outputs
    if how in "+-" and getattr(second, "outputs", outputs) != outputs:
        outputs = None
    if how in "+-" and getattr(first, "inputs", inputs) != inputs:
        inputs = None
    delays = (late,) * made.ninputs
    if hasattr(made, "A"):
        a, b, c, d = (frozen(np.array(m, dtype=np.float64)) for m in (made.A, made.B, made.C, made.D))
        return Parts(None, None, (a, b, c, d), delays, inputs, outputs)
    pairs = [
        [(strip(n), strip(d)) for n, d in zip(nums, dens, strict=True)]
        for nums, dens in zip(made.num_list, made.den_list, strict=True)
    ]
    if how == "/" and (wrong := [(n, d) for row in pairs for n, d in row if n.size > d.size]):
        n, d = wrong[0]
        raise SpecError(
            f"the quotient of these systems is improper, with {n.size - 1} zeros and {d.size - 1} poles, and "
            "an improper system has no response to samples: multiply the numerator by fast poles, as "
            "mf.tf([1], [0.001, 1])"
        )
    numerators = tuple(tuple(frozen(n / d[0]) for n, d in row) for row in pairs)
    denominators = tuple(tuple(frozen(d / d[0]) for _, d in row) for row in pairs)
    return Parts(numerators, denominators, None, delays, inputs, outputs)


def _has_states(given: Any) -> bool:
    """Whether it is a state space, of either package."""
    return getattr(given, "matrices", None) is not None or hasattr(given, "nstates")


def _to_control(given: Any, states: bool) -> Any:
    """What python-control computes with, delays apart."""
    if not hasattr(given, "path_delays"):
        return given
    plain = given.without_delays()
    if states:
        return plain.to_ss().to_control()
    nums, dens = plain.polynomials()
    return polynomials_to_control(nums, dens, plain.delays, None)


def _delay(how: str, first: Any, second: Any) -> float:
    """The one delay of the result: of all paths in series, or equal in both systems of a sum."""
    found: list[NDArray[Any]] = [np.ravel(getattr(one, "path_delays", 0.0)) for one in (first, second)]
    if not any(own.any() for own in found):
        return 0.0
    if how == "*" and all(np.ptp(own) == 0 for own in found):
        return float(found[0][0] + found[1][0])
    if how == "/" and all(np.ptp(own) == 0 for own in found) and found[0][0] >= found[1][0]:
        return float(found[0][0] - found[1][0])
    if how in "+-" and np.ptp(np.concatenate(found)) == 0:
        return float(found[0][0])
    raise SpecError(
        f"the {WORDS[how]} of systems with delays {found[0].tolist()} and {found[1].tolist()} s has no input "
        "delays of its own; give rational forms, as mf.ss(system.to_control(pade=3))"
    )
