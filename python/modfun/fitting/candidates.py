"""Transfer functions of several orders beside each other: the best of them on one band."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.cures import bic_beside, on_band
from ..results.fit import Fit
from .single import fit_quietly

__all__ = ["best_of", "score"]


def best_of(records: tuple[Record, ...], structures: Sequence[TransferFunction], options: Options) -> Fit:
    """Of fits over the band of the largest candidate, which is the last one, that of the lowest BIC.

    A superfluous zero does what reading the input otherwise would: the largest candidate alone tells little.
    """
    last = fit_quietly(records, structures[-1], options)
    best = last
    for structure in structures[:-1]:
        fit = fit_quietly(records, structure, on_band(last, last.band))
        if fit.usable and score(fit, last) < score(best, last):
            best = fit
    return best


def score(fit: Fit, base: Fit) -> float:
    """BIC of a fit beside another of the same records, each pole counted with its transient coefficients."""
    return bic_beside(fit, base) + fit.order * len(fit.omega0) * log(base.df_resid + base.params.size)
