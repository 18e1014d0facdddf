"""Functions that jump inside equations: of time, exact as inputs; of outputs, where noise flips signs."""

from __future__ import annotations

import numpy as np

from ..base.names import listed
from ..language.parser import Node
from .doubts import FINEST, Doubt, pieces, rms
from .estimates import Estimates
from .response_call import output_error_call

__all__ = ["flips", "jumps"]

SEEN = 4.0  # standard errors, which are too small, from zero
STEPS = ("step", "where", "sign", "floor")


def jumps(fit: Estimates) -> Doubt | None:
    """That a term jumps at a time that is written in it; instants on the samples are as bad as others."""
    found: dict[str, None] = {}
    for text, node in pieces(fit):
        steps = node.kind == "compare" or (node.kind == "call" and node.value in STEPS)
        if steps and _of_time(fit, node):
            found[text[node.at : node.end]] = None
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


def flips(fit: Estimates) -> Doubt | None:
    """That equations take the sign of a noisy output that goes through zero, and that it matters.

    Noise moves the instants of jumps, and samples see these up to half an interval off; where dry friction
    holds a state, its sign is that of noise alone. Errors of HC3 do not count it either.
    """
    signs = _signs(fit)
    if not signs or fit.noise_levels.shape[1:] != (len(fit.outputs),):
        return None
    names = [name for name in signs if _flips(fit, name)]
    if not names:
        return None
    name = names[0]
    return Doubt(
        f"sign({name}) takes the sign of noise where {name} goes through zero, which standard errors do not "
        "count: they may be several times too small. First try output error, which integrates the equations, "
        f"{output_error_call(fit, 'fit.structure')}.solve(rec).",
        sure=any(_matters(fit, own) for own in signs[name]),
    )


def _signs(fit: Estimates) -> dict[str, list[set[str]]]:
    """Outputs of which equations take the sign, with the names in each term that does."""
    found: dict[str, list[set[str]]] = {}
    for text in getattr(fit.structure, "parsed", ()):
        for term in _terms(text.tree):
            for node in term.walk():
                parts = [each for each in node.walk() if each.kind == "name"]
                signs = node.kind == "call" and node.value == "sign" and len(parts) == 1
                if signs and parts[0].primes == 0 and parts[0].value in fit.outputs:
                    names = {str(each.value) for each in term.walk() if each.kind == "name"}
                    found.setdefault(parts[0].value, []).append(names)
    return found


def _terms(node: Node) -> list[Node]:
    """Terms of a sum, on both sides of an equation."""
    if node.kind in ("sum", "negative", "compare"):
        return [term for part in node.parts for term in _terms(part)]
    return [node]


def _matters(fit: Estimates, names: set[str]) -> bool:
    """Whether no parameter of a term may be zero."""
    own = [k for k, name in enumerate(fit.param_names) if name in names]
    return bool(np.all(np.abs(fit.params[own]) > SEEN * fit.spread[own]))


def _flips(fit: Estimates, name: str) -> bool:
    """Whether an output goes through zero, and has noise."""
    for rec, levels in zip(fit.records or (), fit.noise_levels, strict=False):
        values, level = rec[name], levels[fit.outputs.index(name)]
        if values.min() < 0 < values.max() and level > FINEST * rms(values, 0.0):
            return True
    return False
