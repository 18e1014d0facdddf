"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import SpecError
from .extras import optional
from .tables import nearest

if TYPE_CHECKING:
    from .comparison import Comparison, CrossValidation
    from .order import OrderSelection
    from .records import Record
    from .reduction import Reduction
    from .results import Fit
    from .signals import Signals
    from .spectra import Spectrum
    from .study.results import Results
    from .tone_results import Sinusoids
    from .track import Track

__all__ = [
    "bode",
    "comparison",
    "cross_validation",
    "order",
    "poles",
    "record",
    "reduction",
    "residuals",
    "response",
    "signals",
    "sinusoids",
    "spectrum",
    "study",
    "track",
]


def record(rec: Record, ax: Any = None) -> Any:
    """Draw a record over time: outputs above, inputs below, held inputs as steps.

    Masked samples are left out; dotted lines bridge them.

    Parameters
    ----------
    rec : Record
    ax : Axes or sequence of Axes, optional
        One Axes a channel, or a single one for all channels (with a legend); new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one channel or one was given, otherwise one a channel.
    """
    names = (*rec.outputs, *rec.inputs)
    axes = _axes(ax, len(names), height=1.6)
    held = dict(zip(rec.inputs, rec.intersample, strict=True))
    for name, here in zip(names, axes, strict=True):
        style = "steps-post" if held.get(name) == "zoh" else "default"
        color = "C1" if name in rec.inputs and len(set(axes)) > 1 else None
        here.plot(rec.t, rec._shown(name), drawstyle=style, label=name, color=color, linewidth=1.0)
        _bridge(here, rec, name, label=f"_{name} masked")
    _label(axes, names, rec.units, "time (s)")
    return _returned(ax, axes)


def signals(given: Signals, ax: Any = None) -> Any:
    """Draw the inputs of an experiment over time, held ones as steps.

    Parameters
    ----------
    given : Signals
    ax : Axes or sequence of Axes, optional
        One Axes an input, or a single one for all inputs (with a legend); new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one input or one was given, otherwise one an input.
    """
    axes = _axes(ax, len(given.inputs), height=1.6)
    for name, u, kind, here in zip(given.inputs, given.u, given.intersample, axes, strict=True):
        style = "steps-post" if kind == "zoh" else "default"
        here.plot(given.t, u, drawstyle=style, label=name, linewidth=1.0)
    _label(axes, given.inputs, {}, "time (s)")
    return _returned(ax, axes)


