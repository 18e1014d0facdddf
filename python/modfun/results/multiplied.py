"""Outputs above zero whose noise goes with their level, as of counts and concentrations."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from ..errors import ModfunError
from .cures import STRONG, again, on_band
from .doubts import Doubt, noise_free
from .estimates import Estimates

__all__ = ["multiplied"]


def multiplied(fit: Estimates) -> Doubt | None:
    """That noise which multiplies the outputs explains samples far better than noise which adds to them."""
    records, plain = fit.records or (), fit.options.noise == "output"
    if fit.layout.rational or not plain or not records or noise_free(fit) is not None:
        return None
    if any(rec.mask is not None or rec.sigma is not None or np.any(rec.y <= 0) for rec in records):
        return None
    gain = _gain(fit, fit)
    if not gain > STRONG:
        return None
    other = again(fit, records, fit.structure, on_band(fit, fit.band).replace(noise="log-normal"))
    if other is None or not other.success or not (gain := _gain(fit, other)) > STRONG:
        return None
    return Doubt(
        'The noise goes with the level of the outputs. First try noise="log-normal", of outputs above zero: '
        f"-2 log likelihood of the samples beside the simulated response falls by {gain:.3g}.",
        sure=False,
    )


def _gain(fit: Estimates, other: Estimates) -> float:
    """By how much -2 log likelihood of white noise falls, if it multiplies the other fit's response."""
    gain = 0.0
    for rec in fit.records or ():
        try:
            added, times = (cast(Any, one).simulate(rec)[0] for one in (fit, other))
        except (ModfunError, np.linalg.LinAlgError):  # a response that leaves the range of numbers
            return 0.0
        if not (np.all(np.isfinite(added)) and np.all(times > 0)):
            return 0.0
        samples = rec.y.shape[1]
        own = np.log(np.mean((rec.y - added) ** 2, axis=1))
        logs = np.log(np.mean(np.log(rec.y / times) ** 2, axis=1)) + 2 * np.mean(np.log(rec.y), axis=1)
        gain += samples * float(np.sum(own - logs))
    return gain
