"""Plots of tables: fits compared, orders, Monte Carlo studies."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from ..base.axes import drawing, label_axes, returned, take_axes, take_grid
from ..errors import SpecError
from ..inference.comparison import Comparison, CrossValidation
from ..inference.order import OrderSelection
from ..study.results import Results


@drawing
def comparison(table: Comparison, ax: Any = None) -> Any:
    """Draw the measured outputs of a record and what each fit simulates, with its fit in per cent.

    Parameters
    ----------
    table : Comparison
    ax : Axes or sequence of Axes, optional
        One Axes an output, or a single one for all; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one output or one was given, otherwise one an output.
    """
    rec = table.record
    axes = take_axes(ax, len(rec.outputs), height=2.3)
    percent = {(row["model"], row["output"]): row["fit_percent"] for row in table}
    for here, name in zip(axes, rec.outputs, strict=True):
        here.plot(rec.t, rec._shown(name), color="0.6", linewidth=2.0, label=f"{name} measured")
    for model, fit in table.fits.items():
        simulated = fit.predict(rec)
        for here, name in zip(axes, rec.outputs, strict=True):
            words = f"{model}: {percent[model, name]:.1f} %"
            here.plot(rec.t, simulated[name], linewidth=1.0, label=words)
    label_axes(axes, rec.outputs, rec.units, "time (s)")
    for here in dict.fromkeys(axes):
        here.legend(frameon=False, fontsize=8)
    return returned(ax, axes)


@drawing
def cross_validation(table: CrossValidation, ax: Any = None) -> Any:
    """Draw how well each record left out is simulated, an estimator a line; below -100 % is left out.

    Parameters
    ----------
    table : CrossValidation
    ax : Axes or sequence of Axes, optional
        One Axes an output, or a single one for all; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
    """
    outputs = list(dict.fromkeys(table["output"]))
    axes = take_axes(ax, len(outputs), height=2.4)
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


@drawing
def order(selection: OrderSelection, ax: Any = None) -> Any:
    """Draw residual level and criterion of the candidates over the number of poles.

    Parameters
    ----------
    selection : OrderSelection
    ax : Axes or sequence of two Axes, optional
        A single Axes takes the criterion alone; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        Above the residual level (logarithmic) with the noise level dashed, below the criterion over its
        lowest value; a number at a point is that of its zeros, the chosen candidate is ringed.
    """
    axes = take_axes(ax, 2, height=2.6)
    upper, lower = axes
    table = selection.table
    poles, level = table["poles"], table["residual"]
    score = table[selection.criterion] - np.nanmin(table[selection.criterion])
    chosen = selection.fits.index(selection.best)
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
        if np.isfinite(selection.sigma):
            upper.axhline(selection.sigma, color="0.3", linestyle="--", linewidth=0.8, label="noise level")
            upper.legend(frameon=False)
    words = {"calibrated_bic": "calibrated BIC", "bic": "BIC"}[selection.criterion]
    lower.set_yscale("symlog", linthresh=10.0)
    lower.set_ylim(bottom=-3.0)
    lower.set_ylabel(f"{words} over its lowest")
    lower.set_xlabel("poles (at each point: zeros)")
    return returned(ax, axes)


@drawing
def study(res: Results, ax: Any = None) -> Any:
    """Draw bias and standard deviation against NSR, as figure 2 of the report, one row a cell otherwise.

    A study with one noise level is drawn over its first axis with several numbers.

    Both are root mean squares over the parameters in % of the true values; bars are ± 2 Monte Carlo
    standard errors, the dotted line is the Cramér–Rao bound.

    Parameters
    ----------
    res : Results
        Of a study over several noise levels, or over an axis of numbers.
    ax : sequence of Axes, optional
        Bias and standard deviation, for each cell in turn; new ones by default.

    Returns
    -------
    ndarray of Axes, shape (2 · cells,)
    """
    over, other, cells = study_rows(res)
    figures = res.relative()
    axes = take_grid(ax, len(cells), 2)
    x = np.array(res.axes[over]) * (100 if over == "nsr" else 1)
    for row, cell in enumerate(cells):
        here = np.ones(len(figures), dtype=bool)
        for name, label in zip(other, cell, strict=True):
            here &= figures[name] == label
        for column, (figure, text) in enumerate((("bias", "bias"), ("sd", "standard deviation"))):
            drawn = axes[2 * row + column]
            for k, name in enumerate(res.estimators):
                mine = here & (figures["estimator"] == name)
                drawn.errorbar(
                    x, figures[figure][mine], yerr=2 * figures[f"{figure}_mcse"][mine], label=name,
                    color=f"C{k % 10}", marker="osD^vP*X"[k % 8], markersize=4, linewidth=1.4, capsize=2,
                )  # fmt: skip
            if figure == "sd":
                bound = figures["crlb"][here & (figures["estimator"] == res.estimators[0])]
                if np.any(np.isfinite(bound)):
                    drawn.plot(x, bound, color="0.3", linestyle=":", label="Cramér–Rao bound")
            drawn.set_ylabel(f"{text} (% of the true values)")
            drawn.set_title(", ".join(map(str, cell)), fontsize="medium")
            drawn.set_ylim(bottom=0.0)
            drawn.grid(True, alpha=0.3)
            if row == len(cells) - 1:
                drawn.set_xlabel("noise-to-signal ratio (%)" if over == "nsr" else over)
    for drawn in axes[:2]:
        drawn.legend(frameon=False, fontsize="small")
    return returned(ax, axes)


def study_rows(res: Results) -> tuple[str, list[str], list[tuple[Any, ...]]]:
    """The axis that a study is drawn over, its other axes, and their labels, a row of Axes each."""
    over = next((name for name in ("nsr", *res.axes) if _is_scale(res.axes.get(name, ()))), None)
    if over is None:
        raise SpecError("plot.study: the study has one noise level and no axis of numbers; give nsr a list")
    if not np.any(np.isfinite(res.truth)):
        raise SpecError("plot.study: no parameter's truth is known, so that there is no bias to draw")
    other = [name for name in res.axes if name not in (over, "estimator", "parameter")]
    return over, other, list(product(*(res.axes[name] for name in other)))


def _is_scale(labels: Sequence[Any]) -> bool:
    """Whether an axis has several labels, all numbers."""
    return len(labels) > 1 and not any(isinstance(label, str) for label in labels)
