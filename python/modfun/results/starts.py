"""Initial states and trends of a fit's records, with standard errors that count those of the parameters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.words import TRENDS
from .prediction import InitialState

__all__ = ["starts"]

STEP = 0.05  # of a standard error: differences by parameters


def starts(fit: Any) -> tuple[list[str], F64, F64]:
    """Names, values and variances of what belongs to each record alone.

    With z(θ) the initial state and trend that suit a record best under θ, the covariance of z at the estimate
    is that of z(θ) at a known θ and ∂z/∂θ cov θ̂ ∂z/∂θᵀ, the block of the inverse of the joint information.
    """
    cov = np.nan_to_num(fit.cov_params())
    names: list[str] = []
    values: list[F64] = []
    variances: list[F64] = []
    for k, rec in enumerate(fit.records):
        found = fit.simulate(rec)[1]
        own = found.of_record()
        slopes = _slopes(fit, rec, own.size)
        variances.append(found.variances() + np.einsum("ij,jk,ik->i", slopes, cov, slopes))
        values.append(own)
        ending = f", record {k}" if len(fit.records) > 1 else ""
        names += [f"{name}{ending}" for name in _names(fit, found)]
    return names, np.concatenate(values), np.concatenate(variances)


def _slopes(fit: Any, rec: Any, size: int) -> F64:
    """∂z/∂θ, (z, parameter), by differences; none for parameters without an error."""
    slopes = np.zeros((size, fit.params.size))
    for j, error in enumerate(fit.bse):
        if not error > 0:
            continue
        sides = []
        for sign in (1.0, -1.0):
            moved = fit.params.copy()
            moved[j] += sign * STEP * error
            sides.append(replace(fit, params=moved).simulate(rec)[1].of_record())
        slopes[:, j] = (sides[0] - sides[1]) / (2 * STEP * error)
    return slopes


def _names(fit: Any, found: InitialState) -> list[str]:
    """Of the states at the first sample, and of the trend."""
    terms = TRENDS.index(fit.trend)
    rational = fit.layout.rational
    whose = fit.outputs if rational else [f"equation {k + 1}" for k in range(found.trend.size)]
    words = ("offset" if rational else "constant", "slope")[:terms]
    behind = [f"{word} of {name}" for name in whose for word in words]
    return [f"{name}(0)" for name in fit.state_names] + behind[: found.trend.size]
