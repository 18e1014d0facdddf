"""Plots of delay systems: roots, responses, bounds; each takes ``ax=`` and returns the Axes drawn on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.axes import frequency_axis, label_axes, returned, take_axes

__all__ = ["margin", "roots", "trajectory"]


def roots(values: C128, line: float, ax: Any = None) -> Any:
    """Characteristic roots in the complex plane, and the line right of which all are shown."""
    (here,) = take_axes(ax, 1, "Characteristic roots", height=4.0, width=5.0)
    here.plot(values.real, values.imag, "x", markersize=7, markeredgewidth=1.6)
    if np.isfinite(line):
        here.axvline(line, color="0.5", linestyle=":", linewidth=1.0)
    here.axhline(0.0, color="0.3", linewidth=0.6)
    here.axvline(0.0, color="0.3", linewidth=0.9)
    here.set_xlabel("real part (1/s)")
    here.set_ylabel("imaginary part (rad/s)")
    here.grid(True, alpha=0.3)
    return returned(ax, [here])


def trajectory(
    t: F64, states: Sequence[str], x: F64, inputs: Sequence[str], u: F64, held: bool, ax: Any = None
) -> Any:
    """States above, inputs below, as steps where they are held from sample to sample."""
    names = (*states, *inputs)
    axes = take_axes(ax, len(names), "Motion", height=1.6)
    for k, (name, values, here) in enumerate(zip(names, [*x, *u], axes, strict=True)):
        is_input = k >= len(x)
        style = "steps-post" if is_input and held else "default"
        color = "C1" if is_input and len(set(axes)) > 1 else None
        here.plot(t, values, label=name, drawstyle=style, color=color, linewidth=1.0)
    label_axes(axes, names, {}, "time (s)")
    return returned(ax, axes)


def margin(omega: F64, upper: F64, ax: Any = None, *, hz: bool = False) -> Any:
    """The bound of μ over frequency, its peak marked."""
    (here,) = take_axes(ax, 1, "Bound of μ", height=3.2)
    scale, label = frequency_axis(hz)
    shown, top = omega > 0, int(np.argmax(upper))
    here.semilogx(scale * omega[shown], upper[shown], linewidth=1.2)
    if omega[top] > 0:
        here.plot(scale * omega[top], upper[top], "o", color="C3", markersize=5)
    here.axhline(1.0, color="0.3", linewidth=0.8, linestyle=":")
    here.set_ylabel(f"upper bound of μ, peak {upper[top]:.3g}")
    here.set_xlabel(label)
    here.grid(True, alpha=0.3)
    return returned(ax, [here])
