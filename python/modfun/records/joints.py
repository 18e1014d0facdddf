"""Records that were put together from several: the instant at which the outputs jump and no input does."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ..base.arrays import F64
from .samples import Samples

__all__ = ["joints"]

SIDE = 5  # samples on each side of an instant, through which lines go
FAR = 50  # samples on each side with which the instant is compared
SURE = 7.0  # times the usual difference of both lines, and
ALONE = 3.0  # times the largest one near it, of a jump
LARGE = 0.1  # of the output's standard deviation
ONCE = 2.0  # times the largest change from one sample to the next near it: flanks of signals take several
INPUTS = 0.4  # of an output's jump, both as parts of their ranges, that an input may jump
REPEATED = 0.2  # of the samples, beyond which jumps are those of rounding or of a dead band
ALIKE, SEVERAL = 0.3, 2  # part by which flanks of a signal differ in size; slower flanks of that, at least
MOST = 5  # jumps of a record beyond which they belong to its signals


def joints(record: Samples) -> list[tuple[str, float, float]]:
    """The output, the time before it and the size of each jump that neither input nor noise explains.

    Lines through the samples before and after an instant differ, halfway between both, by noise and
    curvature, as they do elsewhere; or by a jump, and then by less at the instants beside it. A spike makes
    large differences of either sign, a flank several large changes.
    """
    if record.dt is None or record.intervals < 2 * FAR:
        return []
    moves = [_differences(record[name]) / (np.ptp(record[name]) or 1.0) for name in record.inputs]
    found = []
    for name in record.outputs:
        values = record[name]
        if np.mean(np.diff(values) == 0) > REPEATED:
            continue
        good = record._good(name)
        for at, size in _jumps(values, moves):
            if good[at - SIDE + 1 : at + SIDE].all():
                found.append((name, float(record.t[at - 1]), size))
    return found if len(found) <= MOST * len(record.outputs) else []


def _differences(values: F64) -> F64:
    """Line after less line before each instant, at the half sample between; zero near the ends."""
    along = np.arange(SIDE) - (SIDE - 1) / 2
    to_end = 1 / SIDE + along * (SIDE / 2) / (along @ along)  # weights that carry the line half a sample on
    windows = sliding_window_view(values, SIDE)
    after, before = windows[SIDE:] @ to_end[::-1], windows[:-SIDE] @ to_end
    return np.concatenate([np.zeros(SIDE), after - before, np.zeros(SIDE - 1)])


def _jumps(values: F64, moves: list[F64]) -> list[tuple[int, float]]:
    """First sample after each jump that no input makes, and the jump."""
    apart = _differences(values)
    size = np.abs(apart)
    usual = 1.4826 * float(np.median(size[SIDE : 1 - SIDE]))
    part = INPUTS / float(np.ptp(values) or 1.0)
    flanks = [
        at
        for at in np.flatnonzero(size > max(SURE * usual, LARGE * float(values.std()))).tolist()
        if size[at] == size[at - SIDE + 1 : at + SIDE].max()
        and all([abs(own[at]) < part * size[at] for own in moves])
    ]
    slow = size[[at for at in flanks if not _at_once(values, at)]]
    found = []
    for at in flanks:
        same = apart[at - SIDE + 1 : at + SIDE] * np.sign(apart[at])
        few = np.count_nonzero(np.abs(slow - size[at]) < ALIKE * size[at]) < SEVERAL
        if few and same.min() > -0.5 * size[at] and _sticks_out(size, at) and _at_once(values, at):
            found.append((at, float(apart[at])))
    return found


def _sticks_out(size: F64, at: int) -> bool:
    """Whether a difference is far larger than those near it, its own slopes left out."""
    beside = np.concatenate([size[max(at - FAR, 0) : max(at - SIDE, 0)], size[at + SIDE + 1 : at + FAR]])
    return bool(size[at] > ALONE * beside.max(initial=0.0))


def _at_once(values: F64, at: int) -> bool:
    """Whether an output moves far from one sample to the next, and no other time near it."""
    change = np.abs(np.diff(values[at - SIDE : at + SIDE]))
    return bool(change[SIDE - 1] > ONCE * np.delete(change, SIDE - 1).max())
