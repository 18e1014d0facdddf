"""One replicate of a study, made again from its address."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.names import nearest
from ..errors import DataError, ModfunWarning, SpecError
from ..records.record import Record
from .axes import Axis
from .called import estimate
from .functions import Failed
from .groups import Group
from .plan import Plan
from .work import noise

__all__ = ["replicate"]


def replicate(
    plan: Plan, draw: str, replicates: int, number: int, cell: Mapping[str, Any]
) -> tuple[Record, dict[str, Any]]:
    """Record and fits of a replicate in a cell of a study; see `Results.replicate`."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer):
        raise SpecError(f"replicate: {number!r} is not a number of a replicate; give 0 to {replicates - 1}")
    if not 0 <= number < replicates:
        raise SpecError(f"replicate: {number} is outside of 0 to {replicates - 1}")
    known = [a.name for a in plan.axes if a.labels != ("",)]
    for name in cell:
        if name not in known:
            raise SpecError(f"replicate: there is no axis {name!r}; {nearest(name, known)}")
    at = [_position(a, cell) for a in plan.axes]
    group = plan.groups[int(np.ravel_multi_index(at[:-1], [len(a.labels) for a in plan.axes[:-1]]))]
    sigma = float(plan.sigma(group)[at[-1]])
    fits: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModfunWarning)
        try:
            if draw == "coefficients" and isinstance(group, Group):
                size = sigma * group.unit[:, None]
                rec = group.record(
                    group.clean(plan.seed, int(number)) + size * noise(plan, group, int(number))
                )
            else:
                rec = group.records(plan.seed, int(number), [sigma])[0]
        except Failed as failed:
            raise DataError(f"replicate: {number} has no record: {failed}") from failed.__cause__
        for c in plan.contenders:
            try:
                fits[c.name] = estimate(plan, c, group, rec, int(number))
            except Failed as failed:
                fits[c.name] = failed.__cause__
    return rec, fits


def _position(axis: Axis, cell: Mapping[str, Any]) -> int:
    if axis.name not in cell:
        if len(axis.labels) == 1:
            return 0
        labels = ", ".join(map(repr, axis.labels))
        raise SpecError(
            f"replicate: which {axis.name}? Give {axis.name}= one of {labels} "
            f"(in the shell --cell {axis.name}={axis.labels[0]})"
        )
    return axis.index(cell[axis.name])
