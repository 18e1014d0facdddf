"""Plots over frequency: gains of reduced models."""

from __future__ import annotations

from typing import Any

from ..base.axes import drawing, frequency_axis, returned, take_axes
from ..reduction.reduction import Reduction


@drawing
def reduction(red: Reduction, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the gains of a system, of its reduced model and of their difference over frequency.

    Parameters
    ----------
    red : Reduction
    ax : Axes, optional
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes
        With several channels the largest gain over directions is drawn.
    """
    axes = take_axes(ax, 1, height=3.2)
    scale, label = frequency_axis(hz)
    omega, curves = red.gains()
    for (name, values), style in zip(curves.items(), ("-", "--", ":", ":"), strict=False):
        axes[0].plot(scale * omega, values, style, label=name, linewidth=1.2)
    axes[0].set_xscale("log")
    axes[0].set_yscale("log")
    axes[0].set(xlabel=label, ylabel="gain", xlim=(scale * omega[0], scale * omega[-1]))
    axes[0].legend()
    return returned(ax, axes)
