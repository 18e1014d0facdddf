"""Texts in given names to numbers: the parser's tree walked with NumPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .parser import CONSTANTS, FUNCTIONS, Node, expression

__all__ = ["function_of"]

_COMPARE: dict[str, Callable[[Any, Any], Any]] = {
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
}


def function_of(text: str, names: Sequence[str], what: str = "expression") -> Callable[..., Any]:
    """A text in given names as a function of a mapping from name to number or array.

    Parameters
    ----------
    text : str
        Such as ``"a1/(2*sqrt(a2))"``; it is read once, and never run.
    names : sequence of str
        What may stand in it besides constants and functions.
    what : str
        What it is, for messages.

    Returns
    -------
    callable
        Its values are nan or inf where the expression has none.

    Raises
    ------
    SpecError
        Text with a name, operator or construct outside the language.
    """
    tree = expression(text, what, names).tree

    def at(values: Mapping[str, Any]) -> Any:
        # Overflow and invalid operations show as inf and nan, which the caller reports with their place.
        with np.errstate(all="ignore"):
            return _value(tree, values)

    return at


def _value(node: Node, given: Mapping[str, Any]) -> Any:
    match node.kind:
        case "number":
            return np.float64(node.value)  # never an int: powers cannot grow
        case "name":
            return given[node.value] if node.value in given else CONSTANTS[node.value]
        case "product":  # a/b, not a*(1/b), which is another number
            found = _value(node.parts[0], given)
            for part in node.parts[1:]:
                if part.kind == "inverse":
                    found = np.divide(found, _value(part.parts[0], given))
                else:
                    found = np.multiply(found, _value(part, given))
            return found
    parts = [_value(part, given) for part in node.parts]
    match node.kind:
        case "sum":
            found = parts[0]
            for part in parts[1:]:
                found = np.add(found, part)
            return found
        case "negative":
            return np.negative(parts[0])
        case "power":
            return np.power(*parts)
        case "mod":
            return np.mod(*parts)
        case "compare":
            return _COMPARE[node.value](*parts).astype(np.float64)
        case "call":
            return FUNCTIONS[node.value][1](*parts)
    raise AssertionError(f"unknown node {node.kind}")
