"""Simulating transfer functions against a record: forced response, initial state, trend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._core import simulate_uneven
from ..base.arguments import by_name, shown
from ..base.arrays import F64
from ..base.samples import LARGEST, frozen
from ..errors import DataError, ModfunError, SpecError
from ..models.layout import Layout
from ..records.functions import drives
from ..records.mask import refuse_own_noise, sample_weights
from ..records.record import Record
from ..systems.lti import LTI
from ..systems.making import named
from ..systems.polynomials import companion, strip
from .observer import observe
from .regression import free_response, regress, trend_columns

__all__ = [
    "InitialState",
    "given_state",
    "misses",
    "observe_paths",
    "path_columns",
    "path_model",
    "simulate_paths",
    "simulate_system",
    "states_of",
    "unexplained",
]

TINY = float(np.finfo(float).tiny)
LOST = 1e16  # times an output: of a response as large, doubles have no digit left for it


@dataclass(frozen=True, eq=False)
class InitialState:
    """Initial state of a record under a fitted model.

    Attributes
    ----------
    state : (n,) array
        y, y', ... of the free response at the first sample; of several outputs one after the other.
    cov : (n, n) array
        Covariance, from the residuals taken as white; zeros if the state was given.
    trend : array
        Offset, or offset and slope over the whole record, of each output (empty without a trend).
    trend_cov : array or None
        Covariance of the trend, as that of the state; None where it is not known.
    """

    state: F64
    cov: F64
    trend: F64
    trend_cov: F64 | None = None

    @property
    def bse(self) -> F64:
        """Standard errors of the state."""
        return np.sqrt(np.diag(self.cov))

    def of_record(self) -> F64:
        """State and trend in one array."""
        return np.concatenate([self.state, self.trend])

    def variances(self) -> F64:
        """Variances of `of_record` under known parameters."""
        of_trend = np.full(self.trend.size, np.nan) if self.trend_cov is None else np.diag(self.trend_cov)
        return np.concatenate([np.diag(self.cov), of_trend])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> F64:
        return np.array(self.state, dtype=dtype)

    def __len__(self) -> int:
        return self.state.size

    def __repr__(self) -> str:
        parts = [f"{x:.5g} (standard error {s:.2g})" for x, s in zip(self.state, self.bse, strict=True)]
        trend = f", trend {np.array2string(self.trend, precision=5)}" if self.trend.size else ""
        return f"InitialState({', '.join(parts)}{trend})"


def path_model(layout: Layout, params: F64, output: int) -> LTI:
    """The transfer functions to one output, with the delays of their own."""
    den, nums = layout.polynomials(params, output)
    own = frozen(den)
    tops = (tuple(frozen(strip(num)) for num in nums),)
    made = LTI(tops, ((own,) * len(nums),), None, layout.delays(params, output))
    return named(made, (layout.outputs[output],), layout.inputs)


def simulate_paths(
    layout: Layout,
    params: F64,
    trend: str | None,
    rec: Record,
    initial_state: str | ArrayLike | InitialState | None,
) -> tuple[F64, InitialState]:
    """Outputs of transfer functions for a record, with the initial state and trend that suit it best.

    Parameters
    ----------
    layout : Layout
    params : (p,) array
    trend : {None, "constant", "linear"}
    rec : Record
        With the channels of the layout.
    initial_state : None, "zero", "rest" or array
        None: estimated by least squares on the free response, together with the trend.

    Returns
    -------
    simulated : (output, time) array
    initial : InitialState
    """
    orders = layout.orders
    rest = isinstance(initial_state, str) and initial_state == "rest"
    held = not isinstance(initial_state, str) or rest  # before the record, as in the fit
    given = None if initial_state is None else np.zeros(sum(orders))
    if initial_state is not None and not rest:
        given = given_state(initial_state, states_of(rec.outputs, orders))
    drift, weights = trend_columns(rec.t, trend), sample_weights(rec.mask, rec.sigma, rec.y.shape)
    simulated = np.empty_like(rec.y)
    cov = np.zeros((sum(orders), sum(orders)))
    states, offsets, first = [], [], 0
    trend_cov = np.zeros((len(orders) * len(drift),) * 2)
    for i, n in enumerate(orders):
        behind = slice(i * len(drift), (i + 1) * len(drift))
        den, _ = layout.polynomials(params, i)
        forced = _forced(layout, params, rec, i, held)
        free = free_response(den, rec.t)
        if rest:
            given[first : first + n] = _steady(layout, params, rec, i)  # type: ignore[index]
        left = rec.y[i] - forced
        if given is None:
            found = regress(left, np.vstack([free, drift]), weights[i])
            states.append(found.coefficients[:n])
            cov[first : first + n, first : first + n] = found.covariance[:n, :n]
            offsets.append(found.coefficients[n:])
            trend_cov[behind, behind] = found.covariance[n:, n:]
            fitted = found.fitted
        else:
            states.append(given[first : first + n])
            start = states[-1] @ free
            found = regress(left - start, drift, weights[i])
            offsets.append(found.coefficients)
            trend_cov[behind, behind] = found.covariance
            fitted = start + found.fitted
        simulated[i] = forced + fitted
        first += n
    _refuse_overflow(simulated, rec)
    return simulated, InitialState(np.concatenate(states), cov, np.concatenate(offsets), trend_cov)


def simulate_system(system: LTI, trend: str | None, rec: Record) -> F64:
    """Outputs (output, time) of a system with numbers for a record with its channels; as `simulate_paths`."""
    if rec.dt is not None:
        forced = system.respond(drives(rec, rec.t0), rec.dt, rec.intervals, None, rec.intersample, held=True)
    else:
        forced = _forced_uneven(system, rec)
    drift, weights = trend_columns(rec.t, trend), sample_weights(rec.mask, rec.sigma, rec.y.shape)
    simulated = np.empty_like(rec.y)
    for i, dens in enumerate(system.polynomials()[1]):
        den = np.ones(1)
        for own in {d.tobytes(): d for d in dens}.values():  # each of the paths' once
            den = np.asarray(np.polymul(den, own))
        free = free_response(den, rec.t)
        found = regress(rec.y[i] - forced[i], np.vstack([free, drift]), weights[i])
        simulated[i] = forced[i] + found.fitted
    _refuse_overflow(simulated, rec)
    return simulated


def _refuse_overflow(simulated: F64, rec: Record) -> None:
    """Refuse responses that are no numbers, or of which an output is less than the rounding."""
    size = np.max(np.abs(rec.y), axis=1, keepdims=True)
    if not np.all(np.abs(simulated) < np.where(size > 0, LOST * size, LARGEST)):
        raise DataError(
            f"simulating the fit: the output overflows or leaves all bounds within {rec.duration:g} s, the "
            "model is unstable; predict a shorter piece with rec.window(start, stop)"
        )


def path_columns(layout: Layout, params: F64, trend: str | None, rec: Record, free: bool) -> F64:
    """Derivatives of the outputs to what belongs to the record, (unknown, output, time).

    These are the initial state, where it is free, and the trend of each output.
    """
    drift, found = trend_columns(rec.t, trend), []
    for i in range(len(layout.orders)):
        den, _ = layout.polynomials(params, i)
        for row in [*(free_response(den, rec.t) if free else []), *drift]:
            found.append(np.zeros_like(rec.y))
            found[-1][i] = row
    return np.array(found).reshape(-1, *rec.y.shape)


def observe_paths(
    layout: Layout, params: F64, trend: str | None, rec: Record, eigenvalues: ArrayLike | None
) -> InitialState:
    """Initial state of transfer functions by an observer run backwards in time, the trend beside it."""
    if rec.dt is None:
        raise DataError(
            "initial_state: an observer needs even sampling, and this record's steps are uneven; "
            'use method="lstsq"'
        )
    refuse_own_noise(rec, "initial_state", 'use method="lstsq", which weighs them')
    orders = layout.orders
    terms = len(trend_columns(rec.t, trend))
    cov = np.zeros((sum(orders), sum(orders)))
    states, trends, first = [], [], 0
    # The outputs' free responses have no state in common: an observer each.
    for i, n in enumerate(orders):
        den, _ = layout.polynomials(params, i)
        left = (rec.y[i] - _forced(layout, params, rec, i))[None]
        found = observe(companion(den), np.eye(n)[:1], left, rec.dt, trend=terms, eigenvalues=eigenvalues)
        cov[first : first + n, first : first + n] = found.cov
        states.append(found.state)
        trends.append(found.trend.ravel())
        first += n
    return InitialState(np.concatenate(states), cov, np.concatenate(trends))


def states_of(outputs: Sequence[str], orders: Sequence[int]) -> list[str]:
    """Names of the states of transfer functions: y, y', … of each output."""
    return [name + "'" * k for name, order in zip(outputs, orders, strict=True) for k in range(order)]


