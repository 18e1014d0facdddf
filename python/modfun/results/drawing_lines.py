"""Plots of the lines of a fit: which were used, what is left of them, and tests of that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..base.axes import (
    chosen_rows,
    drawing,
    frequency_axis,
    name_y,
    returned,
    take_axes,
    take_pairs,
)
from ..errors import SpecError
from ..records.record import Record
from .estimates import Estimates as Fit  # by the name that users know, which messages show
from .line_tests import correlation_of_lines, cumulated_power

__all__ = ["harmonics", "lines_over_frequency", "residual_tests", "residuals"]


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
        One Axes where there is one channel or one was given, otherwise one per channel.

    See Also
    --------
    modfun.fit : Chooses the band.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, eq. (20).

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.harmonics(fit)
    >>> [one.get_ylabel() for one in ax]
    ['y', 'u']
    """
    seen = fit.record_of(rec, "plot_harmonics")
    spec = seen.spectrum()
    axes = take_axes(ax, len(spec.channels), "Spectrum and harmonics used", height=1.8)
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
        own = [k for k, one in enumerate(fit.records or ()) if one is rec]
        level = fit.noise_levels[own[0], output] if own else np.atleast_1d(fit.sigma)[output]
        found.insert(0, (float(level), "--", "noise of the fit"))
    gain = np.sqrt(6 / rec.intervals)
    return [(gain * level, style, words) for level, style, words in found if level > 0]


@drawing
def residuals(fit: Fit, ax: Any = None, *, output: str | None = None, hz: bool = False) -> Any:
    """Draw the whitened residual lines over frequency, and their autocorrelation, with 95 % lines.

    Dashed are those of white noise, solid those of the smooth noise spectrum (`fit.noise_spectrum()`).

    Parameters
    ----------
    fit : Fit
    ax : sequence of Axes, optional
        Two a row, in turn; new ones by default. Rows are the outputs; of equations these.
    output : str, optional
        Name of the one row to draw, as "q" or "equation 1"; default: all.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    ndarray of Axes, shape (2 · rows,)

    See Also
    --------
    modfun.plot.residual_tests : Tests of them.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.residuals(fit)
    >>> [one.get_ylabel() for one in ax]
    ['whitened residual', 'autocorrelation']
    """

    def draw(upper: Any, lower: Any, pieces: Sequence[Any], of: str, row: int) -> None:
        lines_over_frequency(upper, fit, row, hz=hz)
        name_y(upper, f"whitened residual{of}")
        test, r = correlation_of_lines(pieces)
        _autocorrelation(lower, r, test.count)
        lower.set_xlabel(f"lag in harmonics (Ljung-Box p = {test.p_value:.2g})")
        name_y(lower, f"autocorrelation{of}")

    chosen = chosen_rows(fit.row_names, fit.outputs, output, "plot.residuals")
    return _each_row(fit, ax, chosen, "Residual lines and their autocorrelation", 2.3, draw)


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

    See Also
    --------
    modfun.plot.residuals : The residuals themselves.

    References
    ----------
    J. D. Hunter, Matplotlib: A 2D graphics environment, Comput. Sci. Eng. 9, 2007.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
    >>> fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    >>> ax = mf.plot.residual_tests(fit)
    >>> [one.get_ylabel() for one in ax]
    ['cumulated power', 'residuals']
    """
    chosen = chosen_rows(fit.row_names, fit.outputs, output, "plot.residual_tests")
    if hasattr(ax, "plot"):
        raise SpecError(f"plot.residual_tests: ax is a single Axes; give {2 * len(chosen)}")

    def draw(left: Any, right: Any, pieces: Sequence[Any], of: str, _: int) -> None:
        _cumulated(left, *cumulated_power(pieces))
        name_y(left, f"cumulated power{of}")
        _quantiles(right, pieces)
        name_y(right, f"residuals{of}")

    return _each_row(fit, ax, chosen, "Tests of the residual lines", 2.6, draw)


def _each_row(
    fit: Fit,
    ax: Any,
    chosen: Sequence[int],
    title: str,
    height: float,
    draw: Callable[[Any, Any, Sequence[Any], str, int], None],
) -> Any:
    """Two Axes per row of residuals, drawn from its lines of each record, " of" its name and its number."""
    axes = take_pairs(ax, len(chosen), title, height=height, sharex=False)
    for pair, i in zip(axes, chosen, strict=True):
        draw(
            *pair,
            [piece[i] for piece in fit.pieces],
            "" if len(fit.row_names) == 1 else f" of {fit.row_names[i]}",
            i,
        )
        for here in pair:
            here.grid(True, alpha=0.3)
    return returned(ax, [here for pair in axes for here in pair])


def lines_over_frequency(here: Any, fit: Fit, row: int, *, hz: bool = False) -> None:
    """Draw the residual lines of one row over frequency, with 95 % lines of white noise and of its own."""
    scale, label = frequency_axis(hz)
    pieces = [piece[row] for piece in fit.pieces]
    for k, ((first, last), spacing, e) in enumerate(zip(fit.lines, fit.omega0, pieces, strict=True)):
        omega, beside = scale * spacing * np.arange(first, last + 1), 0.08 * scale * spacing
        some = len(e) <= 60
        look = {"markersize": 4 if some else 2.5, "linestyle": "none"}
        here.plot(omega - beside, e.real, marker="o", color="C0", label=None if k else "Re", **look)
        here.plot(omega + beside, e.imag, marker="s", color="C1", label=None if k else "Im", **look)
    here.axhline(0.0, color="0.3", linewidth=0.6)
    for level in (-1.96, 1.96):
        here.axhline(level, color="0.4", linestyle="--", linewidth=0.8)
    if fit.spectrum is not None:
        omega, power, _ = fit.spectrum
        for side in (-1.96, 1.96):
            here.plot(scale * omega, side * np.sqrt(power[row]), color="0.4", linewidth=1.0)
    every = np.concatenate(pieces)
    reach = max(3.0, 1.1 * float(np.max(np.abs([every.real, every.imag]), initial=0.0)))
    here.set_ylim(-reach, reach)
    here.set_xlabel(label)
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
