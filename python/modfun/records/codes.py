"""Codes for missing values: one number, several times, far away from all others of its channel."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..base.arrays import F64
from .mask import leaving_out
from .samples import Samples

__all__ = ["Code", "code_in", "codes_of"]

FAR = 10.0  # times the span of all others
FEW = 32  # samples that are looked at first
Code = tuple[float, int, float, float]  # the number, how often, and the least and the largest other one


def code_in(values: F64) -> Code | None:
    """The code among finite values, such as -9999 where nothing was measured; None without."""
    if not values.size:
        return None
    top, bottom = float(values.max()), float(values.min())
    empty = (top - bottom) * (0.5 - 1 / (FAR + 1))  # about the middle, between a code and the others
    few = values[:: max(values.size // FEW, 1)]  # most records show at once that it is not
    if np.any(np.abs(few - (top + bottom) / 2) < empty):
        return None
    for extreme in (top, bottom):
        others = values != extreme  # no copy of long records
        count = values.size - int(np.count_nonzero(others))
        if not 2 <= count < values.size - count:
            continue
        low = float(np.min(values, initial=np.inf, where=others))
        high = float(np.max(values, initial=-np.inf, where=others))
        if high > low and max(low - extreme, extreme - high) > FAR * (high - low):
            return extreme, count, low, high
    return None


def codes_of(record: Samples, name: str) -> Iterator[str]:
    """What to do about the code of a channel, in words."""
    output = name in record.outputs
    masked = output and record.mask is not None
    if found := code_in(record[name][record._good(name)] if masked else record[name]):
        code, count, low, high = found
        # A code in other units has more digits than are shown.
        cure = leaving_out(record, name, f"rec[{name!r}] != {code:.17g}") if output else "fill them in"
        yield (
            f"{'Output' if output else 'Input'} {name!r}: {count} samples are exactly {code:g}, far from all "
            f"others ({low:.4g} to {high:.4g}); if that is a code for missing values, {cure}."
        )
