"""Records drawn over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.axes import bridge_gaps, label_axes, returned, take_axes, take_grid
from ..errors import SpecError
from ..signals.drawing import channel
from .samples import Samples

__all__ = ["record", "records"]


def records(several: Sequence[Samples], ax: Any = None) -> Any:
    """Draw records side by side, those of the same channels on the same scales."""
    first = several[0]
    names = (*first.outputs, *first.inputs)
    for k, rec in enumerate(several):
        if (rec.outputs, rec.inputs) != (first.outputs, first.inputs):
            raise SpecError(
                f"plot.record: record {k} has the channels {', '.join((*rec.outputs, *rec.inputs))}, the "
                f"first {', '.join(names)}; select the same ones"
            )
    made = take_grid(ax, len(names), len(several), "Records", height=1.6, sharex=False)
    axes = np.array(made, dtype=object).reshape(len(names), len(several))
    for k, rec in enumerate(several):
        record(rec, ax=list(axes[:, k]))
        title = f"{k}: {rec.source.name}" if rec.source is not None else f"record {k}"
        axes[0, k].set_title(title, fontsize="medium")
        for here, beside in zip(axes[:, k], axes[:, 0], strict=True):
            if here is not beside:
                here.sharey(beside)
                here.set_ylabel("")
    return axes


def record(rec: Samples, ax: Any = None) -> Any:
    """Draw outputs above, inputs below, held inputs as steps; dotted lines bridge masked samples."""
    names = (*rec.outputs, *rec.inputs)
    axes = take_axes(ax, len(names), "Record", height=1.6)
    held = dict(zip(rec.inputs, rec.intersample, strict=True))
    for name, here in zip(names, axes, strict=True):
        color = "C1" if name in rec.inputs and len(set(axes)) > 1 else None
        channel(here, rec.t, rec._shown(name), name, held.get(name), color)
        bridge_gaps(here, rec.t, rec[name], rec._good(name), label=f"_{name} masked")
    label_axes(axes, names, rec.units, "time (s)")
    return returned(ax, axes)
