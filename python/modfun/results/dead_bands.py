"""Doubts about outputs that stand still: stored with a dead band, or frozen for a while."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..records.check import dropped_samples, frozen_samples
from ..records.dead_band import dead_band
from ..records.mask import Mask
from ..records.record import Record
from ..records.slower import slow_samples
from .cures import again, furthest, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates
from .stand_in import stand_in

__all__ = ["stands_still", "stored_late"]

Look = Callable[[Record, str], Iterator[str]]

MOVED = 1.0  # standard errors: what a dead band may do to an estimate unsaid


def stored_late(fit: Estimates) -> Doubt | None:
    """That an output keeps its value until it has changed by a dead band."""
    for k, rec in enumerate(fit.records or ()):
        for i, name in enumerate(rec.outputs):
            if width := _width(rec, name):
                where = f" of record {k}" if k else ""
                good = "" if rec.mask is None else f" & rec.mask[{i}]"
                return Doubt(
                    f"Output {name!r}{where} keeps its value until it has changed by {width:.3g}, as a data "
                    "historian stores it, and the fit takes these values for samples. First store it without "
                    "a dead band, or draw a curve between the stored values that stays within it, k = "
                    f"np.r_[True, np.diff(rec[{name!r}]) != 0]{good} and rec.assign({name}=np.clip("
                    f"scipy.interpolate.CubicSpline(rec.t[k], rec[{name!r}][k])(rec.t), rec[{name!r}] - "
                    f"{width:.4g}, rec[{name!r}] + {width:.4g})).{_of_delays(fit)}",
                    sure=level_p(stand_in(fit)) < SURE or _moves(fit),
                )
    return None


def _of_delays(fit: Estimates) -> str:
    """What no curve brings back of a free delay."""
    free = fit.layout.rational and fit.layout.free_delays
    words = " The free delay stays uncertain by half the time between stored values."
    return words if free else ""


def _moves(fit: Estimates) -> bool:
    """Whether curves instead of held values change an estimate by more than its standard error."""
    if fit.again is None or fit.records is None:
        return False
    other = again(fit, tuple(_curved(rec) for rec in fit.records), fit.structure, on_band(fit, fit.band))
    if other is None or other.params.shape != fit.params.shape:
        return False
    return furthest(fit, other)[-1] > MOVED


def _curved(rec: Record) -> Record:
    """The record with curves in the place of values that a dead band holds."""
    from scipy.interpolate import CubicSpline

    found = {}
    for name in rec.outputs:
        if width := _width(rec, name):
            k = _stored(rec[name], rec._good(name))
            curve = CubicSpline(rec.t[k], rec[name][k])(rec.t)
            found[name] = np.clip(curve, rec[name] - width, rec[name] + width)
    return rec.assign(**found)


@kept
def _width(rec: Record, name: str) -> float:
    """The dead band of a channel, by the samples that count."""
    return dead_band(rec[name] if rec.mask is None else rec[name][rec._good(name)])


def _stored(values: F64, good: Mask) -> Mask:
    """Which samples were stored: the first, and those that differ from the last one that counts."""
    kept = np.flatnonzero(good)
    found = np.zeros(values.size, dtype=bool)
    found[kept] = np.r_[True, np.diff(values[kept]) != 0]
    return found


def stands_still(fit: Estimates) -> Doubt | None:
    """That an output stood still while it moved before and after, or that a channel dropped out."""
    for k, rec in enumerate(fit.records or ()):
        if text := _standing(rec):
            return Doubt(text if k == 0 else f"Record {k}: {text}")
    return None


@kept
def _standing(rec: Record) -> str:
    """The first channel that stands still and should not, in words; nothing where all move."""
    of_outputs: tuple[Look, ...] = (slow_samples, frozen_samples)
    for name in (*rec.outputs, *rec.inputs):
        for look in (*(of_outputs if name in rec.outputs else ()), dropped_samples):
            for text in look(rec, name):
                return text
    return ""
