"""What a Monte Carlo study found: figures of every cell and their tables, made of sums."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64, I64
from ..base.cached import cached_property
from ..base.elsewhere import STUDY, Elsewhere
from ..base.tables import Table
from ..equations.state_space import StateSpace
from ..equations.written import Written
from ..errors import DataError, SpecError
from ..experiments.bound import crlb
from ..fitting.undeclared import in_sentences
from ..models.free import priors_of
from ..models.process import ProcessNoise
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..systems.lti import LTI
from .axes import Axis
from .contenders import Contender
from .functions import Failed
from .groups import Group
from .metrics import Metric, Metrics
from .plan import Plan
from .tally import STATUS, TEXTS, USED, Tally, share_mcse

__all__ = ["Figures"]

DRAWN = 100  # initial states that the bound is a mean over


@dataclass(frozen=True, eq=False, repr=False)
class Figures(Elsewhere):
    """The figures alone; users see them as `Results`, where their meaning is written down."""

    _elsewhere = STUDY

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
    _within: tuple[tuple[int, ...], ...] | None = None  # positions of the labels in the study, of a part

    @staticmethod
    def cut(array: NDArray[Any], at: Sequence[Sequence[int] | None]) -> Any:
        """The entries at these positions of each axis, all where it is None; read only."""
        for axis, positions in enumerate(at):
            array = array if positions is None else np.take(array, positions, axis)
        array.flags.writeable = False
        return array

    @classmethod
    def collect(
        cls, plan: Plan, tally: Tally, replicates: int, draw: str, samples: F64 | None = None
    ) -> Self:
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

        From all samples, with the estimator's trend unknown, and the initial state unless the estimator
        knows it, which a function says by attributes, ``f.initial_state = "zero"``, ``f.trend =
        "constant"``; with process noise its levels are unknown, too. Where the initial state of a linear
        system is drawn, it is the root mean square of the bounds from the first 100 replicates' states. It is
        nan where the noise or the records are the user's, the structure does not hold the system, process
        noise enters through inputs of its own, or the initial state of equations is drawn. No estimator need
        reach it in a narrow band, and a biased one may pass it.
        """
        plan = self._plan
        array = np.full((*plan.shape[:-1], len(plan.parameters)), np.nan)
        known: dict[Any, F64] = {}
        for g in plan.groups:
            if not isinstance(g, Group) or g.noise is not None:
                continue  # there is no system, or noise whose covariance nobody knows
            rec = g.record(g.rest.y)
            for k, c in enumerate(plan.contenders):
                key = (g.index, c.structures[g.index], c.trend(g), c.initial_state)
                if key not in known:
                    try:
                        known[key] = _bound(g, c, rec, plan.sigma(g), plan.seed)
                    except (SpecError, DataError, Failed):
                        known[key] = np.full((len(c.names(g)), 1), np.nan)
                array[g.index, :, k, plan.columns(c, g)] = known[key]
        bound: F64 = _shaped(array, [a for a in plan.axes if a.given])
        return bound if self._within is None else self.cut(bound, self._within)

    # Tables ----------------------------------------------------------------------------------------

    def table(self) -> Table:
        """Every figure with its Monte Carlo standard error: one row per cell, estimator and parameter.

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
        return Table(columns, title=self._titled())

    def relative(self) -> Table:
        """Figures relative to the true parameters, in %, root mean square over the parameters.

        NAG-1-1065, footnote 10: bias √(mean_j (bias_j/θ_j)²)·100 %; sd, rmse and crlb alike. One row per cell
        and estimator. Parameters whose true value is 0 have no relative figures and are left out; the title
        names them, and `table` has their absolute ones. Without any bias the figure is not 0 but about
        sd/√R, its Monte Carlo noise. The standard errors are those of the delta method with fully correlated
        parameters, so at most too large. `maxiter` as in `table`.
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
        zero = [name for k, name in enumerate(self.param_names) if np.any(self.truth[..., k] == 0)]
        left = f"; {', '.join(zero)} left out where the true value is 0" if zero else ""
        return Table(columns, title=self._titled(f"; % of the true parameters{left}"))

    def _counted(self) -> dict[str, I64]:
        """Outcomes that tables count: failures, and what did not settle where anything did not."""
        unsettled = self.status["maxiter"]
        return {"failures": self.failures} | ({"maxiter": unsettled} if np.any(unsettled) else {})

    def _relative(self, figure: str, where: tuple[int, ...]) -> tuple[float, float]:
        truth = self.truth[where]
        own = ~np.isnan(truth) & (truth != 0)
        if not own.any():
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

    @property
    def notes(self) -> tuple[str, ...]:
        """What has to be known to read the tables, in sentences, which stand in their titles."""
        found: dict[str, None] = {}
        for g in self._plan.groups:
            if isinstance(g, Group) and g.noise_sd != 1:
                kinds = self._plan.axes[-2]
                own = f"={kinds.labels[g.index % len(kinds.labels)]!r}" if kinds.given else "="
                found[
                    f"The noise that noise{own} returns has the standard deviation {g.noise_sd:.3g} where "
                    f"nsr counts on 1, so that each nsr is {g.noise_sd:.3g} times as large as its label."
                ] = None
            if isinstance(g, Group):
                found |= dict.fromkeys((*g.rest.read, *g.rest.jumps))
            for c in self._plan.contenders:
                if c.name not in self.estimators:
                    continue
                if isinstance(g, Group) and np.isnan(c.truth[g.index]).any():
                    found[
                        f"The structure of {c.name!r} does not hold the system, so that it has no true "
                        "parameters: bias, rmse and coverage are nan."
                    ] = None
                if c.undeclared and isinstance(g, Group) and g.noise is None:
                    found[
                        f"The bound beside {c.name!r} is that of an estimator that knows nothing of the "
                        "start and fits no offset; if it does otherwise, say so by its attributes, "
                        'f.initial_state = "zero" or f.trend = "constant".'
                    ] = None
                if c.words:
                    found |= dict.fromkeys(f"{c.name}: {said}" for said in in_sentences(c.words[g.index]))
        return tuple(found)

    def _titled(self, more: str = "") -> str:
        line = f"{self.replicates} replicates, seed {self._plan.seed}{more}"
        return "\n".join((line, *self.notes))

    def to_dict(self) -> dict[str, Any]:
        """All figures as plain Python values, tables by column."""
        return {
            "replicates": self.replicates,
            "seed": self._plan.seed,
            "draw": self.draw,
            "notes": list(self.notes),
            "axes": {name: list(labels) for name, labels in self.axes.items()},
            "table": self.table().to_dict(),
            "relative": self.relative().to_dict(),
            "status": {word: counts.tolist() for word, counts in self.status.items()},
            "metrics": self.metrics.table().to_dict(),
            "messages": self.messages.to_dict(),
            "seconds": self.seconds,
        }


