"""Channels that stand still: stored with a dead band, frozen for a while, or dropping out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from .mask import runs

__all__ = ["FROZEN", "dead_band", "dropouts", "frozen", "off_line"]

REPEATED = 0.1  # of the samples, at least
CHANGES = 10  # at least
LEAST = 0.5  # of the median change, or this over their number: some of so many changes would be smaller,
MANY_CHANGES = 30  # were there no dead band: all of N are larger than x times the median with exp(-N x/2)
OWN = 0.5  # of the changes lead to a value of its own, at least: a sensor of uneven codes has few
FROZEN = 5  # equal samples, at least, of a channel that
RARELY = 0.005  # of the other samples repeat the one before
SHORT = 10  # equal samples, at most, of a dropout
SEVERAL = 2  # dropouts, at least
MANY = 0.1  # of the samples repeat the one before: of more, rest and coarse steps are likelier
CHANCE = 1e-4  # repeats that rounding explains
LEAP = 5.0  # usual second differences: into a channel that stands still elsewhere than where it was
JUMP = 10.0  # usual second differences: into a dropout of one value and out of it
GRID = 0.02  # of the least change: how near changes are to its multiples where values are rounded


def dead_band(values: F64) -> float:
    """The least change of a channel that stands still in between; 0.0 where it is none.

    Rounded values change by multiples of one step, slow sensors by any amount.
    """
    repeated = np.count_nonzero(values[1:] == values[:-1])
    if repeated < REPEATED * (values.size - 1) or values.size - 1 - repeated < CHANGES:
        return 0.0
    change = np.abs(np.diff(values))
    moved = change[change > 0]
    least = float(moved.min())
    multiples = moved / least
    rounded = np.abs(multiples - np.rint(multiples)).max() < GRID
    held = np.gcd.reduce(np.diff(np.flatnonzero(change))) > 1  # by a sensor of another rate
    coded = np.unique(values).size < OWN * moved.size
    usual = min(LEAST, MANY_CHANGES / moved.size) * np.median(moved)
    return 0.0 if rounded or held or coded or least < usual else least


def frozen(values: F64) -> tuple[int, int] | None:
    """First of equal samples, and their number, where others hardly ever are equal; None without.

    Rest at the beginning or the end of a record is no such thing.
    """
    same = values[1:] == values[:-1]
    if not same.any():
        return None
    starts, lengths = runs(same)
    rest = (starts > 0) & (starts + lengths < same.size)
    if not rest.any():
        return None
    at = int(np.argmax(np.where(rest, lengths, 0)))
    others = int(lengths.sum() - lengths[at]) / same.size
    return (int(starts[at]), int(lengths[at]) + 1) if lengths[at] + 1 >= FROZEN and others < RARELY else None


def off_line(values: F64, at: int) -> bool:
    """Whether a sample is far off the line through the two before it, or off the only one."""
    bends = np.diff(values, 2)
    usual = 1.4826 * float(np.median(np.abs(bends))) + 1e-9 * float(np.ptp(values))
    return bool(abs(bends[at - 2] if at > 1 else values[1] - values[0]) > LEAP * usual)


def _peaks(values: F64, starts: NDArray[np.intp], lengths: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which runs of equal samples are the top or bottom of a curve: both sides leave it alike.

    The samples beside a peak between two equal ones are equal, too, to a step or two of the resolution.
    """
    before, after = values[starts - 1], values[starts + lengths]
    turns = (before - values[starts]) * (after - values[starts]) > 0
    fine = 2 * float(np.diff(np.unique(values)).min()) + 1e-9 * float(np.ptp(values))
    found: NDArray[np.bool_] = turns & (np.abs(after - before) <= fine)
    return found


def dropouts(values: F64, good: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], bool] | None:
    """First sample and number of each run of equal ones that is no chance, and whether all are zeros.

    Zeros beside jumps, or the last value again in a channel that is too fine to repeat one; None without.
    """
    same = values[1:] == values[:-1]
    if not same.any():
        return None
    same &= good[1:] & good[:-1]
    if not same.any() or same.mean() > MANY:
        return None
    starts, lengths = runs(same)
    inside = (starts > 0) & (starts + lengths < same.size)
    starts, lengths = starts[inside], lengths[inside] + 1
    rests, short = bool((lengths > SHORT).any()), lengths <= SHORT
    starts, lengths = starts[short], lengths[short]
    curved = _peaks(values, starts, lengths) & (values[starts] != 0)
    starts, lengths = starts[~curved], lengths[~curved]
    if starts.size < SEVERAL:
        return None
    usual = 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) + 1e-9 * float(np.ptp(values))
    ends = starts + lengths - 1
    into, out = np.abs(values[starts] - values[starts - 1]), np.abs(values[ends + 1] - values[ends])
    change = np.abs(np.diff(values))
    part = float(np.diff(np.unique(values)).min()) / float(np.median(change[change > 0]))
    rare = (values.size * part ** (lengths - 1.0) < CHANCE) & (not rests)
    zeros = values[starts] == 0
    if np.count_nonzero(zeros & (rare | (np.minimum(into, out) > JUMP * usual))) >= SEVERAL:
        return starts[zeros], lengths[zeros], True
    return (starts[rare], lengths[rare], False) if rare.sum() >= SEVERAL else None
