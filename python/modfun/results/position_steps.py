"""What one step of linear equations tells of an input that acts otherwise than recorded, in place of fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, log
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..records.record import Record
from .cures import otherwise
from .estimates import Estimates
from .linear_lines import columns_of, linear_of

__all__ = ["left_after", "rows_with", "wider"]


def left_after(fit: Estimates, records: Sequence[Record], ramped: str | None = None) -> float:
    """-2 log likelihood of linear equations with other records after one step, up to a constant."""
    every = rows_with(fit, records, ramped)
    if every is None:
        return inf
    columns, e = every[:-1].T, every[-1]
    left = e - columns @ np.linalg.lstsq(columns, e, rcond=None)[0]
    return (fit.df_resid + fit.params.size) * log(max(float(left @ left), 1e-300))


def rows_with(fit: Estimates, records: Sequence[Record], ramped: str | None = None) -> F64 | None:
    """Columns of parameters and, last, residuals of other records; None where equations are singular.

    `ramped`: an input that is not held there, which equations sum as they did.
    """
    model = linear_of(fit)
    assert model is not None
    if ramped is not None:
        k = fit.inputs.index(ramped)
        both = zip(records, fit.records or (), strict=True)
        records = [_held(rec, k) if old.intersample[k] == "zoh" else rec for rec, old in both]
    changes: dict[str, Any] = {"records": tuple(records), "unfolded": ()}
    moved = replace(fit, **changes)
    parts = [columns_of(moved, model, k, exact=False) for k in range(len(records))]
    found = [part for part in parts if part is not None]
    if len(found) < len(parts):
        return None
    every = np.concatenate(found, axis=1)
    return np.concatenate([every[: fit.params.size], every[-1:]])


def wider(rows: F64, moved: Sequence[F64]) -> F64:
    """By how much standard errors grow where values of a position are estimates, too.

    `moved`: the rows with each of these values moved a little.
    """
    own = rows[:-1]
    every = np.concatenate([own, [each[-1] - rows[-1] for each in moved]])
    both = [np.linalg.pinv(columns @ columns.T).diagonal()[: len(own)] for columns in (every, own)]
    return np.asarray(np.sqrt(both[0] / both[1]))


def _held(rec: Record, channel: int) -> Record:
    """The record with the mean of an input over each sample, held."""
    u = rec[rec.inputs[channel]]
    own: dict[str, Any] = {rec.inputs[channel]: np.r_[(u[:-1] + u[1:]) / 2, u[-1]]}
    return otherwise(rec.assign(**own), channel, "zoh")
