"""Plots: each takes ``ax=`` and returns the Axes drawn on; none shows a window or changes settings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import SpecError
from .extras import optional

if TYPE_CHECKING:
    from .records import Record, Spectrum
    from .response import FrequencyResponse

__all__ = ["bode", "record", "spectrum"]


def record(rec: Record, ax: Any = None) -> Any:
    """Draw a record over time: outputs above, inputs below, held inputs as steps.

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
        here.plot(rec.t, rec[name], drawstyle=style, label=name, color=color, linewidth=1.0)
    _label(axes, names, rec.units, "time (s)")
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


def bode(*responses: FrequencyResponse, ax: Any = None, hz: bool = False) -> Any:
    """Draw magnitude in dB above phase in degrees (unwrapped) over frequency.

    Parameters
    ----------
    *responses : FrequencyResponse
        Each draws one line for every pair of output and input.
    ax : pair of Axes, optional
        For magnitude and phase; new ones by default.
    hz : bool, default False
        Frequencies in hertz instead of rad/s.

    Returns
    -------
    ndarray of Axes, shape (2,)
    """
    if hasattr(ax, "plot"):
        raise SpecError("bode: ax is a single Axes; give two, for magnitude and phase")
    magnitude, phase = axes = _axes(ax, 2, height=2.2)
    scale, label = _frequency(hz)
    for response in responses:
        pairs = response.response.reshape(-1, len(response.omega))
        with np.errstate(divide="ignore"):
            decibels = 20.0 * np.log10(np.abs(pairs))
        magnitude.plot(scale * response.omega, decibels.T, linewidth=1.0)
        phase.plot(scale * response.omega, np.degrees(np.unwrap(np.angle(pairs))).T, linewidth=1.0)
    magnitude.set_ylabel("magnitude (dB)")
    phase.set_ylabel("phase (deg)")
    for here in axes:
        here.set_xscale("log")
        here.grid(True, alpha=0.3)
    phase.set_xlabel(label)
    return _returned(ax, axes)


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
            here.set_ylabel(f"{name} ({units[name]})" if name in units else name)
    for here in axes:
        here.grid(True, alpha=0.3)
    axes[-1].set_xlabel(xlabel)


def _frequency(hz: bool) -> tuple[float, str]:
    """Return the factor from rad/s to the unit drawn, and the label of the axis."""
    return (0.5 / np.pi, "frequency (Hz)") if hz else (1.0, "frequency (rad/s)")
