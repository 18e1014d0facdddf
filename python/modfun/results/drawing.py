"""Plots of fits: against records and gains, poles, correlations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..base.arguments import shown
from ..base.arrays import F64
from ..base.axes import (
    bridge_gaps,
    chosen_outputs,
    drawing,
    name_y,
    returned,
    take_axes,
    take_pairs,
)
from ..base.student import root
from ..errors import ModfunError, SpecError
from ..records.record import Record
from ..systems.drawing import Curve, curves_of, draw_bode, draw_bode_grid, span
from ..systems.frequency_response import FrequencyResponse
from ..systems.making import linear
from .bands import both
from .derived import gain_errors
from .estimates import Estimates as Fit  # by the name that users know, which messages show
from .scores import score

__all__ = ["bode", "correlation", "poles", "response", "word_of"]

WIDE = 5.0  # inches of a panel in whose width a legend of four entries stands
NUMBERS = 10  # parameters up to which correlations are written into their cells


@drawing
def response(fit: Fit, rec: Record | int | None = None, ax: Any = None, *, output: str | None = None) -> Any:
    """Draw measured and simulated outputs, the error below each; masked samples bridged by dots.

    The band of the response is its 95 % interval, that of the errors the interval of new samples
    (`Fit.predict`).

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

    See Also
    --------
    modfun.Fit.predict : The simulation that is drawn.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.response(fit, rec)
    >>> [one.get_ylabel() for one in ax]
    ['y', 'error']
    """
    chosen = chosen_outputs(fit.outputs, output, "plot.response")
    measured = fit.record_of(rec, "plot_response")
    simulated, _ = fit.simulate(measured)
    try:
        bands = both(fit, measured)
    except ModfunError:  # a response that overflows for parameters close by
        bands = None
    errors = np.where(True if measured.mask is None else measured.mask, measured.y - simulated, np.nan)
    levels = score(fit, measured)["signal_to_error"]
    axes = take_pairs(ax, len(chosen), "Measured and simulated outputs", height=2.3)
    for (upper, lower), i in zip(axes, chosen, strict=True):
        name = fit.outputs[i]
        unit = f" ({fit.units[name]})" if name in fit.units else ""
        upper.plot(measured.t, measured._shown(name), color="0.55", linewidth=2.0, label="measured")
        upper.plot(
            measured.t, simulated[i], color="C3", linewidth=1.0, label=f"simulated: {levels[i]:.1f} dB"
        )
        bridge_gaps(upper, measured.t, measured[name], measured._good(name), label="masked")
        lower.plot(measured.t, errors[i], color="C0", linewidth=0.8, label="error")
        if bands is not None:
            response, half = bands["confidence"], bands["prediction"].upper[i] - simulated[i]
            faint = {"alpha": 0.25, "linewidth": 0, "zorder": 1}
            upper.fill_between(
                measured.t, response.lower[i], response.upper[i], color="C3", label="95 % band", **faint
            )
            lower.fill_between(measured.t, -half, half, color="C0", **faint)
        name_y(upper, f"{name}{unit}")
        if lower is not upper:
            lower.axhline(0.0, color="0.3", linewidth=0.6)
            name_y(lower, f"error{unit}" if len(chosen) == 1 else f"error of {name}{unit}")
        columns = 4 if upper.get_window_extent().width > WIDE * upper.figure.dpi else 2
        place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        upper.legend(frameon=False, ncols=columns, **place)
        for here in (upper, lower):
            here.grid(True, alpha=0.3)
    axes[-1][1].set_xlabel("time (s)")
    return returned(ax, [here for pair in axes for here in pair])


@drawing
def bode(
    *systems: Any,
    band: tuple[float, float] | None = None,
    hz: bool = False,
    grid: bool = False,
    labels: Sequence[str] | None = None,
    ax: Any = None,
) -> Any:
    """Draw magnitude (dB) and phase (degrees) over frequency, fits with 95 % bands.

    Parameters
    ----------
    *systems : Fit, LTI or FrequencyResponse, or systems of python-control or SciPy
        Every path of each gets a line; the band of a fit is by the delta method, and what lies outside
        the frequencies it was fitted on is dashed.
    band : (float, float), optional
        Frequencies drawn, rad/s; default: around the bands of the fits or the poles of the systems.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.
    grid : bool, default False
        Panels of its own for each path, outputs below each other and inputs side by side, instead of all
        paths in one pair.
    labels : sequence of str, optional
        A name a system, for the legend.
    ax : sequence of two Axes, optional
        Magnitude and phase; of a grid row by row; new ones by default.

    Returns
    -------
    ndarray of Axes
        Magnitude and phase; of a grid (2 · outputs, inputs).

    See Also
    --------
    modfun.Fit.plot_bode : Of one fit.
    modfun.frf : Measured gains.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.bode(fit)
    >>> [one.get_ylabel() for one in ax]
    ['magnitude (dB)', 'phase (degrees)']
    """
    if not systems:
        raise SpecError("plot.bode: give at least one fit, system or frequency response")
    if labels is not None and len(labels) != len(systems):
        raise SpecError(f"plot.bode: {len(labels)} labels for {len(systems)} systems; give one each")
    curves: list[tuple[str, Curve]] = []
    marks: list[float] = []
    systems = tuple(linear(system, "plot.bode") for system in systems)
    for system in systems:
        if isinstance(system, Fit):
            low, high = system.band
            marks += [max(low, min(system.omega0, default=low)) / 2, 2 * high]
        elif isinstance(system, FrequencyResponse):
            marks += [float(w) for w in system.omega if w > 0]
        elif hasattr(system, "frequency_response"):
            sizes = np.abs(system.poles()) if hasattr(system, "poles") else np.zeros(0)
            marks += [x for size in sizes[sizes > 0] for x in (size / 10, size * 10)]
        else:
            raise SpecError(
                f"plot.bode: {shown(system)} is of type {type(system).__name__}; give a Fit, an LTI or a "
                "FrequencyResponse"
            )
    low, high = span(marks, band)
    omega = np.geomspace(low, high, 400)
    named = labels or ([word_of(system) for system in systems] if len(systems) > 1 else [""])
    for k, system in enumerate(systems):
        for curve in _curves(system, omega):
            words = (named[k], "" if grid else curve.path)
            curves.append((" ".join(filter(None, words)) or type(system).__name__, curve))
    return (draw_bode_grid if grid else draw_bode)(curves, low, high, hz=hz, ax=ax)


def word_of(system: Any) -> str:
    """What a system is called beside others in a legend."""
    if isinstance(system, Fit):
        return f"{system.order} pole{'s' * (system.order != 1)}"
    return "measured" if isinstance(system, FrequencyResponse) else "system"


def _curves(system: Any, omega: F64) -> list[Curve]:
    """What is drawn of a system; of a fit with the errors of its gains, by the delta method."""
    if not isinstance(system, Fit):
        found = system if isinstance(system, FrequencyResponse) else system.frequency_response(omega)
        return curves_of(found.omega, found.response, found.radius(), found.outputs, found.inputs)
    response, size, angle = gain_errors(system, omega)
    inside = (omega >= system.band[0]) & (omega <= system.band[1])
    half = system.interval(np.zeros(omega.size), np.ones(omega.size))[1]
    curves = []
    for i, k in np.argwhere(np.any(response != 0, axis=2)):
        path = f"{system.inputs[k]} → {system.outputs[i]}"
        decibels, degrees = 20 / np.log(10) * half * size[i, k], np.degrees(half * angle[i, k])
        curves.append(Curve(path, omega, response[i, k], decibels, degrees, inside, (int(i), int(k))))
    return curves


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

    See Also
    --------
    modfun.Fit.damp : The poles as frequencies and damping ratios.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.poles(fit)
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', 'real part (rad/s)', 'imaginary part (rad/s)')
    """
    if not fits:
        raise SpecError("plot.poles: give at least one fit")
    if labels is not None and len(labels) != len(fits):
        raise SpecError(f"plot.poles: {len(labels)} labels for {len(fits)} fits; give one each")
    (here,) = take_axes(ax, 1, "Poles with 95 % confidence regions", height=4.0, width=5.0)
    drawn = 0
    for k, fit in enumerate(fits):
        fit.need_numbers("plot.poles")
        named = labels[k] if labels is not None else word_of(fit) if len(fits) > 1 else ""
        for output, i in fit.denominators():
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
    found, gradients = fit.pole_gradients(output)
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