def _bound(group: Group, contender: Contender, rec: Record, levels: F64, seed: int) -> F64:
    """Cramér–Rao bound at each noise level, (parameter, level)."""
    structure = contender.structures[group.index]
    system: Any = group.system
    given: dict[str, Any] = {"trend": contender.trend(group), "initial_state": contender.initial_state}
    names = group.names(structure)
    starts: list[F64 | None] = []
    if isinstance(system, LTI) and isinstance(group.process_noise, ProcessNoise):
        raise SpecError("crlb: the study's system is without the inputs through which noise enters")
    if isinstance(system, LTI):
        drawn = group.state is not None or len(group.free)
        states = [group.begin(seed, r) for r in range(DRAWN)] if drawn else [group.start]
    if isinstance(system, LTI) and isinstance(structure, StateSpace):
        system = structure
        given["params"] = dict(zip(names, contender.truth[group.index].tolist(), strict=True))
        starts = [state if state.any() else None for state in states]
    elif isinstance(system, LTI):
        if isinstance(structure, Written):
            raise SpecError(
                "crlb: for a linear system the bound is that of a TransferFunction's coefficients"
            )
        given["model"] = structure
        starts = [_response_and_slopes(group, structure, state) for state in states]
    elif structure != system.structure or group.drawn or group.state is not None:
        raise SpecError("crlb: the structure is not that of the system, or its initial state is drawn")
    else:
        starts = [group.rest.start]

    def bound(sigma: F64) -> F64:
        each = [crlb(system, rec, sigma=sigma, start=start, **given) for start in starts]
        squares = [[found[name] ** 2 for name in names] for found in each]
        return np.asarray(np.sqrt(np.mean(squares, axis=0)))

    if group.driven is None and not priors_of(structure):  # the bound grows with the noise
        return bound(group.unit)[:, None] * levels
    if group.driven is not None:
        given["process_noise"] = group.process_noise
    return np.array([bound(level * group.unit) for level in levels]).T


def _response_and_slopes(group: Group, structure: TransferFunction, state: F64) -> F64 | None:
    """y, y', …, output after output, of the free response from a state; None at rest."""
    system: Any = group.system
    if not state.any():
        return None
    if system.matrices is None:
        return state
    a, _, c, _ = system.matrices
    orders = structure.layout(group.outputs, group.inputs).orders
    each = zip(c, orders, strict=True)
    return np.array([row @ np.linalg.matrix_power(a, k) @ state for row, n in each for k in range(n)])


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
        mean, spread = values["bias"], values["sd"]
        alike = (spread == 0) & ((mean == 0) | (mean == 1))  # a share, of which others would have shown
        found[name] = Metric(
            mean=mean,
            mean_mcse=np.where(
                alike, share_mcse(np.where(alike, mean, 0.5), _shaped(count, given)), values["bias_mcse"]
            ),
            **{n: values[n] for n in ("sd", "sd_mcse")},
            count=_shaped(count, given),
            failures=_shaped(used - count, given),
            samples=None if samples is None else samples[..., column],
        )
    return Metrics(found, axes)


def _messages(plan: Plan, tally: Tally) -> Table:
    sizes = [len(a.labels) for a in plan.axes[:-1]]
    columns: dict[str, list[Any]] = {a.name: [] for a in plan.axes if a.given}
    columns |= {"estimator": [], "replicate": [], "count": [], "text": []}
    for one in tally.raised:
        at = (*np.unravel_index(one["group"], sizes), one["level"])
        for a, k in zip(plan.axes, at, strict=True):
            if a.given:
                columns[a.name].append(a.labels[int(k)])
        columns["estimator"].append(plan.contenders[one["estimator"]].name)
        for name in ("replicate", "count", "text"):
            columns[name].append(one[name])
    first = f", the first {TEXTS} texts" if len(tally.raised) == TEXTS else ""
    return Table(columns, title=f"What failed of estimates and metrics: first replicate, count{first}")
