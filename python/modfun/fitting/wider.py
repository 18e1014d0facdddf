"""Default bands with more lines than the parameters need, where these leave the noise level uncertain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from ..errors import ModfunError
from ..records.record import Record
from ..records.uneven_rows import gaps
from ..results.band_end import gains, meets_end
from ..results.cures import on_band
from ..results.estimates import Estimates
from ..results.of_equations import EquationFit

__all__ = ["ENOUGH", "LOOKED", "NEARLY", "equations_on_enough_lines", "equations_on_more_lines", "wider_edge"]

ENOUGH = 8  # degrees of freedom: with 2, standard errors scatter tenfold, and intervals of 95 % cover 88 %
LOOKED = 128  # lines that the core's rule for equations looks at,
NEARLY = 0.9  # and the part of them from which on a band ends near the last
SLOWEST = 6  # samples per period of the highest line that is added for them; the core's rule looks further


def wider_edge(fit: Estimates, records: Sequence[Record], degrees: int, slowest: float) -> float:
    """The end of a band with so many degrees of freedom, or that of the fit where it has as many or may not.

    `records`: those whose steps count; `slowest`: samples per period of the highest line.
    """
    edge, missing = fit.band[1], degrees - fit.df_resid
    if missing <= 0:
        return edge
    # Of records with gaps the usual step is far shorter than that of sums.
    steps = [
        rec.duration / rec.intervals if gaps(rec).size else float(np.median(np.diff(rec.t)))
        for rec in records
    ]
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


def equations_on_more_lines(fit: EquationFit, refit: Callable[..., EquationFit]) -> EquationFit:
    """The fit on a default band twice as wide, again and again, as long as that lowers standard errors.

    The core's rule looks at `LOOKED` lines of equations. Where a resonance lay beyond them, stiffness
    and damping had errors 13 to 40 times as large as on twice the band.
    """
    rule, records = fit.band_rule, fit.records
    if rule is None or not fit.success or not records or not fit.params.size or not meets_end(fit):
        return fit
    if any([rec.dt is None for rec in records]):
        return fit
    top, found = min([2 * pi / SLOWEST * rec.intervals / rec.duration for rec in records]), fit
    if not found.band[1] < top:
        return fit  # as it was: nothing is tried
    while found.band[1] < top:
        edge = min(2 * found.band[1], top)
        options = on_band(found, (found.band[0], edge))
        starts = None if found.at_bound else found.params.tolist()
        try:
            wider = refit(records, fit.structure, options, fit.again, starts=starts, near=starts is not None)
        except ModfunError:  # as of samples that leave too few lines
            break
        if not gains(found, wider):
            break
        found = wider
    told = rule | {"asked": 1.0} | ({} if found is fit else {"doubled": 1.0})
    return replace(found, options=fit.options, again=fit.again, band_rule=told)
