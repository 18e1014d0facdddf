"""Whether noise takes outputs near to where a formula of theirs, such as log y or 1/y, has no value."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..base.cached import kept
from ..records.corners import driving
from ..results.of_equations import EquationFit
from .by_samples import weights_of

if TYPE_CHECKING:
    from ..equations.symbolic.formulas import Formulas

__all__ = ["near_singular"]

KEPT = 64  # sets of formulas
# Second differences of a signal over a standard deviation of the noise, over first ones: of log y, σ/2y where
# its noise is largest. Of an epidemic with its susceptibles eliminated, errors of estimates were 1.1 times
# their standard errors below 0.04, 1.5 to 1.7 times at 0.05 to 0.08, and 2.5 times at 0.12.
BENT = 0.05


@kept
def near_singular(fit: EquationFit) -> bool:
    """Whether noise moves a logarithm, a quotient or a root of outputs by more than its slope tells.

    Its noise is then one of few samples, those next to the singular point, which lines cannot weigh. Signals
    with parameters inside are not asked: `EquationFit.bend` is what the core knows of these.
    """
    formulas = fit.layout.formulas
    which = list(_singular(formulas))
    if not which:
        return False
    from ..equations.symbolic.noise_free import signals_of

    for k, rec in enumerate(fit.records or ()):
        level = fit.noise_levels[k][:, None]
        counts = np.all(weights_of(fit, rec) > 0, axis=0)
        with np.errstate(all="ignore"):  # what has no value is as near as can be
            low, mid, high = [
                signals_of(formulas, formulas.rows(y, driving(rec), rec.t, record=k), fit.params, k)[0][which]
                for y in (rec.y - level, rec.y, rec.y + level)
            ]
            first = np.sum((high - low)[:, counts] ** 2, axis=1)
            second = np.sum((high - 2 * mid + low)[:, counts] ** 2, axis=1)
        if not np.all(second <= BENT**2 * first):
            return True
    return False


@lru_cache(KEPT)
def _singular(formulas: Formulas) -> tuple[int, ...]:
    """Signals without parameters that have a singular point in an output."""
    from ..equations.symbolic.noise_bias import is_singular

    results, symbols, _ = formulas.expressions
    outputs = {symbol for channel, symbol in zip(formulas.channels, symbols, strict=False) if channel.own}
    parameters = {*symbols[len(symbols) - len(formulas.compiled.parameters) :]}
    count = 1 + max([signal for _, signal, _ in formulas.words["terms"]])
    return tuple(
        k
        for k, expr in enumerate(results[:count])
        if not expr.free_symbols & parameters and is_singular(expr, outputs)
    )
