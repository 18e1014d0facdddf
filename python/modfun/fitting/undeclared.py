"""Inputs that nobody declared and whose samples leave it open whether they were held: the fit decides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..base.between import BY_FIT, DOUBTFUL, LOOP
from ..errors import ModfunError
from ..models.options import Options
from ..records.record import Record
from ..results.cures import bic_beside, on_band
from ..results.fit import Fit

__all__ = ["settled"]

# Differences of BIC (Kass and Raftery, 1995): positive evidence, and very strong evidence where the record is
# one of a loop. There the noise that comes back biases both fits, and a computer holds what it commands.
POSITIVE, VERY_STRONG = 2.0, 10.0


def settled(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_once: Callable[[tuple[Record, ...], Any, Options], Fit],
) -> tuple[Record, ...]:
    """The records with each open input held or smooth, whichever the fit of the structure prefers.

    Open are undeclared inputs that look `DOUBTFUL`. With a reference all undeclared inputs that move smoothly
    are open, too, and rough ones are held unless the fit says otherwise.
    """
    loop = bool(options.reference)
    bar, forms = (VERY_STRONG, {*DOUBTFUL, "smooth"}) if loop else (POSITIVE, {*DOUBTFUL})
    names = [name for name in records[0].inputs if _forms(records, name) & forms]
    names = [name for name in names if name not in options.reference]
    if not names:
        return records
    for name in names:
        if loop and "rough" in _forms(records, name):
            records = _read(records, name, "zoh", LOOP)
    plain = options.replace(reference=(), robust=False, stable=False)
    best = _fit(records, structure, plain, fit_once)
    if best is None:
        return records
    for name in names:
        if name not in best.inputs:
            continue
        word = records[0].intersample[records[0].inputs.index(name)]
        changed = _read(records, name, "smooth" if word == "zoh" else "zoh", BY_FIT)
        other = _fit(changed, structure, on_band(best, best.band), fit_once)
        if other is None:
            continue
        gain = bic_beside(best, best) - bic_beside(other, best)
        if gain > bar:
            records, best = changed, other
        elif gain < -bar:
            records = _read(records, name, word, BY_FIT)
    return records


def _forms(records: Sequence[Record], name: str) -> set[str]:
    """What the samples of an input look like; nothing where a record declares it."""
    forms = [rec._seen.get(name, "") for rec in records]
    return {*forms} if all(forms) else set()


def _read(records: Sequence[Record], name: str, word: str, why: str) -> tuple[Record, ...]:
    """The records with an input read so, for a reason."""
    at = records[0].inputs.index(name)
    return tuple(
        rec._like(
            intersample=(*rec.intersample[:at], word, *rec.intersample[at + 1 :]),
            _seen={**rec._seen, name: why},
        )
        for rec in records
    )


def _fit(records: Any, structure: Any, options: Options, fit_once: Any) -> Fit | None:
    """A fit with an answer; what is wrong without one, the fit of the user says."""
    try:
        fit: Fit = fit_once(records, structure, options)
    except ModfunError:
        return None
    return fit if fit.usable else None
