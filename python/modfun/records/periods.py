"""Whole periods of a record's inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .record import Record

__all__ = ["periods"]

SHORTEST = 8  # samples of a period
SAME = 1e-9  # of an input's size: periods are compared so closely


def periods(rec: Record) -> int:
    """How many whole periods of its inputs a record holds, its ends in one phase; 1 if they do not repeat."""
    if not rec.inputs:
        return 1
    count = rec.u.shape[1] - 1
    size = np.max(np.abs(rec.u), axis=1, keepdims=True)
    for parts in range(count // SHORTEST, 1, -1):
        length = count // parts
        if count % parts == 0 and np.all(np.abs(rec.u[:, length:] - rec.u[:, :-length]) <= SAME * size):
            return parts
    return 1
