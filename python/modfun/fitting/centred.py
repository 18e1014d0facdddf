"""Starts of factors before exponentials, as k0 of k0*exp(-E/T): found with the exponential about its mean."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.equation import Equation
from ..equations.layout import EquationLayout
from ..errors import ModfunError
from ..models.free import Free
from ..models.options import Options
from ..records.corners import driving
from ..records.record import Record
from .arguments import inside

__all__ = ["centred_starts"]

FAR = 2.0  # ranges of 1/T that its mean is from 0: k0 is then e**(2*10) times what the records tell, or more


def centred_starts(
    structure: Any,
    layout: EquationLayout,
    records: Sequence[Record],
    options: Options,
    within: Sequence[tuple[float, float]],
    fitted: Callable[..., Any],
) -> list[float] | None:
    """Starts of the parameters; None where no exponential has such a factor, or its fit does not settle.

    Where 1/T moves by a third of its mean, k0 hangs on E so much that no search finds both: of a stirred
    reactor with k0 = 7e10 searches took minutes and ended at E < 0. k of k*exp(-E*(1/T - 1/350)) is found.

    `within`: bounds of all parameters; `fitted(records, structure, options)`: the fit of such equations.
    """
    if not isinstance(structure, Equation):
        return None
    pairs = _pairs(layout, records)
    if not pairs:
        return None
    texts, bounds = list(structure.texts), dict(structure.params)
    for factor, scale, mean in pairs:
        words = f"({factor}*exp({-mean!r}*{scale}))"
        texts = [re.sub(rf"(?<![\w.]){re.escape(factor)}(?![\w(])", words, text) for text in texts]
        low, high = within[layout.param_names.index(scale)]
        bounds[scale] = Free(min=low, max=high)
    try:
        fit = fitted(records, structure._like(text=texts, params=bounds), options)
    except ModfunError:  # equations that are not exact so written, say
        return None
    if not fit.success or fit.at_bound:
        return None
    found = dict(zip(fit.param_names, fit.params.tolist(), strict=True))
    with np.errstate(over="ignore"):
        for factor, scale, mean in pairs:
            found[factor] *= float(np.exp(-mean * found[scale]))
    starts = [found[name] for name in layout.param_names]
    return starts if np.all(np.isfinite(starts)) else None


def _pairs(layout: EquationLayout, records: Sequence[Record]) -> list[tuple[str, str, float]]:
    """Factor and scale of exponentials, as k0 and E, and the mean of what the scale multiplies."""
    from ..equations.symbolic.arguments import factors

    found: list[tuple[str, str, float]] = []
    for k, slopes, _ in inside(layout):
        (slope, steep), *more = slopes
        if more or not steep:
            continue
        values = np.concatenate([_values(layout, slope, rec) for rec in records])
        mean = float(f"{np.mean(values):.6g}") if values.size else 0.0
        if not abs(mean) > FAR * np.ptp(values):
            continue
        used = {name for name, _, _ in found}
        free = [name for name in factors(layout.compiled, k) if name not in used]
        found += [(name, layout.compiled.parameters[k], mean) for name in free[:1]]
    return found


def _values(layout: EquationLayout, expr: Any, rec: Record) -> F64:
    """Finite samples of an expression."""
    with np.errstate(all="ignore"):
        values = layout.formulas.values(expr, rec.y, driving(rec), rec.t)
    return values[np.isfinite(values)]
