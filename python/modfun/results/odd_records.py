"""Records of a batch that are unlike the others: what they leave, and what they say of a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64

__all__ = ["Odd", "odd_records"]

LEAST = 4  # records that tell what is usual
TIMES = 3.0  # what a record leaves, over what is usual: in simulated batches at most 2 by chance
SPREADS = 8.0  # of logarithms of the same, for batches whose noise differs from record to record
FAR = 20.0  # of the spread of estimates, and of their own standard errors
NAMED = 5  # in a sentence
SAME = 1e-9  # relative difference of costs that are one


class Odd(NamedTuple):
    """Which records are unlike the others, the one that leaves most, and what to say of them."""

    records: NDArray[np.bool_]
    worst: int | None
    texts: tuple[str, ...]


def odd_records(params: F64, bse: F64, cost: F64, usable: NDArray[np.bool_], names: Sequence[str]) -> Odd:
    """Records that leave far more than the others do, or whose estimates are far from theirs.

    A sensor that is stuck or out of step enlarges what a fit leaves some 10 to 30 times, and its standard
    errors with it, so that no estimate looks odd. One that is dead leaves only noise, but its gain is zero.
    """
    odd, worst, texts = np.zeros(len(params), bool), None, []
    good = np.flatnonzero(usable)
    if good.size < LEAST:
        return Odd(odd, None, ())
    with np.errstate(all="ignore"):  # nan where there is nothing to compare, which is not odd
        # The cost is the same where a covariance of several outputs is fitted: then errors grow.
        same = np.ptp(cost[good]) <= SAME * np.abs(cost[good]).max()
        left = np.nanmax(_logs(bse[good]), axis=1) if same else _logs(np.sqrt(cost[good]))
        more = left > max(np.log(TIMES), SPREADS * _spread(left))
        middle, spread = np.median(params[good], axis=0), _spread(params[good])
        away = np.abs(params[good] - middle)
        far = (away > FAR * spread) & (away > FAR * bse[good]) & (spread > 0)
    if more.any():
        worst, times = int(good[np.nanargmax(left)]), float(np.exp(left[more].min()))
        has, leaves = ("has", "leaves") if more.sum() == 1 else ("have", "leave")
        what = (
            f"{has} standard errors of at least {times:.2g} times those of the others"
            if same
            else f"{leaves} at least {times:.2g} times what the others leave"
        )
        texts.append(
            f"{int(more.sum())} of {len(params)} records {what}: {_named(good[more])}. "
            f"Look at one, mf.fit(data[{worst}], model); params[~odd] leaves them out"
        )
    else:
        worst = int(good[far.any(axis=1)][0]) if far.any() else None
    for k in np.flatnonzero((far & ~more[:, None]).any(axis=0)).tolist():
        own = good[far[:, k] & ~more]
        texts.append(
            f"{names[k]} is far from that of the others in {_named(own)}: {params[own[0], k]:.4g} ± "
            f"{bse[own[0], k]:.2g} in record {own[0]}, where the median is {middle[k]:.4g}"
        )
    odd[good] = more | far.any(axis=1)
    return Odd(odd, worst, tuple(texts))


def _logs(sizes: F64) -> F64:
    """Logarithms of sizes over their medians, nan where these are zero."""
    usual = np.median(sizes, axis=0)
    return np.asarray(np.log(sizes / np.where(usual > 0, usual, np.nan)))


def _spread(values: F64) -> F64:
    """Standard deviation of each column, by its median deviation."""
    return np.asarray(1.4826 * np.median(np.abs(values - np.median(values, axis=0)), axis=0))


def _named(records: NDArray[np.intp]) -> str:
    text = ", ".join(str(k) for k in records[:NAMED])
    more = f" and {records.size - NAMED} more" if records.size > NAMED else ""
    return f"record{'s' if records.size > 1 else ''} {text}{more}"
