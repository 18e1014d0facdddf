"""The doubt that an input which nobody declared was held, where a record does not tell."""

from __future__ import annotations

from ..base.between import OPEN
from .cures import again, bic_beside, furthest, on_band
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["undeclared"]


def undeclared(fit: Estimates) -> Doubt | None:
    """That an input which nobody declared fits as well held, with other estimates."""
    records = fit.records or ()
    name = next((name for rec in records[:1] for name in rec.inputs if rec._seen.get(name) == OPEN), None)
    if fit.again is None or name is None:
        return None
    read = records[0].intersample
    held = tuple("zoh" if own == name else word for own, word in zip(records[0].inputs, read, strict=True))
    changed = tuple(rec._like(intersample=held) for rec in records)
    other = again(fit, changed, fit.structure, on_band(fit, fit.band))
    if other is None:
        return None
    fallen = bic_beside(fit, fit) - bic_beside(other, fit)
    parameter, was, now, _ = furthest(fit, other)
    both = (held, read) if len(held) > 1 else (held[0], read[0])
    return Doubt(
        f"Nobody declared how input {name!r} goes between samples. Held, as by a computer, it fits about as "
        f"well (BIC {'falls' if fallen > 0 else 'rises'} by {abs(fallen):.2g}), and {parameter} is {now} "
        f"instead of {was}. If it was held, give intersample={both[0]!r}; else declare "
        f"intersample={both[1]!r}.",
        sure=False,
    )