@drawing
def correlation(fit: Fit, ax: Any = None) -> Any:
    """Draw the correlations of the estimates as a matrix: blue negative, red positive.

    Parameters
    ----------
    fit : Fit
    ax : Axes, optional
        A new one by default.

    Returns
    -------
    Axes

    See Also
    --------
    modfun.Fit.cov_params : What is drawn.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.correlation(fit)
    >>> ax.get_title(), ax.get_xlabel(), ax.get_ylabel()
    ('', '', '')
    """
    between = fit.correlation()
    names = fit.param_names
    (here,) = take_axes(ax, 1, "Correlations of the estimates", height=4.0, width=5.0)
    drawn = here.pcolormesh(between, cmap="RdBu_r", vmin=-1.0, vmax=1.0, edgecolors="0.6", linewidth=0.4)
    here.figure.colorbar(drawn, ax=here, shrink=0.8)
    here.set_aspect("equal")
    here.invert_yaxis()
    here.set_xticks(np.arange(len(names)) + 0.5, names, rotation=45, ha="right", parse_math=False)
    here.set_yticks(np.arange(len(names)) + 0.5, names, parse_math=False)
    if len(names) <= NUMBERS:
        for (i, j), value in np.ndenumerate(between):
            colour = "#fefefe" if abs(value) > 0.6 else "#222222"
            here.text(j + 0.5, i + 0.5, f"{value:.2f}", ha="center", va="center", color=colour, size=8)
    return returned(ax, [here])
