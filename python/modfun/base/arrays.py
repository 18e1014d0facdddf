"""Arrays of numbers by their kind, for annotations, and their geometric mean."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["C128", "F64", "I64", "geometric_mean"]

F64 = NDArray[np.float64]
C128 = NDArray[np.complex128]
I64 = NDArray[np.int64]


def geometric_mean(values: F64 | Sequence[F64], weights: Sequence[float]) -> F64:
    """Of each column, over rows of these weights."""
    if len(values) == 1:
        return np.array(values[0])
    with np.errstate(divide="ignore"):
        share = np.array(weights, dtype=np.float64)
        return np.asarray(np.exp(np.add.reduce(share[:, None] * np.log(values)) / np.add.reduce(share)))
