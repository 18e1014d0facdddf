"""Codes for missing values: one number, several times, far away from all others of its channel."""

from __future__ import annotations

from collections.abc import Iterator

from ..base.arrays import F64
from .mask import leaving_out
from .samples import Samples

__all__ = ["Code", "code_in", "codes_of"]

FAR = 10.0  # times the span of all others
Code = tuple[float, int, float, float]  # the number, how often, and the least and the largest other one


def code_in(values: F64) -> Code | None:
    """The code among finite values, such as -9999 where nothing was measured; None without."""
    for extreme in (float(values.max()), float(values.min())) if values.size else ():
        others = values[values != extreme]
        count = len(values) - len(others)
        if not 2 <= count < len(others):
            continue
        low, high = float(others.min()), float(others.max())
        if high > low and max(low - extreme, extreme - high) > FAR * (high - low):
            return extreme, count, low, high
    return None


def codes_of(record: Samples, name: str) -> Iterator[str]:
    """What to do about the code of a channel, in words."""
    if found := code_in(record[name][record._good(name)]):
        code, count, low, high = found
        output = name in record.outputs
        # A code in other units has more digits than are shown.
        cure = leaving_out(record, name, f"rec[{name!r}] != {code:.17g}") if output else "fill them in"
        yield (
            f"{'Output' if output else 'Input'} {name!r}: {count} samples are exactly {code:g}, far from all "
            f"others ({low:.4g} to {high:.4g}); if that is a code for missing values, {cure}."
        )
