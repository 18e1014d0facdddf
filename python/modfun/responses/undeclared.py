"""How inputs that nobody declared go between samples: fits of low order tell where samples do not."""

from __future__ import annotations

from math import isfinite, nan

import numpy as np

from ..base.arrays import F64
from ..base.between import BY_FIT, DOUBTFUL, OPEN
from ..errors import ModfunError
from ..fitting.candidates import best_of, score
from ..fitting.undeclared import OTHER, STRONG, Which, Word, read_as
from ..models.free import Free
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.cures import on_band
from ..results.misfit import refuted
from ..results.undeclared import POSITIVE
from ..systems.frequency_response import FrequencyResponse

__all__ = ["as_fits_prefer", "doubts_of"]

# Every strictly proper one of up to four poles. One order alone would tell little: where it has a pole and a
# zero to spare, they do what half a sample of delay does.
ORDERS = tuple(TransferFunction(poles=n, zeros=m) for n in range(1, 5) for m in range(n))
FEW = 4  # records of one kind that are asked
LATE = 20  # samples, the longest delay that is looked for
NEGLIGIBLE = 0.05  # of the gains: that so many circles miss their gains, they allow themselves


def as_fits_prefer(
    records: list[Record], band: float | tuple[float, float] | None
) -> tuple[list[Record], dict[str, float]]:
    """The records with their open inputs as fits prefer them, and by how much BIC falls for those left open.

    Open are inputs that nobody declared and that look rough, like stairs or like a motion: each may have been
    held for one sample, or not, which is half a sample of delay. Models without an order cannot tell it.
    """
    read, left = list(records), {}
    for name in records[0].inputs:
        for form in (*DOUBTFUL, "smooth"):
            own = [k for k, rec in enumerate(records) if rec._seen.get(name) == form]
            if not own:
                continue
            word = records[own[0]].intersample[records[0].inputs.index(name)]
            gain = sum(_gain(read[k], name, word, band) for k in own[:FEW])
            # Positive evidence decides where samples are doubtful, strong evidence against their looks.
            bar = POSITIVE if form in DOUBTFUL else STRONG
            if gain > bar:
                word, why = OTHER[word], BY_FIT
            else:
                why = BY_FIT if gain < -POSITIVE else OPEN
            if why == OPEN:
                left[name] = gain
            for k in own:
                (read[k],) = read_as((read[k],), {Which(name): Word(word, why)})
    return read, left


def doubts_of(left: dict[str, float], dt: float, found: FrequencyResponse) -> tuple[str, ...]:
    """Say of each input left open where the other reading makes other gains; nothing where it does not."""
    radius = found.radius()
    if radius is None:
        return ()
    apart: F64 = np.abs(found.response * (1 - np.exp(-0.5j * dt * found.omega))) > radius
    said = []
    for name, gain in left.items():
        differ = apart[:, found.inputs.index(name)].any(axis=0)
        if not differ.mean() > NEGLIGIBLE:
            continue
        word = found.between[found.inputs.index(name)].split()[0]
        other = "if each value was held for one sample" if word == "smooth" else "if it was not held"
        fits = f"fits of both, whose BIC differs by {abs(gain):.2g}," if isfinite(gain) else "fits"
        said.append(
            f"Nobody declared how {name!r} goes between samples, and neither its samples nor {fits} tell: it "
            f"is read as {word}. Gains at {int(differ.sum())} of {differ.size} frequencies would be others "
            f"by more than their 95 % circles {other}. Declare what it was, intersample='zoh' or 'smooth'."
        )
    return tuple(said)


def _gain(rec: Record, name: str, word: str, band: float | tuple[float, float] | None) -> float:
    """By how much BIC falls with an input read otherwise, over all outputs; nan where fits cannot tell.

    They cannot where the better one leaves more than noise, or where a delay beside a smooth input is better
    than both: the system has one, of which half a sample may be the hold.
    """
    total = 0.0
    late = Free(min=0.0, max=LATE * float(rec.dt or 0))
    delayed = tuple(TransferFunction(poles=n, zeros=m, delay=late) for n in range(1, 4) for m in range(n))
    for output in rec.outputs:
        own = rec.select(outputs=[output])
        try:
            fit = best_of((own,), ORDERS, Options.checked("frf", band=band))
            options = on_band(fit, fit.band)
            other = best_of(read_as((own,), {Which(name): Word(OTHER[word], BY_FIT)}), ORDERS, options)
            slower = best_of(read_as((own,), {Which(name): Word("smooth", BY_FIT)}), delayed, options)
        except ModfunError:
            return nan
        gain = score(fit, fit) - score(other, fit)
        better = other if gain > 0 else fit
        if not (fit.usable and other.usable) or refuted(better):
            return nan
        if slower.usable and score(slower, fit) < score(better, fit) - STRONG:
            return nan
        total += gain
    return total
