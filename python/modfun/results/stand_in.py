"""The fit that looks are made at where a few samples are masked: of whole records, which show more."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from ..base.cached import kept
from ..errors import ModfunError
from ..records.mask import runs
from ..records.record import Record
from .cures import again, on_band
from .estimates import Estimates

__all__ = ["stand_in"]

FEW = 0.05  # of the samples of an output, that may be filled: more would show in its noise


@kept
def stand_in(fit: Estimates) -> Estimates:
    """The fit of the records with their masked samples filled; the fit itself where none or many are masked.

    Units, signs, times and missing inputs are told by lines of even samples and by the noise that an unused
    band shows, which masked records do not have. What is filled in is the model's response and a line between
    the mean residuals of as many samples on either side: neighbours alone would make a pulse of noise.
    """
    records = fit.records or ()
    if not fit.success or fit.again is None or all(rec.mask is None for rec in records):
        return fit
    if any(rec.dt is None or rec.sigma is not None or _most(rec) > FEW for rec in records):
        return fit
    try:
        filled = tuple([rec if rec.mask is None else _filled(fit, rec) for rec in records])
    except ModfunError:
        return fit
    if not all(np.isfinite(rec.y).all() for rec in filled):
        return fit
    other = again(fit, filled, fit.structure, on_band(fit, fit.band))
    return other if other is not None and other.success else fit


def _most(rec: Record) -> float:
    return 0.0 if rec.mask is None else 1.0 - float(rec.mask.mean(axis=1).min())


def _filled(fit: Estimates, rec: Record) -> Record:
    simulated = cast(Any, fit).simulate(rec)[0]
    y = rec.y.copy()
    assert rec.mask is not None
    for own, good, response in zip(y, rec.mask, simulated, strict=True):
        off, seen = own - response, np.flatnonzero(good)
        for start, length in zip(*runs(~good), strict=True):
            at = int(np.searchsorted(seen, start))
            before, after = off[seen[max(at - length, 0) : at]], off[seen[at : at + length]]
            first = float(np.mean(before if before.size else after))
            last = float(np.mean(after if after.size else before))
            gap = slice(start, start + length)
            own[gap] = response[gap] + np.linspace(first, last, length + 2)[1:-1]
    return rec._like(y=y, mask=None)
