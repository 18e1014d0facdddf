"""The figures of a Monte Carlo study."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import plot
from ..base.arguments import public
from ..base.optional import optional
from ..base.tables import Table
from ..equations.written import Written
from ..errors import DataError, SpecError
from ..experiments.bound import crlb
from ..records.record import Record
from ..systems.lti import LTI
from .axes import Axis
from .contenders import Contender
from .groups import Group
from .metrics import Metric, Metrics
from .plan import Plan
from .tally import STATUS, USED, Tally

__all__ = ["Results"]

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@public
@dataclass(frozen=True, eq=False, repr=False)
class Results:
    """Figures of a study; arrays are (cell…, estimator, parameter), `*_mcse` the Monte Carlo error.

    The axes of the cells are those given as a dict or a list, in the order system, input, initial_state,
    nsr; `axes` names them all. Estimates that were found (status "ok", or "maxiter": the iteration did not
    settle) enter the figures, the others are counted in `failures`. A few that did not settle may make most
    of a spread; tables that have any count them in a column `maxiter`. A standard error that the replicates
    are too few to tell is nan.

    Attributes
    ----------
    axes : dict of str to tuple
        Labels of each axis, estimator and parameter last.
    truth : ndarray
        True parameters; nan where the structure fitted does not hold the system, as are then bias, median,
        rmse and coverage.
    bias, bias_mcse : ndarray
        Mean error. Standard error sd/√R.
    sd, sd_mcse : ndarray
        Standard deviation over R replicates. Standard error √((m₄ − m₂²)/R)/2sd (delta method) with the
        central moments m₂, m₄ of the estimates.
    rmse, rmse_mcse : ndarray
        Root mean square error. Standard error √(var(e²)/R)/2rmse (delta method).
    median, median_mcse : ndarray
        Median error, of counts in bins 0.4 to 0.8 % of the error wide; nan beyond 2²⁰ times the truth.
        Standard error 1.2533 sd/√R, as for normal estimates.
    coverage, coverage_mcse : ndarray
        Share c of 95 % intervals that hold the truth: those of each estimator's `cov_type`, HC3's unless
        "nonrobust" was asked for; of functions, those of the Fit that they returned. Standard error
        √(c̃(1 − c̃)/R) with half a case added on both sides, c̃ = (cR + ½)/(R + 1), so that it is not 0 where
        all or none do.
    failures : ndarray of int, (cell…, estimator)
        Replicates without an estimate.
    status : dict of str to ndarray of int, (cell…, estimator)
        Replicates by outcome: "ok", "maxiter", "rank", "nonfinite", "raised".
    nit : ndarray, (cell…, estimator)
        Mean number of iterations.
    samples : ndarray, (cell…, estimator, replicate, parameter), or None
        Estimates, nan where there is none; None unless kept.
    metrics : dict of str to Metric
        What the study's `metrics` said: mean and sd of each over (cell…, estimator).
    seconds : dict of str to float
        Time of each estimator, noise included, of all processes together. Methods in the compiled core
        share their noise; their common time is split as they take alone.
    messages : Table
        What functions raised, and why records or metrics are missing: cell, estimator, replicate, text; of
        the first hundred. `status` counts all.
    replicates : int
    """

    axes: dict[str, tuple[Any, ...]]
    truth: F64
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
    failures: I64
    status: dict[str, I64]
    nit: F64
    samples: F64 | None
    metrics: Metrics
    seconds: dict[str, float]
    messages: Table
    replicates: int
    draw: str
    _plan: Plan = field(repr=False)

    @classmethod
    def collect(
        cls, plan: Plan, tally: Tally, replicates: int, draw: str, samples: F64 | None = None
    ) -> Results:
        """Results from sums; samples are (replicate, group, level, estimator, parameter)."""
        given = [a for a in plan.axes if a.given]
        names = tuple(c.name for c in plan.contenders)
        axes = {a.name: a.labels for a in given} | {"estimator": names, "parameter": plan.parameters}
        by_word = {word: _shaped(tally.status[..., k], given) for k, word in enumerate(STATUS)}
        count = len(plan.parameters)  # metrics follow them
        figures = {name: _shaped(values, given) for name, values in tally.figures(plan.truth).items()}
        if samples is not None:
            sizes = [len(a.labels) for a in given]
            samples = samples.reshape(len(samples), *sizes, *samples.shape[3:])
            samples = np.moveaxis(samples, 0, -2)
            samples.flags.writeable = False
        return cls(
            axes=axes,
            truth=_shaped(plan.truth[..., :count], given),
            **{name: values[..., :count] for name, values in figures.items()},
            failures=_shaped(tally.status[..., USED:].sum(axis=-1), given),
            status=by_word,
            nit=_shaped(tally.nit, given),
            samples=None if samples is None else samples[..., :count],
            metrics=_metrics(plan, tally, samples, axes),
            seconds=dict(zip(names, tally.seconds.tolist(), strict=True)),
            messages=_messages(plan, tally),
            replicates=replicates,
            draw=draw,
            _plan=plan,
        )

    @property
    def param_names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.axes["parameter"]

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators."""
        return self.axes["estimator"]

    @cached_property
    def crlb(self) -> F64:
        """Cramér–Rao bound under white noise as standard deviations, (cell…, estimator, parameter).

        With the initial state (and the estimator's trend) unknown, from all samples; nan where the noise or
        the records are the user's, the structure does not hold the system, or the initial state of equations
        is drawn. No estimator need reach it in a narrow band, and a biased one may pass it.
        """
        plan = self._plan
        array = np.full((*plan.shape[:-1], len(plan.parameters)), np.nan)
        known: dict[Any, F64] = {}
        for g in plan.groups:
            if not isinstance(g, Group) or g.noise is not None:
                continue  # there is no system, or noise whose covariance nobody knows
            rec = g.record(g.rest.y)
            for k, c in enumerate(plan.contenders):
                key = (g.index, c.structures[g.index], c.trend)
                if key not in known:
                    try:
                        known[key] = _bound(g, c, rec)
                    except (SpecError, DataError):
                        known[key] = np.full(len(c.names(g)), np.nan)
                array[g.index, :, k, plan.columns(c, g)] = known[key][:, None] * plan.sigma(g)
        bound: F64 = _shaped(array, [a for a in plan.axes if a.given])
        return bound

    # Tables ----------------------------------------------------------------------------------------

    def table(self) -> Table:
        """Every figure with its Monte Carlo standard error: a row a cell, estimator and parameter.

        `maxiter`, where there are any, counts estimates that did not settle and are in the figures.
        """
        columns: dict[str, list[Any]] = {name: [] for name in self.axes}
        figures = ("bias", "sd", "rmse", "median", "coverage")
        columns["true"] = []
        for name in figures:
            columns |= {name: [], f"{name}_mcse": []}
        counted = self._counted()
        columns |= {"crlb": [], **{name: [] for name in counted}}
        for where, labels in self._rows():
            for k, name in enumerate(self.param_names):
                if np.isnan(self.sd[where][k]) and np.isnan(self.truth[where][k]):
                    continue  # another structure's parameter
                for axis, label in zip(self.axes, (*labels, name), strict=True):
                    columns[axis].append(label)
                columns["true"].append(self.truth[where][k])
                for figure in figures:
                    columns[figure].append(getattr(self, figure)[where][k])
                    columns[f"{figure}_mcse"].append(getattr(self, f"{figure}_mcse")[where][k])
                columns["crlb"].append(self.crlb[where][k])
                for name, counts in counted.items():
                    columns[name].append(int(counts[where]))
        return Table(columns, title=self._title())

    def relative(self) -> Table:
        """Figures relative to the true parameters, in %, root mean square over the parameters.

        The report's footnote 10: bias √(mean_j (bias_j/θ_j)²)·100 %; sd, rmse and crlb alike. A row a cell
        and estimator. Without any bias the figure is not 0 but about sd/√R, its Monte Carlo noise. The
        standard errors are those of the delta method with fully correlated parameters, so at most too
        large. `maxiter` as in `table`.
        """
        columns: dict[str, list[Any]] = {name: [] for name in self.axes if name != "parameter"}
        figures = ("bias", "sd", "rmse", "crlb")
        for name in figures:
            columns[name] = []
            if name != "crlb":
                columns[f"{name}_mcse"] = []
        counted = self._counted()
        columns |= {name: [] for name in counted}
        for where, labels in self._rows():
            for axis, label in zip(self.axes, labels, strict=False):
                columns[axis].append(label)
            for figure in figures:
                value, error = self._relative(figure, where)
                columns[figure].append(value)
                if figure != "crlb":
                    columns[f"{figure}_mcse"].append(error)
            for name, counts in counted.items():
                columns[name].append(int(counts[where]))
        return Table(columns, title=f"{self._title()}; % of the true parameters")

    def _counted(self) -> dict[str, I64]:
        """Outcomes that tables count: failures, and what did not settle where anything did not."""
        unsettled = self.status["maxiter"]
        return {"failures": self.failures} | ({"maxiter": unsettled} if np.any(unsettled) else {})

    def _relative(self, figure: str, where: tuple[int, ...]) -> tuple[float, float]:
        truth = self.truth[where]
        own = ~np.isnan(truth)
        if not own.any() or np.any(truth[own] == 0):
            return float("nan"), float("nan")
        values = 100 * getattr(self, figure)[where][own] / truth[own]
        size = float(np.sqrt(np.mean(values**2)))
        if figure == "crlb":
            return size, float("nan")
        errors = 100 * getattr(self, f"{figure}_mcse")[where][own] / np.abs(truth[own])
        if size == 0:
            return 0.0, float(np.sqrt(np.mean(errors**2)))
        return size, float(np.sum(np.abs(values) * errors) / (values.size * size))

    def _rows(self) -> Iterator[tuple[tuple[int, ...], tuple[Any, ...]]]:
        used = [labels for name, labels in self.axes.items() if name != "parameter"]
        for where in product(*(range(len(labels)) for labels in used)):
            yield where, tuple(labels[k] for labels, k in zip(used, where, strict=True))

    def _title(self) -> str:
        return f"{self.replicates} replicates, seed {self._plan.seed}"

    def to_dict(self) -> dict[str, Any]:
        """All figures as plain Python values, tables by column."""
        return {
            "replicates": self.replicates,
            "seed": self._plan.seed,
            "draw": self.draw,
            "axes": {name: list(labels) for name, labels in self.axes.items()},
            "table": self.table().to_dict(),
            "relative": self.relative().to_dict(),
            "status": {word: counts.tolist() for word, counts in self.status.items()},
            "metrics": self.metrics.table().to_dict(),
            "messages": self.messages.to_dict(),
            "seconds": self.seconds,
        }

    def to_pandas(self) -> Any:
        """The rows of `table` as a pandas.DataFrame (extra ``pandas``)."""
        return self.table().to_pandas()

    def to_xarray(self) -> Any:
        """All figures as an xarray.Dataset (extra ``xarray``).

        Dimensions are those of `axes`, and replicate where samples were kept; each figure has its
        Monte Carlo standard error beside it as ``<figure>_mcse``. Those of a metric are ``<metric>_mean``
        and so on.
        """
        xarray = optional("xarray", "xarray", "Results.to_xarray")
        cell = tuple(name for name in self.axes if name != "parameter")
        figures = ("bias", "sd", "rmse", "median", "coverage")
        names = ["truth", *(n for name in figures for n in (name, f"{name}_mcse")), "crlb"]
        variables = {name: ((*cell, "parameter"), getattr(self, name)) for name in names}
        variables |= {name: (cell, getattr(self, name)) for name in ("failures", "nit")}
        variables |= {f"status_{word}": (cell, counts) for word, counts in self.status.items()}
        for name, metric in self.metrics.items():
            shown = [n for word in ("mean", "sd") for n in (word, f"{word}_mcse")]
            shown += ["count", "failures"]
            variables |= {f"{name}_{figure}": (cell, getattr(metric, figure)) for figure in shown}
        if self.samples is not None:
            variables["samples"] = ((*cell, "replicate", "parameter"), self.samples)
        return xarray.Dataset(
            variables,
            coords={name: list(labels) for name, labels in self.axes.items()},
            attrs={"replicates": self.replicates, "seed": self._plan.seed},
        )

    # One replicate ---------------------------------------------------------------------------------

    def replicate(self, number: int, **cell: Any) -> tuple[Record, dict[str, Any]]:
        """One replicate made again from its address, and fitted.

        Parameters
        ----------
        number : int
            From 0 to replicates − 1.
        **cell
            Label of each axis with several: ``system="eq24", nsr=0.2``.

        Returns
        -------
        record : Record
        fits : dict of str to Fit
            By estimator; what a function returned as it is, or the exception that was raised.

        Raises
        ------
        SpecError
            A cell that is not in the study, or noise that was drawn as coefficients.
        DataError
            A function of yours made no record in this replicate; its own exception is the cause.
        """
        from .replicate import replicate

        return replicate(self._plan, self.draw, self.replicates, number, cell)

    def report(
        self,
        path: str | os.PathLike[str],
        *,
        directory: str | os.PathLike[str] | None = None,
        title: str | None = None,
    ) -> Path:
        """Write a page about the study: tables, figure, failures, provenance (extra ``report``).

        Parameters
        ----------
        path : path
            Ends in .html; a page that is there is replaced, once the new one is whole.
        directory : path, optional
            That of the study: hashes of its files, its runs and study.toml join the provenance.
        title : str, optional

        Returns
        -------
        Path
            Where it was written.

        Raises
        ------
        SpecError
            A place that cannot be written, or no directory of a study.
        ImportError
            jinja2 or matplotlib is not installed.
        """
        from .page import write_study

        return write_study(self, path, directory=directory, title=title)

    # Looks -----------------------------------------------------------------------------------------

    def plot(self, ax: Any = None) -> Any:
        """Draw bias and standard deviation against NSR, as the report's Fig. 2; see `mf.plot.study`."""
        return plot.study(self, ax=ax)

    def __repr__(self) -> str:
        return repr(self._shown())

    def _repr_html_(self) -> str:
        return self._shown()._repr_html_()

    def _shown(self) -> Table:
        return self.relative() if np.any(np.isfinite(self.truth)) else self.table()


