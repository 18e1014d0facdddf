"""Channels slower than their record: new values every few samples only, held or drawn as lines between."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from math import gcd

import numpy as np

from ..base.arrays import F64
from ..base.between import SAME, UNITS
from .mask import Mask, leaving_out
from .samples import Samples

__all__ = ["drawn", "held", "ordinal", "own_clock", "slow_samples"]

LEVELS, STAYS = 3, 3  # values of a command, at most; samples that it stays at one, at least
FIRST, CHUNK = 32, 4096  # samples that are looked at together: of most records, the first few tell
SLOWEST = 50  # samples, at most, from one measured value to the next
PART = 0.5  # of the samples on a grid that show a change or an angle, at least; of those off it that count
LEAST, CHANCE = 10, 1e-6  # changes, at least, and how likely others would all be on one grid
CLOCKED = 20  # new values, at least: as many on one line are no chance
CLOSE = 0.01  # between the steps of an output and of an input that it follows
SELDOM = 1.25  # samples, from one new value to the next: those that clip, or tops of curves, repeat less
REGULAR, JITTER = 0.9, 1.0  # of the time, in usual steps; samples that a new value is off its time
BRIDGED = 6  # samples from one that counts to the next, at most, of which a mask makes good estimates
ROWS, LAGS, EXACT = 1000, 64, 1e-6  # samples, last inputs, part of the rms: an output that inputs explain


def held(values: F64, good: Mask | None = None) -> tuple[int, int]:
    """How many samples lie from one measured value to the next, and the first; (1, 0) if all are measured."""
    return _grid(values, good, 1)


def drawn(values: F64, good: Mask | None = None) -> tuple[int, int]:
    """The same of values between which lines were drawn."""
    return _grid(values, good, 2)


def own_clock(values: F64, good: Mask | None = None) -> float:
    """How many samples lie from one new value to the next of a slower clock on no grid of them; 0 if none.

    Its values go on for `k` or `k + 1` samples, and their times stay beside a straight line. Rounded values
    that happen to be equal go on for longer now and then.
    """
    least = SAME * float(np.ptp(values))
    if np.all(np.abs(np.diff(values[:FIRST])) > least):
        return 0.0
    moved = np.abs(np.diff(values)) > least
    at = 1 + np.flatnonzero(moved if good is None else moved & _whole(good, 1))
    if at.size < CLOCKED:
        return 0.0
    lengths = np.diff(at)
    k = int(lengths.min())
    usual = lengths[lengths <= k + 1]
    sizes = np.abs(np.diff(values)[at - 1])
    rounded = sizes.mean() <= UNITS * sizes.min()
    between = max(k, SELDOM) < usual.mean() < k + 1
    if not between or usual.sum() < REGULAR * lengths.sum() or k > SLOWEST or rounded:
        return 0.0
    # Of each longer one, as many ticks as fit in it.
    ticks = np.concatenate([[0.0], np.cumsum(np.rint(lengths / usual.mean()))])
    apart, begin = np.polyfit(ticks, at, 1)
    return float(apart) if np.max(np.abs(at - begin - apart * ticks)) <= JITTER else 0.0


def _grid(values: F64, good: Mask | None, order: int) -> tuple[int, int]:
    """Step and first sample of the grid that holds all differences of an order that are not zero.

    Samples that do not count show nothing. Where neighbours differ, which is nearly always, the first few
    samples end the search.
    """
    least = SAME * float(values.max() - values.min())
    step = count = 0
    first = -1
    for begin, end in pairwise((0, *range(FIRST, values.size - order, CHUNK), values.size - order)):
        window = slice(begin, end + order)
        moved = np.abs(np.diff(values[window], order)) > least
        if good is not None:
            moved &= _whole(good[window], order)
        at = begin + 1 + np.flatnonzero(moved)
        if not at.size:
            continue
        first = int(at[0]) if first < 0 else first
        step = gcd(step, int(np.gcd.reduce(at - first)))
        if step == 1:
            return 1, 0
        count += at.size
    if not 1 < step <= SLOWEST or count < LEAST or step ** (1.0 - count) > CHANCE:
        return 1, 0
    first %= step
    size = values.size - order
    whole = np.broadcast_to(np.True_, size) if good is None else _whole(good, order)
    on_grid = whole[(first - 1) % step :: step]
    seen = int(np.count_nonzero(on_grid))
    if np.count_nonzero(whole) - seen < PART * (size - on_grid.size):
        return 1, 0  # what the mask leaves might move between as well
    return (step, first) if count >= PART * seen else (1, 0)


def _whole(good: Mask, order: int) -> Mask:
    """Where all samples of a difference count."""
    found = good[order:].copy()
    for k in range(order):
        found &= good[k : good.size - order + k]
    return found


def slow_samples(record: Samples, name: str) -> Iterator[str]:
    """Say that an output is slower than its record, unless only its own samples count, or may be an input."""
    if _commands(record, name):
        yield (
            f"Output {name!r} jumps between {np.unique(record[name]).size} values, as a command does, and no "
            "input does: inputs and outputs may have been swapped. First look at which is which."
        )
        return
    good = None if record.mask is None else record._good(name)
    step, first = held(record[name], good)
    seen = "has a new value only every {} sample and repeats it, as a slower sensor does"
    if step == 1:
        step, first = drawn(record[name], good)
        seen = "consists of straight lines between every {} sample, as of a slower record"
    apart = own_clock(record[name], good) if step == 1 else 0.0
    if apart and not any(abs(own_clock(record[u]) - apart) < CLOSE * apart for u in record.inputs):
        k = int(apart)
        yield (
            f"Output {name!r} has a new value only every {k} to {k + 1} samples ({apart:.4g} on average) and "
            "repeats it, as a sensor with its own clock does: the samples between are no measurements. "
            f"First {leaving_out(record, name, f'np.r_[True, np.diff(rec[{name!r}]) != 0]')}."
        )
        return
    if step == 1 or _explained(record, name, step, first):
        return
    yield (
        f"Output {name!r} {seen.format(ordinal(step))}: the samples between are no measurements. "
        f"First {_cure(record, name, step, first)}."
    )


def _commands(record: Samples, name: str) -> bool:
    """Whether an output stands at one of few values, and changes seldom, where inputs do neither."""
    if record.mask is not None or not record.inputs or not _few(record[name]):
        return False
    return not any(_few(record[u]) for u in record.inputs)


def _few(values: F64) -> bool:
    """Whether samples jump between few values and stay there."""
    if len({*values[:FIRST].tolist()}) > LEVELS or np.unique(values).size > LEVELS:
        return False
    ends = np.flatnonzero(np.diff(values))
    return ends.size > 0 and bool(np.all(np.diff(ends, prepend=-1) >= STAYS))


def _explained(record: Samples, name: str, step: int, first: int) -> bool:
    """Whether an output that moves on a grid does so by itself: rounded, or since inputs move so."""
    good = record._good(name)
    change = np.abs(np.diff(record[name][first::step][good[first::step]]))
    change = change[change > SAME * np.ptp(record[name])]
    unit = float(change.min()) if change.size else 0.0
    if change.size == 0 or change.mean() <= UNITS * unit:
        return True
    lines = held(record[name], good)[0] == 1
    if lines and any(held(record[u])[0] == step for u in record.inputs):
        return True  # an integral, however late
    return _follows(record, name, good, step, unit)


def _follows(record: Samples, name: str, good: Mask, step: int, unit: float) -> bool:
    """Whether the last inputs explain an output to its unit, or its changes, as of a gain or an integral.

    Only outputs without noise are explained so: of a sensor, the least change is far below its noise.
    """
    count = min(record.t.size, ROWS)
    lags = min(LAGS, count // (2 * step * len(record.inputs) + 1))  # fewer than values, or all are explained
    rows = np.unique(np.linspace(lags, record.t.size - 2, count).astype(np.intp))
    rows = rows[good[rows] & good[rows + 1]]
    columns = [record[u][rows - lag] for u in record.inputs for lag in range(lags)]
    a = np.column_stack([np.ones(rows.size), *columns])
    values = record[name][rows]
    for part, least in ((values, unit), (record[name][rows + 1] - values, 0.0)):
        off = part - a @ np.linalg.lstsq(a, part, rcond=None)[0]
        if off.std() <= max(EXACT * part.std(), least):
            return True
    return False


def _cure(record: Samples, name: str, step: int, first: int) -> str:
    """Say, by code, which samples to take: of the output, or of all channels where all are as slow."""
    whole = bool(record.inputs) and all(
        (step, first) in (held(record[u]), drawn(record[u])) for u in record.inputs
    )
    if step <= BRIDGED and not whole:
        return leaving_out(record, name, f"np.arange(rec.t.size) % {step} == {first}")
    own = f"[:, {first}::{step}]"
    clock = f"dt={step} * rec.dt" if record.dt else f"t=rec.t[{first}::{step}]"
    names = ", outputs=rec.outputs"
    if record.inputs:
        names = f", u=rec.u{own}{names}, inputs=rec.inputs"
    declared = whole and not record._seen and set(record.intersample) == {"zoh"}
    word = ', intersample="zoh"' if declared else ""
    return f"take these samples of all channels, mf.Record(y=rec.y{own}, {clock}{names}{word})"


def ordinal(number: int) -> str:
    teens = number % 100 in (11, 12, 13)
    return f"{number}{'th' if teens else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"
