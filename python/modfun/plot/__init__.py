"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings.

They are drawn where what they show is made; here they stand under one name.
"""

from __future__ import annotations

from typing import Any

from ..base.axes import drawing
from ..inference.comparison import comparison, cross_validation
from ..inference.order import order
from ..records.record import Record
from ..reduction.reduction import Reduction
from ..results.drawing import bode, correlation, harmonics, poles, residual_tests, residuals, response
from ..signals.signals import Signals
from ..signals.spectrum import Spectrum
from ..streams.track import Track
from ..study.drawing import study
from ..tones.results import Sinusoids

__all__ = [
    "bode",
    "comparison",
    "correlation",
    "cross_validation",
    "harmonics",
    "order",
    "poles",
    "record",
    "reduction",
    "residual_tests",
    "residuals",
    "response",
    "signals",
    "sinusoids",
    "spectrum",
    "study",
    "track",
]


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


@drawing
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
    return red.plot(ax=ax, hz=hz)
