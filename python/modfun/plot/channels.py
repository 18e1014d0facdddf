"""Plots of samples and lines: records, inputs, spectra, tones, estimates over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.axes import decibels, drawing, frequency_axis, label_axes, returned, take_axes
from ..records.record import Record
from ..signals.signals import Signals
from ..signals.spectrum import Spectrum
from ..streams.track import Track
from ..tones.results import Sinusoids


@drawing
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
    return rec.plot(ax)


@drawing
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
    return given.plot(ax)


@drawing
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
    return spec.plot(ax, hz=hz)


@drawing
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
    here = take_axes(ax, 1, height=3.0)[0]
    scale, label = frequency_axis(hz)
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
        here.plot(scale * omega[shown], decibels(lines), label=name, **style)
    here.plot(scale * found.omega, decibels(found.amplitude), "C3o", markersize=5, label="tones")
    for omega_i, reach in zip(found.omega, 1.96 * found.bse[: len(found)], strict=True):
        here.axvspan(scale * (omega_i - reach), scale * (omega_i + reach), color="C3", alpha=0.2, linewidth=0)
    here.set(xlabel=label, ylabel="amplitude (dB)")
    here.grid(True, alpha=0.3)
    here.legend(frameon=False)
    return here


@drawing
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
    axes = take_axes(ax, len(found.param_names), height=1.5)
    good = found.success
    for here, values, errors in zip(axes, found.params.T, found.bse.T, strict=True):
        values, half = np.where(good, values, np.nan), 2 * np.where(good, errors, np.nan)
        here.fill_between(found.t, values - half, values + half, alpha=0.25, linewidth=0)
        here.plot(found.t, values, linewidth=1.2)
        here.grid(True, alpha=0.3)
    label_axes(axes, found.param_names, {}, "end of the window (s)")
    return returned(ax, axes)
