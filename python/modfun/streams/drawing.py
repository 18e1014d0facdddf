"""Estimates over time, drawn with bands of two standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.axes import label_axes, returned, take_axes

__all__ = ["estimates"]


def estimates(
    t: F64, params: F64, bse: F64, good: NDArray[np.bool_], names: Sequence[str], ax: Any = None
) -> Any:
    """Draw each parameter (moment, p) over time; gaps where an estimate cannot be used."""
    axes = take_axes(ax, len(names), "Estimates over time", height=1.5)
    for here, values, errors in zip(axes, params.T, bse.T, strict=True):
        values, half = np.where(good, values, np.nan), 2 * np.where(good, errors, np.nan)
        here.fill_between(t, values - half, values + half, alpha=0.25, linewidth=0)
        here.plot(t, values, linewidth=1.2)
        here.grid(True, alpha=0.3)
    label_axes(axes, names, {}, "end of the window (s)")
    return returned(ax, axes)
