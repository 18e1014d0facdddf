"""Selected terms, drawn."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.axes import returned, take_axes
from ..base.tables import Table

__all__ = ["terms"]

MOST = 20  # candidates that are shown, the likeliest first


def terms(path: Table, inclusion: Table, ax: Any = None) -> Any:
    """Draw the criterion over the number of terms, and probabilities; see `modfun.plot.terms`."""
    axes = take_axes(ax, 2, "Selection of terms", height=2.8, sharex=False)
    upper, lower = axes
    upper.plot(path["terms"], path["rise"], "o-", color="C0", markersize=4, linewidth=0.8)
    chosen = path["chosen"]
    upper.plot(path["terms"][chosen], path["rise"][chosen], "o", color="C3", markersize=11, fillstyle="none")
    upper.set_yscale("symlog", linthresh=10.0)
    upper.set_ylim(bottom=-3.0)
    upper.set_xlabel("number of terms")
    upper.set_ylabel("criterion over its lowest")
    upper.grid(True, alpha=0.3)
    if lower is not upper:
        order = np.argsort(-inclusion["probability"], kind="stable")[:MOST][::-1]
        colours = ["C3" if inclusion["chosen"][k] else "0.6" for k in order]
        lower.barh(np.arange(order.size), inclusion["probability"][order], color=colours)
        lower.set_yticks(np.arange(order.size), [str(inclusion["term"][k]) for k in order], fontsize=8)
        lower.set_xlim(0.0, 1.0)
        lower.set_xlabel("probability that a term belongs")
    return returned(ax, axes)
