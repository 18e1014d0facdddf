"""Initial state of a record under equations with numbers: least squares on its outputs.

Of linear equations all responses are exact and their sum is linear; of others the search is nonlinear.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import F64
from ..base.least_squares import damped_step, levenberg_marquardt
from ..base.student import root
from ..base.words import TRENDS
from ..equations.nonlinear import NonlinearModel, model_of
from ..errors import DataError
from ..records.functions import drives
from ..records.mask import sample_weights
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.making import ss
from ..systems.propagate import respond
from .estimates import Estimates
from .prediction import InitialState, given_state
from .regression import regress, trend_columns

__all__ = ["begins_in_zero", "find_state", "from_zero", "linear_columns", "simulate_equations", "slopes"]

HORIZONS = (1 / 16, 1 / 4, 1.0)  # of the record: a long response from a poor start has many minima
# First guesses of what is not measured, in units of the outputs' size.
MULTIPLES = (0.0, 1.0, -1.0, 0.1, -0.1, 10.0, -10.0)
LOST = 0.5  # of an output's motion left by a rough response: digits do not matter, and may take minutes
FINE = 1e-9  # relative error of a step in the answer
ROUGH = 1e-6  # relative error of integrations on the way
STEP = 1e-6  # of a state's size: the difference that stands for its derivative
SLOPE = 1e-4  # the same for integrations of their own steps
ROUNDS = 30
FEW = 6  # samples of a start that follows the first ones closely
STRAIGHT = 2  # rounds where outputs are straight in the unknowns
NEARLY, TOL = 1e-4, 1e-10  # what a step has to promise, on the way and at the end


def simulate_equations(
    fit: Estimates,
    rec: Record,
    initial_state: str | ArrayLike | InitialState | None,
    near: InitialState | None = None,
) -> tuple[F64, InitialState]:
    """Outputs of fitted equations for a record; as `prediction.simulate_paths`.

    Parameters
    ----------
    fit : Estimates
        Of an Equation or a StateSpace.
    rec : Record
    initial_state : None, "zero" or array
        None: estimated by least squares, states that are not measured included.
    near : InitialState, optional
        Where a search of nonlinear equations begins: that of parameters near by.

    Returns
    -------
    simulated : (output, time) array
    initial : InitialState

    Raises
    ------
    DataError
        The response leaves all bounds from every initial state tried, or from the one given.
    """
    structure: Any = fit.structure
    if structure.linear and rec.dt is not None:
        state = None if initial_state is None else given_state(initial_state, structure.states)
        return _linear(fit, rec, structure, state)
    model = model_of(structure.compiled(fit.outputs, fit.inputs), fit.params, structure)
    names = structure.states if structure.linear else model.states
    state = None if initial_state is None else given_state(initial_state, names)
    if not structure.linear:
        return find_state(model, rec, fit.trend, state, near)
    place = [model.states.index(name) for name in structure.states]  # the user's order
    back = np.argsort(place)
    simulated, found = find_state(model, rec, fit.trend, None if state is None else state[back])
    return simulated, replace(found, state=found.state[place], cov=found.cov[np.ix_(place, place)])


def begins_in_zero(fit: Estimates) -> bool:
    """Whether trends of a fit of equations are those of its outputs, as records begin in zero beside them.

    A constant in the equations is an offset of what is measured only where the state begins at its steady
    state, as the past of a fit's sums does. From a state of zero the response would move to that level first,
    with a time constant of the system.
    """
    structure: Any = fit.structure
    told = fit.options.initial_state
    if fit.layout.rational:
        return False
    zero = isinstance(told, str) and told == "zero"
    return bool(zero and fit.trend and structure.compiled(fit.outputs, fit.inputs).is_linear)


def from_zero(fit: Estimates, rec: Record) -> tuple[F64, F64]:
    """Outputs of linear equations that begin in zero, with the trend of each output that suits a record.

    Returns
    -------
    simulated : (output, time) array
    trend : array
        Offset, or offset and slope over the record, of each output; empty without a trend.
    """
    structure: Any = fit.structure
    model = model_of(structure.compiled(fit.outputs, fit.inputs), fit.params, structure)
    state = np.zeros(len(model.states))
    forced = model.respond(drives(rec, 0.0), rec.t, state, rec.intersample)
    drift, weights = trend_columns(rec.t, fit.trend), sample_weights(rec.mask, rec.sigma, rec.y.shape)
    if not len(drift):
        return forced, np.zeros(0)
    each = zip(rec.y - forced, weights, strict=True)
    found = [regress(left, drift, own).coefficients for left, own in each]
    return forced + np.array(found) @ drift, np.concatenate(found)


def _linear(fit: Estimates, rec: Record, structure: Any, state: F64 | None) -> tuple[F64, InitialState]:
    """As `simulate_equations`, for a StateSpace."""
    system, algebraic = _system(fit, rec, structure)
    return _linear_state(system, rec, TRENDS.index(fit.trend), algebraic, state)


def linear_columns(fit: Estimates, rec: Record, free: bool) -> F64:
    """Derivatives of a StateSpace's outputs to its initial state, where free, and trend."""
    system, algebraic = _system(fit, rec, fit.structure)
    return np.array(_columns(system, rec, TRENDS.index(fit.trend), algebraic, free)).reshape(-1, *rec.y.shape)


