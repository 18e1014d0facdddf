"""Figures of the replicates of one cell, with their Monte Carlo standard errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["STATUS", "Summary", "from_core", "from_samples"]

F64 = NDArray[np.float64]
STATUS = ("ok", "maxiter", "rank", "nonfinite", "raised")
USED = 2  # the first two have an estimate


@dataclass(frozen=True, eq=False)
class Summary:
    """One cell and estimator; arrays are (parameter,), `*_mcse` the standard error of the figure before.

    With e the errors of R estimates, s their standard deviation and m₂, m₄ their central moments:
    bias s/√R; sd √((m₄ − m₂²)/R)/2s; rmse √(var(e²)/R)/2rmse (both by the delta method); coverage
    √(c(1 − c)/R); median 1.2533 s/√R, as for normal estimates.
    """

    count: int
    status: NDArray[np.int64]
    bias: F64
    bias_mcse: F64
    sd: F64
    sd_mcse: F64
    rmse: F64
    rmse_mcse: F64
    median: F64
    median_mcse: F64
    coverage: F64
    coverage_mcse: F64
    nit: float
    theta: F64 | None
    bse: F64 | None
    status_each: NDArray[np.uint8] | None


def from_samples(
    theta: F64, bse: F64 | None, covered: F64, status: NDArray[np.uint8], truth: F64, nit: float, keep: bool
) -> Summary:
    """Summarise estimates (replicate, parameter); `covered` is 1, 0 or nan where there is no interval."""
    used = status < USED
    errors = theta[used] - truth
    count = int(used.sum())
    nothing = np.full(truth.size, np.nan)
    bias = sd = rmse = median = coverage = nothing
    fourth = square = nothing
    with np.errstate(invalid="ignore", divide="ignore"):
        if count:
            bias, median = errors.mean(axis=0), np.median(errors, axis=0)
            squares = np.mean(errors**2, axis=0)
            rmse = np.sqrt(squares)
            square = np.mean((errors**2 - squares) ** 2, axis=0)
            known = covered[used]
            coverage = np.where(np.isnan(known).any(axis=0) | np.isnan(truth), np.nan, known.mean(axis=0))
        if count > 1:
            sd = theta[used].std(axis=0, ddof=1)
            about = theta[used] - theta[used].mean(axis=0)
            fourth = np.mean(about**4, axis=0) - np.mean(about**2, axis=0) ** 2
        rooted = np.sqrt(count) if count else np.nan
        return Summary(
            count=count,
            status=np.bincount(status, minlength=len(STATUS)).astype(np.int64),
            bias=bias,
            bias_mcse=sd / rooted,
            sd=sd,
            sd_mcse=_ratio(np.sqrt(np.maximum(fourth, 0.0)), 2 * sd * rooted),
            rmse=rmse,
            rmse_mcse=_ratio(np.sqrt(square), 2 * rmse * rooted),
            median=median,
            median_mcse=np.sqrt(np.pi / 2) * sd / rooted,
            coverage=coverage,
            coverage_mcse=np.sqrt(coverage * (1 - coverage)) / rooted,
            nit=nit,
            theta=np.where(used[:, None], theta, np.nan) if keep else None,
            bse=bse if keep else None,
            status_each=status if keep else None,
        )


def from_core(found: Mapping[str, Any], truth: F64) -> Summary:
    """The compiled core's summary in the same form."""
    count = int(found["count"])
    rooted = np.sqrt(count) if count else np.nan
    nothing = np.full(truth.size, np.nan)

    def of(name: str) -> F64:
        return np.asarray(found[name], dtype=np.float64) if count and name in found else nothing

    known = np.where(np.isnan(truth), np.nan, 1.0)  # the core got 0 for what is unknown
    with np.errstate(invalid="ignore", divide="ignore"):
        sd, covered = of("sd"), known * of("covered")
        status = np.zeros(len(STATUS), dtype=np.int64)
        status[:-1] = np.asarray(found["status"], dtype=np.int64)
        return Summary(
            count=count,
            status=status,
            bias=known * of("bias"),
            bias_mcse=sd / rooted,
            sd=sd,
            sd_mcse=np.where(sd == 0, 0.0, of("sd_mcse")),
            rmse=known * of("rmse"),
            rmse_mcse=known * np.where(of("rmse") == 0, 0.0, of("rmse_mcse")),
            median=of("median") - truth,
            median_mcse=np.sqrt(np.pi / 2) * sd / rooted,
            coverage=covered,
            coverage_mcse=np.sqrt(covered * (1 - covered)) / rooted,
            nit=float(found["nit"]),
            theta=found.get("theta"),
            bse=found.get("bse"),
            status_each=found.get("status_each"),
        )


def _ratio(over: F64, under: F64) -> F64:
    """0/0 is 0: without noise all estimates are equal and the figure is exact."""
    return np.where(over == 0, 0.0, over / under) if np.all(np.isfinite(over)) else over / under
