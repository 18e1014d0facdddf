"""Gains of a system and of its reduced models, drawn over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..base.arrays import F64
from ..base.axes import frequency_axis, returned, take_axes

__all__ = ["gains"]


def gains(omega: F64, curves: Mapping[str, F64], ax: Any = None, hz: bool = False) -> Any:
    """Draw gains by their names: the system, its model, then differences."""
    axes = take_axes(ax, 1, "Largest gain of system and reduced model", height=3.2)
    scale, label = frequency_axis(hz)
    for (name, values), style in zip(curves.items(), ("-", "--", ":", ":"), strict=False):
        axes[0].plot(scale * omega, values, style, label=name, linewidth=1.2)
    axes[0].set_xscale("log")
    axes[0].set_yscale("log")
    axes[0].set(xlabel=label, ylabel="gain", xlim=(scale * omega[0], scale * omega[-1]))
    axes[0].legend()
    return returned(ax, axes)
