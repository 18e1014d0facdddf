"""Two estimators of a study compared on the same records, with the uncertainty of the comparison."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.names import nearest
from ..base.tables import Table
from ..errors import SpecError
from .figures import Figures
from .tally import share_mcse

__all__ = ["paired"]


def paired(res: Figures, first: str, second: str) -> Table:
    """Differences of the figures of two estimators; see `Results.compare`."""
    for name in (first, second):
        if name not in res.estimators:
            raise SpecError(f"compare: there is no estimator {name!r}; {nearest(name, list(res.estimators))}")
    if first == second:
        raise SpecError(f"compare: {first!r} is compared with itself; name two of {list(res.estimators)}")
    if res.samples is None:
        raise SpecError('compare: estimates were not kept; run the study with keep="samples"')
    axes = {name: own for name, own in res.axes.items() if name not in ("estimator", "parameter")}
    figures = ("rmse", "rmse_mcse", "rmse_z", "bias", "bias_mcse", "bias_z", "closer", "closer_mcse")
    columns: dict[str, list[Any]] = {name: [] for name in (*axes, "parameter", *figures, "count")}
    both = [res.estimators.index(name) for name in (first, second)]
    for where in np.ndindex(*(len(labels) for labels in axes.values())):
        for k, parameter in enumerate(res.param_names):
            errors = np.array([res.samples[(*where, i)][:, k] - res.truth[(*where, i, k)] for i in both])
            errors = errors[:, np.isfinite(errors).all(axis=0)]
            if errors.shape[1] < 2:
                continue  # another structure's parameter, or no truth
            for (axis, labels), at in zip(axes.items(), where, strict=True):
                columns[axis].append(labels[at])
            columns["parameter"].append(parameter)
            for name, value in zip(figures, _differences(errors), strict=True):
                columns[name].append(value)
            columns["count"].append(errors.shape[1])
    return Table(
        columns,
        title=f"{first} less {second} on the same records, {res.replicates} replicates; closer: share in "
        f"which {first} is nearer to the true value",
    )


def _differences(errors: F64) -> tuple[float, ...]:
    """Differences with their errors and ratios, from the errors of two estimators (2, replicate)."""
    count = errors.shape[1]
    size = np.sqrt(np.mean(errors**2, axis=1, keepdims=True))
    # What one replicate adds to the difference of the roots, to first order (delta method).
    moved = np.diff((errors**2 / np.where(size > 0, size, 1.0) / 2)[::-1], axis=0)
    of_rmse = float(size[0, 0] - size[1, 0]), float(moved.std(ddof=1) / np.sqrt(count))
    apart = errors[0] - errors[1]
    of_bias = float(apart.mean()), float(apart.std(ddof=1) / np.sqrt(count))
    nearer = np.sign(np.abs(errors[1]) - np.abs(errors[0])) / 2 + 0.5  # half where both are as far
    share = float(nearer.mean())
    error = float(share_mcse(np.array(share), np.array(count)))
    return *of_rmse, _ratio(*of_rmse), *of_bias, _ratio(*of_bias), share, error


def _ratio(value: float, error: float) -> float:
    return value / error if error > 0 else float("nan")
