"""Plots of fits: simulation beside measurement, poles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.axes import bridge_gaps, chosen_outputs, drawing, returned, take_axes, take_pairs
from ..base.student import root
from ..errors import SpecError
from ..records.record import Record
from ..results.fit import Fit


@drawing
def response(fit: Fit, rec: Record | int | None = None, ax: Any = None, *, output: str | None = None) -> Any:
    """Draw measured and simulated outputs, the error below each; masked samples bridged by dots.

    Parameters
    ----------
    fit : Fit
    rec : Record or int, optional
        A record, or the index of one of the fit's own (needed where it has several).
    ax : Axes or sequence of Axes, optional
        Two an output, in turn; of one output a single Axes takes both. New ones by default.
    output : str, optional
        Name of the one output to draw; default: all.

    Returns
    -------
    Axes or ndarray of Axes, shape (2 · outputs,)
    """
    chosen = chosen_outputs(fit.outputs, output, "plot.response")
    measured = fit._record(rec, "plot.response")
    simulated, errors = fit.predict(measured), fit.errors(measured)
    levels = fit.score(measured)["signal_to_error"]
    axes = take_pairs(ax, len(chosen), height=2.3)
    for (upper, lower), i in zip(axes, chosen, strict=True):
        name = fit.outputs[i]
        unit = f" ({fit.units[name]})" if name in fit.units else ""
        upper.plot(measured.t, measured._shown(name), color="0.55", linewidth=2.0, label="measured")
        upper.plot(
            simulated.t, simulated.y[i], color="C3", linewidth=1.0, label=f"simulated: {levels[i]:.1f} dB"
        )
        bridge_gaps(upper, measured.t, measured[name], measured._good(name), label="masked")
        lower.plot(measured.t, errors[i], color="C0", linewidth=0.8, label="error")
        upper.set_ylabel(f"{name}{unit}")
        if lower is not upper:
            lower.axhline(0.0, color="0.3", linewidth=0.6)
            lower.set_ylabel(f"error{unit}" if len(chosen) == 1 else f"error of {name}{unit}")
        upper.legend(frameon=False, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
        for here in (upper, lower):
            here.grid(True, alpha=0.3)
    axes[-1][1].set_xlabel("time (s)")
    return returned(ax, [here for pair in axes for here in pair])


@drawing
def poles(*fits: Fit, labels: Sequence[str] | None = None, ax: Any = None) -> Any:
    """Draw the poles of fits with 95 % confidence ellipses (real poles: intervals).

    Outputs with denominators of their own have a colour each.

    Parameters
    ----------
    *fits : Fit
    labels : sequence of str, optional
        A name a fit, for the legend.
    ax : Axes, optional
        A new one by default.

    Returns
    -------
    Axes
    """
    from ..results.derived import denominators

    if not fits:
        raise SpecError("plot.poles: give at least one fit")
    if labels is not None and len(labels) != len(fits):
        raise SpecError(f"plot.poles: {len(labels)} labels for {len(fits)} fits; give one each")
    (here,) = take_axes(ax, 1, height=4.0, width=5.0)
    drawn = 0
    for k, fit in enumerate(fits):
        fit._need_numbers("plot.poles")
        named = labels[k] if labels is not None else f"{fit.order} poles" if len(fits) > 1 else ""
        for output, i in denominators(fit):
            name = " ".join(part for part in (named, output) if part)
            _poles_of_output(here, fit, i, f"C{drawn % 10}", name)
            drawn += 1
    here.axhline(0.0, color="0.3", linewidth=0.6)
    here.axvline(0.0, color="0.3", linewidth=0.9)
    here.margins(0.12)
    here.autoscale_view()
    tall = 0.25 * max(map(abs, here.get_xlim()))  # real poles alone would stand on an axis without height
    here.set_ylim(min(here.get_ylim()[0], -tall), max(here.get_ylim()[1], tall))
    here.set_xlabel("real part (rad/s)")
    here.set_ylabel("imaginary part (rad/s)")
    here.grid(True, alpha=0.3)
    if drawn > 1:
        here.legend(frameon=False)
    return returned(ax, [here])


def _poles_of_output(here: Any, fit: Fit, output: int, color: str, label: str) -> None:
    from scipy.special import fdtri

    turn = np.exp(2j * np.pi * np.arange(181) / 180)
    found, gradients = fit._poles(output)
    cov = fit.cov_params()
    here.plot(found.real, found.imag, "x", color=color, markersize=8, markeredgewidth=1.8, label=label)
    for pole, gradient in zip(found, gradients, strict=True):
        if pole.imag == 0:
            low, high = fit.interval(np.array(pole.real), root(gradient.real @ cov @ gradient.real))
            here.plot([low, high], [0, 0], color=color, linewidth=6, alpha=0.3, solid_capstyle="butt")
            continue
        both = np.array([gradient.real, gradient.imag])
        spread = both @ cov @ both.T
        if not np.all(np.isfinite(spread)):
            continue
        size, axes = np.linalg.eigh(spread)
        radius = np.sqrt(2 * fdtri(2, max(fit.df_resid, 1), 0.95) * np.maximum(size, 0.0))
        edge = axes @ (radius[:, None] * np.array([turn.real, turn.imag]))
        here.fill(pole.real + edge[0], pole.imag + edge[1], color=color, alpha=0.2, linewidth=0)
        here.plot(pole.real + edge[0], pole.imag + edge[1], color=color, linewidth=0.8)
