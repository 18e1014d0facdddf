"""Plots of fits: against records and gains, poles, what residuals tell, correlations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..base.arguments import shown
from ..base.arrays import F64
from ..base.axes import (
    bridge_gaps,
    chosen_outputs,
    chosen_rows,
    drawing,
    frequency_axis,
    returned,
    take_axes,
    take_pairs,
)
from ..base.student import root
from ..errors import SpecError
from ..records.record import Record
from ..systems.drawing import Curve, curves_of, draw_bode, span
from ..systems.frequency_response import FrequencyResponse
from .estimates import Estimates as Fit  # by the name that users know, which messages show
from .line_tests import correlation_of_lines, cumulated_power
from .scores import score

__all__ = ["bode", "correlation", "harmonics", "poles", "residual_tests", "residuals", "response"]

NUMBERS = 10  # parameters up to which correlations are written into their cells


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
    measured = fit.record_of(rec, "plot.response")
    simulated, _ = fit.simulate(measured)
    errors = np.where(True if measured.mask is None else measured.mask, measured.y - simulated, np.nan)
    levels = score(fit, measured)["signal_to_error"]
    axes = take_pairs(ax, len(chosen), height=2.3)
    for (upper, lower), i in zip(axes, chosen, strict=True):
        name = fit.outputs[i]
        unit = f" ({fit.units[name]})" if name in fit.units else ""
        upper.plot(measured.t, measured._shown(name), color="0.55", linewidth=2.0, label="measured")
        upper.plot(
            measured.t, simulated[i], color="C3", linewidth=1.0, label=f"simulated: {levels[i]:.1f} dB"
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
def bode(
    *systems: Any,
    band: tuple[float, float] | None = None,
    hz: bool = False,
    labels: Sequence[str] | None = None,
    ax: Any = None,
) -> Any:
    """Draw magnitude (dB) and phase (degrees) over frequency, fits with 95 % bands.

    Parameters
    ----------
    *systems : Fit, LTI or FrequencyResponse
        Every path of each gets a line; the band of a fit is by the delta method, and what lies outside
        the frequencies it was fitted on is dashed.
    band : (float, float), optional
        Frequencies drawn, rad/s; default: around the bands of the fits or the poles of the systems.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.
    labels : sequence of str, optional
        A name a system, for the legend.
    ax : sequence of two Axes, optional
        Magnitude and phase; new ones by default.

    Returns
    -------
    ndarray of Axes
    """
    if not systems:
        raise SpecError("plot.bode: give at least one fit, system or frequency response")
    if labels is not None and len(labels) != len(systems):
        raise SpecError(f"plot.bode: {len(labels)} labels for {len(systems)} systems; give one each")
    curves: list[tuple[str, Curve]] = []
    marks: list[float] = []
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
    for k, system in enumerate(systems):
        for curve in _curves(system, omega):
            words = (curve.path,) if labels is None else (labels[k], curve.path)
            curves.append((" ".join(filter(None, words)) or type(system).__name__, curve))
    return draw_bode(curves, low, high, hz=hz, ax=ax)


def _curves(system: Any, omega: F64) -> list[Curve]:
    """What is drawn of a system; of a fit with the errors of its gains, by the delta method."""
    if not isinstance(system, Fit):
        found = system if isinstance(system, FrequencyResponse) else system.frequency_response(omega)
        return curves_of(found.omega, found.response, found.radius(), found.outputs, found.inputs)
    system.need_numbers("frequency_response")
    response, gradient = system.response_gradients(omega)
    cov = system.cov_params()
    inside = (omega >= system.band[0]) & (omega <= system.band[1])
    half = system.interval(np.zeros(omega.size), np.ones(omega.size))[1]
    curves = []
    for i, k in np.argwhere(np.any(response != 0, axis=2)):
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = gradient[:, i, k] / response[i, k]
        size, angle = (
            root(np.einsum("pf,pq,qf->f", part, cov, part)) for part in (relative.real, relative.imag)
        )
        path = f"{system.inputs[k]} → {system.outputs[i]}"
        decibels, degrees = 20 / np.log(10) * half * size, np.degrees(half * angle)
        curves.append(Curve(path, omega, response[i, k], decibels, degrees, inside))
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
    """
    if not fits:
        raise SpecError("plot.poles: give at least one fit")
    if labels is not None and len(labels) != len(fits):
        raise SpecError(f"plot.poles: {len(labels)} labels for {len(fits)} fits; give one each")
    (here,) = take_axes(ax, 1, height=4.0, width=5.0)
    drawn = 0
    for k, fit in enumerate(fits):
        fit.need_numbers("plot.poles")
        named = labels[k] if labels is not None else f"{fit.order} poles" if len(fits) > 1 else ""
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
def harmonics(fit: Fit, rec: Record | int | None = None, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the spectrum of a record with the harmonics that the fit uses shaded, and its noise level.

    Dashed, at outputs: the level at which white noise of the fit's standard deviation would stand; dotted:
    that of the noise in the unused high band. They are left out where steps are uneven or the fit's noise
    is no white noise on outputs.

    Parameters
    ----------
    fit : Fit
    rec : Record or int, optional
        A record, or the index of one of the fit's own (needed where it has several).
    ax : Axes or sequence of Axes, optional
        One Axes a channel, or a single one for all; new ones by default.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one channel or one was given, otherwise one a channel.
    """
    seen = fit.record_of(rec, "plot.harmonics")
    spec = seen.spectrum()
    axes = take_axes(ax, len(spec.channels), height=1.8)
    spec.plot(axes[0] if hasattr(ax, "plot") else axes, hz=hz)
    scale, _ = frequency_axis(hz)
    low, high = _used(fit, seen)
    edges = scale * max(low, spec.omega[0] / 2), scale * min(high, 1.05 * spec.omega[-1])
    for here in dict.fromkeys(axes):
        here.axvspan(*edges, color="C2", alpha=0.18, linewidth=0, label="used")
        here.set_xlim(scale * spec.omega[0] / 2, scale * 1.05 * spec.omega[-1])
    for name, here in zip(fit.outputs, axes, strict=False):
        for level, style, words in _levels(fit, fit.outputs.index(name), seen):
            here.axhline(level, color="0.4", linestyle=style, linewidth=0.9, label=words)
    if len(set(axes)) == len(axes):
        handles, labels = axes[0].get_legend_handles_labels()
        look: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        axes[0].legend(handles[1:], labels[1:], frameon=False, ncols=4, **look)
    return returned(ax, axes)


def _used(fit: Fit, rec: Record) -> tuple[float, float]:
    """Frequencies that the fit uses of a record, half a line added on both sides; of others its band."""
    for own, (first, last), spacing in zip(fit.records or (), fit.lines, fit.omega0, strict=False):
        if own is rec:
            return (first - 0.5) * spacing, (last + 0.5) * spacing
    return fit.band


def _levels(fit: Fit, output: int, rec: Record) -> list[tuple[float, str, str]]:
    """Levels of white noise in an amplitude spectrum under a Hann window: sqrt(6/N) of its deviation."""
    if rec.dt is None:
        return []
    found = [(float(fit.high_band_levels[output]), ":", "noise of the high band")]
    if fit.options.noise != "equation" and fit.options.method in ("awls", "ml"):
        found.insert(0, (float(np.atleast_1d(fit.sigma)[output]), "--", "noise of the fit"))
    gain = np.sqrt(6 / rec.intervals)
    return [(gain * level, style, words) for level, style, words in found if level > 0]


@drawing
def residuals(fit: Fit, ax: Any = None, *, output: str | None = None) -> Any:
    """Draw the whitened residual lines over m, and their autocorrelation, with 95 % lines.

    Parameters
    ----------
    fit : Fit
    ax : sequence of Axes, optional
        Two a row, in turn; new ones by default. Rows are the outputs; of equations these.
    output : str, optional
        Name of the one row to draw, as "q" or "equation 1"; default: all.

    Returns
    -------
    ndarray of Axes, shape (2 · rows,)
    """

    def draw(upper: Any, lower: Any, pieces: Sequence[Any], of: str) -> None:
        _lines_over_m(upper, fit.lines, pieces)
        upper.set_ylabel(f"whitened residual{of}")
        test, r = correlation_of_lines(pieces)
        _autocorrelation(lower, r, test.count)
        lower.set_xlabel(f"lag in harmonics (Ljung-Box p = {test.p_value:.2g})")
        lower.set_ylabel(f"autocorrelation{of}")

    return _each_row(fit, ax, chosen_rows(fit.row_names, fit.outputs, output, "plot.residuals"), 2.3, draw)


@drawing
def residual_tests(fit: Fit, ax: Any = None, *, output: str | None = None) -> Any:
    """Draw the cumulated power of the residual lines over the band, and their normal quantiles.

    A straight line is noise of one level over the band; dashed is the 95 % band of the Kolmogorov-Smirnov
    test. Points on the diagonal are normal; the band holds each point with 95 %.

    Parameters
    ----------
    fit, ax, output
        As in `residuals`.

    Returns
    -------
    ndarray of Axes, shape (2 · rows,)
    """
    chosen = chosen_rows(fit.row_names, fit.outputs, output, "plot.residual_tests")
    if hasattr(ax, "plot"):
        raise SpecError(f"plot.residual_tests: ax is a single Axes; give {2 * len(chosen)}")

    def draw(left: Any, right: Any, pieces: Sequence[Any], of: str) -> None:
        _cumulated(left, *cumulated_power(pieces))
        left.set_ylabel(f"cumulated power{of}")
        _quantiles(right, pieces)
        right.set_ylabel(f"residuals{of}")

    return _each_row(fit, ax, chosen, 2.6, draw)


def _each_row(
    fit: Fit,
    ax: Any,
    chosen: Sequence[int],
    height: float,
    draw: Callable[[Any, Any, Sequence[Any], str], None],
) -> Any:
    """Two Axes a row of residuals; `draw` gets these, the lines of each record, and " of" the row's name."""
    axes = take_pairs(ax, len(chosen), height=height, sharex=False)
    for pair, i in zip(axes, chosen, strict=True):
        draw(
            *pair,
            [piece[i] for piece in fit.pieces],
            "" if len(fit.row_names) == 1 else f" of {fit.row_names[i]}",
        )
        for here in pair:
            here.grid(True, alpha=0.3)
    return returned(ax, [here for pair in axes for here in pair])


def _lines_over_m(here: Any, lines: Sequence[tuple[int, int]], pieces: Sequence[Any]) -> None:
    for k, ((first, last), e) in enumerate(zip(lines, pieces, strict=True)):
        m = np.arange(first, last + 1)
        some = len(e) <= 60
        look = {"markersize": 4 if some else 2.5, "linestyle": "none"}
        here.plot(m - 0.08, e.real, marker="o", color="C0", label=None if k else "Re", **look)
        here.plot(m + 0.08, e.imag, marker="s", color="C1", label=None if k else "Im", **look)
    here.axhline(0.0, color="0.3", linewidth=0.6)
    for level in (-1.96, 1.96):
        here.axhline(level, color="0.4", linestyle="--", linewidth=0.8)
    every = np.concatenate(pieces)
    reach = max(3.0, 1.1 * float(np.max(np.abs([every.real, every.imag]), initial=0.0)))
    here.set_ylim(-reach, reach)
    here.xaxis.get_major_locator().set_params(integer=True)
    here.set_xlabel("harmonic m")
    here.legend(frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def _autocorrelation(here: Any, r: Any, count: int) -> None:
    lags = np.arange(1, r.size + 1)
    here.bar(lags, r, width=0.35, color="C0")
    here.axhline(0.0, color="0.3", linewidth=0.6)
    limit = 1.96 / np.sqrt(2 * max(count, 1))
    for level in (-limit, limit):
        here.axhline(level, color="0.4", linestyle="--", linewidth=0.8)
    here.set_xticks(lags)
    here.set_xlim(0.0, max(10, r.size) + 1.0)


def _cumulated(here: Any, share: Any, power: Any) -> None:
    here.plot(share, power, ".-", color="C0", linewidth=1.0, markersize=4)
    away = 1.358 / np.sqrt(max(share.size - 1, 1))
    for shift, style in ((0.0, "-"), (away, "--"), (-away, "--")):
        here.plot([0, 1], [shift, 1 + shift], style, color="0.4", linewidth=0.8)
    here.set(xlim=(0, 1), ylim=(-0.02, 1.02), xlabel="part of the band")


def _quantiles(here: Any, pieces: Sequence[Any]) -> None:
    from scipy.special import betaincinv, ndtri

    every = np.concatenate(pieces)
    values = np.sort(np.concatenate([every.real, every.imag]))
    rank = np.arange(1, values.size + 1)
    normal = ndtri((rank - 0.5) / values.size)
    edges = [ndtri(betaincinv(rank, values.size + 1 - rank, p)) for p in (0.025, 0.975)]
    here.fill_between(normal, *edges, color="0.5", alpha=0.2, linewidth=0)
    here.plot(normal, normal, color="0.4", linewidth=0.8)
    here.plot(normal, values, ".", color="C0", markersize=4)
    here.set_xlabel("normal quantiles")


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
    """
    between = fit.correlation()
    names = fit.param_names
    (here,) = take_axes(ax, 1, height=4.0, width=5.0)
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
