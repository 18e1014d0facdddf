"""Figures 1(c) and 2 of report NAG-1-1065, drawn from the numbers of the reproduction."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..base.optional import optional
from ..base.tables import Table

__all__ = ["noise", "sampling"]

# One colour an estimator in all figures (safe for colour-blind readers).
LOOKS = {
    "ls": ("#0072B2", "o", "ls: the report's MFT"),
    "awls": ("#009E73", "s", "awls"),
    "ml": ("#D55E00", "D", "ml"),
    "output error": ("#666666", "^", "output error, continuous time"),
    "pem": ("#CC79A7", "v", "PEM, 2 coefficients"),
    "pem, b u(t)": ("#CC79A7", "x", "PEM, 1 coefficient b u(t)"),
    "pem, from rest": ("#CC79A7", "v", "PEM, from rest"),
    "pem, state estimated": ("#8E44AD", "P", "PEM, state estimated"),
}

RULE = {"staircase": "staircase rule (the report's)", "gregory": "Gregory's rule"}
# Upper ends of the axes, %: the bars of the PEM at NSR 60 % go beyond.
TOP = {"bias": 19.0, "sd": 36.0}
# Markers of the estimators stand side by side, in % of NSR.
SIDE = ("ls", "awls", "ml", "output error", "pem, from rest", "pem, state estimated")
ASIDE = {name: 0.5 * k for k, name in enumerate(SIDE, -2)}


def _figure(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Any, Any]:
    figure = optional("matplotlib.figure", "plot", "drawing the figures").Figure(
        figsize=size, dpi=150, layout="constrained"
    )
    optional("matplotlib.backends.backend_agg", "plot", "drawing").FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def sampling(table: Table, path: Path) -> Path:
    """Draw Fig. 1(c): error without noise against the sampling rate."""
    figure, axes = _figure(1, 1, (7.6, 5.0))
    ax = axes[0, 0]
    kinds = list(dict.fromkeys(zip(table["estimator"].tolist(), table["rule"].tolist(), strict=True)))
    for name, rule in kinds:
        color, marker, label = LOOKS[name]
        mine = (table["estimator"] == name) & (table["rule"] == rule)
        line = {"staircase": "-", "gregory": "--", "": "-." if name == "pem" else ":"}[rule]
        short = name if rule else label
        ax.plot(
            table["rate_hz"][mine], table["error"][mine], color=color, marker=marker, linestyle=line,
            markersize=5, linewidth=1.4, markerfacecolor=color if rule == "staircase" else "white",
            label=f"{short}, {RULE[rule]}" if rule else label,
        )  # fmt: skip
    ax.axvline(25.6, color="0.6", linewidth=0.8, zorder=0)
    ax.annotate(
        "25.6 Hz, the report's Fig. 2", (25.6, 1.0), xycoords=("data", "axes fraction"), xytext=(4, -4),
        textcoords="offset points", va="top", fontsize="small", color="0.35",
    )  # fmt: skip
    ax.set_xscale("log", base=2)
    ax.set_yscale("log")
    ticks = sorted(set(table["rate_hz"].tolist()))
    ax.set_xticks(ticks, [f"{v:g}" for v in ticks])
    ax.set_xlabel("sampling rate (Hz), 10 s of data")
    ax.set_ylabel("error of the parameters (% of the true values, RMS)")
    ax.set_title("Sampling rate and error without noise (report NAG-1-1065, Fig. 1(c))", fontsize="medium")
    ax.grid(True, which="major", alpha=0.3)
    ax.legend(
        frameon=False,
        fontsize="small",
        ncols=2,
        handlelength=3.2,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.14),
    )
    figure.savefig(path)
    return path


def noise(table: Table, runs: int, many: int, path: Path) -> Path:
    """Draw Fig. 2: bias and standard deviation against NSR, initial state zero above, random below."""
    figure, axes = _figure(2, 2, (10.0, 8.2), sharex=True, sharey="col")
    names = list(dict.fromkeys(table["estimator"].tolist()))
    for row, state in enumerate(("zero", "random")):
        for column, (what, text) in enumerate((("bias", "bias"), ("sd", "standard deviation"))):
            ax = axes[row, column]
            _said(ax, what, state)
            here = table["initial_state"] == state
            for name in names:
                _curve(ax, table, here & (table["estimator"] == name), name, what, runs, many)
            if what == "sd":
                one = here & (table["estimator"] == "ls") & (table["runs"] == many)
                ax.plot(
                    100 * table["nsr"][one], table["crlb"][one], color="black", linestyle=(0, (1, 1.5)),
                    linewidth=1.6, label="Cramér–Rao bound, state unknown",
                )  # fmt: skip
            ax.set_ylim(0.0, TOP[what])
            ax.tick_params(labelleft=True)
            ax.set_title(f"{text}, initial state {state}", fontsize="medium")
            ax.set_ylabel(f"{text} (% of the true values)")
            ax.grid(True, alpha=0.3)
            if row:
                ax.set_xlabel("noise-to-signal ratio NSR (%)")
    entries: dict[str, Any] = {}
    for ax in axes.ravel():
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=3, fontsize="small",
                  frameon=False)  # fmt: skip
    figure.suptitle(
        f"Noise and error (report NAG-1-1065, Fig. 2): lines {many:,} runs, markers {runs:,} runs "
        "± 2 Monte Carlo standard errors",
        fontsize="medium",
    )
    figure.savefig(path)
    return path


def _curve(ax: Any, table: Table, mine: Any, name: str, what: str, runs: int, many: int) -> None:
    color, marker, label = LOOKS[name]
    few = mine & (table["runs"] == runs)
    large = mine & (table["runs"] == many)
    both = bool(large.any()) and runs != many
    if both:
        ax.plot(100 * table["nsr"][large], table[what][large], color=color, linewidth=1.8)
    ax.errorbar(
        100 * table["nsr"][few] + ASIDE[name], table[what][few], yerr=2 * table[f"{what}_mcse"][few],
        color=color, marker=marker, markersize=5, linewidth=0.0 if both else 1.2, elinewidth=1.0, capsize=2.5,
        linestyle="none" if both else "--", label=label,
    )  # fmt: skip


def _said(ax: Any, what: str, state: str) -> None:
    """What the report states in words; its curves are not available as numbers."""
    if (what, state) != ("bias", "zero"):
        return
    ax.axhspan(6, 7, color="#CC79A7", alpha=0.25, linewidth=0, label="report: PEM 6–7 %")
    ax.plot(
        [60], [12], marker="*", markersize=15, color="#0072B2", markerfacecolor="white", linestyle="none",
        clip_on=False, label="report: MFT ~12 % at NSR 60 %", zorder=5,
    )  # fmt: skip
