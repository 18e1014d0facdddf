"""Samples over time and amplitudes over frequency, drawn channel by channel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.axes import frequency_axis, label_axes, returned, take_axes

__all__ = ["channel", "inputs", "spectrum"]


def channel(here: Any, t: F64, values: F64, name: str, kind: str | None, color: str | None = None) -> None:
    """Draw one channel over time, as it goes on between its samples."""
    style = "steps-post" if kind == "zoh" else "default"
    here.plot(t, values, drawstyle=style, label=name, color=color, linewidth=1.0)


def inputs(t: F64, u: F64, names: Sequence[str], kinds: Sequence[str], ax: Any = None) -> Any:
    """Draw inputs over time, held ones as steps."""
    axes = take_axes(ax, len(names), "Inputs", height=1.6)
    for name, values, kind, here in zip(names, u, kinds, axes, strict=True):
        channel(here, t, values, name, kind)
    label_axes(axes, names, {}, "time (s)")
    return returned(ax, axes)


def spectrum(
    omega: F64, amplitude: F64, names: Sequence[str], units: dict[str, str], ax: Any = None, hz: bool = False
) -> Any:
    """Draw amplitudes over frequency, both axes logarithmic."""
    axes = take_axes(ax, len(names), "Amplitude spectrum", height=1.8)
    scale, label = frequency_axis(hz)
    for name, row, here in zip(names, amplitude, axes, strict=True):
        values = np.where(row > 0, row, np.nan)  # zeros have no place on a logarithmic axis
        here.plot(scale * omega, values, label=name, linewidth=1.0)
        here.set_xscale("log")
        if np.isfinite(values).any():
            here.set_yscale("log")
    label_axes(axes, names, units, label)
    return returned(ax, axes)
