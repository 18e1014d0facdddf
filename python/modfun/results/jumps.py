"""Functions that jump inside equations: of time, exact as inputs; of outputs, where noise flips signs."""

from __future__ import annotations

from ..base.names import listed
from ..language.parser import Node
from .doubts import FINEST, Doubt, pieces, rms
from .estimates import Estimates

__all__ = ["flips", "jumps"]

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
    """That equations take the sign of a noisy output that goes through zero."""
    if fit.options.cov_type == "HC3" or fit.noise_levels.shape[1:] != (len(fit.outputs),):
        return None
    for _, node in pieces(fit):
        parts = [each for each in node.walk() if each.kind == "name"]
        if node.kind != "call" or node.value != "sign" or len(parts) != 1:
            continue
        name = parts[0].value
        if parts[0].primes == 0 and name in fit.outputs and _flips(fit, name):
            return Doubt(
                f"sign({name}) takes the sign of noise where {name} goes through zero, which standard "
                'errors do not count: they may be several times too small. Compare cov_type="HC3".',
                sure=False,
            )
    return None


def _flips(fit: Estimates, name: str) -> bool:
    """Whether an output goes through zero, and has noise."""
    for rec, levels in zip(fit.records or (), fit.noise_levels, strict=False):
        values, level = rec[name], levels[fit.outputs.index(name)]
        if values.min() < 0 < values.max() and level > FINEST * rms(values, 0.0):
            return True
    return False
