"""Metrics of a study: what functions of the user said of every estimate and its record."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64, I64
from ..base.names import nearest
from ..base.tables import Table
from ..errors import SpecError

__all__ = ["Metric", "Metrics"]


@dataclass(frozen=True, eq=False)
class Metric:
    """Figures of one metric; arrays are (cell…, estimator), `*_mcse` the Monte Carlo standard error.

    Attributes
    ----------
    mean, mean_mcse : ndarray
        Standard error sd/√R over R values; that of a share, with half a case added on both sides, where all
        are 0 or all are 1.
    sd, sd_mcse : ndarray
        Standard error √((m₄ − m₂²)/R)/2sd (delta method).
    count : ndarray of int
        Values R.
    failures : ndarray of int
        Estimates of which there is no value: the function raised, or returned a number that is not finite.
    samples : ndarray, (cell…, estimator, replicate), or None
        Values, nan where there is none; None unless kept.
    """

    mean: F64
    mean_mcse: F64
    sd: F64
    sd_mcse: F64
    count: I64
    failures: I64
    samples: F64 | None


class Metrics(Mapping[str, Metric]):
    """Metrics by name; prints as a table."""

    def __init__(self, found: Mapping[str, Metric], axes: Mapping[str, tuple[object, ...]]) -> None:
        self._found = dict(found)
        self._axes = {name: labels for name, labels in axes.items() if name != "parameter"}

    def __getitem__(self, name: str) -> Metric:
        if name not in self._found:
            raise SpecError(f"the study has no metric {name!r}; {nearest(name, list(self._found))}")
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)

    def table(self) -> Table:
        """One row per cell, estimator and metric."""
        figures = ("mean", "mean_mcse", "sd", "sd_mcse", "count", "failures")
        columns: dict[str, list[object]] = {name: [] for name in (*self._axes, "metric", *figures)}
        for where in np.ndindex(*(len(labels) for labels in self._axes.values())):
            for name, one in self._found.items():
                for axis, k in zip(self._axes, where, strict=True):
                    columns[axis].append(self._axes[axis][k])
                columns["metric"].append(name)
                for figure in figures:
                    columns[figure].append(getattr(one, figure)[where].item())
        return Table(columns)

    def __repr__(self) -> str:
        return repr(self.table()) if self._found else "no metrics"

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()
