"""How the inputs of several records go between samples: in each, in common, and where nobody declared it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from ..base.between import MIXED, liveliest
from .batches import Batch
from .samples import Samples

__all__ = ["Forms", "agreed", "forms_of", "in_common"]

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


def agreed(records: Sequence[Own]) -> tuple[Own, ...]:
    """Return records of the same inputs with one word for each that was not declared.

    What a record declares holds for all. Else the record in which the input moves most decides, since it
    may rest in the others. Records that declare different words stay as they are.
    """
    words = []
    for k, name in enumerate(records[0].inputs):
        said = {rec.intersample[k] for rec in records if name not in rec._seen}
        seen = {rec.intersample[k] for rec in records}
        if len(said) > 1:
            return tuple(records)
        if not said and len(seen) > 1:
            said = {liveliest([rec.intersample[k] for rec in records], [rec.u[k] for rec in records])}
        words.append((said or seen).pop())
    kinds = tuple(words)
    return tuple(rec if rec.intersample == kinds else rec._like(intersample=kinds) for rec in records)
