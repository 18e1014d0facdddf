"""Starts from free coefficients: equations linear in these are fitted at once, parameters matched to them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.layout import EquationLayout
from ..errors import ModfunError
from ..records.record import Record
from ..results.refits import ran_away
from .restarts import settled_within
from .scales import sizes

__all__ = ["likelier", "matched"]

KEPT = 32
SAME = 1e-6  # relative difference of coefficients of the same equations
ROUGHLY = 1.0  # decades
AWAY = 4.0  # standard errors: another minimum


def matched(
    fitted: Callable[[Any], Any],
    sought: Callable[..., Any],
    structure: Any,
    layout: EquationLayout,
    records: Sequence[Record],
) -> Any | None:
    """The fit from parameters whose coefficients come nearest to those of a fit of free ones; None without.

    Quotients and products of parameters, as 1/J and K/J, lead searches to infinity, where terms vanish:
    matching takes no record, and so may begin at many places. `fitted(equations)`: the fit of others to the
    same records; `sought(starts, within, near=)`: that of these from starts.
    """
    words = layout.formulas.words
    # Masked samples are filled, and uneven ones judged, by a response, which free coefficients do not have.
    odd = any(rec.mask is not None or rec.dt is None for rec in records)
    free = None if words["linear"] or odd else _freed(layout, structure.trend)
    if free is None:
        return None
    try:
        coefficients = fitted(free)
    except ModfunError:  # a band with fewer equations than unknowns
        return None
    if not coefficients.success or ran_away(coefficients):
        return None
    centres, _ = _centres(structure, layout, records)
    low, high = np.array(words["bounds"], dtype=float).T
    starts: F64 | None = free.nearest(coefficients.params, coefficients.cov_spectral, centres, low, high)
    if starts is None:
        return None
    fit = sought(starts.tolist(), None, near=True)
    return fit if settled_within(fit, layout) and not ran_away(fit) else None


def likelier(
    fit: Any,
    sought: Callable[..., Any],
    structure: Any,
    layout: EquationLayout,
    records: Sequence[Record],
) -> Any:
    """The fit, or that with other parameters of the same equations which lie nearer to what was told of them.

    A motor has two such sets, L and J of one with time constants exchanged: chance chose between L = 0.004
    and L = 1.8 beside a start of 0.002. Without a start those count that the equations ask for, which are
    rough: a set must be nearer by a decade.
    """
    free = None if layout.formulas.words["linear"] else _freed(layout, structure.trend)
    if free is None or not fit.usable or fit.at_bound:
        return fit
    from ..equations.symbolic.freed import far

    centres, told = _centres(structure, layout, records)
    low, high = np.array(layout.formulas.words["bounds"], dtype=float).T
    given = free.functions[0](fit.params)
    weights = np.diag(1 / np.where(given == 0, 1.0, np.abs(given)))
    other = free.led(np.clip(centres, low, high), given, weights)
    if other is None or np.any((other < low) | (other > high)):
        return fit
    if not np.allclose(free.functions[0](other), given, rtol=SAME, atol=0):
        return fit
    by = told if np.any(told) else np.ones_like(told)
    margin = 0.0 if np.any(told) else ROUGHLY
    if not far(other[by], centres[by]) + margin < far(fit.params[by], centres[by]):
        return fit
    found = sought(other.tolist(), None, near=True)
    if not found.success or found.at_bound:
        return fit
    # Its default band may end elsewhere, so that costs do not compare.
    near = np.abs(found.params - other) < AWAY * np.sqrt(np.diag(found.cov_spectral))
    return found if np.all(near) else fit


def _centres(structure: Any, layout: EquationLayout, records: Sequence[Record]) -> tuple[F64, Any]:
    """Where each parameter is likely, and of which the user told it."""
    words = layout.formulas.words
    asked = sizes(structure, layout.param_names, records)
    starts = np.array([start or 0.0 for start in words["starts"]])
    high = np.array([high for _, high in words["bounds"]])
    return np.where(starts != 0, starts, np.where(high <= 0, -asked, asked)), starts != 0


@lru_cache(KEPT)
def _freed(layout: EquationLayout, trend: str | None) -> Any | None:
    from ..equations.symbolic.freed import freed

    return freed(layout.compiled, trend)
