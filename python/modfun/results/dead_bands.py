"""Doubts about outputs that stand still: stored with a dead band, or frozen for a while."""

from __future__ import annotations

from ..records.check import dropped_samples, frozen_samples
from ..records.dead_band import dead_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates

__all__ = ["stands_still", "stored_late"]


def stored_late(fit: Estimates) -> Doubt | None:
    """That an output keeps its value until it has changed by a dead band."""
    for k, rec in enumerate(fit.records or ()):
        for name in rec.outputs:
            if rec.mask is None and (width := dead_band(rec[name])):
                where = f" of record {k}" if k else ""
                return Doubt(
                    f"Output {name!r}{where} keeps its value until it has changed by {width:.3g}, as a data "
                    "historian stores it, and the fit takes these values for samples. First store it without "
                    "a dead band, or draw lines between the stored values, k = np.r_[True, "
                    f"np.diff(rec[{name!r}]) != 0] and rec.assign({name}=np.interp(rec.t, rec.t[k], "
                    f"rec[{name!r}][k])).",
                    sure=level_p(fit) < SURE,
                )
    return None


def stands_still(fit: Estimates) -> Doubt | None:
    """That an output stood still while it moved before and after, or that a channel dropped out."""
    for k, rec in enumerate(fit.records or ()):
        for name in (*rec.outputs, *rec.inputs):
            standing = frozen_samples(rec, name) if name in rec.outputs else ()
            for text in (*standing, *dropped_samples(rec, name)):
                return Doubt(text if k == 0 else f"Record {k}: {text}")
    return None
