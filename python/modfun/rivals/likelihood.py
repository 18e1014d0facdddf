"""Output error of several outputs and records by maximum likelihood, whatever the structure.

With Σ the covariance of the residuals r of a record, −log likelihood is samples/2 · log det Σ(θ), summed over
records, once Σ is put at its best value for θ, the mean of r rᵀ. The derivative of this criterion is that of
the weighted sum of squares with Σ held at its value: Gauss–Newton steps for that sum, judged by the
criterion, estimate parameters and covariance together (Maine and Iliff).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import public, reals
from ..base.arrays import F64
from ..base.least_squares import scaled_lstsq
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import DataError, FitError, ModfunError, ModfunWarning, SpecError
from ..experiments.sensitivities import trend_rows
from ..experiments.slopes import Equations, Known, Slopes, States, Transfers
from ..fitting.fit import fit
from ..models.free import Free, refuse_priors
from ..models.transfer_function import TransferFunction
from ..records.mask import refuse_own_noise
from ..records.record import Record
from ..results.initial_state import find_state
from .common import errors_of, joined

__all__ = ["OutputErrorFit", "most_likely"]

FLOOR = 1e-8  # of an output's rms: what integration and rounding leave of a record without noise
SETTLED = 1e-8  # a step that promises no more of −log likelihood has arrived: 1e-4 standard errors
STUCK = 1e-3  # the same where no step, however short, is better: 3 % of a standard error
DAMPED, MOST_DAMPED = 1e4, 1e8  # where a kink is looked for, and where a search ends
PIECES = (4, 16, 64)  # of a record: 10 s of Lorenz's system, nine times the e-folding time, take 16
TOLD = 0.3  # of a direction of unit length: a parameter that takes part in it
SHORTEST = 20  # intervals of a piece, which has an initial state of its own

WHAT = "output error"


@public
@dataclass(frozen=True, eq=False)
class OutputErrorFit:
    """What an output error found, nuisance included; from ``output_error(model).solve(records)``.

    Attributes
    ----------
    params, bse : dict of str to float
        Estimates, and standard errors for white residuals of these covariances.
    noise_cov : tuple of ndarray, shape (output, output)
        Covariance of the residuals of each record.
    initial_states : tuple of ndarray, shape (state,)
        Of each record: y, y', … of each output of a transfer function, the states of a `StateSpace`, the
        states of ``Equation.model(params).states``.
    trends : tuple of ndarray, shape (output, term)
        Of each record: offset, and slope with time counted from −1 to 1, of each output.
    simulated : tuple of ndarray, shape (output, time)
        Outputs of each record.
    nit : int
        Steps tried.
    pieces : int
        Into how many pieces each record was cut, with an initial state each: more than one where nonlinear
        equations led to no estimate over whole records, as those of chaos do. Covariances are then means
        over the pieces, initial states those of the first.

    See Also
    --------
    modfun.rivals.output_error : Where it comes from.

    References
    ----------
    R. E. Maine, K. W. Iliff, Application of Parameter Estimation to Aircraft Stability and Control,
    NASA RP-1168, 1986.

    Examples
    --------
    >>> import modfun as mf
    >>> model = mf.StateSpace([["a", 1], [-4, "b"]], [[0], ["c"]])
    >>> system = model.model({"a": -1.0, "b": -2.0, "c": 3.0})
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.05, seed=1)
    >>> found = mf.rivals.output_error(model).solve(rec)
    >>> found.noise_cov[0].shape
    (2, 2)
    """

    params: dict[str, float]
    bse: dict[str, float]
    noise_cov: tuple[F64, ...]
    initial_states: tuple[F64, ...]
    trends: tuple[F64, ...]
    simulated: tuple[F64, ...]
    nit: int
    pieces: int = 1


@dataclass(frozen=True, eq=False)
class _Point:
    """A point of the search: unknowns, the criterion, and what a step from it needs."""

    x: F64
    cost: float
    residuals: list[F64]  # of each record, (output, time) at the samples that count
    slopes: list[Slopes]
    covariances: list[F64]


class _Problem:
    """Structure and records, and the unknowns: parameters, then initial state and trend of each record."""

    def __init__(
        self, model: Any, records: Sequence[Record], free: bool, trend: str | None, started: bool = False
    ) -> None:
        self.started = started  # from a given point
        self.model, self.free, self.trend = model, free, trend
        first = records[0]
        if isinstance(model, TransferFunction):
            self.layout = model.layout(first.outputs, first.inputs)
            self.names = tuple(self.layout.param_names)
            self.records = [rec.select(outputs=first.outputs, inputs=first.inputs) for rec in records]
        else:
            records = [model.own_channels(rec) for rec in records]
            for rec in records:
                model.simulated(rec.outputs, rec.inputs)  # refuses what does not go together
            self.names = tuple(model.simulated().parameters)
            own = {"outputs": list(model.outputs), "inputs": list(model.inputs)}
            self.records = [rec.select(**own) for rec in records]
        bounds = {name: given for name, given in model.params if isinstance(given, Free)}
        if isinstance(model, TransferFunction) and isinstance(model.delay, Free):
            bounds |= dict.fromkeys(self.names[len(self.names) - len(self.layout.free_delays) :], model.delay)
        refuse_priors(WHAT, model)
        self.low = np.array([bounds[n].min if n in bounds else -np.inf for n in self.names])
        self.high = np.array([bounds[n].max if n in bounds else np.inf for n in self.names])
        self.kept = [_kept(rec) for rec in self.records]
        pairs = list(zip(self.records, self.kept, strict=True))
        self.floors = [(FLOOR * np.sqrt(np.mean(rec.y[:, keep] ** 2, axis=1))) ** 2 for rec, keep in pairs]
        if not all(floor.all() for floor in self.floors):
            raise FitError(f"{WHAT}: an output is zero throughout, its parameters cannot be found")
        self.drifts = [_drift(trend, rec) for rec in self.records]

    def is_kinked(self, theta: F64) -> bool:
        """Whether responses have kinks in the unknowns: states stop and stick."""
        known = self.known(theta)
        return isinstance(known, Equations) and known.model.form.slides

    def known(self, theta: F64) -> Known:
        """The structure with these parameters."""
        if isinstance(self.model, TransferFunction):
            return Transfers(self.layout, theta)
        values = dict(zip(self.names, theta.tolist(), strict=True))
        return States(self.model, values) if self.model.linear else Equations(self.model.model(values))

    def complete(self, theta: F64) -> F64:
        """Unknowns with the best initial states and trends for these parameters."""
        known, x = self.known(theta), [theta]
        for rec, drift, keep in zip(self.records, self.drifts, self.kept, strict=True):
            if isinstance(known, Equations) and self.free:
                state = find_state(known.model, rec, None)[1].state
                left = (rec.y - known.slopes(rec, state).y)[:, keep]
                x += [state, np.array([scaled_lstsq(drift[:, keep].T, one) for one in left]).ravel()]
                continue
            slopes = known.slopes(rec, None)
            columns = self._columns(slopes, drift)[theta.size :]
            if not len(columns):  # from zero, without a trend
                continue
            columns = columns[..., keep]
            size = np.sqrt(np.mean(rec.y[:, keep] ** 2, axis=1))[:, None]  # outputs in units of their own
            target = ((rec.y - slopes.y)[:, keep] / size).ravel()
            x.append(scaled_lstsq((columns / size).reshape(len(columns), -1).T, target))
        return np.concatenate(x)

    def _columns(self, slopes: Slopes, drift: F64) -> F64:
        """Derivatives of a record's outputs to the parameters and to its own unknowns."""
        q = len(slopes.y)
        trends = np.einsum("ij,kt->ikjt", np.eye(q), drift).reshape(-1, q, drift.shape[1])
        state = slopes.state if self.free else slopes.state[:0]
        return np.concatenate([slopes.params, state, trends])

    def parts(self, point: _Point) -> list[tuple[F64, F64]]:
        """Initial state and trend of each record."""
        at, found = len(self.names), []
        for rec, slopes, drift in zip(self.records, point.slopes, self.drifts, strict=True):
            n, q = len(slopes.state) if self.free else 0, len(rec.y)
            own = point.x[at : at + n + q * len(drift)]
            found.append((own[:n], own[n:].reshape(q, -1)))
            at += own.size
        return found

    def at(self, x: F64) -> _Point | None:
        """The point of these unknowns; None where no finite response is."""
        residuals, slopes, covariances, cost, place = [], [], [], 0.0, len(self.names)
        try:
            with np.errstate(all="ignore"):
                known = self.known(x[: len(self.names)])
                own_words = zip(self.records, self.drifts, self.floors, self.kept, strict=True)
                for rec, drift, floor, keep in own_words:
                    q = len(rec.y)
                    n = self._states(known) if self.free else 0
                    own = x[place : place + n + q * len(drift)]
                    place += own.size
                    found = known.slopes(rec, own[:n] if self.free else None)
                    left = (rec.y - found.y - own[n:].reshape(q, -1) @ drift)[:, keep]
                    cov = left @ left.T / left.shape[1] + np.diag(floor)
                    sign, level = np.linalg.slogdet(cov)
                    if not (sign > 0 and np.isfinite(level) and np.isfinite(found.params).all()):
                        return None
                    cost += left.shape[1] / 2 * float(level)
                    residuals.append(left)
                    slopes.append(found)
                    covariances.append(cov)
        except (DataError, FitError, np.linalg.LinAlgError, OverflowError):
            return None
        return _Point(x, cost, residuals, slopes, covariances)

    def _states(self, known: Known) -> int:
        if isinstance(known, Transfers):
            return sum(known.layout.orders)
        return len(known.matrices[0]) if isinstance(known, States) else len(known.model.states)

    def whitened(self, point: _Point) -> tuple[F64, F64]:
        """Jacobian and residuals of all records, white with unit variance: (row, unknown), (row,)."""
        rows, target, at = [], [], len(self.names)
        parts = zip(point.residuals, point.slopes, point.covariances, self.drifts, self.kept, strict=True)
        for left, slopes, cov, drift, keep in parts:
            columns = self._columns(slopes, drift)[..., keep]
            scale = np.linalg.inv(np.linalg.cholesky(cov))
            own = (scale @ columns).reshape(len(columns), -1).T
            wide = np.zeros((len(own), point.x.size))
            extra = own.shape[1] - len(self.names)
            wide[:, : len(self.names)] = own[:, : len(self.names)]
            wide[:, at : at + extra] = own[:, len(self.names) :]
            at += extra
            rows.append(wide)
            target.append((scale @ left).ravel())
        return np.concatenate(rows), np.concatenate(target)


