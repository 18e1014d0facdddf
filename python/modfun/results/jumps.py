"""Functions of time that jump inside equations: exact as inputs, sums over samples as terms."""

from __future__ import annotations

from ..base.names import listed
from ..language.parser import Node
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["jumps"]

STEPS = ("step", "where", "sign", "floor")


def jumps(fit: Estimates) -> Doubt | None:
    """That a term jumps at a time that is written in it; instants on the samples are as bad as others."""
    found: dict[str, None] = {}
    for text in getattr(fit.structure, "parsed", ()):  # of `Equation`
        for node in text.tree.walk():
            if (node.kind == "compare" or (node.kind == "call" and node.value in STEPS)) and _of_time(
                fit, node
            ):
                found[text.text[node.at : node.end]] = None
    if not found:
        return None
    return Doubt(
        f"The equations jump in time by {listed(list(found))}, and sums over samples see a jump up to a "
        "sampling interval off, which biases the estimates. First make it an input, which is exact: write d "
        f'in its place, with inputs=["d"], and give Record(u={{"d": "{next(iter(found))}"}}).'
    )


def _of_time(fit: Estimates, node: Node) -> bool:
    """Whether its names are t alone, and t is time."""
    names = {each.value for each in node.walk() if each.kind == "name"}
    return names == {"t"} and "t" not in (*fit.outputs, *fit.inputs)
