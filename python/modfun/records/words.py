"""Words that remarks about records share: kinds, numbers, times, and code that leaves samples out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from .mask import runs
from .samples import Samples

__all__ = ["LONGEST", "SHORTEST", "count", "first_times", "kind", "left_out", "without_samples"]

TIMES = 3  # that are said
LONGEST = 0.1  # of a record may be hidden in a row; beyond, errors of a fit are far too small
SHORTEST = 16  # samples between gaps that make a record


def kind(record: Samples, name: str) -> str:
    return "Output" if name in record.outputs else "Input"


def count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def first_times(record: Samples, places: NDArray[np.intp]) -> str:
    """The first times of these samples, in words."""
    shown = ", ".join([f"{time:.6g}" for time in record.t[places[:TIMES]]])
    return f"{shown}, …" if places.size > TIMES else shown


def left_out(record: Samples, name: str, good: str, counts: NDArray[np.bool_] | None = None) -> str:
    """Say how to leave samples of one output out, by code and where that is true.

    Gaps that no fit bridges are the ends of records of their own.
    """
    masked = f"rec.weigh(mask={good if len(record.outputs) == 1 else f'{{{name!r}: {good}}}'})"
    if counts is None:
        return f"leave them out, {masked}"
    pieces = list(_pieces(record._good(name) & counts, 0))
    if pieces == [(0, counts.size)] or not pieces:
        return f"leave them out, {masked}"
    cuts = ", ".join([f"own.window({record.t[a]:.6g}, {record.t[b - 1]:.6g})" for a, b in pieces])
    return (
        "leave them out and fit what lies around them, as a gap is longer than a tenth of the record: "
        f"own = {masked} and mf.fit([{cuts}], model)"
    )


def _pieces(good: NDArray[np.bool_], first: int) -> Iterator[tuple[int, int]]:
    """First and last but one of what is left without gaps that are too long for it."""
    starts, lengths = runs(~good)
    k = int(np.argmax(lengths)) if lengths.size else 0
    if lengths.size and lengths[k] > LONGEST * good.size:
        yield from _pieces(good[: starts[k]], first)
        yield from _pieces(good[starts[k] + lengths[k] :], first + int(starts[k] + lengths[k]))
    elif good.size >= SHORTEST:
        yield first, first + good.size


def without_samples(record: Samples, name: str, places: NDArray[np.intp]) -> str:
    """Say how to leave the samples with these numbers out of a channel."""
    if name in record.outputs:
        return left_out(record, name, f"~{_numbered(places)}")
    return (
        f"take the samples beside them, k = ~{_numbered(places)} and rec.assign({name}=np.interp(rec.t, "
        f"rec.t[k], rec[{name!r}][k]))"
    )


def _numbered(places: Iterable[int]) -> str:
    """Code that is true at the samples with these numbers."""
    return f"np.isin(np.arange(rec.t.size), {[int(k) for k in places]})"
