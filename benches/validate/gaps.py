"""The greatest difference of each quantity from its twin."""

from __future__ import annotations

import numpy as np


class Gaps:
    """Greatest difference and number of comparisons, a quantity each."""

    def __init__(self) -> None:
        self.rows: dict[str, list[float]] = {}

    def add(self, name: str, limit: float, got: object, want: object, size: float | None = None) -> None:
        """|got − want| over the largest |want|, or over `size`."""
        got, want = np.asarray(got), np.asarray(want)
        gap = float(np.max(np.abs(got - want)) / (np.max(np.abs(want)) if size is None else size))
        row = self.rows.setdefault(name, [0, 0.0, limit])
        row[0] += 1
        row[1] = float(np.maximum(row[1], gap))  # nan stays