def most_likely(
    model: TransferFunction | StateSpace | Equation,
    records: Sequence[Record],
    free: bool,
    trend: str | None,
    start: Mapping[str, float] | None,
    maxiter: int,
) -> OutputErrorFit:
    """Estimate parameters, covariances of the residuals, and initial states and trends of the records."""
    _check_records(records, model)
    problem = _Problem(model, records, free, trend, start is not None)
    unknowns = len(problem.names)
    if (
        have := sum(len(rec.y) * int(k.sum()) for rec, k in zip(problem.records, problem.kept, strict=True))
    ) < 2 * unknowns:
        raise DataError(f"{WHAT}: {have} samples for {unknowns} parameters; give longer records")
    points = _starts(problem, start)
    try:
        return _found(problem, points, maxiter, 1)
    except FitError:
        # Over a long record the response of a chaotic system says nothing of its parameters.
        cut = isinstance(model, Equation) and not model.linear and free and trend is None
        for pieces in PIECES if cut else ():
            try:
                parts = [part for rec in problem.records for part in _pieces(rec, pieces)]
                if min(part.intervals for part in parts) < SHORTEST:
                    break
                return _found(_Problem(model, parts, free, trend, problem.started), points, maxiter, pieces)
            except (FitError, DataError):  # a piece may have too few samples
                continue
        raise


