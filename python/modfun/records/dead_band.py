"""Channels that stand still: stored with a dead band, frozen for a while, or dropping out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from .mask import runs

__all__ = ["CHANGES", "FROZEN", "dead_band", "dropouts", "frozen", "missing_small", "off_line", "rounded_top"]

REPEATED = 0.1  # of the samples, at least
CHANGES = 10  # at least
LEAST = 0.5  # of the median change, or this over their number: some of so many changes would be smaller,
MANY_CHANGES = 30  # were there no dead band: all of N are larger than x times the median with exp(-N x/2)
OWN = 0.5  # of the changes lead to a value of its own, at least: a sensor of uneven codes has few
FROZEN = 5  # equal samples, at least, of a channel that stands still and should not
SHORT = 10  # equal samples, at most, of a dropout that may be rest; longer ones are looked at more closely
SEVERAL = 2  # dropouts, at least
MANY = 0.1  # of the other samples repeat the one before: of more, rest and coarse steps are likelier
MOST = 0.3  # of all samples: of more, the sensor is slow
CHANCE = 1e-4  # repeats that rounding explains
FINE = 3.0  # steps of rounding: noise beyond which no sensor rests
SMALL = 0.01  # of the changes are smaller than what is taken for the step of rounding
LEAP = 5.0  # usual second differences: into a channel that stands still elsewhere than where it was
CAUGHT_UP = 3.0  # changes of the next sample: the leap to where a frozen channel would have been
JUMP = 10.0  # usual second differences: into a dropout of one value and out of it
TOP = 4.0  # times the samples one step beside an extreme: those at it; 2.4 of a parabola in coarse steps
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
    held = np.gcd.reduce(np.diff(np.flatnonzero(change))) > 1  # by a sensor of another rate
    coded = np.unique(values).size < OWN * moved.size
    return 0.0 if held or coded or not missing_small(moved) else float(moved.min())


def missing_small(moved: F64) -> bool:
    """Whether small changes are missing that are no multiples of one step."""
    least = float(moved.min())
    multiples = moved / least
    rounded = np.abs(multiples - np.rint(multiples)).max() < GRID
    return not rounded and bool(least >= min(LEAST, MANY_CHANGES / moved.size) * np.median(moved))


def frozen(values: F64, good: NDArray[np.bool_] | None = None) -> tuple[int, int] | None:
    """First of equal samples, and their number, where a channel stood still once and should have moved.

    None of rest, and where the channel drops out several times.
    """
    same = values[1:] == values[:-1]
    if not same.any():
        return None
    good = np.broadcast_to(np.True_, values.size) if good is None else good
    same &= good[1:] & good[:-1]
    starts, lengths = runs(same)
    stuck = _stuck(values, starts, lengths)
    if not stuck.any() or dropouts(values, good) is not None:
        return None
    at = int(np.argmax(np.where(stuck, lengths, 0)))
    return int(starts[at]), int(lengths[at]) + 1


def _stuck(values: F64, starts: NDArray[np.intp], lengths: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which runs of repeats, by their first samples, are those of a sensor that froze in motion.

    A sensor with noise well above the step of its rounding never rests. One without stops at once and leaps
    to where it would have been; so does any that froze at an extreme only and is not clipped there.
    """
    size = values.size - 1
    found = (lengths + 1 >= FROZEN) & (starts > 0) & (starts + lengths < size)
    others = (lengths.sum() - lengths[found].sum()) / size
    if not found.any() or lengths.sum() > MOST * size or others > MANY:
        return np.zeros(starts.size, dtype=bool)
    found &= (size * others**lengths < CHANCE) & ~_again(values[starts], lengths + 1 >= FROZEN)
    change = np.abs(np.diff(values))
    step = float(np.quantile(change[change > 0], SMALL))
    bend, rough = (float(np.median(np.abs(np.diff(values, order)))) for order in (2, 4))
    noisy = rough > max(bend, FINE * step * 70**0.5 / 1.4826)  # 70: variance of fourth differences of noise
    inner = ~np.isin(values[starts], (values.min(), values.max()))
    plain = noisy & (inner | bool(np.any(found & inner)))  # what froze elsewhere froze at an extreme, too
    changes = np.append(change, (0.0, 0.0))
    into, out, then = changes[starts - 1], changes[starts + lengths], changes[starts + lengths + 1]
    least = max(LEAP * _usual_bend(values), FINE * step)
    found &= plain | ((into > FINE * step) & (out > np.maximum(least, CAUGHT_UP * then)))
    return found


def _again(levels: F64, counting: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which runs stand at the level of another one, as those of rest and of clipped channels do."""
    seen, count = np.unique(levels[counting], return_counts=True)
    return np.isin(levels, seen[count > 1])


def _usual_bend(values: F64) -> float:
    """The usual second difference of a channel."""
    return 1.4826 * float(np.median(np.abs(np.diff(values, 2)))) + 1e-9 * float(np.ptp(values))


def off_line(values: F64, at: int) -> bool:
    """Whether a sample is far off the line through the two before it, or off the only one."""
    bends = np.diff(values, 2)
    return bool(abs(bends[at - 2] if at > 1 else values[1] - values[0]) > LEAP * _usual_bend(values))


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
    if not same.any() or same.mean() > MOST:
        return None
    starts, lengths = runs(same)
    stuck = _stuck(values, starts, lengths)
    if lengths[~stuck].sum() > MANY * same.size:
        return None
    inside = (starts > 0) & (starts + lengths < same.size)
    starts, lengths, stuck = starts[inside], lengths[inside] + 1, stuck[inside]
    short = (lengths <= SHORT) | stuck
    rests = not short.all()
    starts, lengths = starts[short], lengths[short]
    curved = _peaks(values, starts, lengths) & (values[starts] != 0) & ~stuck[short]
    starts, lengths = starts[~curved], lengths[~curved]
    if starts.size < SEVERAL:
        return None
    ends = starts + lengths - 1
    into, out = np.abs(values[starts] - values[starts - 1]), np.abs(values[ends + 1] - values[ends])
    change = np.abs(np.diff(values))[good[1:] & good[:-1]]
    moved = change[change > 0]
    # Of what was measured: values in the place of masked samples know no rounding.
    part = float(np.diff(np.unique(values[good])).min()) / float(np.median(moved))
    zeros = values[starts] == 0
    rare = (values.size * part ** (lengths - 1.0) < CHANCE) & (not rests) & (not missing_small(moved))
    rare &= zeros | ~_again(values[starts], ~zeros)
    if np.count_nonzero(zeros & (rare | (np.minimum(into, out) > JUMP * _usual_bend(values)))) >= SEVERAL:
        return starts[zeros], lengths[zeros], True
    return (starts[rare], lengths[rare], False) if rare.sum() >= SEVERAL else None


def rounded_top(values: F64, extreme: float) -> bool:
    """Whether an extreme is that of a curve in coarse steps, which is one step beside it nearly as long."""
    change = np.abs(np.diff(values))
    step = float(change[change > 0].min())
    away = np.abs(values - extreme) / step
    beside = total = 0
    for start, length in zip(*runs(away < 1.5), strict=True):
        top = int(np.count_nonzero(away[start : start + length] < 0.5))
        total += top
        beside += int(length) - top if top else 0
    return total < TOP * beside
