"""Plots of samples and lines: records, inputs, spectra, tones, estimates over time."""

from __future__ import annotations

from typing import Any

from ..base.axes import drawing
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
    return found.plot(ax=ax, hz=hz)


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
    return found.plot(ax)
