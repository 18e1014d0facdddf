"""Where a record is cut into pieces: at equal times, at gaps, or where a channel goes on and off."""

from __future__ import annotations

import math
import warnings
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import real
from ..base.arrays import F64
from ..base.samples import FEWEST
from ..errors import DataError, ModfunWarning, SpecError

__all__ = ["SLACK", "pieces_between", "pieces_every", "pieces_on"]

SLACK = 1e-6  # of a mean step, so that 0.1·k typed as a decimal hits its sample

Pieces = tuple[
    list[tuple[int, int]], str
]  # first sample and the one after the last of each; the call in words


def pieces_every(t: F64, every: float) -> Pieces:
    """Cut at equal times; neighbours share the sample between them.

    Raises
    ------
    SpecError
        If `every` is not a positive number.
    DataError
        If no piece would have 8 samples.
    """
    length = real("split", "every", every, finite=False)
    if not (math.isfinite(length) and length > 0):
        raise SpecError(f"split: every={every!r} must be a positive number of seconds")
    duration = float(t[-1] - t[0])
    slack = SLACK * duration / (len(t) - 1)
    count = int(min((duration + slack) / length, len(t)))
    edges = np.searchsorted(t, t[0] + length * np.arange(count + 1) - slack, side="left")
    if count == 0 or np.min(np.diff(edges)) + 1 < FEWEST:
        raise DataError(
            f"split(every={length:g}): pieces need at least {FEWEST} samples and may not be longer than the "
            f"record, which has {len(t)} samples in {duration:g} s"
        )
    return [(int(a), int(b) + 1) for a, b in pairwise(edges)], f"split(every={length:g})"


def pieces_between(t: F64, gap: float, rows: NDArray[np.intp]) -> Pieces:
    """Cut where neighbouring rows with samples are more than `gap` seconds apart; short pieces are left out.

    Raises
    ------
    SpecError
        If `gap` is not a positive number.
    DataError
        If no piece has 8 samples.
    """
    least = real("split", "gap", gap, finite=False)
    if not least > 0:
        raise SpecError(f"split: gap={gap!r} must be a positive number of seconds")
    what, before = f"split(gap={least:g})", np.flatnonzero(np.diff(t[rows]) > least)
    starts, ends = rows[np.append(0, before + 1)], rows[np.append(before, -1)] + 1
    if np.max(ends - starts) < FEWEST:
        raise DataError(
            f"{what}: the longest of {len(starts)} pieces has {np.max(ends - starts)} samples, and a record "
            f"needs {FEWEST}; the usual step is {np.median(np.diff(t)):.4g} s, so give a longer gap"
        )
    return _long_enough(t, starts, ends, what), what


def pieces_on(t: F64, values: F64, channel: str) -> Pieces:
    """Cut where a channel of marks, or of numbers that last, is on; stretches too short are left out.

    Raises
    ------
    DataError
        If the channel never changes, or is never on for 8 samples.
    """
    what = f"split(on={channel!r})"
    low, high = float(values.min()), float(values.max())
    if low == high:
        raise DataError(
            f"{what}: the channel is {low:g} throughout, so it never goes on or off; name a channel that "
            "marks the pieces"
        )
    steady = FEWEST * np.count_nonzero(np.diff(values)) < len(values)
    numbers = np.unique(values)
    counts = len(numbers) > 2 or (
        low > 0 and high == low + 1
    )  # two values are a mark, but 1 and 2 are numbers
    counter = low >= 0 and steady and counts and not np.any(values % 1)
    level = values if counter else np.where(values > 0.5 * (low + high), 1.0, 0.0)
    edges = np.flatnonzero(np.diff(level, prepend=np.nan, append=np.nan) != 0)
    on = level[edges[:-1]] > 0
    starts, ends = edges[:-1][on], edges[1:][on]
    long = ends - starts >= FEWEST
    if not long.any():
        times = ", ".join(f"{t[start]:g}" for start in starts[:6])
        raise DataError(
            f"{what}: the channel is on {len(starts)} times, never for {FEWEST} samples or more (at t = "
            f"{times}{', ...' if len(starts) > 6 else ''} s); name another channel, or cut pieces that begin "
            "there with window"
        )
    return _long_enough(t, starts, ends, what), what


def _long_enough(
    t: F64, starts: NDArray[np.intp], ends: NDArray[np.intp], what: str
) -> list[tuple[int, int]]:
    """The pieces of 8 samples and more, with a warning if there are others."""
    long = ends - starts >= FEWEST
    if not long.all():
        warnings.warn(
            f"{what}: {int((~long).sum())} of {len(long)} pieces have fewer than {FEWEST} samples and are "
            f"left out, the first at t = {t[starts[~long][0]]:g} s",
            ModfunWarning,
            stacklevel=5,
        )
    return [(int(a), int(b)) for a, b in zip(starts[long], ends[long], strict=True)]
