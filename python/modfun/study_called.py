"""Estimators of a study that are functions of the user: replicates through them, counted as in the core."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from .errors import ModfunWarning, SpecError
from .records import Record
from .results import Fit
from .study_plan import Contender, Group, Plan
from .study_tally import STATUS, TEXTS, USED, Tally, united

__all__ = ["LEVEL", "called"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Bins = tuple[I64, I64]

LEVEL = 0.95  # of the intervals whose coverage is counted
LONGEST = 2000  # characters kept of one exception


def called(
    plan: Plan,
    first: int,
    replicates: int,
    coverage: bool,
    samples: bool,
    progress: Callable[[int, int], None] | None,
) -> Tally:
    """Replicates from `first` on through functions, on the very samples that the core sees."""
    tally = Tally.empty(plan.shape, replicates if samples else None)
    users = [(k, c) for k, c in enumerate(plan.contenders) if c.call is not None]
    raised: list[dict[str, Any]] = []
    bins: list[tuple[I64, I64]] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModfunWarning)  # a study counts what a single fit would warn of
        for g in plan.groups:
            sigma = plan.sigma(g).tolist()
            cells = {(level, k): _Cell(c, g, replicates) for level in range(len(sigma)) for k, c in users}
            for r in range(replicates):
                for level, y in enumerate(g.outputs(plan.seed, first + r, sigma)):
                    rec = g.record(y)
                    for k, _ in users:
                        text = cells[level, k].take(r, rec, plan.generator(first + r, g))
                        if text is not None and len(raised) < TEXTS:
                            found = {"group": g.index, "level": level, "estimator": k, "replicate": first + r}
                            raised.append({**found, "text": text})
                if progress is not None:
                    progress(g.index * replicates + r + 1, len(plan.groups) * replicates)
            for (level, k), one in cells.items():
                where = g.index, level, k
                bins.append(one.count(tally, where, plan.columns(one.contender, g), coverage))
    counted = reduce(united, bins, (tally.bins, tally.counts))
    return replace(tally, bins=counted[0], counts=counted[1], raised=tuple(raised))


class _Cell:
    """Estimates of one function in one cell."""

    def __init__(self, contender: Contender, group: Group, replicates: int) -> None:
        self.contender = contender
        self.names = contender.names(group)
        self.truth = contender.truth[group.index]
        self.theta = np.full((replicates, len(self.names)), np.nan)
        self.covered = np.full_like(self.theta, np.nan)
        self.status = np.zeros(replicates, dtype=np.uint8)
        self.nit: list[int] = []
        self.seconds = 0.0

    def take(self, replicate: int, rec: Record, rng: np.random.Generator) -> str | None:
        """Estimate from one record; the text of what was raised, if anything was."""
        assert self.contender.call is not None
        start = time.perf_counter()
        try:
            answer = self.contender.call(rec, rng)
        except Exception as error:
            self.status[replicate] = STATUS.index("raised")
            return f"{type(error).__name__}: {error}"[:LONGEST]
        finally:
            self.seconds += time.perf_counter() - start
        theta = _parameters(answer, self.names, self.contender.name)
        self.theta[replicate] = theta
        if isinstance(answer, Fit):
            self.status[replicate] = STATUS.index(answer.status)
            self.nit.append(answer.nit)
            low, high = answer.interval(answer.params, answer.bse, LEVEL)
            self.covered[replicate] = (low <= self.truth) & (self.truth <= high)
        if not np.all(np.isfinite(theta)) and self.status[replicate] < USED:
            self.status[replicate] = STATUS.index("nonfinite")
        return None

    def count(self, tally: Tally, where: tuple[int, int, int], columns: list[int], coverage: bool) -> Bins:
        """Write into the arrays of a tally; occupied bins and their counts."""
        used = self.status < USED
        truth = np.nan_to_num(self.truth)
        figures = (np.ravel_multi_index(where, tally.covered.shape[:-1]) * tally.covered.shape[-1]) + columns
        errors = np.ascontiguousarray(self.theta[used] - truth)
        moments, bins, counts = _core.count_errors(errors, truth, figures.tolist())
        tally.moments[where][columns] = moments
        if coverage:
            known = ~np.isnan(self.covered[used])
            tally.intervals[where][columns] = known.sum(axis=0)
            tally.covered[where][columns] = (known & (self.covered[used] == 1)).sum(axis=0)
        tally.status[where] = np.bincount(self.status, minlength=len(STATUS))
        tally.fits[where], tally.iterations[where] = len(self.nit), sum(self.nit)
        tally.seconds[where[2]] += self.seconds
        if tally.samples is not None:
            kept = np.where(used[:, None], self.theta, np.nan)
            tally.samples[(slice(None), *where)][:, columns] = kept
        return bins, counts


def _parameters(answer: Any, names: tuple[str, ...], who: str) -> F64:
    """What a function returned, in the order of the parameter names."""
    if isinstance(answer, Fit):
        answer = answer.estimates()
    if isinstance(answer, Mapping):
        missing = [name for name in names if name not in answer]
        if missing:
            raise SpecError(
                f"MonteCarlo: the estimator {who!r} returned {', '.join(map(str, answer)) or 'nothing'}; "
                f"{', '.join(missing)} of {', '.join(names)} is missing: return all, or give model="
            )
        answer = [answer[name] for name in names]
    try:
        theta = np.asarray(answer, dtype=np.float64)
    except (TypeError, ValueError):
        theta = np.empty(0)
    if theta.shape != (len(names),):
        raise SpecError(
            f"MonteCarlo: the estimator {who!r} returned {type(answer).__name__} of shape {theta.shape}; "
            f"return a dict, an array of {', '.join(names)}, or a Fit"
        )
    return theta
