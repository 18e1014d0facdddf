"""The spectrum of a record and what its tones leave of it, drawn in dB."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.axes import decibels, frequency_axis, take_axes

__all__ = ["tones"]


def tones(
    y: NDArray[Any],
    left: NDArray[Any],
    weights: F64,
    dt: float,
    omega: F64,
    bse: F64,
    amplitude: F64,
    ax: Any = None,
    hz: bool = False,
) -> Any:
    """Draw the spectra of samples and of what is left of them, tones as dots with bands of 95 %."""
    here = take_axes(ax, 1, "Spectrum and sinusoids", height=3.0)[0]
    scale, label = frequency_axis(hz)
    size, own = 8 * y.size, np.iscomplexobj(y)
    lines = 2 * np.pi / dt * np.fft.fftfreq(size)
    shown = np.argsort(lines) if own else slice(0, size // 2)
    gain = (1.0 if own else 2.0) / np.sum(weights > 0)
    for values, name, style in (
        (y, "record", {"color": "C0", "linewidth": 1.2}),
        (left, "without the tones", {"color": "0.6", "linewidth": 0.8}),
    ):
        found = gain * np.abs(np.fft.fft(np.where(weights > 0, values, 0.0), size)[shown])
        here.plot(scale * lines[shown], decibels(found), label=name, **style)
    here.plot(scale * omega, decibels(amplitude), "C3o", markersize=5, label="tones")
    for middle, reach in zip(omega, 1.96 * bse, strict=True):
        here.axvspan(scale * (middle - reach), scale * (middle + reach), color="C3", alpha=0.2, linewidth=0)
    here.set(xlabel=label, ylabel="amplitude (dB)")
    here.grid(True, alpha=0.3)
    here.legend(frameon=False)
    return here
