"""Fits beside each other and candidates of several orders, drawn."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.axes import label_axes, returned, take_axes
from ..base.tables import Table
from ..records.record import Record

__all__ = ["comparison", "cross_validation", "order"]


def comparison(rec: Record, simulated: Mapping[str, Record], table: Table, ax: Any = None) -> Any:
    """Draw the measured outputs, and those simulated by each model with its fit in per cent by the table."""
    axes = take_axes(ax, len(rec.outputs), "Measured and simulated outputs", height=2.3)
    percent = {(row["model"], row["output"]): row["fit_percent"] for row in table}
    for here, name in zip(axes, rec.outputs, strict=True):
        here.plot(rec.t, rec._shown(name), color="0.6", linewidth=2.0, label=f"{name} measured")
    for model, response in simulated.items():
        for here, name in zip(axes, rec.outputs, strict=True):
            words = f"{model}: {percent[model, name]:.1f} %"
            here.plot(rec.t, response[name], linewidth=1.0, label=words)
    label_axes(axes, rec.outputs, rec.units, "time (s)")
    for here in dict.fromkeys(axes):
        above = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        here.legend(frameon=False, ncols=4, fontsize="small", **above)
    return returned(ax, axes)


def cross_validation(table: Table, ax: Any = None) -> Any:
    """Draw how well each record left out is simulated; see `modfun.plot.cross_validation`."""
    outputs = list(dict.fromkeys(table["output"]))
    axes = take_axes(ax, len(outputs), "Prediction of records left out", height=2.4)
    for here, output in zip(axes, outputs, strict=True):
        for model in dict.fromkeys(table["model"]):
            rows = (table["model"] == model) & (table["output"] == output)
            shown = np.where(table["fit_percent"][rows] < -100, np.nan, table["fit_percent"][rows])
            here.plot(table["record"][rows], shown, "o-", linewidth=0.8, label=model)
        here.set_xticks(np.unique(table["record"]))
        here.set_ylabel(f"{output}: fit (%)" if len(outputs) > 1 else "fit (%)")
        here.grid(True, alpha=0.3)
    axes[0].legend(frameon=False, fontsize=8)
    axes[-1].set_xlabel("record left out")
    return returned(ax, axes)


def order(table: Table, criterion: str, chosen: int, sigma: float, ax: Any = None) -> Any:
    """Draw residual level and criterion of the candidates of a table; see `modfun.plot.order`."""
    axes = take_axes(ax, 2, "Selection of the order", height=2.6)
    upper, lower = axes
    poles, level = table["poles"], table["residual"]
    score = table[criterion] - np.nanmin(table[criterion])
    degrees = [
        max((z for z in np.ravel(np.array(d, object)) if z is not None), default=0) for d in table["zeros"]
    ]
    place = poles + 0.13 * (np.array(degrees) - (poles - 1) / 2)  # side by side, by their zeros
    for here, values in [(lower, score)] if lower is upper else [(upper, level), (lower, score)]:
        here.plot(place, values, "o", color="C0", markersize=4)
        here.plot(place[chosen], values[chosen], "o", color="C3", markersize=11, fillstyle="none")
        for x, value, zeros in zip(place, values, table["zeros"], strict=True):
            if np.isfinite(value):
                words = "" if zeros is None else f"{zeros}"
                here.annotate(words, (x, value), (0, 6), textcoords="offset points", ha="center", size=7)
        here.set_xticks(np.unique(poles))
        here.margins(x=0.1, y=0.15)
        here.grid(True, alpha=0.3)
    if lower is not upper:
        upper.set_yscale("log")
        upper.set_ylabel("residual level")
        if np.isfinite(sigma):
            upper.axhline(sigma, color="0.3", linestyle="--", linewidth=0.8, label="noise level")
            upper.legend(frameon=False)
    words = {"calibrated_bic": "calibrated BIC", "bic": "BIC"}[criterion]
    lower.set_yscale("symlog", linthresh=10.0)
    lower.autoscale_view()  # margins are those of the scale, and hold the labels
    lower.set_ylim(bottom=-3.0)
    lower.set_ylabel(f"{words} over its lowest")
    lower.set_xlabel("poles (at each point: zeros)")
    return returned(ax, axes)