def spectrum(spec: Spectrum, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw amplitude spectra, both axes logarithmic.

    Parameters
    ----------
    spec : Spectrum
    ax : Axes or sequence of Axes, optional
        One Axes a channel, or a single one for all channels (with a legend); new ones by default.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one channel or one was given, otherwise one a channel.
    """
    axes = _axes(ax, len(spec.channels), height=1.8)
    scale, label = _frequency(hz)
    for name, here in zip(spec.channels, axes, strict=True):
        values = np.where(spec[name] > 0, spec[name], np.nan)  # zeros have no place on a logarithmic axis
        here.plot(scale * spec.omega, values, label=name, linewidth=1.0)
        here.set_xscale("log")
        if np.isfinite(values).any():
            here.set_yscale("log")
    _label(axes, spec.channels, spec.units, label)
    return _returned(ax, axes)


def sinusoids(found: Sinusoids, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the spectrum of a record and of what its tones leave, in dB, the tones as dots.

    Zero-padded, without a window: a tone that does not decay stands at its amplitude.

    Parameters
    ----------
    found : Sinusoids
    ax : Axes, optional
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes
    """
    here = _axes(ax, 1, height=3.0)[0]
    scale, label = _frequency(hz)
    size = 8 * found.y.size
    omega = 2 * np.pi / found.dt * np.fft.fftfreq(size)
    shown = np.argsort(omega) if np.iscomplexobj(found.y) else slice(0, size // 2)
    gain = (1.0 if np.iscomplexobj(found.y) else 2.0) / np.sum(found.weights > 0)
    left = np.where(found.weights > 0, found.errors(), 0.0)
    for values, name, style in (
        (np.where(found.weights > 0, found.y, 0.0), "record", {"color": "C0", "linewidth": 1.2}),
        (left, "without the tones", {"color": "0.6", "linewidth": 0.8}),
    ):
        lines = gain * np.abs(np.fft.fft(values, size)[shown])
        here.plot(scale * omega[shown], _decibels(lines), label=name, **style)
    here.plot(scale * found.omega, _decibels(found.amplitude), "C3o", markersize=5, label="tones")
    for omega_i, reach in zip(found.omega, 1.96 * found.bse[: len(found)], strict=True):
        here.axvspan(scale * (omega_i - reach), scale * (omega_i + reach), color="C3", alpha=0.2, linewidth=0)
    here.set(xlabel=label, ylabel="amplitude (dB)")
    here.grid(True, alpha=0.3)
    here.legend(frameon=False)
    return here


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
    chosen = _outputs(fit, output, "plot.response")
    measured = fit._record(rec, "plot.response")
    simulated, errors = fit.predict(measured), fit.errors(measured)
    levels = fit.score(measured)["signal_to_error"]
    axes = _pairs(ax, len(chosen), height=2.3)
    for (upper, lower), i in zip(axes, chosen, strict=True):
        name = fit.outputs[i]
        unit = f" ({fit.units[name]})" if name in fit.units else ""
        upper.plot(measured.t, measured._shown(name), color="0.55", linewidth=2.0, label="measured")
        upper.plot(
            simulated.t, simulated.y[i], color="C3", linewidth=1.0, label=f"simulated: {levels[i]:.1f} dB"
        )
        _bridge(upper, measured, name, label="masked")
        lower.plot(measured.t, errors[i], color="C0", linewidth=0.8, label="error")
        upper.set_ylabel(f"{name}{unit}")
        if lower is not upper:
            lower.axhline(0.0, color="0.3", linewidth=0.6)
            lower.set_ylabel(f"error{unit}" if len(chosen) == 1 else f"error of {name}{unit}")
        upper.legend(frameon=False, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
        for here in (upper, lower):
            here.grid(True, alpha=0.3)
    axes[-1][1].set_xlabel("time (s)")
    return _returned(ax, [here for pair in axes for here in pair])


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
    axes = _axes(ax, len(rec.outputs), height=2.3)
    percent = {(row["model"], row["output"]): row["fit_percent"] for row in table}
    for here, name in zip(axes, rec.outputs, strict=True):
        here.plot(rec.t, rec._shown(name), color="0.6", linewidth=2.0, label=f"{name} measured")
    for model, fit in table.fits.items():
        simulated = fit.predict(rec)
        for here, name in zip(axes, rec.outputs, strict=True):
            words = f"{model}: {percent[model, name]:.1f} %"
            here.plot(rec.t, simulated[name], linewidth=1.0, label=words)
    _label(axes, rec.outputs, rec.units, "time (s)")
    for here in dict.fromkeys(axes):
        here.legend(frameon=False, fontsize=8)
    return _returned(ax, axes)


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
    axes = _axes(ax, len(outputs), height=2.4)
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
    return _returned(ax, axes)


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
    axes = _axes(ax, 2, height=2.6)
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
    return _returned(ax, axes)


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
    low, high = _range(systems) if band is None else band
    if not 0 < low < high:
        raise SpecError(f"plot.bode: band={band!r} must be (lower, upper) in rad/s with 0 < lower < upper")
    omega = np.geomspace(low, high, 400)
    upper, lower = _axes(ax, 2, height=2.4)
    factor, label = _frequency(hz)
    color = 0
    drawn: dict[str, Any] = {}  # the phase of each path as first drawn
    for k, system in enumerate(systems):
        named = None if labels is None else labels[k]
        for name, w, gain, db_error, degrees_error, inside in _paths(system, omega):
            with np.errstate(divide="ignore"):
                db = 20 * np.log10(np.abs(gain))
            degrees = _turned(np.degrees(np.unwrap(np.angle(gain))), w, drawn, name)
            text = " ".join(part for part in (named, name) if part) or type(system).__name__
            for here, values, error in ((upper, db, db_error), (lower, degrees, degrees_error)):
                line = f"C{color % 10}"
                if error is not None:
                    here.fill_between(
                        factor * w, values - error, values + error, color=line, alpha=0.2, linewidth=0
                    )
                    here.plot(factor * w, values, color=line, linewidth=0.9, linestyle=(0, (4, 3)))
                here.plot(
                    factor * w,
                    np.where(inside, values, np.nan),
                    color=line,
                    linewidth=1.5,
                    label=text if here is upper else None,
                )
            color += 1
    for here in (upper, lower):
        here.set_xscale("log")
        here.grid(True, which="both", alpha=0.25)
        here.set_xlim(factor * low, factor * high)
    upper.set_ylabel("magnitude (dB)")
    lower.set_ylabel("phase (degrees)")
    lower.set_xlabel(label)
    _clip_to_lines(upper)
    _clip_to_lines(lower)
    above = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 4, "fontsize": "small"}
    upper.legend(frameon=False, **(above if color > 4 else {}))  # many names would hide the lines
    return _returned(ax, [upper, lower])


def reduction(red: Reduction, ax: Any = None, *, hz: bool = False) -> Any:
    """Draw the gains of a system, of its reduced model and of their difference over frequency.

    Parameters
    ----------
    red : Reduction
    ax : Axes, optional
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    Axes
        With several channels the largest gain over directions is drawn.
    """
    axes = _axes(ax, 1, height=3.2)
    scale, label = _frequency(hz)
    omega, curves = red.gains()
    for (name, values), style in zip(curves.items(), ("-", "--", ":", ":"), strict=False):
        axes[0].plot(scale * omega, values, style, label=name, linewidth=1.2)
    axes[0].set_xscale("log")
    axes[0].set_yscale("log")
    axes[0].set(xlabel=label, ylabel="gain", xlim=(scale * omega[0], scale * omega[-1]))
    axes[0].legend()
    return _returned(ax, axes)


def residuals(fit: Fit, ax: Any = None, *, output: str | None = None) -> Any:
    """Draw the whitened residual lines over m, and their autocorrelation, with 95 % lines.

    Parameters
    ----------
    fit : Fit
    ax : sequence of Axes, optional
        Two an output, in turn; new ones by default.
    output : str, optional
        Name of the one output to draw; default: all.

    Returns
    -------
    ndarray of Axes, shape (2 · outputs,)
    """
    from .validation import correlation_of_lines

    chosen = _outputs(fit, output, "plot.residuals")
    axes = _pairs(ax, len(chosen), height=2.3, sharex=False)
    for (upper, lower), i in zip(axes, chosen, strict=True):
        pieces = [piece[i] for piece in fit.pieces]
        of = "" if len(fit.outputs) == 1 else f" of {fit.outputs[i]}"
        _lines_over_m(upper, fit.lines, pieces)
        upper.set_ylabel(f"whitened residual{of}")
        test, r = correlation_of_lines(pieces)
        _autocorrelation(lower, r, test.count)
        lower.set_xlabel(f"lag in harmonics (Ljung-Box p = {test.p_value:.2g})")
        lower.set_ylabel(f"autocorrelation{of}")
        for here in (upper, lower):
            here.grid(True, alpha=0.3)
    return _returned(ax, [here for pair in axes for here in pair])


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
    from .derived import denominators

    if not fits:
        raise SpecError("plot.poles: give at least one fit")
    if labels is not None and len(labels) != len(fits):
        raise SpecError(f"plot.poles: {len(labels)} labels for {len(fits)} fits; give one each")
    (here,) = _axes(ax, 1, height=4.0, width=5.0)
    drawn = 0
    for k, fit in enumerate(fits):
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
    return _returned(ax, [here])


def _poles_of_output(here: Any, fit: Fit, output: int, color: str, label: str) -> None:
    from scipy.special import fdtri

    turn = np.exp(2j * np.pi * np.arange(181) / 180)
    found, gradients = fit._poles(output)
    cov = fit.cov_params()
    here.plot(found.real, found.imag, "x", color=color, markersize=8, markeredgewidth=1.8, label=label)
    for pole, gradient in zip(found, gradients, strict=True):
        if pole.imag == 0:
            low, high = fit.interval(np.array(pole.real), np.sqrt(gradient.real @ cov @ gradient.real))
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


def study(res: Results, ax: Any = None) -> Any:
    """Draw bias and standard deviation against NSR, as the report's Fig. 2, one row a cell otherwise.

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
    over = next((name for name in ("nsr", *res.axes) if _is_scale(res.axes.get(name, ()))), None)
    if over is None:
        raise SpecError("plot.study: the study has one noise level and no axis of numbers; give nsr a list")
    if not np.any(np.isfinite(res.truth)):
        raise SpecError("plot.study: no parameter's truth is known, so that there is no bias to draw")
    figures = res.relative()
    other = [name for name in res.axes if name not in (over, "estimator", "parameter")]
    cells = list(dict.fromkeys(zip(*(figures[name].tolist() for name in other), strict=True))) or [()]
    axes = _grid(ax, len(cells), 2)
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
                drawn.plot(x, bound, color="0.3", linestyle=":", label="Cramér–Rao bound")
            drawn.set_ylabel(f"{text} (% of the true values)")
            drawn.set_title(", ".join(map(str, cell)), fontsize="medium")
            drawn.set_ylim(bottom=0.0)
            drawn.grid(True, alpha=0.3)
            if row == len(cells) - 1:
                drawn.set_xlabel("noise-to-signal ratio (%)" if over == "nsr" else over)
    for drawn in axes[:2]:
        drawn.legend(frameon=False, fontsize="small")
    return _returned(ax, axes)


def track(found: Track, ax: Any = None) -> Any:
    """Draw estimates over time, each with a band of two standard errors.

    Parameters
    ----------
    found : Track
        Of `Stream.follow`. Moments whose estimates cannot be used are left out.
    ax : Axes or sequence of Axes, optional
        One a parameter; new ones by default.

    Returns
    -------
    Axes or ndarray of Axes
        One Axes where there is one parameter, otherwise one a parameter.
    """
    axes = _axes(ax, len(found.param_names), height=1.5)
    good = found.success
    for here, values, errors in zip(axes, found.params.T, found.bse.T, strict=True):
        values, half = np.where(good, values, np.nan), 2 * np.where(good, errors, np.nan)
        here.fill_between(found.t, values - half, values + half, alpha=0.25, linewidth=0)
        here.plot(found.t, values, linewidth=1.2)
        here.grid(True, alpha=0.3)
    _label(axes, found.param_names, {}, "end of the window (s)")
    return _returned(ax, axes)


def _is_scale(labels: Sequence[Any]) -> bool:
    """Whether an axis has several labels, all numbers."""
    return len(labels) > 1 and not any(isinstance(label, str) for label in labels)


# What every plot uses -----------------------------------------------------------------------------


def _axes(ax: Any, count: int, *, height: float = 2.4, width: float = 7.0, sharex: bool = True) -> list[Any]:
    """Return `count` Axes: new ones below each other, the given ones, or the given one `count` times."""
    if ax is None:
        pyplot = optional("matplotlib.pyplot", "plot", "plotting")
        size = (width, max(height * count, 2.6) + 0.5)
        _, made = pyplot.subplots(count, 1, sharex=sharex, squeeze=False, figsize=size, layout="constrained")
        return list(made[:, 0])
    if hasattr(ax, "plot"):
        return [ax] * count
    given = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(given) != count:
        raise SpecError(f"plot: ax has {len(given)} Axes where {count} are needed, or a single one for all")
    return given


def _pairs(ax: Any, outputs: int, *, height: float, sharex: bool = True) -> list[tuple[Any, Any]]:
    """Return two Axes an output; a single Axes serves as both of a single output."""
    if outputs > 1 and hasattr(ax, "plot"):
        raise SpecError(
            f"plot: ax is a single Axes and there are {outputs} outputs; give {2 * outputs} Axes, or choose "
            "one output, as output="
        )
    axes = _axes(ax, 2 * outputs, height=height, sharex=sharex)
    return list(zip(axes[::2], axes[1::2], strict=True))


def _outputs(fit: Fit, output: str | None, what: str) -> list[int]:
    """Positions of the outputs to draw: the one that is named, or all."""
    if output is None:
        return list(range(len(fit.outputs)))
    if output not in fit.outputs:
        raise SpecError(f"{what}: the fit has no output {output!r}; {nearest(output, fit.outputs)}")
    return [fit.outputs.index(output)]


def _grid(ax: Any, rows: int, columns: int) -> list[Any]:
    """Return Axes row by row: new ones, or the given ones."""
    if ax is not None:
        if hasattr(ax, "plot"):
            raise SpecError(f"plot: ax is a single Axes; give {rows * columns}")
        return _axes(ax, rows * columns)
    pyplot = optional("matplotlib.pyplot", "plot", "plotting")
    _, made = pyplot.subplots(
        rows,
        columns,
        sharex=True,
        squeeze=False,
        figsize=(4.6 * columns, 3.1 * rows + 0.5),
        layout="constrained",
    )
    return list(made.ravel())


def _returned(ax: Any, axes: Sequence[Any]) -> Any:
    """Return what the caller sees: one Axes, or an array of them."""
    if len(axes) == 1 or hasattr(ax, "plot"):
        return axes[0]
    array = np.empty(len(axes), dtype=object)
    array[:] = axes
    return array


def _label(axes: Sequence[Any], names: Sequence[str], units: dict[str, str], xlabel: str) -> None:
    """Name the axes: a channel each, or a legend where they share one."""
    if len(set(axes)) < len(axes):
        axes[0].legend()
    else:
        for name, here in zip(names, axes, strict=True):
            unit = units.get(name, "")
            here.set_ylabel(f"{name} ({unit})" if unit and unit not in name else name)
    for here in axes:
        here.grid(True, alpha=0.3)
    axes[-1].set_xlabel(xlabel)


def _bridge(here: Any, rec: Record, name: str, label: str) -> None:
    """Dots from the good samples beside a gap across the masked ones, whose values the record filled in."""
    masked = ~rec._good(name)
    if masked.any():
        masked |= np.append(masked[1:], False) | np.insert(masked[:-1], 0, False)
        here.plot(rec.t, np.where(masked, rec[name], np.nan), ":", color="0.5", linewidth=1.0, label=label)


def _frequency(hz: bool) -> tuple[float, str]:
    """Return the factor from rad/s to the unit drawn, and the label of the axis."""
    return (0.5 / np.pi, "frequency (Hz)") if hz else (1.0, "frequency (rad/s)")


def _decibels(size: Any) -> Any:
    return 20 * np.log10(np.maximum(size, 1e-300))


def _range(systems: Sequence[Any]) -> tuple[float, float]:
    """Frequencies worth drawing, rad/s."""
    marks: list[float] = []
    for system in systems:
        if hasattr(system, "omega0"):
            low, high = system.band
            marks += [max(low, min(system.omega0, default=low)) / 2, 2 * high]
        elif hasattr(system, "omega"):
            marks += [float(w) for w in system.omega if w > 0]
        elif hasattr(system, "poles"):
            sizes = np.abs(system.poles())
            marks += [x for size in sizes[sizes > 0] for x in (size / 10, size * 10)]
    return (min(marks), max(marks)) if marks else (0.1, 10.0)


def _turned(degrees: Any, omega: Any, drawn: dict[str, Any], name: str) -> Any:
    """A phase on the branch, of all that differ by whole turns, that is nearest to the path's first one."""
    # A single path of one system may have no name.
    other = drawn.get(name) or (next(iter(drawn.values())) if len(drawn) == 1 else None)
    if other is None:
        drawn[name] = (omega, degrees)
        return degrees
    apart = np.interp(omega, *other) - degrees
    return degrees + 360 * np.round(np.median(apart[np.isfinite(apart)]) / 360) if apart.size else degrees


def _paths(system: Any, omega: Any) -> Any:
    """Yield name, frequencies, gain, errors in dB and degrees (or None), and which lie in the fitted band."""
    if hasattr(system, "omega0"):  # a fit
        outputs, inputs = len(system.outputs), len(system.inputs)
        response, gradient = system.frequency_response(omega)
        response = response.reshape(outputs, inputs, -1)
        gradient = gradient.reshape(-1, outputs, inputs, omega.size)
        cov = system.cov_params()
        inside = (omega >= system.band[0]) & (omega <= system.band[1])
        half = system.interval(np.zeros(omega.size), np.ones(omega.size))[1]
        for i, k in np.argwhere(np.any(response != 0, axis=2)):
            gain = response[i, k]
            with np.errstate(divide="ignore", invalid="ignore"):
                relative = gradient[:, i, k] / gain
            errors = [
                np.sqrt(np.einsum("pf,pq,qf->f", part, cov, part)) for part in (relative.real, relative.imag)
            ]
            decibel, degree = 20 / np.log(10) * half * errors[0], np.degrees(half * errors[1])
            yield f"{system.inputs[k]} → {system.outputs[i]}", omega, gain, decibel, degree, inside
        return
    found = system if hasattr(system, "omega") else system.frequency_response(omega)
    everywhere = np.ones(found.omega.size, dtype=bool)
    several = found.response.shape[:2] != (1, 1)
    radius = found.radius()
    for i, row in enumerate(found.response):
        for k, gain in enumerate(row):
            name = f"{found.inputs[k]} → {found.outputs[i]}" if several else ""
            decibel = degree = None
            if radius is not None:
                with np.errstate(divide="ignore", invalid="ignore"):
                    relative = radius[i, k] / np.abs(gain)
                # Beyond the gain itself nothing is known of the angle.
                decibel = 20 / np.log(10) * relative
                degree = np.degrees(np.arcsin(np.minimum(relative, 1.0)))
            yield name, found.omega, gain, decibel, degree, everywhere


def _clip_to_lines(axes: Any) -> None:
    """Scale an axis by its lines: an enormous confidence band must not flatten them."""
    values = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()])
    values = values[np.isfinite(values)]
    if values.size:
        low, high = float(values.min()), float(values.max())
        room = 0.15 * (high - low) or 1.0
        axes.set_ylim(low - room, high + room)