def _system(fit: Estimates, rec: Record, structure: Any) -> tuple[LTI, list[int]]:
    """The system with its channels by name, as the record has them, and outputs that are no states."""
    a, b, c, d = fit.model.matrices  # type: ignore[misc]  # of a state space there are
    late = np.asarray(fit.model.delays)
    rows = [structure.outputs.index(name) for name in rec.outputs]
    pick = np.array([[float(own == name) for name in rec.inputs] for own in structure.inputs])
    pick = pick.reshape(len(structure.inputs), len(rec.inputs))
    algebraic = [k for k, name in enumerate(rec.outputs) if name not in structure.states]
    return ss(a, b @ pick, c[rows], d[rows] @ pick, delay=late @ pick), algebraic


def _linear_state(
    system: LTI, rec: Record, terms: int, algebraic: Sequence[int], state: F64 | None
) -> tuple[F64, InitialState]:
    """The initial state, and a trend of each equation, with which a linear system follows a record best.

    Parameters
    ----------
    system : LTI
        A state space.
    rec : Record
        Evenly sampled.
    terms : int
        Unknowns of each equation: 0, 1 (a constant) or 2 (and a drift).
    algebraic : sequence of int
        Outputs that have an equation of their own, y = Cx + Du, beside those of the states.
    state : (states,) array, optional
        The initial state, where it is known.

    Returns
    -------
    simulated : (output, time) array
    initial : InitialState
        `trend`, of the states' equations and then of the outputs', stands on the side of the derivative.

    Raises
    ------
    DataError
        A response that overflows.
    """
    assert system.matrices is not None
    assert rec.dt is not None
    a, b, c, d = system.matrices
    n, outputs = a.shape[0], c.shape[0]
    none = np.zeros((n, 0))
    words = (rec.dt, rec.intervals)

    late = system.path_delays[0].tolist()  # of each input
    # Before the record inputs are taken as at its first sample, unless they are known there.
    driven = drives(rec, rec.t0)
    forced = respond((a, b, c, d), np.zeros(n), driven, *words, rec.intersample, late, held=True)
    if state is not None:
        forced = forced + respond((a, none, c, np.zeros((outputs, 0))), state, [], *words, (), ())
    columns = _columns(system, rec, terms, algebraic, state is None)
    if not columns:
        return forced, InitialState(np.asarray(state), np.zeros((n, n)), np.zeros(0), np.zeros((0, 0)))
    own = sample_weights(rec.mask, rec.sigma, rec.y.shape)
    left, regressors = rec.y - forced, np.array(columns)
    if not (np.all(np.isfinite(left)) and np.all(np.isfinite(regressors))):
        raise DataError(
            f"simulating the fit: the response overflows within {rec.duration:g} s, the model is unstable; "
            "look at the fit's parameters, or predict a shorter piece with rec.window(start, stop)"
        )
    weight = own / np.maximum(np.std(rec.y, axis=1), 1e-300)[:, None]
    for _ in range(1 + (outputs > 1)):
        # States come first: an offset that one makes, too, as behind an integrator, counts as its.
        found = regress(left.ravel(), regressors.reshape(len(columns), -1), weight.ravel())
        simulated = found.fitted.reshape(left.shape)
        e = own * (left - simulated)
        level = np.sqrt(np.sum(e**2, axis=1) / np.count_nonzero(own, axis=1))
        weight = own / np.maximum(level, 1e-9 * np.abs(rec.y).max())[:, None]
    z, cov = found.coefficients, found.covariance
    if state is not None:
        return forced + simulated, InitialState(state, np.zeros((n, n)), z, cov)
    return forced + simulated, InitialState(z[:n], cov[:n, :n], z[n:], cov[n:, n:])


