"""Replicates in Python: records that functions make, estimators that are functions, metrics of any estimator.

They are counted as the core counts its own.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from math import inf, isfinite
from typing import Any

import numpy as np

from .._core import count_errors
from ..base.arrays import F64, I64
from ..base.student import student_factor
from ..errors import ModfunWarning, SpecError
from ..fitting.fit import Estimator, fit_many
from ..fitting.single import fit_whole
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..results.fit import Fit
from ..results.many import FitMany
from ..systems.lti import LTI
from .contenders import Contender
from .functions import Failed, attempt, generator, number, own_errors, parameters
from .generated import Generated
from .groups import Group
from .plan import Plan
from .tally import STATUS, USED, Tally, each_once, united

__all__ = ["LEVEL", "called", "estimate"]

Bins = tuple[I64, I64]

LEVEL = 0.95  # of the intervals whose coverage is counted


def called(
    plan: Plan,
    first: int,
    replicates: int,
    coverage: bool,
    samples: bool,
    progress: Callable[[int, int], None] | None,
) -> Tally:
    """Replicates `first` to `first + replicates` of all estimators that cannot run in the core's study."""
    tally = Tally.empty(plan.shape, replicates if samples else None)
    here = [(k, c) for k, c in enumerate(plan.contenders) if plan.made or c.call is not None]
    raised: list[dict[str, Any]] = []
    bins: list[Bins] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModfunWarning)  # a study counts what a single fit would warn of
        for g in plan.groups:
            sigma = plan.sigma(g).tolist()
            cells = {
                (level, k): _Cell(plan, c, g, replicates) for level in range(len(sigma)) for k, c in here
            }
            for r in range(replicates):
                _one(plan, g, first + r, r, sigma, cells)
                if progress is not None:
                    progress(g.index * replicates + r + 1, len(plan.groups) * replicates)
            for (level, k), one in cells.items():
                one.end()
                where = g.index, level, k
                bins.append(one.count(tally, where, coverage))
                raised += [
                    {
                        "group": g.index, "level": level, "estimator": k, "replicate": first + r,
                        "text": text, "count": 1,
                    }
                    for r, text in one.texts
                ]  # fmt: skip
    raised.sort(key=lambda one: (one["group"], one["replicate"], one["level"], one["estimator"]))
    counted = reduce(united, bins, (tally.bins, tally.counts))
    return replace(tally, bins=counted[0], counts=counted[1], raised=each_once(raised))


def estimate(plan: Plan, contender: Contender, group: Group | Generated, rec: Record, replicate: int) -> Any:
    """What an estimator makes of a record: a Fit, or whatever its function returned.

    Raises
    ------
    Failed
        With the exception as its cause.
    """
    if contender.call is None:
        return attempt("", _fit_one, contender.estimators[group.index], contender.read(group, rec))
    return attempt("", contender.call, rec, generator("estimator", plan.seed, replicate, group.index))


def _one(
    plan: Plan,
    group: Group | Generated,
    replicate: int,
    row: int,
    sigma: list[float],
    cells: dict[tuple[int, int], _Cell],
) -> None:
    try:
        records = group.records(plan.seed, replicate, sigma)
    except Failed as failed:
        for cell in cells.values():
            cell.fail(row, str(failed))
        return
    for (level, _), cell in cells.items():
        cell.take(row, replicate, records[level])


