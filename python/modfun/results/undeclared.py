"""Doubts about inputs that nobody declared: whether one was held."""

from __future__ import annotations

from ..base.between import OPEN, form_of
from .cures import again, bic_beside, furthest, on_band, otherwise
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["POSITIVE", "undeclared"]

POSITIVE = 2.0  # evidence by a difference of BIC (Kass and Raftery, 1995)


def undeclared(fit: Estimates) -> Doubt | None:
    """That an input which nobody declared fits as well held, or smooth, with other estimates.

    A warning where the samples are a random walk, which say neither; most motions are what they look like.
    """
    records = fit.records or ()
    left = [(rec, name) for rec in records for name in rec.inputs if rec._seen.get(name) == OPEN]
    if fit.again is None or not left:
        return None
    first, name = left[0]
    channel, read = first.inputs.index(name), first.intersample
    word, how = (
        ("smooth", "Smooth, as a motion") if read[channel] == "zoh" else ("zoh", "Held, as by a computer")
    )
    kinds = (*read[:channel], word, *read[channel + 1 :])
    alike = [rec._seen.get(name) == OPEN and rec.intersample[channel] == read[channel] for rec in records]
    changed = tuple(
        otherwise(rec, channel, word) if own else rec for rec, own in zip(records, alike, strict=True)
    )
    other = again(fit, changed, fit.structure, on_band(fit, fit.band))
    if other is None:
        return None
    fallen = bic_beside(fit, fit) - bic_beside(other, fit)
    parameter, was, now, _ = furthest(fit, other)
    held, moved = (kinds, read) if word == "zoh" else (read, kinds)
    given, else_given = (held, moved) if len(read) > 1 else (held[0], moved[0])
    walk = form_of(first[name], None if first.dt else first.t) == "walk"
    return Doubt(
        f"Nobody declared how input {name!r} goes between samples. {how}, it fits about as "
        f"well (BIC {'falls' if fallen > 0 else 'rises'} by {abs(fallen):.2g}), and {parameter} is {now} "
        f"instead of {was}. If it was held, give intersample={given!r}; else declare "
        f"intersample={else_given!r}.",
        sure=walk,
    )