def given_state(
    initial_state: str | ArrayLike | Mapping[str, float] | InitialState, names: Sequence[str]
) -> F64:
    """An initial state as the user gave it to `predict`, in the order of the names."""
    n = len(names)
    if isinstance(initial_state, str):
        if initial_state != "zero":
            raise SpecError(
                f'predict: initial_state={initial_state!r} must be "zero", "rest" (of transfer functions), '
                "an array, or left out"
            )
        return np.zeros(n)
    initial_state = by_name("predict", "initial_state", initial_state, names)
    try:
        state = np.asarray(initial_state, dtype=float)
    except Exception:  # of whatever the conversion of an unknown object raises
        raise SpecError(
            f'predict: initial_state must be "zero" or {n} numbers, got {shown(initial_state)}'
        ) from None
    if state.shape != (n,) or not np.all(np.isfinite(state)):
        raise SpecError(
            f"predict: initial_state has shape {state.shape}, the model has {n} states: give y, y', ... "
            "of the free response at the first sample, as finite numbers"
        )
    if np.abs(state).max(initial=0.0) > LARGEST:
        raise SpecError(
            f"predict: initial_state reaches {np.abs(state).max():.3g}, whose square overflows; take "
            "other units"
        )
    return state


def _steady(layout: Layout, params: F64, rec: Record, output: int) -> F64:
    """Free response at the first sample, y, y', …, of an output steady under the inputs' first values."""
    if not rec.inputs:
        return np.zeros(layout.orders[output])
    den, nums = layout.polynomials(params, output)
    standing = rec._like(u=np.repeat(rec.u[:, :1], rec.u.shape[1], axis=1))
    level = sum(num[-1] * u for num, u in zip(nums, rec.u[:, 0], strict=True)) / den[-1] if den[-1] else 0.0
    left = level - _forced(layout, params, standing, output)
    return np.asarray(np.linalg.lstsq(free_response(den, rec.t).T, left, rcond=None)[0])