def _columns(system: LTI, rec: Record, terms: int, algebraic: Sequence[int], free: bool) -> list[F64]:
    """Outputs (output, time) of each state at 1, where it is free, and of each term of a trend."""
    assert system.matrices is not None
    assert rec.dt is not None
    a, _, c, _ = system.matrices
    n, outputs = a.shape[0], c.shape[0]
    none, words = np.zeros((n, 0)), (rec.dt, rec.intervals)
    shapes, columns = [rec.t**power for power in range(terms)], []
    if free:
        through = a, none, c, np.zeros((outputs, 0))
        columns += [respond(through, x0, [], *words, (), ()) for x0 in np.eye(n)]
    for column in np.eye(n)[:, :, None]:
        pushed = a, column, c, np.zeros((outputs, 1))
        columns += [-respond(pushed, np.zeros(n), [u], *words, ("foh",), (0.0,)) for u in shapes]
    return columns + [-np.eye(outputs)[:, [i]] * u for i in algebraic for u in shapes]


@np.errstate(over="ignore", invalid="ignore")  # what leaves the range of numbers has words of its own
def find_state(
    model: NonlinearModel,
    rec: Record,
    trend: str | None = None,
    state: F64 | None = None,
    near: InitialState | None = None,
) -> tuple[F64, InitialState]:
    """The initial state, and the trend of each equation, with which a model follows a record best.

    Levenberg–Marquardt on the outputs over growing pieces of the record; derivatives of the response by
    differences of integrations on common steps. Outputs are weighted by their residuals.

    Parameters
    ----------
    model : NonlinearModel
    rec : Record
    trend : {None, "constant", "linear"}
        What is unknown in each equation.
    state : (states,) array, optional
        The initial state, where it is known.
    near : InitialState, optional
        Where the search begins, over all samples; elsewhere where there is no response from there.

    Returns
    -------
    simulated : (output, time) array
    initial : InitialState
        `trend` holds the constant, or the constant and the slope by t, of each equation.
    """
    search = _Search(model, rec, TRENDS.index(trend), state)
    n, count = len(model.states), rec.t.size
    # Masked samples tell nothing: pieces hold so many that count.
    counted = np.cumsum(np.any(search.own > 0, axis=0))
    least = [max(int(h * counted[-1]), min(int(counted[-1]), 8 + 8 * search.sizes.size)) for h in HORIZONS]
    lengths = [*(np.searchsorted(counted, least[:-1]) + 1).tolist(), count]
    tried, rounds = [], ROUNDS
    if model.compiled.is_linear:  # outputs are straight in all unknowns: one start, over all samples
        search.step, rounds = 1.0, STRAIGHT
    if near is not None or model.compiled.is_linear:
        if near is None:
            start = next(search.starts(lengths[0]))
        else:
            start = np.append(near.state[: search.found], near.trend)
        tried = [search.refine(start, count, rounds, NEARLY)]
    if tried and np.isfinite(tried[0][1]):
        lengths = [count]
    else:
        search.step, rounds = STEP, ROUNDS
        tried = [search.refine(z, lengths[0], 5, 0.1) for z in search.starts(lengths[0])]
    if not any([np.isfinite(cost) for _, cost in tried]):  # few samples a cycle: a shorter polynomial
        tried = [search.refine(z, lengths[0], 5, 0.1) for z in search.starts(min(lengths[0], FEW), 1)]
    z, cost = min(tried, key=lambda one: one[1])
    if not np.isfinite(cost):
        if state is not None:
            model.respond(drives(rec, 0.0), rec.t, state, rec.intersample)  # says when it leaves
        raise DataError(
            "simulating the fit: the response leaves all bounds within the first "
            f"{rec.t[lengths[0] - 1] - rec.t[0]:.4g} s from every initial state tried; give "
            "initial_state=, or look at the fit's parameters"
        )
    for length in lengths[1:]:
        z, _ = search.refine(z, length, rounds, NEARLY)
    for rtol, tol in ((ROUGH, NEARLY), (FINE, TOL)) if len(rec.outputs) > 1 else ((FINE, TOL),):
        left = search.weigh(z)
        if rtol == FINE and left > LOST:  # of chaos, or on a plateau that small steps lead off
            z, _ = search.refine(z, count, rounds, TOL)
            if search.weigh(z) > LOST:
                break
        search.rtol = rtol
        z, _ = search.refine(z, count, rounds, tol)
    here = search.at(z, count)  # DataError: it leaves all bounds, and says when
    freedom = max(int(np.count_nonzero(search.weights)) - z.size, 1)
    cov = np.zeros((n + z.size - search.found, n + z.size - search.found))
    cov[n - search.found :, n - search.found :] = np.linalg.pinv(here.jacobian.T @ here.jacobian)
    x, drift = search.split(z)
    cov *= here.cost / freedom
    return here.y, InitialState(x, cov[:n, :n], drift, cov[n:, n:])


