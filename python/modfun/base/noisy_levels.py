"""Commands that were held and then measured: levels that jump from one sample to the next, under noise."""

from __future__ import annotations

from itertools import pairwise
from math import comb, sqrt

import numpy as np
from numpy.typing import NDArray

from .arrays import F64

__all__ = ["held_in_noise", "levels_in_noise", "white_level"]

NORMAL = 0.6745  # median of the size of a standard normal number
FEWEST, ENOUGH = 64, 2**14  # samples; of longer signals the middle is looked at
PIECES, EACH = 64, 2**12  # of longer signals that tell the level of white noise, and samples of each
JUMP, CHANGES = 5.0, 5  # standard deviations of noise's changes in a jump, and of these at least
SHORT, RARE = 2, 0.1  # samples of a level that may be one of a passing signal, and how many may be
BINS, MOST, SHARE = 32, 5, 0.05  # of a histogram; levels at most, and samples on each at least
NORMAL_MOST = 4.5  # standard deviations, of noise beside few levels
CHANCE = 3.0  # standard errors of what noise on levels does not do
ORDERS = (1, 4)  # of differences: beside jumps the first holds least of these, the fourth of a motion


def held_in_noise(values: F64) -> bool:
    """Tell whether samples are those of a held command with white noise on them.

    Levels are what stands between changes far above the noise, or a few ones apart in a histogram. What is
    left must not follow itself, and the samples beside a jump must be on its levels: those of an actuator
    lag behind.
    """
    first = max(0, (values.size - ENOUGH) // 2)
    return levels_in_noise(values[first : first + ENOUGH]) is not None


def levels_in_noise(values: F64) -> F64 | None:
    """Return the level that was held at each sample; None where that is not what samples look like."""
    if values.size < FEWEST or not np.ptp(values):
        return None
    for find in (_between_jumps, _apart):
        levels = find(values)
        if levels is not None and _noise_alone(values - levels, levels):
            return levels
    return None


def white_level(values: F64) -> float:
    """Return the level of white noise, from medians of differences: jumps of a held signal count little."""
    if values.size > PIECES * EACH:
        starts = np.linspace(0, values.size - EACH, PIECES).astype(int)
        values = np.concatenate([values[first : first + EACH] for first in starts.tolist()])
    found = list[float]()
    for order in ORDERS:
        sizes = np.abs(np.diff(values, order))
        found.append(float(np.median(sizes)) / NORMAL / sqrt(comb(2 * order, order)))
    return min(found)


def _between_jumps(values: F64) -> F64 | None:
    """Return the mean between jumps beside each sample; None where there are few, or they are close."""
    size = np.abs(np.diff(values))
    usual = float(np.median(size)) / NORMAL
    jumps = size > JUMP * usual
    count = int(np.count_nonzero(jumps))
    if not (usual > 0 and CHANGES <= count <= values.size // (2 * SHORT)):
        return None
    ends = [0, *(np.flatnonzero(jumps) + 1).tolist(), values.size]
    if np.count_nonzero(np.diff(ends) <= SHORT) > RARE * (count + 1):
        return None
    return np.concatenate([_steps(values[a:b], usual / sqrt(2)) for a, b in pairwise(ends)])


def _steps(values: F64, level: float) -> F64:
    """Return the mean beside each sample, of parts wherever these differ by far more than noise does."""
    size = values.size
    if size > 2 * SHORT:
        k = np.arange(1, size)
        far = np.abs(np.cumsum(values - values.mean())[:-1]) / np.sqrt(k * (size - k) / size)
        at = int(np.argmax(far))
        if far[at] > JUMP * level:
            return np.concatenate([_steps(values[: at + 1], level), _steps(values[at + 1 :], level)])
    return np.full(size, values.mean())


def _apart(values: F64) -> F64 | None:
    """Return the mean of the part of the histogram around each sample; None where that has no few parts."""
    low = float(values.min())
    place = ((values - low) * (BINS / (float(values.max()) - low))).astype(np.intp).clip(0, BINS - 1)
    full = np.bincount(place, minlength=BINS) > 0
    if full.all():
        return None
    part = np.cumsum(np.diff(full.astype(np.intp), prepend=0) > 0)[place] - 1
    counts = np.bincount(part)
    if not (1 < len(counts) <= MOST and counts.min() >= SHARE * values.size):
        return None
    levels: F64 = (np.bincount(part, values) / counts)[part]
    left = values - levels
    return levels if np.abs(left).max() < NORMAL_MOST * left.std() else None


def _noise_alone(left: F64, levels: F64) -> bool:
    """Tell whether what levels leave is white, also beside the jumps between them."""
    change, level = np.diff(levels), float(left.std())
    jump = np.flatnonzero(np.abs(change) > JUMP * level)  # of smaller ones noise hides the place
    if jump.size < CHANGES or not level > 0:
        return False
    unit = left / level
    if float(unit[1:] @ unit[:-1]) > CHANCE * np.sqrt(unit.size):
        return False
    way = np.sign(change[jump])
    beside: NDArray[np.float64] = np.array([way @ unit[jump], way @ unit[jump + 1]])
    return bool(np.all(np.abs(beside) < CHANCE * np.sqrt(jump.size)))
