"""How the noise of samples goes with time where the equations hold powers and products of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64
from ..records.record import Record

__all__ = ["Spread", "spread_of"]

PIECE = (
    1 << 15
)  # intervals of a piece of a long record whose high band is looked at (rust/core/noise_level.rs)
LOST = 1e4  # variance of a sample that its sigma is to leave out, over the usual: not its noise


@dataclass(frozen=True, slots=True)
class Spread:
    """Noise of the samples of a record.

    Attributes
    ----------
    rows : ndarray, shape (output, time)
        Standard deviations over the level.
    usual : ndarray, shape (output,)
        That of the usual sample over the level.
    """

    rows: F64
    usual: F64


def spread_of(rec: Record, order: int, seen: bool) -> Spread:
    """Noise of the samples of a record, relative to the usual one, or to the level that its high band shows.

    What is seen there is a mean over the record that its middle dominates: differences of lines of order q
    taper the samples by sin(πt/T)^q. Where masked, samples are interpolated, and so is their noise.
    """
    if rec.sigma is None:
        return Spread(np.ones_like(rec.y), np.ones(len(rec.y)))
    taper = np.ones(rec.t.size)
    if rec.dt is not None:
        piece = PIECE if rec.intervals >= 2 * PIECE else rec.intervals
        taper = np.sin(np.pi / piece * (np.arange(rec.t.size) % piece)) ** (2 * order + 4)
    rows, usual = np.ones_like(rec.y), np.ones(len(rec.y))
    for k, own in enumerate(rec.sigma**2):
        good = np.ones(own.size, bool) if rec.mask is None else rec.mask[k]
        relative = own / np.median(own[good])
        good = good & (relative < LOST)
        level = np.average(relative[good], weights=taper[good]) if seen else 1.0
        rows[k] = np.sqrt(np.interp(rec.t, rec.t[good], relative[good]) / level)
        usual[k] = 1 / np.sqrt(level)
    return Spread(rows, usual)
