"""Whether the time step of one record is another than the rest of a list says."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

import numpy as np

from ..records.record import Record
from .diagnosis import poles_of
from .doubts import Doubt
from .estimates import Estimates
from .odd_channels import left_of

__all__ = ["OtherStep", "other_step"]

# Slips of a time step: every other sample, another rate, ms or µs for s, minutes or hours for s.
SLIPS = (1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 8.0, 10.0, 20.0, 25.0, 40.0, 50.0, 60.0, 100.0, 1e3, 3600.0, 1e4, 1e6)
NEAR = 0.25  # of a slip: how far poles of a short record may be from it
BETTER = 0.1  # by which a slip lowers the logarithm of what is left of a record, at least


@dataclass(frozen=True)
class OtherStep:
    """A record that others predict where all in it is so many times slower."""

    record: int
    faster: float

    def undone(self, rec: Record) -> Record:
        """The record with the step that the others would have."""
        t = rec.t * self.faster if rec.dt is None else rec.t[0] + rec.dt * self.faster * np.arange(rec.t.size)
        return rec._like(t=t, dt=rec.dt and rec.dt * self.faster)

    def told(self, fit: Estimates, own: Estimates | None, others: Estimates) -> Doubt:
        """What was seen, with the parameter that tells it best where the record alone has one, and a step.

        Two records that are both explained alone do not tell whose step is wrong.
        """
        pair = len(fit.records or ()) == 2
        whose = f"record {1 - self.record}" if pair else "the others"
        asked = "Are both time steps right" if pair else "Is its time step right"
        times = f"{self.faster:g} times faster" if self.faster > 1 else f"{1 / self.faster:g} times slower"
        either = ", with which all records agree"
        if pair and own is not None and own.usable:
            other = _step_of(fit, 1 - self.record, 1 / self.faster)
            either = f", or {other}: with either both agree, and they do not tell which is wrong"
        return Doubt(
            f"Record {self.record} contradicts {whose}: {_apart(own, others)}as if all in it went {times}. "
            f"{asked}? First try {_step_of(fit, self.record, self.faster)}{either}."
        )


def _step_of(fit: Estimates, record: int, times: float) -> str:
    """A record's time step made so many times longer, in words."""
    rec = (fit.records or ())[record]
    step = rec.dt or float(np.median(np.diff(rec.t)))
    return f"dt={step * times:.6g} for record {record} in place of {step:.6g}"


def _apart(own: Estimates | None, others: Estimates) -> str:
    """The parameter of a record that is furthest from that of the others."""
    if own is None or not own.usable:
        return ""
    errors = np.hypot(own.spread, others.spread)
    at = int(np.argmax(np.abs(own.params - others.params) / np.where(errors > 0, errors, np.inf)))
    here, there = (f"{one.params[at]:.4g} ± {one.spread[at]:.2g}" for one in (own, others))
    return f"{own.param_names[at]} is {here} against {there}, "


def other_step(base: Estimates, rec: Record, k: int, own: Estimates | None) -> OtherStep | None:
    """The slip of the time step of record `k` with which a fit of the others predicts it best.

    `own`: a fit of the record that leaves only the noise, which has its poles as many times faster.
    """
    if not base.has_poles:  # to integrate equations for each slip would take too long
        return None
    ways = [way for slip in SLIPS for way in (slip, 1 / slip)]
    if own is not None:
        ratio = _faster(own, base)
        ways = [way for way in ways if abs(ratio / way - 1) < NEAR]
    tried = [OtherStep(k, way) for way in ways]
    left = [left_of(base, one.undone(rec)) for one in tried]
    best = int(np.argmin(left)) if left else -1
    return tried[best] if left and left[best] < left_of(base, rec) - BETTER else None


def _faster(own: Estimates, base: Estimates) -> float:
    """How many times faster the poles of a fit are than those of another, as a geometric mean."""
    here, there = (sizes[sizes > 0] for sizes in (np.abs(poles_of(own)), np.abs(poles_of(base))))
    if not here.size or here.size != there.size:  # of integrators nothing is told
        return nan
    return float(np.exp(np.mean(np.log(here)) - np.mean(np.log(there))))