class _Cell:
    """Estimates of one estimator in one cell, and metrics of them."""

    def __init__(self, plan: Plan, contender: Contender, group: Group | Generated, replicates: int) -> None:
        self.plan, self.contender, self.group = plan, contender, group
        self.names = contender.names(group)
        self.truth = contender.truth[group.index]
        self.theta = np.full((replicates, len(self.names)), np.nan)
        self.covered = np.full_like(self.theta, np.nan)
        self.metrics = np.full((replicates, len(plan.metrics)), np.nan)
        self.status = np.zeros(replicates, dtype=np.uint8)
        self.fits = self.iterations = 0
        self.texts: list[tuple[int, str]] = []
        self.seconds = 0.0
        self._waiting: list[tuple[int, Record]] = []
        self._taken: Any = None  # structure of fits that were seen to be the system's

    def fail(self, row: int, text: str) -> None:
        """There is no estimate."""
        self.status[row] = STATUS.index("raised")
        self.texts.append((row, text))

    def take(self, row: int, replicate: int, rec: Record) -> None:
        """Estimate from a record now, or where that suffices with others of its kind at the end."""
        if self.contender.call is None and not self.plan.metrics:
            self._waiting.append((row, self.contender.read(self.group, rec)))
            return
        start = time.perf_counter()
        try:
            answer = estimate(self.plan, self.contender, self.group, rec, replicate)
        except Failed as failed:
            self.fail(row, str(failed))
            return
        finally:
            self.seconds += time.perf_counter() - start
        self.theta[row] = parameters(answer, self.names, self.contender.name)
        if isinstance(answer, Fit):
            self.status[row] = STATUS.index(answer.status)
            self._refuse_another(answer)
            self.fits, self.iterations = self.fits + 1, self.iterations + answer.nit
            # It may have more parameters, in another order.
            own = [answer.param_names.index(name) for name in self.names]
            degrees = np.broadcast_to(answer.degrees, answer.bse.shape)
            # An estimate on its bound has no interval, and misses the truth.
            self._cover(np.array([row]), answer.spread[None, own], degrees[own])
        else:
            errors, wrong = own_errors(answer, self.names)
            self._cover(np.array([row]), errors[None], inf)
            if wrong:
                self.texts.append((row, wrong))
        if not np.all(np.isfinite(self.theta[row])) and self.status[row] < USED:
            self.status[row] = STATUS.index("nonfinite")
            if not isinstance(answer, Fit):
                theirs = zip(self.names, self.theta[row].tolist(), strict=True)
                given = ", ".join(f"{name} = {value:g}" for name, value in theirs if not isfinite(value))
                self.texts.append((row, f"returned {given}"))
        if self.status[row] < USED:
            self._measure(row, answer, rec)

    def _refuse_another(self, fit: Fit) -> None:
        """Refuse transfer functions whose parameters share names with those of the study, and no more."""
        structure = fit.structure
        if structure == self._taken or not isinstance(self.group, Group):
            return
        if isinstance(structure, TransferFunction) and isinstance(self.group.system, LTI):
            theirs = dict(zip(self.group.names(structure), self.group.truth(structure), strict=True))
            own = zip(self.names, self.truth, strict=True)
            other = [name for name, true in own if isfinite(true) and theirs.get(name) != true]
            if other:
                raise SpecError(
                    f"MonteCarlo: the estimator {self.contender.name!r} returned a fit of {structure}, which "
                    f"is not the system's structure: its {other[0]} is another parameter, with no true value "
                    f"in the study. Give it as mf.Estimator({structure}), return a dict with names of your "
                    "own beside model=, or count what you want as a metric"
                )
        self._taken = structure

    def _measure(self, row: int, answer: Any, rec: Record) -> None:
        for k, (name, call) in enumerate(self.plan.metrics):
            try:
                what = f"metric {name!r}"
                self.metrics[row, k] = number(attempt(what, call, answer, rec), what)
            except Failed as failed:
                self.texts.append((row, str(failed)))

    def end(self) -> None:
        """Fit what waits."""
        if not self._waiting:
            return
        start = time.perf_counter()
        rows = np.array([row for row, _ in self._waiting])
        own = self.contender.estimators[self.group.index]
        for places, found in _fit_records(own, [rec for _, rec in self._waiting], self.contender.alone):
            mine = rows[places]
            if isinstance(found, str):
                self.fail(int(mine[0]), found)
                continue
            self.theta[mine], self.status[mine] = found.params, [STATUS.index(w) for w in found.status]
            self.fits, self.iterations = self.fits + mine.size, self.iterations + int(found.nit.sum())
            self._cover(mine, found.bse, found.degrees)
        self._waiting = []
        self.seconds += time.perf_counter() - start

    def _cover(self, rows: I64, bse: F64, degrees: Any) -> None:
        with np.errstate(invalid="ignore"):
            off, reach = np.abs(self.theta[rows] - self.truth), student_factor(degrees, LEVEL) * bse
            self.covered[rows] = np.where(np.isnan(off) | np.isnan(reach), np.nan, off <= reach)

    def count(self, tally: Tally, where: tuple[int, int, int], coverage: bool) -> Bins:
        """Write into the arrays of a tally; occupied bins and their counts."""
        plan, used = self.plan, self.status < USED
        columns = plan.columns(self.contender, self.group)
        bins = [self._moments(tally, where, columns, self.theta[used], np.nan_to_num(self.truth))]
        for k in range(len(plan.metrics)):
            column = len(plan.parameters) + k
            values = self.metrics[:, [k]]
            bins.append(self._moments(tally, where, [column], values[~np.isnan(values[:, 0])], np.zeros(1)))
            if tally.samples is not None:
                tally.samples[(slice(None), *where)][:, column] = values[:, 0]
        if coverage:
            known = ~np.isnan(self.covered[used])
            tally.intervals[where][columns] = known.sum(axis=0)
            tally.covered[where][columns] = (known & (self.covered[used] == 1)).sum(axis=0)
        tally.status[where] = np.bincount(self.status, minlength=len(STATUS))
        tally.fits[where], tally.iterations[where] = self.fits, self.iterations
        tally.seconds[where[2]] += self.seconds
        if tally.samples is not None:
            tally.samples[(slice(None), *where)][:, columns] = np.where(used[:, None], self.theta, np.nan)
        return reduce(united, bins)

    def _moments(
        self, tally: Tally, where: tuple[int, int, int], columns: list[int], values: F64, truth: F64
    ) -> Bins:
        size = tally.covered.shape
        figures = np.ravel_multi_index(where, size[:-1]) * size[-1] + np.array(columns)
        errors = np.ascontiguousarray(values - truth)
        moments, bins, counts = count_errors(errors, truth, figures.tolist())
        tally.moments[where][columns] = moments
        return bins, counts


