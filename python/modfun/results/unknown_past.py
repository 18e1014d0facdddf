"""Records whose delayed inputs reach back before the first sample, with hardly a weight until they do not."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64
from ..records.record import Record

__all__ = ["from_known_inputs", "lead"]

GUESS = 1e3  # times the noise of other samples: under held inputs, which are right or off by the signal


def lead(fit: Any, k: int) -> int:
    """First samples of the k-th record that inputs before it move; none where those are known."""
    if fit.options.initial_state not in ("unknown", "periodic"):
        return 0
    return max(int(fit.records[k].intervals) - int(fit.intervals[k]), 0)


def from_known_inputs(fit: Any) -> tuple[Record, ...]:
    """The fit's records as a simulation has to see them whose initial state is to be that of the samples.

    A simulation holds inputs at their first value before the record. Samples that this guess has moved pull
    the initial state by up to the whole signal, and the free response hands that on to those behind them.
    From there on the response is right whatever the guess, with the initial state that suits it. They keep a
    small weight: alone they tell of motions that decay before.
    """
    return tuple([_trusted(rec, lead(fit, k)) for k, rec in enumerate(fit.records)])


def _trusted(rec: Record, first: int) -> Record:
    if not first:
        return rec
    sigma: F64 = np.ones(rec.y.shape) if rec.sigma is None else rec.sigma.copy()
    sigma[:, :first] *= GUESS
    return rec._like(sigma=sigma)
