"""What a stream takes: samples and records, checked against its channels and its step."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import real
from ..base.arrays import F64
from ..base.between import AUTO
from ..base.samples import Names, names_of
from ..errors import DataError, SpecError
from ..models.transfer_function import TransferFunction
from ..records.record import Record

__all__ = ["FEWEST", "LONGEST", "block_of", "channels_of", "intervals_of", "refuse_record", "seconds"]

FEWEST = 8  # intervals of a window
LONGEST = 1 << 20  # samples remembered


def channels_of(model: Any, which: str, given: Names, letter: str) -> tuple[str, ...]:
    """Names of the outputs or inputs of a stream, as its model has them or as its user gave them."""
    if not isinstance(model, TransferFunction):
        own: tuple[str, ...] = getattr(model, which)
        return own if given is None else names_of(given, len(own), letter, which)
    count = model.n_outputs if which == "outputs" else model.n_inputs
    if count is None:
        count = 1 if given is None or isinstance(given, str) else len(given)
    return names_of(given, count, letter, which)


def block_of(
    y: ArrayLike, u: ArrayLike | None, outputs: Sequence[str], inputs: Sequence[str], count: int
) -> F64:
    """Samples as (channel, time), outputs first; `count` of them were there before.

    Raises
    ------
    DataError
        Another number of channels, or values that are not finite.
    """
    q, k = len(outputs), len(inputs)
    if isinstance(y, float) and isinstance(u, float) and q == k == 1 and isfinite(y) and isfinite(u):
        return np.array([[y], [u]])  # the most frequent case, four times as fast
    above = _rows("y", y, q)
    block = np.empty((q + k, above.shape[1]))
    block[:q] = above
    if k or (u is not None and np.size(u)):
        below = _rows("u", () if u is None else u, k)
        if below.shape[1] != above.shape[1]:
            raise DataError(
                f"Stream.push: {above.shape[1]} samples of y, {below.shape[1]} of u; give as many of both"
            )
        block[q:] = below
    if not np.isfinite(block).all():
        row, column = np.argwhere(~np.isfinite(block))[0]
        raise DataError(
            f"Stream.push: {(*outputs, *inputs)[row]!r} is {block[row, column]} at sample "
            f"{count + column}; nothing was taken: give its last good value, or clear() and begin "
            "again"
        )
    return block


def refuse_record(
    rec: Any, outputs: tuple[str, ...], inputs: tuple[str, ...], dt: float, intersample: tuple[str, ...]
) -> None:
    """Refuse a record that a stream of these channels cannot go on with.

    Raises
    ------
    SpecError, DataError
    """
    if not isinstance(rec, Record):
        raise SpecError(f"Stream.follow: {type(rec).__name__} is not a Record; push samples, or make one")
    if (rec.outputs, rec.inputs) != (outputs, inputs):
        raise DataError(
            f"Stream.follow: the record has outputs {list(rec.outputs)}, inputs {list(rec.inputs)}, the "
            f"stream {list(outputs)} and {list(inputs)}; select them, or name the stream's"
        )
    if rec.dt is None or abs(rec.dt - dt) > 1e-6 * dt:
        have = "uneven steps" if rec.dt is None else f"a step of {rec.dt:g} s"
        raise DataError(f"Stream.follow: the record has {have}, the stream one of {dt:g} s")
    both = zip(inputs, rec.intersample, intersample, strict=True)
    if any(own not in (theirs, AUTO) and name not in rec._seen for name, theirs, own in both):
        raise DataError(
            f"Stream.follow: between samples the record's inputs are {', '.join(rec.intersample)}, the "
            f"stream's {', '.join(intersample)}; make it Stream(..., intersample=...)"
        )
    if rec.mask is not None or rec.sigma is not None:
        raise DataError("Stream.follow: masked samples and sigma are for records; fill them first")


def intervals_of(length: float, dt: float) -> int:
    """Intervals of a window of so many seconds.

    Raises
    ------
    SpecError
    """
    if length / dt > LONGEST:
        raise SpecError(
            f"Stream: a window of {length:g} s holds {length / dt:.3g} intervals of {dt:g} s, at most "
            f"{LONGEST}; take a shorter window or longer steps"
        )
    intervals = round(length / dt)
    if intervals < FEWEST:
        raise SpecError(
            f"Stream: a window of {length:g} s holds {intervals} intervals of {dt:g} s; at least {FEWEST} "
            "are needed"
        )
    return intervals


def seconds(name: str, given: Any) -> float:
    """A positive time, as a user gave it.

    Raises
    ------
    SpecError
    """
    found = real("Stream", name, given, finite=False)
    if not (isfinite(found) and found > 0):
        raise SpecError(f"Stream: {name}={given!r} must be a positive number of seconds")
    return found


def _rows(name: str, given: ArrayLike, channels: int) -> F64:
    masked = isinstance(given, np.ma.MaskedArray) and np.ma.getmaskarray(given).any()
    values = np.asarray(given)
    if masked or values.dtype.kind not in "biuf":
        what = "masked samples" if masked else f"{values.dtype.name} values"
        raise DataError(
            f"Stream.push: {name} holds {what}; give numbers, the last good one for what is missing"
        )
    values = values.astype(np.float64, copy=False)
    if values.ndim == 0:
        values = values.reshape(1, 1)
    elif values.ndim == 1:
        values = values[None] if channels == 1 else values[:, None]
    if values.ndim != 2 or values.shape[0] != channels:
        raise DataError(
            f"Stream.push: {name} has shape {np.shape(given)}, the stream {channels} channel(s) of it; give "
            "(channel,) for one sample or (channel, time) for a block, time last"
        )
    return values
