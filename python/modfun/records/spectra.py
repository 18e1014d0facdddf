"""Amplitude spectra of records, and the noise that their upper harmonics show."""

from __future__ import annotations

import numpy as np

from .._core import noise_level
from ..base.arguments import whole
from ..base.arrays import F64
from ..base.cached import kept
from ..base.samples import frozen
from ..base.tables import Table
from ..signals.spectrum import Spectrum
from .samples import Samples

__all__ = ["beside_neighbours", "clipped_level", "high_band_level", "noise_table", "spectrum_of", "too_short"]

NEIGHBOURS = (2, 3)  # on each side of a sample; what is smaller holds less of a fast signal
MEDIAN = 0.4549364231195727  # of chi-square with one degree of freedom
LARGE, CLIPPED = 9.0, 0.99501  # beyond which one counts no more, and its mean then
LINES = 4  # that a level is the mean over, at least
ENOUGH = 20_000  # samples that are looked at


@kept
def high_band_level(record: Samples, first: int, order: int) -> F64:
    """Noise level of each output in the high band of its samples, from one of them on."""
    return noise_level(np.ascontiguousarray(record.y[:, first:]), order)


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


def beside_neighbours(t: F64, rows: F64) -> F64:
    """Noise levels of rows from what each sample is beside its neighbours."""
    return np.asarray(np.min([_beside_neighbours(t, rows, count) for count in NEIGHBOURS], axis=0))


def _beside_neighbours(t: F64, rows: F64, count: int) -> F64:
    """Noise levels from what each sample is beside the polynomial through as many neighbours on each side.

    Squares are clipped beside their median, so that gaps and spikes count little.
    """
    some = slice(None, None, 1 + t.size // ENOUGH)
    windows = np.lib.stride_tricks.sliding_window_view(t, 2 * count + 1)[some]
    middle = windows[:, count]
    nodes = np.delete(windows, count, axis=1)
    apart = nodes[:, :, None] - nodes[:, None, :]
    there = middle[:, None] - nodes
    own = np.eye(2 * count, dtype=bool)
    # Of Lagrange's polynomials: each node's product over the others.
    weights = np.prod(np.where(own, 1.0, there[:, None, :] / np.where(own, 1.0, apart)), axis=2)
    seen = np.lib.stride_tricks.sliding_window_view(rows, 2 * count + 1, axis=1)[:, some]
    around = np.delete(seen, count, axis=2)
    left = seen[:, :, count] - np.einsum("ij,kij->ki", weights, around)
    return clipped_level(left / np.sqrt(1 + np.sum(weights**2, axis=1)))


def clipped_level(rows: F64) -> F64:
    """Root of the mean square of each row, with squares clipped beside their median."""
    squares = rows**2
    most = LARGE * np.median(squares, axis=1, keepdims=True) / MEDIAN
    return np.asarray(np.sqrt(np.mean(np.minimum(squares, most), axis=1) / CLIPPED))


def too_short(samples: int, order: int) -> bool:
    """Whether so many even samples leave too few lines for a level (rust/core/noise_level.rs)."""
    return samples < 4 * (order + 2 + LINES) - 5


def noise_table(record: Samples, order: int) -> Table:
    """Return what `Record.noise_level` promises."""
    both = np.ascontiguousarray(np.concatenate((record.y, record.u)))
    order = whole("noise_level", "order", order, 1, 100)
    few = too_short(record.t.size, order) and record.t.size > 2 * max(NEIGHBOURS)
    if record.dt is None or few:
        level = beside_neighbours(record.t, both)
    else:
        level = np.asarray(noise_level(both, order))
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