def _bound(group: Group, contender: Contender, rec: Record) -> F64:
    """Cramér–Rao bound for noise of unit standard deviation."""
    structure, system = contender.structures[group.index], group.system
    if isinstance(system, LTI) and isinstance(structure, Written):
        raise SpecError("crlb: for a linear system the bound is that of a TransferFunction's coefficients")
    if isinstance(system, LTI):
        return crlb(system, rec, sigma=group.unit, trend=contender.trend, model=structure).sd
    if structure != system.structure or group.drawn or group.state is not None:
        raise SpecError("crlb: the structure is not that of the system, or its initial state is drawn")
    return crlb(system, rec, sigma=group.unit, trend=contender.trend, start=group.rest.start).sd


def _shaped(array: NDArray[Any], given: Sequence[Axis]) -> Any:
    """(group, level, estimator, …) as (cell…, estimator, …), read only."""
    shaped = array.reshape(*(len(a.labels) for a in given), *array.shape[2:])
    shaped.flags.writeable = False
    return shaped


def _metrics(plan: Plan, tally: Tally, samples: F64 | None, axes: dict[str, tuple[Any, ...]]) -> Metrics:
    """Figures of the metrics, which stand behind the parameters; their truth being 0, moments are theirs."""
    given = [a for a in plan.axes if a.given]
    used = tally.status[..., :USED].sum(axis=-1)
    zero = tally.figures(np.zeros(plan.shape))
    found = {}
    for k, (name, _) in enumerate(plan.metrics):
        column = len(plan.parameters) + k
        values = {n: _shaped(v[..., column], given) for n, v in zero.items()}
        count = tally.moments[..., column, 0].astype(np.int64)
        found[name] = Metric(
            mean=values["bias"],
            mean_mcse=values["bias_mcse"],
            **{n: values[n] for n in ("sd", "sd_mcse")},
            count=_shaped(count, given),
            failures=_shaped(used - count, given),
            samples=None if samples is None else samples[..., column],
        )
    return Metrics(found, axes)


def _messages(plan: Plan, tally: Tally) -> Table:
    sizes = [len(a.labels) for a in plan.axes[:-1]]
    columns: dict[str, list[Any]] = {a.name: [] for a in plan.axes if a.given}
    columns |= {"estimator": [], "replicate": [], "text": []}
    for one in tally.raised:
        at = (*np.unravel_index(one["group"], sizes), one["level"])
        for a, k in zip(plan.axes, at, strict=True):
            if a.given:
                columns[a.name].append(a.labels[int(k)])
        columns["estimator"].append(plan.contenders[one["estimator"]].name)
        columns["replicate"].append(one["replicate"])
        columns["text"].append(one["text"])
    count = int(tally.status[..., STATUS.index("raised")].sum())
    first = f", the first {len(tally.raised)} are" if count > len(tally.raised) else ""
    return Table(columns, title=f"{count} estimates failed with an exception{first}")
