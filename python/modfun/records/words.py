"""Words that remarks about records share: kinds, numbers, times, and code that leaves samples out."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from .samples import Samples

__all__ = ["count", "first_times", "kind", "left_out", "without_samples"]

TIMES = 3  # that are said


def kind(record: Samples, name: str) -> str:
    return "Output" if name in record.outputs else "Input"


def count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def first_times(record: Samples, places: NDArray[np.intp]) -> str:
    """The first times of these samples, in words."""
    shown = ", ".join([f"{time:.6g}" for time in record.t[places[:TIMES]]])
    return f"{shown}, …" if places.size > TIMES else shown


def left_out(record: Samples, name: str, good: str) -> str:
    """Say how to leave samples of one output out."""
    return f"leave them out, rec.weigh(mask={good if len(record.outputs) == 1 else f'{{{name!r}: {good}}}'})"


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