def slopes(fit: Estimates, rec: Record, initial: InitialState) -> F64:
    """Derivatives of simulated outputs to parameters, initial state and trend, (unknown, output, time)."""
    structure: Any = fit.structure
    compiled = structure.compiled(fit.outputs, fit.inputs)
    if initial.trend.size:
        from ..equations.symbolic.ode import with_trend

        compiled = with_trend(compiled, initial.trend.size // len(compiled.source))
    z = np.concatenate([fit.params, initial.state, initial.trend])
    errors = np.concatenate([root(np.diag(fit.cov_nonrobust)), initial.bse, np.zeros(initial.trend.size)])
    p, n = fit.params.size, initial.state.size
    found = []
    for k in range(z.size):
        step = SLOPE * (max(abs(z[k]), float(np.nan_to_num(errors[k]))) or 1.0)
        sides = []
        for sign in (1.0, -1.0):
            moved = z.copy()
            moved[k] += sign * step
            model = model_of(compiled, np.append(moved[:p], moved[p + n :]))
            sides.append(model.respond(drives(rec, 0.0), rec.t, moved[p : p + n], rec.intersample))
        found.append((sides[0] - sides[1]) / (2 * step))
    return np.array(found)


class _Search:
    """Residuals of a record over its first samples, and steps that make them smaller."""

    def __init__(self, model: NonlinearModel, rec: Record, terms: int, state: F64 | None) -> None:
        self.rec, self.rtol, self.step, self.state = rec, ROUGH, STEP, state
        self.params = np.array(list(model.params.values()))
        if terms:
            from ..equations.symbolic.ode import with_trend

            wider = with_trend(model.compiled, terms)
            extra = len(wider.parameters) - self.params.size
            model = model_of(wider, np.append(self.params, np.zeros(extra)))
        self.model = model
        self.found = len(model.states) if state is None else 0  # so many of the unknowns are states
        self.own = sample_weights(rec.mask, rec.sigma, rec.y.shape)
        spread = np.std(rec.y, axis=1)
        self.weights = self.own / np.where(spread > 0, spread, 1.0)[:, None]
        # A state's size in time: derivatives of an output by the time in which it turns.
        span = float(rec.t[-1] - rec.t[0])
        rough = {
            name: max(float(np.abs(y).max()), 1e-300) for name, y in zip(rec.outputs, rec.y, strict=True)
        }
        typical = float(np.mean(list(rough.values())))
        known = [rough.get(x.rstrip("'"), typical) * (10.0 / span) ** x.count("'") for x in model.states]
        drifts = [typical * 10.0 / span / (span**k) for _ in model.compiled.source for k in range(terms)]
        self.sizes = np.array(known[: self.found] + drifts)

    def split(self, z: F64) -> tuple[F64, F64]:
        """Initial state and trend among the unknowns."""
        return (z[: self.found] if self.state is None else self.state), z[self.found :]

    def starts(self, length: int, extra: int = 2) -> Iterator[F64]:
        """First guesses: what polynomials through the first samples say, and multiples for the rest."""
        more = np.zeros(self.sizes.size - self.found)
        if not self.found:
            yield more
            return
        derivative = np.array(["'" in s for s in self.model.states])
        x = self._polynomial(length, extra)
        unseen = np.isnan(x)
        for multiple in MULTIPLES if unseen.any() else (0.0,):
            guess = np.where(derivative, 0.0, multiple * self.sizes[: self.found])
            yield np.append(np.where(unseen, guess, x), more)

    def _polynomial(self, length: int, extra: int) -> F64:
        """Values and slopes of measured outputs at the first sample, nan for the rest."""
        x = np.full(len(self.model.states), np.nan)
        t = self.rec.t - self.rec.t[0]
        for name, y, weight in zip(self.rec.outputs, self.rec.y, self.own, strict=True):
            order = sum(s.rstrip("'") == name for s in self.model.states)
            first = np.flatnonzero(weight)  # where few samples count, some beyond these
            first = first[: max(int(np.searchsorted(first, length)), 1 + order)]
            if not first.size:
                continue
            degree = min(order + extra, max(first.size // 3, 1), first.size - 1)
            found = np.polynomial.Polynomial.fit(t[first], y[first], degree, w=weight[first])
            for k in range(order):
                slope = found.deriv(k) if k else found
                x[self.model.states.index(name + "'" * k)] = slope(0.0)
        return x

    def weigh(self, z: F64) -> float:
        """Weigh outputs by the residuals that z leaves; the largest of these in units of the motion."""
        try:
            e = self.own * (self.rec.y - self.at(z, self.rec.t.size).y)
        except DataError:
            return 0.0
        level = np.sqrt(np.sum(e**2, axis=1) / np.maximum(np.count_nonzero(self.own, axis=1), 1))
        level = np.maximum(level, 1e-9 * np.max(np.abs(self.rec.y)))
        self.weights = self.own / level[:, None]
        return float(np.max(level / np.maximum(self.rec.y.std(axis=1), 1e-300)))

    def at(self, z: F64, length: int) -> _Point:
        """Response, Jacobian and residuals, weighted, over the first samples."""
        rec, steps = self.rec, self.step * np.maximum(np.abs(z), self.sizes)
        moved = z[:, None] + np.hstack([np.zeros((z.size, 1)), np.diag(steps)])
        starts = moved[: self.found] if self.state is None else np.tile(self.state[:, None], moved.shape[1])
        params = None
        if z.size > self.found:
            same = np.tile(self.params[:, None], moved.shape[1])
            params = np.vstack([same, moved[self.found :]])
        y, _ = self.model.family(
            drives(rec, 0.0), rec.t, np.ascontiguousarray(starts), rec.intersample, self.rtol, length, params
        )
        w = self.weights[:, None, :length]
        jacobian = (w * (y[:, 1:] - y[:, :1]) / steps[:, None]).transpose(0, 2, 1)
        jacobian = jacobian.reshape(y.shape[0] * y.shape[2], z.size)
        residual = (self.weights[:, :length] * (rec.y[:, :length] - y[:, 0])).ravel()
        if not np.isfinite(np.sum(jacobian**2) + residual @ residual):
            raise DataError("simulating the fit: the response leaves the range of numbers")
        return _Point(z, y[:, 0], jacobian, residual)

    def refine(self, z: F64, length: int, rounds: int, tol: float) -> tuple[F64, float]:
        """Levenberg–Marquardt steps until one gains less than `tol`; cost inf where there is no response."""
        try:
            here = self.at(z, length)
        except DataError:
            return z, np.inf

        def moved(at: _Point, step: F64) -> _Point | None:
            try:
                return self.at(at.z + step, length)
            except DataError:
                return None

        here, _, _ = levenberg_marquardt(
            here,
            lambda at: at.jacobian,
            damped_step,
            moved,
            enough=0.0,
            tol=tol,
            maxiter=rounds if z.size else 0,
            damping=1e-6,
        )
        return here.z, here.cost


@dataclass(frozen=True, eq=False)
class _Point:
    """Unknowns, their response, and weighted derivatives and residuals."""

    z: F64
    y: F64
    jacobian: F64
    residual: F64

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)
