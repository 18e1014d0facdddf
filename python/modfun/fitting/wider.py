"""Default bands with more lines than the parameters need, where these leave the noise level uncertain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from ..records.record import Record
from ..results.cures import on_band
from ..results.estimates import Estimates
from ..results.of_equations import EquationFit

__all__ = ["ENOUGH", "equations_on_enough_lines", "wider_edge"]

ENOUGH = 8  # degrees of freedom: with 2, standard errors scatter tenfold, and intervals of 95 % cover 88 %
SLOWEST = 6  # samples per period of the highest line that is added for them; the core's rule looks further


def wider_edge(fit: Estimates, records: Sequence[Record], degrees: int, slowest: float) -> float:
    """The end of a band with so many degrees of freedom, or that of the fit where it has as many or may not.

    `records`: those whose steps count; `slowest`: samples per period of the highest line.
    """
    edge, missing = fit.band[1], degrees - fit.df_resid
    if missing <= 0:
        return edge
    steps = [float(np.median(np.diff(rec.t))) for rec in records]
    length = sum([step * count for step, count in zip(steps, fit.intervals, strict=True)])
    most = 2 * pi / (slowest * max(steps))
    return max(edge, min(edge + pi * missing / (length * len(fit.outputs)), most))


def equations_on_enough_lines(fit: EquationFit, refit: Callable[..., EquationFit]) -> EquationFit:
    """The fit on a default band that is wide enough for the noise level; itself where it is.

    Few lines may tell the parameters as well as all do, and then leave hardly an equation for residuals.
    """
    if fit.band_rule is None or not fit.success or not fit.records:
        return fit
    edge = wider_edge(fit, fit.records, ENOUGH, SLOWEST)
    if edge == fit.band[1]:
        return fit
    other = refit(fit.records, fit.structure, on_band(fit, (fit.band[0], edge)), fit.again)
    if not other.success or other.lines == fit.lines:
        return fit
    return replace(other, options=fit.options, band_rule=fit.band_rule | {"widened": 1.0})
