"""Estimators of the compiled core on records made in Python: batches where the sampling is common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..errors import ModfunError
from ..fitting.fit import Estimator, fit_many, fit_quietly
from ..records.record import Record
from ..results.fit import Fit
from ..results.many import FitMany

__all__ = ["fit_one", "fit_records"]


def fit_one(own: Estimator, rec: Record) -> Fit:
    """A fit without its warnings."""
    return fit_quietly((rec,), own.model, own.options)


def fit_records(own: Estimator, records: Sequence[Record]) -> Iterator[tuple[list[int], FitMany | str]]:
    """Fit every record, those of one sampling together; the same numbers as one by one.

    Yields
    ------
    places : list of int
        Which of the records.
    found : FitMany or str
        Their fits; or the text of what was raised, for a single record.
    """
    alike: dict[object, list[int]] = {}
    for k, rec in enumerate(records):
        alike.setdefault((rec.intervals, rec.dt, rec.intersample) if rec.dt is not None else k, []).append(k)
    for places in alike.values():
        yield from _fits(own, records, places)


def _fits(
    own: Estimator, records: Sequence[Record], places: list[int]
) -> Iterator[tuple[list[int], FitMany | str]]:
    few = [records[k] for k in places]
    try:
        yield places, fit_many(few, own.model, threads=1, progress=False, **own.options.given())
    except ModfunError as error:
        if len(places) == 1:
            yield places, f"{type(error).__name__}: {error}"
            return
        for place in places:  # one may stand still where the others move
            yield from _fits(own, records, [place])
