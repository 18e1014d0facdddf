"""An input and an output that were taken for each other, where the other way round only the noise is left."""

from __future__ import annotations

import numpy as np

from .cures import ENOUGH, again
from .diagnosis import growth, level_p
from .doubts import SURE, Doubt, noise_free
from .estimates import Estimates

__all__ = ["swapped"]

MOST = 0.5  # of an input's standard deviation: what noise may be of it as an output


def swapped(fit: Estimates) -> Doubt | None:
    """That the input is the output, which has noise of its own, and the output, without, the input."""
    if not (fit.layout.rational and len(fit.outputs) == len(fit.inputs) == 1) or not level_p(fit) < SURE:
        return None
    records, (y,), (u,) = fit.records or (), fit.outputs, fit.inputs
    if (
        fit.again is None
        or noise_free(fit)
        or any(rec.mask is not None or rec.sigma is not None for rec in records)
        # What stands still from sample to sample, as the command of a relay does, has no noise.
        or any(not np.median(np.abs(np.diff(rec.u[0]))) > 0 for rec in records)
    ):
        return None
    turned = tuple([rec._like(y=rec.u, u=rec.y, outputs=(u,), inputs=(y,)) for rec in records])
    options = fit.options.replace(band=None, harmonics=None)
    other = again(fit, turned, fit.structure, options)
    if other is None or not other.success or not ENOUGH < level_p(other) < 1 - SURE:
        return None
    # Turned round, edges of a square wave between samples look like an unstable pole that the noise hides.
    if growth(other) > 0 >= growth(fit):
        return None
    # An input of all frequencies is its own high band, and nothing explains it.
    if any(other.high_band_levels[0] > MOST * rec.u.std() for rec in records):
        return None
    return Doubt(
        f"The residuals are far above the noise of {y}, and with {y} as the input and {u} as the output only "
        f"the noise of {u} is left: they were taken for each other. First swap them, "
        f"mf.Record(y=rec[{u!r}], u=rec[{y!r}], ...)."
    )
