"""Where parameters in functions and exponents are sought: k of sin(k*y) up to 30/R, where y moves by R."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, inf, log2
from typing import Any

import numpy as np

from ..equations.layout import EquationLayout
from ..records.corners import driving
from ..records.record import Record

__all__ = ["inside", "sensible"]

# Largest argument over the range of a signal: beyond some five periods of a sine, what its noise does to it
# follows any record.
MOST = 30.0
# The same of an exponential, which changes by a factor of e**10 = 22,000 meanwhile: up to e**30 the search
# ran to a bound, where single samples are all, in two of four records of a stirred reactor. Steeper ones are
# found without bounds.
STEEPEST = 10.0
KEPT = 32


def sensible(layout: EquationLayout, records: Sequence[Record]) -> tuple[tuple[float, float], ...] | None:
    """Bounds of all parameters, closer for those of which the user told nothing and that signals scale.

    None where there are no such parameters. Powers of two: records alike share what is prepared for them.
    """
    found = inside(layout)
    if not found:
        return None
    bounds = list(layout.formulas.words["bounds"])
    for k, slopes, even in found:
        widest = 0.0
        for rec in records:
            for expr, steep in slopes:
                with np.errstate(all="ignore"):
                    values = layout.formulas.values(expr, rec.y, driving(rec), rec.t)
                finite = values[np.isfinite(values)]  # the logarithm of zero is not
                range_ = float(np.ptp(finite)) if finite.size else 0.0
                widest = max(widest, range_ / (STEEPEST if steep else MOST))
        if not 0 < widest < inf:
            return None
        most = 2.0 ** ceil(-log2(widest))
        bounds[k] = (0.0 if even else -most, most)
    return tuple(bounds)


@lru_cache(KEPT)
def inside(layout: EquationLayout) -> list[tuple[int, Any, bool]]:
    """What parameters multiply inside functions: see `equations.symbolic.arguments.multiplied`."""
    if layout.formulas.words["linear"] or not layout.formulas.words["signal_slopes"]:
        return []
    from ..equations.symbolic.arguments import multiplied

    return multiplied(layout.compiled)