# Estimators of the core on records made in Python: batches where the sampling is common ---------------


def _fit_one(own: Estimator, rec: Record) -> Fit:
    """A fit without its warnings."""
    return fit_whole((rec,), own.model, own.options)


def _fit_records(
    own: Estimator, records: Sequence[Record], alone: bool
) -> Iterator[tuple[list[int], FitMany | str]]:
    """Fit every record, those of one sampling together unless alone; the same numbers as one by one.

    Yields
    ------
    places : list of int
        Which of the records.
    found : FitMany or str
        Their fits; or the text of what was raised, for a single record.
    """
    alike: dict[object, list[int]] = {}
    for k, rec in enumerate(records):
        together = rec.dt is not None and not alone
        alike.setdefault((rec.intervals, rec.dt, rec.intersample) if together else k, []).append(k)
    for places in alike.values():
        yield from _fits_of(own, records, places)


def _fits_of(
    own: Estimator, records: Sequence[Record], places: list[int]
) -> Iterator[tuple[list[int], FitMany | str]]:
    few = [records[k] for k in places]

    def fit_all(some: Sequence[Record]) -> FitMany:
        return fit_many(some, own.model, threads=1, progress=False, **own.options.given())

    try:
        yield places, attempt("", fit_all, few)
    except Failed as failed:
        if len(places) == 1:
            yield places, str(failed)
            return
        for place in places:  # one may stand still where the others move
            yield from _fits_of(own, records, [place])
