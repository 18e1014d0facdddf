"""Doubts about inputs that nobody declared: whether one was held."""

from __future__ import annotations

from ..base.between import OPEN, form_of
from ..records.record import Record
from .cures import again, as_declared, bic_beside, furthest, on_band, otherwise
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["POSITIVE", "undeclared", "wandering"]

POSITIVE = 2.0  # evidence by a difference of BIC (Kass and Raftery, 1995)


def wandering(fit: Estimates) -> Doubt | None:
    """The same of a random walk alone, which says neither; most motions are what they look like."""
    left = _left(fit)
    return undeclared(fit) if left and _walks(*left[0]) else None


def undeclared(fit: Estimates) -> Doubt | None:
    """That an input which nobody declared fits as well held, or smooth, with other estimates."""
    records, left = fit.records or (), _left(fit)
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
    return Doubt(
        f"Nobody declared how input {name!r} goes between samples. {how}, it fits about as "
        f"well (BIC {'falls' if fallen > 0 else 'rises'} by {abs(fallen):.2g}), and {parameter} is {now} "
        f"instead of {was}. If it was held, give {as_declared(fit, held)}; else declare "
        f"{as_declared(fit, moved)}.",
        sure=_walks(first, name),
    )


def _left(fit: Estimates) -> list[tuple[Record, str]]:
    """Inputs whose reading was left open, each with its record."""
    return [(rec, name) for rec in fit.records or () for name in rec.inputs if rec._seen.get(name) == OPEN]


def _walks(rec: Record, name: str) -> bool:
    """Whether an input's samples are a random walk, which says nothing of how it goes between them."""
    return form_of(rec[name], None if rec.dt else rec.t) == "walk"
