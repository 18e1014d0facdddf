"""What a study keeps of its replicates: sums that merge, and the figures made of them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import figures as core_figures
from .._core import merge_moments, quantiles
from ..base.arrays import F64, I64
from ..base.words import STATUS as ENDS

__all__ = ["STATUS", "TEXTS", "USED", "Tally", "each_once", "share_mcse", "united"]


STATUS = (*ENDS, "raised")  # a function of the user may
USED = 2  # the first two have an estimate
TEXTS = 100  # different texts kept of what functions raised; all failures are counted

_SUMS = ("intervals", "covered", "status", "fits", "iterations", "seconds")


@dataclass(frozen=True, eq=False)
class Tally:
    """Sums over some replicates; a cell and estimator that was not run holds zeros.

    Attributes
    ----------
    moments : ndarray, shape (group, level, estimator, parameter, 5)
        Of the errors of estimates that were found (estimates themselves where the truth is unknown):
        count, mean, sums of powers 2 to 4 about it.
    intervals, covered : ndarray of int, shape (group, level, estimator, parameter)
        Intervals looked at, and those that held the truth.
    status : ndarray of int, shape (group, level, estimator, 5)
        Replicates by outcome, in the order of `STATUS`.
    fits, iterations : ndarray of int, shape (group, level, estimator)
        Estimates whose iterations are known, and these together.
    bins, counts : ndarray of int, shape (occupied,)
        Occupied bins of all histograms in order, and their counts.
    seconds : ndarray, shape (estimator,)
    raised : tuple of dict
        Group, level, estimator, first replicate, text and count of the first exceptions.
    samples : ndarray, shape (replicate, group, level, estimator, parameter), or None
        Estimates, nan where there is none.
    """

    moments: F64
    intervals: I64
    covered: I64
    status: I64
    fits: I64
    iterations: I64
    bins: I64
    counts: I64
    seconds: F64
    raised: tuple[dict[str, Any], ...] = ()
    samples: F64 | None = None

    @classmethod
    def empty(cls, shape: tuple[int, int, int, int], replicates: int | None = None) -> Tally:
        """Nothing counted yet; with a number of replicates, place for their samples."""
        cells = shape[:-1]
        return cls(
            moments=np.zeros((*shape, 5)),
            intervals=np.zeros(shape, np.int64),
            covered=np.zeros(shape, np.int64),
            status=np.zeros((*cells, len(STATUS)), np.int64),
            fits=np.zeros(cells, np.int64),
            iterations=np.zeros(cells, np.int64),
            bins=np.zeros(0, np.int64),
            counts=np.zeros(0, np.int64),
            seconds=np.zeros(cells[-1]),
            samples=None if replicates is None else np.full((replicates, *shape), np.nan),
        )

    def merge(self, later: Tally) -> Tally:
        """Both together, `later` holding later replicates; samples are left out."""
        shape = self.moments.shape
        merged = merge_moments(self.moments.reshape(-1, 5), later.moments.reshape(-1, 5))
        bins, counts = united((self.bins, self.counts), (later.bins, later.counts))
        return Tally(
            moments=merged.reshape(shape),
            bins=bins,
            counts=counts,
            raised=each_once(self.raised + later.raised),
            **{name: getattr(self, name) + getattr(later, name) for name in _SUMS},
        )

    def beside(self, others: Tally) -> Tally:
        """Both together, `others` holding other estimators on the same replicates."""
        samples = self.samples
        if samples is not None and others.samples is not None:
            samples = np.where(np.isnan(samples), others.samples, samples)
        return replace(self.merge(others), samples=samples)

    def figures(self, truth: F64) -> dict[str, F64]:
        """Figures (group, level, estimator, parameter) with their standard errors, `*_mcse`.

        An error that the replicates cannot tell is nan, not the 0 that its formula gives: that of an rmse of
        one, and of an sd of two, whose fourth moment is the square of the second.
        """
        shape = truth.shape
        found = {
            name: values.reshape(shape)
            for name, values in core_figures(self.moments.reshape(-1, 5)).items()
        }  # fmt: skip
        known = np.where(np.isnan(truth), np.nan, 1.0)
        count = self.moments[..., 0]
        zero_if_unknown = np.ascontiguousarray(np.nan_to_num(truth).ravel())
        median = quantiles(self.bins, self.counts, zero_if_unknown, 0.5).reshape(shape)
        with np.errstate(invalid="ignore", divide="ignore"):
            whole = np.where((self.intervals == count) & (count > 0), known, np.nan)
            covered = whole * self.covered / self.intervals
            return {
                "bias": known * found["bias"],
                "bias_mcse": found["bias_mcse"],
                "sd": found["sd"],
                "sd_mcse": np.where(count > 2, found["sd_mcse"], np.nan),
                "rmse": known * found["rmse"],
                "rmse_mcse": np.where(count > 1, known * found["rmse_mcse"], np.nan),
                "median": known * median,
                "median_mcse": np.sqrt(np.pi / 2) * found["bias_mcse"],
                "coverage": covered,
                "coverage_mcse": share_mcse(covered, self.intervals),
            }

    @property
    def nit(self) -> F64:
        """Mean iterations (group, level, estimator)."""
        with np.errstate(invalid="ignore"):
            return self.iterations / self.fits

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All but the samples as arrays by name, for a file."""
        raised = np.frombuffer(json.dumps(self.raised).encode(), np.uint8)
        return {name: getattr(self, name) for name in (*_SUMS, "moments", "bins", "counts")} | {
            "raised": raised
        }

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]]) -> Tally:
        """From what `arrays` returned."""
        given = dict(arrays)
        raised = [{"count": 1} | one for one in json.loads(given.pop("raised").tobytes())]
        return cls(raised=tuple(raised), **given)


def each_once(raised: Sequence[dict[str, Any]]) -> tuple[dict[str, Any], ...]:
    """The first texts of each cell and estimator, one that is repeated once with its count."""
    found: dict[tuple[Any, ...], dict[str, Any]] = {}
    for one in raised:
        key = tuple(one[name] for name in ("group", "level", "estimator", "text"))
        if key in found:
            found[key] = found[key] | {"count": found[key]["count"] + one["count"]}
        elif len(found) < TEXTS:
            found[key] = one
    return tuple(found.values())


def united(one: tuple[I64, I64], two: tuple[I64, I64]) -> tuple[I64, I64]:
    """Bins and counts of both together, in order."""
    bins, counts = (np.concatenate(pair) for pair in zip(one, two, strict=True))
    if bins.size == 0:
        return bins, counts
    order = np.argsort(bins, kind="stable")
    bins, counts = bins[order], counts[order]
    first = np.flatnonzero(np.concatenate([[True], bins[1:] != bins[:-1]]))
    return bins[first], np.add.reduceat(counts, first)


def share_mcse(share: F64, of: NDArray[np.int64]) -> F64:
    """Standard error of a share; half a case is added on both sides, so that it is not 0 at 0 and at 1."""
    middle = (share * of + 0.5) / (of + 1.0)
    with np.errstate(invalid="ignore", divide="ignore"):  # of no case
        return np.asarray(np.sqrt(middle * (1 - middle) / of), dtype=np.float64)
