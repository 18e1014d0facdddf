"""What errors do not count: that a channel may have been recorded a sample late or early."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F64
from ..base.names import series
from .doubts import noise_free
from .estimates import Estimates
from .late_channels import longest_step
from .shifts import Moved, each_moved, earlier_by

__all__ = ["uncounted_time"]

FAR = 5.0  # standard errors by which one sample has to move an estimate for it to be said
RULED_OUT = 4.0  # standard errors from a sample on which a record excludes that a channel is late by so much
NAMED = 4  # estimates, those that it moves furthest


def uncounted_time(fit: Estimates) -> str:
    """How far one sample of a channel's time moves the estimates, where the record leaves that time open.

    "" where it moves none far. That needs no test, and no test would be sharp: of a vane one sample late the
    residuals were like noise in 7 of 12 manoeuvres, and derivatives were 15 standard errors off.
    """
    if fit.layout.priors or noise_free(fit) is not None:
        return ""
    moved = each_moved(fit)
    if not moved:
        return ""
    step = longest_step(fit)
    if len(fit.outputs) == len(fit.inputs) == 1:
        moved = moved[1:]  # the output's time is the input's
    left = [(one, _sizes(fit, one)) for one in moved if step - abs(one.late) < RULED_OUT * one.error]
    far = sorted([pair for pair in left if pair[1].max() > FAR], key=lambda pair: -pair[1].max())
    if not far:
        return ""
    (first, sizes), *others = far
    order = [k for k in np.argsort(-sizes) if sizes[k] > FAR][:NAMED]
    errors = np.hypot(fit.spread, first.slopes * first.error)
    values = fit.params + first.slopes * first.late
    names = [fit.param_names[k] for k in order]
    off = [f"{sizes[k]:.2g}{'' if at else ' standard errors off'}" for at, k in enumerate(order)]
    free = [f"{'' if at else 'about '}{values[k]:.3g} ± {errors[k]:.2g}" for at, k in enumerate(order)]
    also = series([f"{one.channel} (up to {own.max():.2g} standard errors)" for one, own in others])
    words, _ = earlier_by(fit.records or (), first.channel, step, whole=True)
    return (
        f"If {first.channel} was recorded one sample ({step:.3g} s) late or early, {_each(names, off)}: "
        f"these errors take all channels as sampled at one time. This record does not rule it out (late by "
        f"{first.late:.2g} ± {first.error:.2g} s); with that time as an unknown {_each(names, free)}."
        f"{f' The same holds of {also}.' if also else ''} First find out when {first.channel} is sampled, "
        f"and correct its time: {words} if it is one sample late."
    )


def _each(names: list[str], what: list[str]) -> str:
    """What several names are, with one verb."""
    first, *others = [f"{name} {own}" for name, own in zip(names, what, strict=True)]
    return series([first.replace(" ", " is ", 1), *others])


def _sizes(fit: Estimates, one: Moved) -> F64:
    """By how many of its standard errors a sample of time moves each estimate; those on bounds have none."""
    with np.errstate(all="ignore"):
        sizes = np.abs(one.slopes) * longest_step(fit) / fit.bse
    return np.where(np.isfinite(sizes), sizes, 0.0)
