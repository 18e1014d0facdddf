"""Whether the records of a term selection follow one equation, and what the odd ones have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from ..errors import ModfunError
from ..records.record import Record
from ..results.diagnosis import level_ratio
from ..results.unlike_records import unlike_records
from .term_selection import TermSelection, fit_terms

__all__ = ["unlike_terms"]

FAR = 4.0  # of the power of the noise, which whole libraries leave: a record is odd, or a term is missing
MOST = 16  # records that are searched alone


def unlike_terms(records: Sequence[Record], excess: float, alone: Callable[[Record], TermSelection]) -> str:
    """That records which one equation explains alone are not explained together; "" where they are.

    Of a record in another unit, or with exchanged columns, no term of a library is right for all: a constant
    was all that was chosen, and "a term is missing" all that was said.
    """
    if not (excess > FAR and 1 < len(records) <= MOST):
        return ""
    found: list[TermSelection] = []
    for rec in records:
        try:
            found.append(alone(rec))
        except ModfunError:
            return ""
    texts = [one.equation.texts for one in found]
    usual, count = Counter(texts).most_common(1)[0]
    explained = [
        level_ratio(one.fit) ** 2 < FAR for one, own in zip(found, texts, strict=True) if own == usual
    ]
    if count < 2 or 2 * count < len(records) or not all(explained):
        return ""
    one = found[texts.index(usual)]
    others = [f"record {k}: {', '.join(own)}" for k, own in enumerate(texts) if own != usual]
    where = [str(k) for k, own in enumerate(texts) if own == usual]
    each = f"records {', '.join(where)} are" if others else "each is"
    told = f"The records do not follow one equation. Alone, {each} explained by {', '.join(usual)}"
    told += f"{''.join(f'; {other}' for other in others)}."
    try:
        doubt = unlike_records(fit_terms(records, one.equation, one.options))
    except ModfunError:
        doubt = None
    return f"{told} {doubt.text}" if doubt else f"{told} See their units and columns."
