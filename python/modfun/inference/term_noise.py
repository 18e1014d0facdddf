"""Noise that a search for terms did not count on: uneven, or of a channel computed from another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.arrays import F64
from ..records.record import Record
from ..results.computed_channels import Computed, computed, may_be_computed
from ..results.fit import Fit
from ..results.uneven_noise import SHORTEST, UNEVEN, Uneven, in_words, p_values, uneven, unforeseen

__all__ = ["Noted", "may_be_odd", "noted_of"]

PERHAPS = 0.05  # p-value of samples as they are, above which no fit is asked whether their noise changes
LAWS = (1.0, 2.0)  # powers of the reading that a variance goes with: of counts, and of errors in proportion
COEFFICIENTS = 3  # of a smooth level, beyond the one that such a law has


class Noted(NamedTuple):
    """What the fit of the chosen terms told about the noise.

    Attributes
    ----------
    computed : Computed, optional
        The channel that was computed from another one.
    records : tuple of Record
        With their samples weighted, where the noise changes and there is no such channel; else none.
    uneven : str
        That the noise changes, and that the samples were weighted by it; else "".
    """

    computed: Computed | None = None
    records: tuple[Record, ...] = ()
    uneven: str = ""


def may_be_odd(records: Sequence[Record]) -> bool:
    """Whether the samples of outputs, as they are, are a reason to look at what a fit leaves of them."""
    plain = [rec.y for rec in records if rec.dt is not None and rec.mask is None]
    if len(plain) < len(records):
        return False
    if len(plain[0]) > 1 and may_be_computed(plain):
        return True
    if min(y.shape[1] for y in plain) <= SHORTEST:
        return False
    new, sizes = [unforeseen(y) for y in plain], [np.abs(y) for y in plain]
    return bool(min(p_values(new).min(), p_values(new, sizes).min()) < PERHAPS)


def noted_of(records: Sequence[Record], fit: Fit | None) -> Noted:
    """Whether a channel was computed from another one, or the noise changes, and the weights for that."""
    if fit is None or not fit.usable:
        return Noted()
    if (found := computed(fit)) is not None:
        return Noted(found)
    changes = uneven(fit)
    if changes is None or changes.p_value > UNEVEN:
        return Noted()
    levels = _levels(changes)
    own = []
    for k, rec in enumerate(records):
        sigma = np.ones_like(rec.y)  # of outputs that the equation does not name: any
        for name, level in zip(fit.outputs, levels, strict=True):
            before = rec.y.shape[1] - 1 - level[k].size  # samples that the fit left out
            sigma[rec.outputs.index(name)] = np.pad(level[k], (before, 1), mode="edge")
        own.append(rec.weigh(sigma=sigma))
    text = f"{in_words(fit, changes)} The samples were weighted by it, as by Record(sigma=...)."
    return Noted(None, tuple(own), text)


def _levels(found: Uneven) -> list[list[F64]]:
    """Level of the noise of each output in each record: by a law with one coefficient, or smooth.

    Of few samples a law is far more certain than a smooth curve; the one that explains them better is taken.
    """
    smooth = found.levels()
    chosen = []
    for i, goes in enumerate(found.goes):
        new = [own[i] for own in found.new]
        usual = [own[i] for own in smooth]
        price = COEFFICIENTS * np.log(sum(own.size for own in new))
        best, least = usual, _criterion(new, usual) + price
        for power in LAWS if goes else ():
            sizes = [np.maximum(own[i], np.finfo(float).tiny) ** (power / 2) for own in found.readings]
            ratio = [own / size[-own.size :] for own, size in zip(new, sizes, strict=True)]
            scale = np.sqrt(np.mean(np.concatenate(ratio) ** 2))
            levels = [scale * size for size in sizes]
            if (value := _criterion(new, levels)) < least:
                best, least = levels, value
        chosen.append(best)
    return chosen


def _criterion(new: Sequence[F64], levels: Sequence[F64]) -> float:
    """-2 log likelihood of what is new in each record, but for a constant."""
    own = [level[-rows.size :] for rows, level in zip(new, levels, strict=True)]
    return float(
        sum(np.sum(2 * np.log(level) + (rows / level) ** 2) for rows, level in zip(new, own, strict=True))
    )
