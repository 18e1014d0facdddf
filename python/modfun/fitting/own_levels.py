"""Noise levels of records too short to see them in: those of the fit's own residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..equations.layout import EquationLayout
from ..models.options import Options
from ..records.record import Record
from ..records.spectra import too_short
from ..results.of_equations import EquationFit

__all__ = ["by_own_levels"]

LEAST = 1e-9  # of an output: what a noise level is at least where samples follow a curve without noise
ROUNDS = 8
SETTLED = 0.05  # of a level: two per cent of a standard error hang on it


def beside_neighbours(records: Sequence[Record], order: int, options: Options) -> list[float]:
    """Level of each output, or of its logarithm, as samples show it beside their neighbours."""
    each = []
    for rec in records:
        if options.noise == "log-normal":  # what is not positive is refused later
            rec = rec._like(y=np.log(np.where(rec.y > 0, rec.y, np.finfo(float).tiny)))
        each.append(rec.noise_level(order)["noise_sd"][: len(rec.outputs)])
    return [float(level) for level in np.sqrt(np.mean(np.square(each), axis=0))]


def by_own_levels(
    records: Sequence[Record],
    layout: EquationLayout,
    options: Options,
    fitted: Callable[[list[float]], EquationFit],
) -> EquationFit | None:
    """The fit whose noise levels are those of its residuals; None where the records or the user tell them.

    Samples beside few neighbours hold the signal, too; levels from residuals and estimates follow one another
    until both stand.
    """
    formulas: Any = layout.formulas
    order = max(layout.orders)
    short = any([too_short(rec.t.size, order) for rec in records])
    plain = all([rec.dt is not None and rec.mask is None and rec.sigma is None for rec in records])
    if not (short and plain and formulas.needs_levels and options.noise in ("output", "log-normal")):
        return None
    least = LEAST * np.max([np.abs(rec.y).max(axis=1) for rec in records], axis=0)
    if not least.all():
        return None
    levels = np.maximum(beside_neighbours(records, order, options), least).tolist()
    for _ in range(ROUNDS):
        fit = fitted(levels)
        if not fit.usable:
            break
        own = np.maximum(np.sqrt(np.mean(fit.noise_levels**2, axis=0)), least)
        done = bool(np.all(np.abs(own / levels - 1) < SETTLED))
        levels = own.tolist()
        if done:
            break
    return fit
