"""Amplitude spectra of records, and the noise that their upper harmonics show."""

from __future__ import annotations

import numpy as np

from .._core import noise_level
from ..base.arguments import whole
from ..base.samples import frozen
from ..base.tables import Table
from ..errors import DataError
from ..signals.spectrum import Spectrum
from .samples import Samples

__all__ = ["noise_table", "spectrum_of"]


def spectrum_of(record: Samples) -> Spectrum:
    """Return what `Record.spectrum` promises."""
    both = np.concatenate((record.y, record.u))
    phase = (record.t - record.t[0]) / record.duration
    hann = 0.5 - 0.5 * np.cos(2.0 * np.pi * phase)
    if record.dt is not None:
        weights = np.full(len(record.t), 1.0 / record.intervals)
    else:
        steps = np.diff(phase)
        weights = 0.5 * (np.append(steps, 0.0) + np.insert(steps, 0, 0.0))
    shape = hann * weights / np.sum(hann * weights)
    seen = 2.0 * shape * (both - (both @ shape)[:, None])
    if record.dt is not None:  # the window is zero at the last sample, which makes N samples of it
        lines = np.abs(np.fft.rfft(seen[:, :-1], axis=1))[:, 1:]
    else:
        count = min(record.intervals // 2, 512)
        lines = np.array([np.abs(seen @ np.exp(-2j * np.pi * m * phase)) for m in range(1, count + 1)]).T
    omega = 2.0 * np.pi / record.duration * np.arange(1, lines.shape[1] + 1)
    names = (*record.outputs, *record.inputs)
    units = {name: unit for name, unit in record._units.items() if name in names}
    return Spectrum(frozen(omega), frozen(lines), names, units)


def noise_table(record: Samples, order: int) -> Table:
    """Return what `Record.noise_level` promises."""
    if record.dt is None:
        raise DataError(
            "noise_level needs evenly spaced samples; resample the record, or give dt= if it is even"
        )
    both = np.ascontiguousarray(np.concatenate((record.y, record.u)))
    level = np.asarray(noise_level(both, whole("noise_level", "order", order, 1, 100)))
    rms = both.std(axis=1)
    names = (*record.outputs, *record.inputs)
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = 100.0 * level / rms
    columns = {
        "channel": names,
        "unit": [record._units.get(name, "") for name in names],
        "noise_sd": level,
        "rms": rms,
        "percent": percent,
    }
    return Table(columns)
