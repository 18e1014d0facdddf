"""Missing values of columns that are read: refused, left out where they are outputs, or held."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.arrays import F64
from ..base.names import nearest
from ..errors import DataError, SpecError
from .columns import Columns

__all__ = ["held", "marks_of", "refuse_missing", "refuse_other_word"]

WORDS = ("refuse", "mask", "hold")  # what may be done with missing values


def refuse_other_word(missing: str) -> None:
    """Refuse a word for missing values that is none.

    Raises
    ------
    SpecError
    """
    if missing not in WORDS:
        raise SpecError(f"read: missing={missing!r} is unknown; {nearest(missing, WORDS)}")


def marks_of(given: str | Sequence[str] | None) -> frozenset[str]:
    """Texts that mark missing values, in lower case."""
    texts = [given] if isinstance(given, str) else given or ()
    return frozenset(str(text).strip().lower() for text in texts)


def held(values: F64) -> F64:
    """Values of which missing ones are the last before; missing ones at the beginning stay."""
    good = np.isfinite(values)
    last = np.maximum.accumulate(np.where(good, np.arange(len(values)), -1))
    return np.where(last < 0, values, values[np.maximum(last, 0)])


def refuse_missing(table: Columns, name: str, values: F64, role: str, missing: str) -> None:
    """Refuse missing values of a column; `role`: of an output, of one that may be held, or neither.

    Raises
    ------
    DataError
        The message names their places.
    """
    bad = np.flatnonzero(~np.isfinite(values))
    if not bad.size:
        return
    places = ", ".join(table.place(int(row)) for row in bad[:5]) + (", ..." if bad.size > 5 else "")
    cure = "fill or cut these rows, or read the stretches between them as separate records"
    if role == "output":
        cure += ", or leave them out with missing='mask'"
    if role == "held" and missing == "hold":
        cure = "there is no value before that may be held: fill or cut these rows"
    elif role == "held":
        cure += ", or give missing='hold' if an empty cell means that the last value still holds"
    raise DataError(
        f"{table.label}: column {name!r} has {bad.size} missing or infinite values ({places}); {cure}"
    )
