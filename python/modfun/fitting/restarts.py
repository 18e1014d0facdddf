"""Starts of sizes that an equation and its record ask for, where the search from others led nowhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import inf
from typing import Any

import numpy as np

from ..equations.layout import EquationLayout
from ..errors import DataError
from ..records.record import Record
from ..results.refits import ran_away
from .scales import sizes

__all__ = ["compared", "restarted", "settled_within"]

FACTOR = 10.0  # of a size either way
SMALLER = 5.0  # than its size: what a signal is compared with, as a half-saturation

Bounds = tuple[tuple[float, float], ...]


def restarted(
    sought: Callable[[list[float], Bounds, bool], Any],
    structure: Any,
    layout: EquationLayout,
    records: Sequence[Record],
    learns: bool,
) -> Any | None:
    """The first fit from within a box that ends at a minimum inside it, and leaves noise; None if none does.

    `sought` makes one from starts, within bounds, with levels of noise learnt or not: of several outputs a
    level that runs away takes the parameters along, and levels that the high band shows do not.
    """
    words = layout.formulas.words
    if words["linear"] and not compared(layout.compiled):
        return None  # linear ones begin at their minimum
    own = words["bounds"]
    inside = {k for _, k, _ in words["signal_slopes"]} | compared(layout.compiled)
    asked = sizes(structure, layout.param_names, records).tolist()
    for starts, box in _boxes(asked, words["starts"], own, inside):
        for learn in (True, False) if learns else (True,):
            try:
                fit = sought(starts, box, learn)
                if fit.status == "maxiter" and not fit.at_bound:  # on its way
                    fit = sought(fit.params.tolist(), box, learn)
            except DataError:  # a band with fewer equations than unknowns
                continue
            # Where a level took the residuals up, the fit is none: that of a wrong model would pass for one.
            if settled_within(fit, layout) and not ran_away(fit):
                return fit
    return None


def compared(compiled: Any) -> set[int]:
    """Parameters that the user's equations add to signals in denominators, wherever the compiler put them."""
    import sympy

    signals = {*compiled.outputs, *compiled.inputs, *compiled.hidden}
    found: set[str] = set()
    for expr in compiled.source:
        for power in expr.atoms(sympy.Pow):
            names = {s.name for s in power.base.free_symbols}
            if power.base.is_Add and power.exp.is_negative and names & signals:
                found |= names
    return {k for k, name in enumerate(compiled.parameters) if name in found}


def settled_within(fit: Any, layout: EquationLayout) -> bool:
    """Whether a search within closer bounds ended at a minimum: on no bound but a user's own."""
    own = layout.formulas.words["bounds"]
    at = [layout.param_names.index(name) for name in fit.at_bound]
    return bool(fit.success) and all(fit.params[k] in own[k] for k in at)


def _boxes(
    sizes: Sequence[float], told: Sequence[float | None], own: Bounds, inside: set[int]
) -> Iterator[tuple[list[float], Bounds]]:
    """Starts and bounds about them, within a user's own bounds.

    `inside`: parameters beside signals, as in S/(Ks + S), which cross zero last: with the other sign such a
    term has a pole.
    """
    every = set(range(len(sizes)))
    # A start that a user told was tried already, and says which sign is likelier.
    centres = [
        size if start is None or start >= 0 else -size for start, size in zip(told, sizes, strict=True)
    ]
    # As the sizes are, then either way: coefficients may also be far smaller than their term can be, and what
    # a signal is compared with, as Ks, than the signal is.
    ways = [
        (set[int](), 1.0),
        *([(every - inside, 1.0), (every - inside, SMALLER)] * bool(inside)),
        (every, 1.0),
    ]
    for signed, smaller in ways:
        box = []
        for k, (centre, start, (low, high)) in enumerate(zip(centres, told, own, strict=True)):
            centre = centre / smaller if k in inside and start is None else centre
            if -inf < low and high < inf:
                box.append((low, high))
                continue
            if high <= 0 < centre and start is None:
                centre = -centre
            ends = sorted([centre / FACTOR, centre * FACTOR])
            if k in signed and start is None:
                ends = [-abs(centre) * FACTOR, abs(centre) * FACTOR]
            box.append((max(low, ends[0]), min(high, ends[1])))
        if all(a < b for a, b in box):
            yield [float(np.clip(x, a, b)) for x, (a, b) in zip(centres, box, strict=True)], tuple(box)