def _pieces(rec: Record, count: int) -> list[Record]:
    """The record in as many parts of about the same length, none of which shares a sample."""
    ends = np.linspace(0, rec.t.size, count + 1).astype(int)
    return [rec.window(rec.t[a], rec.t[b - 1]) for a, b in pairwise(ends.tolist())]


def _found(problem: _Problem, points: Sequence[F64], maxiter: int, pieces: int) -> OutputErrorFit:
    """The estimate from the best of these parameters; `pieces`: of each of the records it is asked of."""
    here, nit = _search(problem, _started(problem, points), maxiter)
    unknowns = len(problem.names)
    bse = errors_of(problem.whitened(here)[0])[:unknowns]
    parts = problem.parts(here)
    both = zip(here.slopes, parts, problem.drifts, strict=True)
    simulated = [slopes.y + trend @ drift for slopes, (_, trend), drift in both]
    each = [slice(k, k + pieces) for k in range(0, len(parts), pieces)]
    return OutputErrorFit(
        dict(zip(problem.names, here.x[:unknowns].tolist(), strict=True)),
        dict(zip(problem.names, bse.tolist(), strict=True)),
        tuple([np.mean(here.covariances[own], axis=0) for own in each]),
        tuple([parts[own.start][0] for own in each]),
        tuple([parts[own.start][1] for own in each]),
        tuple([np.hstack(simulated[own]) for own in each]),
        nit,
        pieces,
    )


