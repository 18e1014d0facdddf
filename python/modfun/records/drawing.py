"""Records drawn over time."""

from __future__ import annotations

from typing import Any

from ..base.axes import bridge_gaps, label_axes, returned, take_axes
from ..signals.drawing import channel
from .samples import Samples

__all__ = ["record"]


def record(rec: Samples, ax: Any = None) -> Any:
    """Draw outputs above, inputs below, held inputs as steps; dotted lines bridge masked samples."""
    names = (*rec.outputs, *rec.inputs)
    axes = take_axes(ax, len(names), height=1.6)
    held = dict(zip(rec.inputs, rec.intersample, strict=True))
    for name, here in zip(names, axes, strict=True):
        color = "C1" if name in rec.inputs and len(set(axes)) > 1 else None
        channel(here, rec.t, rec._shown(name), name, held.get(name), color)
        bridge_gaps(here, rec.t, rec[name], rec._good(name), label=f"_{name} masked")
    label_axes(axes, names, rec.units, "time (s)")
    return returned(ax, axes)
