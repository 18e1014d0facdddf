"""Single samples that stick out of their neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64

__all__ = ["SHARE", "bends", "lone"]

SHARE = 0.05  # of the samples, at most: more are those of a channel that jumps
BESIDE = 16  # samples on either side of one that show what is usual there
BACK = 0.2  # of the bend at a spike, at least, are the opposite ones on either side; a half without noise


def bends(values: F64) -> F64:
    """How far each sample but the first and last is from the middle of its neighbours."""
    return np.asarray(values[1:-1] - 0.5 * (values[:-2] + values[2:]))


def lone(values: F64, times: float, least: float) -> NDArray[np.intp]:
    """Samples that bend a channel by more than `least` and so many times what is usual around them.

    A step has two equal bends, a kink has one, a spike has one between two opposite ones.
    """
    bend = bends(values)
    if bend.size < 3:
        return np.zeros(0, np.intp)
    size = np.abs(bend)
    usual = 1.4826 * float(np.median(size)) + 1e-9 * float(np.ptp(values))
    before, after = np.insert(bend[:-1], 0, -bend[0]), np.append(bend[1:], -bend[-1])
    sign = np.sign(bend)
    found = (size > max(times * usual, least)) & (size > 1.5 * np.maximum(np.abs(before), np.abs(after)))
    found &= (sign * before < -BACK * size) & (sign * after < -BACK * size)
    places = np.flatnonzero(found)
    near = [1.4826 * float(np.median(size[max(k - BESIDE, 0) : k + BESIDE + 1])) for k in places]
    return np.asarray(places[size[places] > times * np.array(near)] + 1)  # what is usual may change in time