def _starts(problem: _Problem, start: Mapping[str, float] | None) -> list[F64]:
    """The given parameters, or the one-shot estimates and where the model's own parameters begin."""
    if start is not None:
        missing, more = set(problem.names) - set(start), set(start) - set(problem.names)
        if missing or more:
            said = f"lacks {joined(missing)}" if missing else f"names {joined(more)}"
            raise SpecError(
                f"output_error: start= {said}; give {', '.join(problem.names)}, all and only these"
            )
        return [reals("output_error", "start", [start[name] for name in problem.names])]
    told = dict(getattr(problem.model, "params", ()))
    begun = [getattr(told.get(name), "start", None) for name in problem.names]
    points: list[F64] = [] if None in begun else [np.array(begun, float)]
    joint = isinstance(problem.model, TransferFunction)  # several outputs have no one-shot estimate
    for method in ("awls",) if joint else ("wls", "ls"):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ModfunWarning)  # of a start nothing need be said
                points.append(fit(problem.records, problem.model, method=method).params)
        except (FitError, DataError):
            continue
    return points


def _started(problem: _Problem, points: Sequence[F64]) -> _Point:
    """The best of these parameters, with its initial states and trends."""
    found, why = [], ""
    for theta in points:
        try:
            with np.errstate(all="ignore"):
                found.append(problem.at(problem.complete(np.clip(theta, problem.low, problem.high))))
        except (ModfunError, np.linalg.LinAlgError) as error:
            why = f" ({error})"
    finite = [point for point in found if point is not None]
    if not finite:
        cure = "give another start" if problem.started else "give one, start={name: value}"
        raise FitError(f"{WHAT}: no start with a finite response{why}; {cure}")
    return min(finite, key=lambda point: point.cost)


def _search(problem: _Problem, here: _Point, maxiter: int) -> tuple[_Point, int]:
    start = "give another start" if problem.started else "give a start"
    damping, nit, p = 1e-3, 0, len(problem.names)
    while True:
        jacobian, target = problem.whitened(here)
        uphill = jacobian.T[:p] @ target
        # What stands on a bound and would go beyond it stays for this step.
        jacobian[:, :p][:, np.where(uphill < 0, here.x[:p] <= problem.low, here.x[:p] >= problem.high)] = 0.0
        size = np.linalg.norm(jacobian, axis=0)
        size[size == 0] = 1.0
        left, values, right = np.linalg.svd(jacobian / size, full_matrices=False)
        seen = left.T @ target
        kept = values > 1e-12 * values[0]
        promised = float(np.sum(seen[kept] ** 2)) / 2  # by the undamped step
        if promised <= SETTLED:
            return here, nit
        beyond: list[_Point] = []  # where steps ended that lowered nothing
        while True:
            if nit >= maxiter:
                raise FitError(
                    f"{WHAT}: not converged after {nit} evaluations"
                    + (_hardly_told(problem, jacobian) or f"; raise maxiter= or {start}")
                )
            nit += 1
            move = right.T @ (np.where(kept, values, 0) / (values**2 + damping) * seen) / size
            x = here.x + move
            x[:p] = np.clip(x[:p], problem.low, problem.high)
            there = problem.at(x)
            if there is not None and there.cost < here.cost:
                here, damping = there, max(damping / 10, 1e-12)
                break
            beyond += [there] if there is not None else []
            damping = max(damping, 1e-8) * 10
            if promised > STUCK and damping > DAMPED and beyond and problem.is_kinked(here.x[:p]):
                turn = (right / size)[kept] / values[kept, None]
                seen[kept] = _along_kink(problem, seen[kept], turn, beyond)
                beyond, damping, promised = [], 1e-3, float(np.sum(seen[kept] ** 2)) / 2
                if promised <= STUCK:
                    return here, nit
            if damping > MOST_DAMPED:
                if promised <= STUCK or _exact(problem, here):
                    return here, nit
                raise FitError(
                    f"{WHAT}: no step lowers the criterion"
                    + (_hardly_told(problem, jacobian) or f"; {start}")
                )


