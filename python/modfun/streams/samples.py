"""What a stream takes: samples and records, checked against its channels and its step."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import F64
from ..base.between import AUTO
from ..base.samples import Names, names_of
from ..errors import DataError, SpecError
from ..fitting.fit import Estimator, fit_quietly
from ..fitting.undeclared import decided_by_fit, in_sentences, read_as
from ..models.transfer_function import TransferFunction
from ..records.record import Record

__all__ = ["block_of", "channels_of", "refuse_record", "words_of"]


def channels_of(model: Any, which: str, given: Names, letter: str) -> tuple[str, ...]:
    """Names of the outputs or inputs of a stream, as its model has them or as its user gave them."""
    if not isinstance(model, TransferFunction):
        own: tuple[str, ...] = getattr(model, which)
        return own if given is None else names_of(given, len(own), letter, which)
    count = model.n_outputs if which == "outputs" else model.n_inputs
    if count is None:
        count = 1 if given is None or isinstance(given, str) else len(given)
    return names_of(given, count, letter, which)


def words_of(
    rec: Record, told: tuple[str, ...], estimator: Estimator
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """How the inputs of a first window go between samples where that was not told, and what decided it."""
    both = list(zip(rec.inputs, told, rec.intersample, strict=True))
    rec = rec._like(
        intersample=tuple(theirs if own == AUTO else own for _, own, theirs in both),
        _seen={name: rec._seen[name] for name, own, _ in both if own == AUTO and name in rec._seen},
    )
    found = decided_by_fit([(rec,)], estimator.model, estimator.options, fit_quietly)
    return read_as((rec,), found)[0].intersample, in_sentences(found)


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
