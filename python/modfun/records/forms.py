"""How the inputs of several records go between samples: in each, in common, and where nobody declared it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from ..base.between import MIXED
from .batches import Batch
from .samples import Samples

__all__ = ["Forms", "agreed", "forms_of", "functions_alone", "in_common"]

Own = TypeVar("Own", bound=Samples)
Forms = tuple[tuple[str, ...], ...]


def forms_of(data: Batch | Sequence[Samples]) -> Forms:
    """Return the words of each record; those of one where all are alike."""
    if isinstance(data, Batch):
        return (data.intersample,)
    first = data[0].intersample
    if all([rec.intersample == first for rec in data]):
        return (first,)
    return tuple([rec.intersample for rec in data])


def in_common(forms: Forms) -> tuple[str, ...]:
    """Return the word of each input, "mixed" where records differ."""
    if len(forms) == 1:
        return forms[0]
    return tuple([words[0] if len({*words}) == 1 else MIXED for words in zip(*forms, strict=True)])


def functions_alone(records: Sequence[Samples]) -> bool:
    """Return whether smooth inputs of all records are known as functions."""
    words = [
        (rec, name, word) for rec in records for name, word in zip(rec.inputs, rec.intersample, strict=True)
    ]
    return bool(words) and all(word != "smooth" or name in rec.functions for rec, name, word in words)


def agreed(records: Sequence[Own], *, alike: bool = False) -> tuple[Own, ...]:
    """Return records of the same inputs, of which undeclared ones go as the others where these tell.

    What one record declares holds for all, unless others declare other words. An input at rest goes as in the
    record in which it moves most; where all are `alike`, every one does.
    """
    words = [list(rec.intersample) for rec in records]
    forms = [dict(rec._seen) for rec in records]
    for k, name in enumerate(records[0].inputs if records else ()):
        said = {rec.intersample[k] for rec in records if name not in {*rec._seen, *rec.functions}}
        seen = [n for n, rec in enumerate(records) if name in rec._seen]
        most = max(seen, key=lambda n: records[n].u[k].var() * records[n].u[k].size, default=0)
        for n in seen:
            if len(said) == 1:
                (words[n][k],) = said
                del forms[n][name]
            elif alike or forms[n][name] == "rest":
                words[n][k], forms[n][name] = records[most].intersample[k], records[most]._seen[name]
    return tuple(
        rec
        if own == rec._seen and (*kinds,) == rec.intersample
        else rec._like(intersample=(*kinds,), _seen=own)
        for rec, kinds, own in zip(records, words, forms, strict=True)
    )