def _along_kink(problem: _Problem, seen: F64, turn: F64, beyond: Sequence[_Point]) -> F64:
    """The slope of the criterion along a kink: of that at a point, `seen`, and those where its steps ended.

    States stop, stick and start at instants which pass samples: the response has kinks there, and the best
    parameters may be on one, where steps down either side end on the other. Of the mixtures of the slopes of
    both sides the shortest leads down along the kink, or is none where nothing does.

    `turn`: unknowns' slopes to those in which squared residuals are round, in units of which it is short.
    """
    shortest = seen
    for there in beyond:
        jacobian, target = problem.whitened(there)
        change = turn @ (jacobian.T @ target) - seen
        share = np.clip(-(seen @ change) / max(float(change @ change), 1e-300), 0.0, 1.0)
        mixed = seen + share * change
        shortest = min(shortest, mixed, key=lambda one: float(one @ one))
    return shortest


def _hardly_told(problem: _Problem, jacobian: F64) -> str:
    """The parameters of the direction in which the response changes least, where there are several."""
    size = np.linalg.norm(jacobian, axis=0)
    right = np.linalg.svd(jacobian / np.where(size > 0, size, 1.0), full_matrices=False)[2]
    share = np.abs(right[-1])
    names = [name for name, part in zip(problem.names, share, strict=False) if part > TOLD]
    if len(names) < 2:
        own = problem.free and np.max(share[len(problem.names) :], initial=0.0) > TOLD
        known = 'give initial_state="zero" where it is known, or hold parameters'
        return f"; the records hardly tell the initial state from the rest, {known}" if own else ""
    return (
        f"; the records hardly tell {', '.join(names[:-1])} and {names[-1]} apart, hold or bound one of them"
    )


def _drift(trend: str | None, rec: Record) -> F64:
    """As `trend_rows`, at the times of a record."""
    if rec.dt is not None:
        return trend_rows(trend, rec.t.size)
    rows = trend_rows(trend, 2)
    return np.array([np.interp(rec.t, rec.t[[0, -1]], row) for row in rows]).reshape(len(rows), rec.t.size)


def _kept(rec: Record) -> NDArray[np.bool_]:
    """The samples that count, (time,)."""
    return np.ones(rec.t.size, bool) if rec.mask is None else np.asarray(rec.mask[0])


def _exact(problem: _Problem, here: _Point) -> bool:
    """Whether the residuals are those of a record without noise: integration's errors."""
    pairs = zip(here.residuals, problem.floors, strict=True)
    return all(bool(np.all(np.mean(left**2, axis=1) <= 1e4 * floor)) for left, floor in pairs)


def _check_records(records: Sequence[Record], model: Any) -> None:
    if not records:
        raise SpecError(f"{WHAT}: there is no record; give one, or a list of them")
    for rec in records:
        if not isinstance(rec, Record):
            raise SpecError(f"{WHAT}: got a {type(rec).__name__}; it takes a Record or a list of these")
        if rec.dt is None and not isinstance(model, Equation):
            raise DataError(
                f"{WHAT}: the record is sampled unevenly; write the model as an mf.Equation, or resample it"
            )
        if rec.sigma is not None or (rec.mask is not None and np.any(rec.mask != rec.mask[0])):
            # Of samples masked in some outputs, the covariance of the residuals is not a plain mean.
            refuse_own_noise(rec, WHAT, "take a piece without them, rec.window(start, stop), or use mf.fit")
