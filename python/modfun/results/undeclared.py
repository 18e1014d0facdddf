"""Doubts about inputs that nobody declared: whether one was held, and whether records differ in that."""

from __future__ import annotations

from ..base.between import EITHER, FORMS, OPEN, UNLIKE, form_of
from .cures import again, bic_beside, furthest, on_band
from .doubts import Doubt
from .estimates import Estimates
from .misfit import refuted

__all__ = ["POSITIVE", "undeclared", "unlike", "unlike_records"]

POSITIVE = 2.0  # evidence by a difference of BIC (Kass and Raftery, 1995)


def unlike_records(fit: Estimates, name: str) -> tuple[int, str, float] | None:
    """That records of one fit, each alone, fit better with an input read as it looks.

    The record that says most and its word, and by how much BIC falls over all.
    """
    records = fit.records or ()
    if fit.again is None or len(records) < 2:
        return None
    channel, options = records[0].inputs.index(name), on_band(fit, fit.band)
    falls: dict[tuple[int, str], float] = {}
    for k, rec in enumerate(records):
        form, word = form_of(rec[name], None if rec.dt else rec.t), rec.intersample[channel]
        either = form in EITHER
        looks = (
            set() if form == "rest" else {FORMS[form], "zoh"} - {word} if either else {FORMS[form]} - {word}
        )
        for look in looks:
            kinds = (*rec.intersample[:channel], look, *rec.intersample[channel + 1 :])
            alone = again(fit, (rec,), fit.structure, options)
            other = again(fit, (rec._like(intersample=kinds),), fit.structure, options)
            if alone is None or other is None or not other.success or refuted(other):
                continue  # of two wrong models: half a sample of delay makes up for many a lag
            falls[k, look] = bic_beside(alone, alone) - bic_beside(other, alone)
            if either:
                falls[k, look] = max(falls[k, look], 0.0)
    if sum(falls.values()) <= POSITIVE:
        return None
    return (*max(falls, key=falls.__getitem__), sum(falls.values()))


def unlike(fit: Estimates) -> Doubt | None:
    """That records of one fit differ in how an input goes between samples."""
    for name in fit.inputs:
        if all(rec._seen.get(name) != UNLIKE for rec in fit.records or ()):
            continue
        if found := unlike_records(fit, name):
            k, word, fallen = found
            own = fit.intersample[fit.inputs.index(name)]
            return Doubt(
                f"Input {name!r} goes between samples in unlike ways: it is read as {own} in all records, "
                f"and record {k} looks {word} (each alone, read as they look, BIC falls by {fallen:.3g}). "
                "One fit takes one form of an input, which biases the estimates. First fit the records one "
                "by one, mf.fit_many(records, model), or leave out those that differ."
            )
    return None


def undeclared(fit: Estimates) -> Doubt | None:
    """That an input which nobody declared fits as well held, or smooth, with other estimates.

    A warning where the samples are a random walk, which say neither; most motions are what they look like.
    """
    records = fit.records or ()
    name = next((name for rec in records[:1] for name in rec.inputs if rec._seen.get(name) == OPEN), None)
    if fit.again is None or name is None:
        return None
    first, channel = records[0], records[0].inputs.index(name)
    read = first.intersample
    word, how = (
        ("smooth", "Smooth, as a motion") if read[channel] == "zoh" else ("zoh", "Held, as by a computer")
    )
    kinds = (*read[:channel], word, *read[channel + 1 :])
    changed = tuple(rec._like(intersample=kinds) for rec in records)
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
