"""What fits of equations say of inputs that never move, whose parameters no search can find."""

from __future__ import annotations

from typing import Any

import numpy as np

from .estimates import Estimates

__all__ = ["of_still_inputs"]


def of_still_inputs(fit: Estimates) -> str:
    """That inputs never move, where records cannot tell parameters apart; "" where it is no matter.

    Without constants in the equations, an input that stands at another value than 0 may tell its gain.
    """
    if fit.status != "rank" or fit.layout.rational:
        return ""
    records = fit.records or ()
    still = [u for u in fit.inputs if records and all(np.ptp(rec[u]) == 0 for rec in records)]
    if not still:
        return ""
    names = " and ".join([repr(u) for u in still])
    levels = " and ".join([f"{records[0][u][0]:g}" for u in still])
    word, its, them = ("Inputs", "their gains", "them") if len(still) > 1 else ("Input", "its gain", "it")
    left = [u for u in records[0].inputs if u not in still]
    own = _parameters(fit.structure.compiled(), set(still))
    hold = f", or hold what says {its}, params={dict.fromkeys(own, 0)}" if own else ""
    return (
        f"{word} {names} never moved, at {levels} throughout, so nothing can be learnt about {its} from the "
        f"record. First leave {them} out of the model and of the record, rec.select(inputs={left}){hold}."
    )


def _parameters(compiled: Any, inputs: set[str]) -> list[str]:
    """Parameters of terms that are zero where these inputs are."""
    used, left = set(), set()
    for equation in compiled.source:
        symbols = equation.free_symbols
        nothing = dict.fromkeys([one for one in symbols if one.name.rstrip("'") in inputs], 0)
        used |= {one.name for one in symbols}
        left |= {one.name for one in equation.subs(nothing).expand().free_symbols}
    return [name for name in compiled.parameters if name in used - left]
