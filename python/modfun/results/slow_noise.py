"""Slow disturbances of outputs, whose lines are to be weighted by their spectrum."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._core import pooled_power
from .coloured_load import in_coloured_noise, moved_by_weights
from .cures import DRIFT, ENOUGH, again, of_written
from .diagnosis import diagnose, level_p
from .doubts import SURE, Doubt, noise_free
from .estimates import Estimates
from .followers import in_loop
from .misfit import SUREST, UNLIKELY, refuted, suspicious
from .origin import LEAST_GAIN, origin, smaller_errors, wide_band
from .unseen_events import settles_otherwise
from .worth import worth

__all__ = ["slow_noise"]

Warned = Callable[[Estimates], list[str]]

SLOW, MANY = 2.0, 16  # residual lines of the lower half of the band over those of the upper, of so many
FEWEST = 4  # samples per period where bands for such weights end
PAYS = 3.0  # standard errors without their spectrum over those with it


def slow_noise(fit: Estimates, warnings_of: Warned) -> Doubt | None:
    """That disturbances of the outputs are slow, which weights of white noise leave in the estimates.

    Their lines follow each other, as those of an event do, and the inputs by chance: structures that follow
    these are wrong. Said where weights of their spectrum leave nothing in doubt, and beyond doubt where
    they make errors far smaller. `warnings_of`: what a fit is warned of.
    """
    layout: Any = fit.layout
    plain = fit.options.noise == "output" and (layout.rational or layout.compiled.is_linear)
    if not plain or fit.again is None or not fit.records or not suspicious(fit) or not refuted(fit):
        return None
    if not layout.rational and worth(fit):
        return None  # terms that it may lack are tried first where a regression says which are worth it
    d = diagnose(fit, UNLIKELY)
    if noise_free(fit):
        return None
    seen = d.colour_ratio > SLOW and d.colour.p_value < SURE and _falls(fit)
    found = origin(fit)
    moved = moved_by_weights(fit) if found in ("either", "coloured") else None
    if not (seen or moved) or found == "process":
        return None
    drift = again(fit, fit.records, fit.structure, fit.options.replace(trend="linear"), near=True)
    if drift is None or not refuted(drift) or level_p(fit) < SURE < ENOUGH < level_p(drift):
        return None  # chance refutes one of some thousand drifts that leave the noise alone
    if _structural(fit, drift):
        return None
    weighted = _weighted(fit, warnings_of)
    if weighted is None:
        return None
    other, words = weighted
    if moved:
        return Doubt(
            f"The estimates seem to follow slow noise of {d.coloured}, for which their errors do not allow. "
            f"First weight the lines by their spectrum, {words}: {moved}."
        )
    gain = smaller_errors(fit, other)
    followed = min([d.correlation.p_value, *(one.p_value * len(d.further) for one in d.further)])
    sure = gain > PAYS or followed < SUREST or bool(fit.at_bound)
    if layout.rational and not sure and not gain > LEAST_GAIN:
        return None  # what else residuals say tells more than weights that gain nothing
    less = f", and standard errors {gain:.2g} times smaller (geometric mean)" if gain > LEAST_GAIN else ""
    return Doubt(
        f"A slow disturbance is on {d.coloured}: residual lines are {d.colour_ratio:.3g} times as strong in "
        "the lower half of the band as in the upper. First weight the lines by their spectrum, "
        f"{words}: that leaves nothing unexplained{less}.",
        sure=sure,
    )


def _falls(fit: Estimates) -> bool:
    """Whether residuals of a row are strongest in the lowest eighth of the band, as those of no mode are."""
    for i in range(len(fit.row_names)):
        pooled = pooled_power([piece[i] for piece in fit.pieces])
        if (
            pooled.size >= MANY
            and pooled[: pooled.size // 8].mean() > SLOW**2 * pooled[pooled.size // 8 :].mean()
        ):
            return True
    return False


def _structural(fit: Estimates, drift: Estimates) -> bool:
    """Whether another structure is wanted: by tests beside a drift, or by what brings residuals to the noise.

    The ends of slow noise lie apart as those of a drift do, which turns all lines alike: without one, such
    noise follows inputs by chance.
    """
    if not fit.at_bound:
        tests = [
            one.p_value for one in diagnose(drift, UNLIKELY).further if one.what not in ("event", "spike")
        ]
        if min(tests, default=1.0) < SURE:
            return True
    layout: Any = fit.layout
    if not layout.rational:
        cure = of_written(fit)
        return cure is not None and cure.words != DRIFT and cure.level_p > ENOUGH
    if len(layout.free_delays) > 1:  # each cure is a search
        return False
    return settles_otherwise(fit)


def _weighted(fit: Estimates, warnings_of: Warned) -> tuple[Estimates, str] | None:
    """The fit with weights of the noise spectrum, and its options in words, on the narrowest band in order.

    The default band is chosen by white noise: where that is strong, steep noise needs more lines. In a loop
    it is no matter of order: over all lines what comes back of the noise cancels, over few it biases.
    """
    other, words = in_coloured_noise(fit), 'noise="coloured"'
    top = min([2 * np.pi / (FEWEST * rec.dt) for rec in fit.records or () if rec.dt], default=0.0)
    low, edge = fit.band
    if in_loop(fit) and fit.options.band is None and fit.options.harmonics is None:
        other, edge = None, wide_band(fit)[1] / 2
    while other is None or not other.success or warnings_of(other):
        edge = float(f"{2 * edge:.3g}")
        if fit.options.band is not None or fit.options.harmonics is not None or edge > top:
            return None
        band = (float(f"{low:.3g}"), edge)
        options = fit.options.replace(noise="coloured", output_weights=None, band=band)
        other = again(fit, fit.records or (), fit.structure, options)
        words = f'noise="coloured", band=({band[0]:g}, {band[1]:g})'
    return other, words
