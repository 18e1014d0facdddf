"""Transfer functions with some of their words changed, and how users write these."""

from __future__ import annotations

from typing import Any

from ..models.free import Free
from ..models.transfer_function import TransferFunction
from .estimates import Estimates

__all__ = ["in_words", "rewritten"]


def rewritten(fit: Estimates, **changes: Any) -> TransferFunction:
    """The structure with some of its words changed, each written [output][input]."""
    structure, layout = fit.structure, fit.layout
    words: dict[str, Any] = {
        "poles": structure.poles,
        "zeros": [list(row) for row in layout.numerators],
        "delay": structure.delay,
        "denominator": structure.denominator,
        "params": dict(structure.params) or None,
    } | changes
    for name in ("zeros", "delay"):
        if structure.denominator is None and isinstance(words[name], list):
            words[name] = words[name][0]
    return TransferFunction(**words)


def in_words(rows: list[list[Any]]) -> str:
    """As short as a user would write it."""
    flat = [value for row in rows for value in row]
    if all(value == flat[0] for value in flat):
        return f"mf.{flat[0]!r}" if isinstance(flat[0], Free) else repr(flat[0])
    text = repr(rows[0] if len(rows) == 1 else rows)
    return text.replace("Free(", "mf.Free(")