def _forced(layout: Layout, params: F64, rec: Record, output: int, held: bool = True) -> F64:
    """Response of an output from rest to the record's inputs, `held` before it or zero."""
    if not rec.inputs:
        return np.zeros(rec.t.size)
    model = path_model(layout, params, output)
    if rec.dt is not None:
        driven = drives(rec, rec.t0)
        response: F64 = model.respond(driven, rec.dt, rec.intervals, None, rec.intersample, held)[0]
        return response
    return np.asarray(_forced_uneven(model, rec)[0])


def _forced_uneven(model: LTI, rec: Record) -> F64:
    """Exact at uneven instants, (output, time); smooth inputs are treated as straight between samples."""
    if np.any(model.path_delays):
        raise DataError(
            f"simulating the fit: delays of {model.delays} s need even sampling and this record's steps are "
            "uneven; resample it first"
        )
    a, b, c, d, _ = model.scaled()
    held = [kind == "zoh" for kind in rec.intersample]
    return simulate_uneven(a, b, c, d, np.zeros(len(a)), rec.u, held, rec.t).reshape(len(c), -1)


def unexplained(fit: Any, rec: Record) -> F64:
    """What a fit's response leaves of the outputs; all of them where it cannot be simulated."""
    try:
        with np.errstate(all="ignore"):
            left: F64 = rec.y - fit.simulate(rec)[0]
    except ModfunError:
        return rec.y
    return left if np.isfinite(left).all() else rec.y


def misses(fit: Any) -> float:
    """Squares of what the response leaves of the records' outputs, each in units of its own scatter."""
    total = 0.0
    with np.errstate(over="ignore"):  # of an unstable estimate
        for rec in fit.records or ():
            scatter = np.maximum(rec.y.std(axis=1, keepdims=True), TINY)
            total += float(np.sum((unexplained(fit, rec) / scatter) ** 2))
    return total
