"""Inputs that are a pulse of few samples, such as a hammer's: their area, and so gains, are known badly."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from ..base.arrays import F64
from ..records.mask import runs
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["short_pulse"]

ACTIVE = 0.05  # of the peak, from which a sample is one of a pulse
TALL = 0.3  # of the highest peak: smaller pulses carry little
FEW = 0.02  # of all samples are in pulses, at most: others are no hits
MANY = 2**16  # samples that tell what is usual
LONGEST = 40  # samples of a pulse whose area may be wrong by 0.05 %
HALF_SINE = pi**2 / 12  # over the square of its intervals: how far the sum is off from the area, at most
FACTOR = 3.0  # times the standard error of the gains, beyond which a fit warns


def short_pulse(fit: Estimates) -> Doubt | None:
    """That gains have errors from what an input does between the few samples of a pulse.

    A half-sine that begins between two samples has an area up to 5 % beside that of 4 samples, 1.3 % of 8.
    """
    if not fit.layout.rational or not fit.records or not fit.usable:
        return None
    for j, name in enumerate(fit.inputs):
        read = [rec.u[j] for rec in fit.records if rec.intersample[j] != "zoh" and not rec.functions]
        found = [own for u in read if (own := _pulses(u)) is not None]
        if len(found) < len(fit.records):
            continue
        intervals = np.concatenate(found)
        off = HALF_SINE * sqrt(float(np.mean(intervals**-4.0)) / intervals.size)
        known = _of_scale(fit, name)
        if known is None or not off > known:
            continue
        samples = max(round(float(np.median(intervals))), 1)
        pulses, lasts = ("pulses", "last") if intervals.size > 1 else ("pulse", "lasts")
        return Doubt(
            f"The {pulses} of {name} {lasts} about {samples} samples, and what {name} is between these is "
            f"not known: the area may be {100 * off:.2g} % off, and so may the gains, whose standard errors "
            f"say {100 * known:.2g} %. Poles are not affected. First sample so fast that a pulse has some 30 "
            f"samples, or low-pass filter {name} and the outputs alike before they are sampled.",
            sure=off > FACTOR * known,
        )
    return None


def _pulses(u: F64) -> F64 | None:
    """Intervals of each tall pulse of an input that is nothing else; None where it is more than that."""
    usual = float(np.median(u[:: max(u.size // MANY, 1)]))
    peak = max(float(u.max()) - usual, usual - float(u.min()))
    active = (u > usual + ACTIVE * peak) | (u < usual - ACTIVE * peak)
    if not peak > 0 or not 0 < np.mean(active) < FEW:
        return None
    each = [(n, np.abs(u[start : start + n] - usual).max()) for start, n in zip(*runs(active), strict=True)]
    lengths = np.array([n + 0.5 for n, height in each if height > TALL * peak])
    return lengths if lengths.max() < LONGEST else None


def _of_scale(fit: Estimates, name: str) -> float | None:
    """Relative standard error of all gains of an input together; None where they have none."""
    of = f",{name}]" if len(fit.inputs) > 1 else ""
    at = [k for k, own in enumerate(fit.param_names) if own.startswith("b") and own.endswith(of)]
    gains, cov = fit.params[at], fit.cov_params()[np.ix_(at, at)]
    if not at or not np.all(np.diag(cov) > 0):
        return None
    weight = float(gains @ np.linalg.pinv(cov) @ gains)
    return weight**-0.5 if weight > 0 else None
