"""A part of a study's results: some labels of some axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from ..base.arguments import is_sequence
from ..base.names import nearest
from ..base.tables import Table
from ..errors import SpecError
from .axes import Axis
from .figures import Figures
from .metrics import Metric, Metrics

__all__ = ["selected"]

Own = TypeVar("Own", bound=Figures)
_WHOLE = {
    "axes", "samples", "status", "metrics", "seconds", "messages", "replicates", "draw", "_plan", "_within",
}  # fmt: skip


def selected(res: Own, labels: Mapping[str, Any]) -> Own:
    """The results of these labels alone; see `Results.sel`."""
    for name in labels:
        if name not in res.axes:
            raise SpecError(f"sel: there is no axis {name!r}; {nearest(name, list(res.axes))}")
    at = {name: _positions(Axis(name, own, True), labels.get(name, own)) for name, own in res.axes.items()}
    axes = {name: tuple(own[k] for k in at[name]) for name, own in res.axes.items()}
    every = tuple(at.values())

    def cut(array: Any) -> Any:
        return res.cut(array, every[: array.ndim])

    figures = {f.name: cut(getattr(res, f.name)) for f in fields(Figures) if f.name not in _WHOLE}
    samples = None if res.samples is None else res.cut(res.samples, (*every[:-1], None, every[-1]))
    metrics = {name: _metric(one, cut) for name, one in res.metrics.items()}
    within = (
        every
        if res._within is None
        else tuple(tuple(old[k] for k in new) for old, new in zip(res._within, every, strict=True))
    )
    return replace(
        res,
        axes=axes,
        **figures,
        samples=samples,
        status={word: cut(counts) for word, counts in res.status.items()},
        metrics=Metrics(metrics, axes),
        seconds={name: res.seconds[name] for name in axes["estimator"]},
        messages=_messages(res.messages, axes),
        _within=within,
    )  # fmt: skip


def _positions(axis: Axis, given: Any) -> tuple[int, ...]:
    wanted = given if is_sequence(given) else (given,)
    if not len(wanted):
        raise SpecError(f"sel: {axis.name}=[] leaves nothing; give at least one label")
    return tuple(axis.index(label) for label in wanted)


def _metric(one: Metric, cut: Any) -> Metric:
    parts: dict[str, Any] = {f.name: getattr(one, f.name) for f in fields(Metric)}
    own: dict[str, Any] = {name: None if array is None else cut(array) for name, array in parts.items()}
    return Metric(**own)


def _messages(table: Table, axes: Mapping[str, Sequence[Any]]) -> Table:
    """The texts of these cells and estimators; the title counts those of the whole study."""
    keep = np.array([all(row[n] in own for n, own in axes.items() if n in row) for row in table], dtype=bool)
    return Table({name: table[name][keep] for name in table.columns}, title=table.title)
