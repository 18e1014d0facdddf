"""Plots of delay systems: roots, responses, bounds; each takes ``ax=`` and returns the Axes drawn on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.axes import frequency_axis, label_axes, returned, take_axes

if TYPE_CHECKING:
    from .motion import Trajectory
    from .mu import Margin
    from .roots import Roots

__all__ = ["margin", "roots", "trajectory"]


def roots(found: Roots, ax: Any = None) -> Any:
    """Characteristic roots in the complex plane, and the line right of which all are shown."""
    (here,) = take_axes(ax, 1, height=4.0, width=5.0)
    here.plot(found.real, found.imag, "x", markersize=7, markeredgewidth=1.6)
    if np.isfinite(found.line):
        here.axvline(found.line, color="0.5", linestyle=":", linewidth=1.0)
    here.axhline(0.0, color="0.3", linewidth=0.6)
    here.axvline(0.0, color="0.3", linewidth=0.9)
    here.set_xlabel("real part (1/s)")
    here.set_ylabel("imaginary part (rad/s)")
    here.grid(True, alpha=0.3)
    return returned(ax, [here])


def trajectory(found: Trajectory, ax: Any = None) -> Any:
    """States above, inputs below."""
    names = (*found.plant.states, *found.plant.inputs)
    axes = take_axes(ax, len(names), height=1.6)
    for k, (name, values, here) in enumerate(zip(names, [*found.x, *found.u], axes, strict=True)):
        is_input = k >= len(found.x)
        style = "steps-post" if is_input and found.z is not None else "default"
        color = "C1" if is_input and len(set(axes)) > 1 else None
        here.plot(found.t, values, label=name, drawstyle=style, color=color, linewidth=1.0)
    label_axes(axes, names, {}, "time (s)")
    return returned(ax, axes)


def margin(found: Margin, ax: Any = None, *, hz: bool = False) -> Any:
    """The bound of μ over frequency, its peak marked."""
    (here,) = take_axes(ax, 1, height=3.2)
    scale, label = frequency_axis(hz)
    shown = found.omega > 0
    here.semilogx(scale * found.omega[shown], found.upper[shown], linewidth=1.2)
    if found.peak_omega > 0:
        here.plot(scale * found.peak_omega, found.peak, "o", color="C3", markersize=5)
    here.axhline(1.0, color="0.3", linewidth=0.8, linestyle=":")
    here.set_ylabel(f"upper bound of μ, peak {found.peak:.3g}")
    here.set_xlabel(label)
    here.grid(True, alpha=0.3)
    return returned(ax, [here])
