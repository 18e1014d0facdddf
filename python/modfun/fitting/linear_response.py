"""Responses of linear equations between the samples: exact, and linear in initial state and trend."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F64, I64
from ..base.words import TRENDS
from ..equations.nonlinear import NonlinearModel, model_of
from ..records.functions import drives
from ..records.mask import sample_weights
from ..records.record import Record
from ..results.regression import regress
from ..systems.propagate import respond

__all__ = ["linear_response"]

AFFINE = 1e-9  # relative error of rates at a point from those of the matrices
WEIGHINGS = 2  # of several outputs, by what they leave


def linear_response(fit: Any, rec: Record, fine: Record, at: I64) -> F64 | None:
    """Outputs (output, time) of fitted equations at the times of an even record between the samples.

    Integration of each initial state and trend in steps took a third of a fit with two lags and delays.

    Parameters
    ----------
    fit : EquationFit
    rec : Record
        Its samples tell the initial state and the trend.
    fine : Record
        Inputs in equal parts of its step.
    at : ndarray
        The samples among the times of `fine`.

    Returns
    -------
    ndarray or None
        None of equations that are no linear system with constant numbers, and of what overflows.
    """
    compiled = fit.structure.compiled(fit.outputs, fit.inputs)
    if fine.dt is None or not compiled.is_linear:
        return None
    terms = TRENDS.index(fit.trend)
    params = np.asarray(fit.params, dtype=float)
    if terms:
        from ..equations.symbolic.ode import with_trend

        compiled = with_trend(compiled, terms)
        params = np.append(params, np.zeros(len(compiled.parameters) - params.size))
    system = _system(model_of(compiled, params), params.size - fit.params.size)
    if system is None:
        return None
    (a, b, c, d), late, channels, (own, out) = system
    n, words = len(a), (fine.dt, fine.intervals)
    none, still = np.zeros((n, 0)), np.zeros((len(c), 0))
    # The last column is what stands without any signal.
    given = drives(fine, fine.t0)
    inputs = [*(given[k] for k in channels), np.ones(fine.t.size)]
    kinds = [*(fine.intersample[k] for k in channels), "zoh"]
    forced = respond((a, b, c, d), np.zeros(n), inputs, *words, kinds, [*late, 0.0], held=True)
    columns = [respond((a, none, c, still), x0, [], *words, (), ()) for x0 in np.eye(n)]
    for k in range(own.shape[1]):
        pushed = a, own[:, [k]], c, out[:, [k]]
        shape = fine.t ** (k % terms)
        columns.append(respond(pushed, np.zeros(n), [shape], *words, ("foh",), (0.0,)))
    basis = np.array(columns).reshape(-1, *forced.shape)
    if not (np.isfinite(forced).all() and np.isfinite(basis).all()):
        return None
    z = _least(rec, forced[:, at], basis[:, :, at])
    return np.asarray(forced + np.tensordot(z, basis, 1))


def _system(model: NonlinearModel, trends: int) -> Any:
    """A, B, C, D; delays and channels of the inputs; what trends of each equation push and add.

    None where equations look back at states, take derivatives of inputs, or change in time.
    """
    form, theta = model.form, np.array(list(model.params.values()))
    late = [float(one) for one in form.delays(theta)]
    plain = not form.pasts and not model._known and all(one.order == 0 for one in form.drives)
    if not plain or not all(np.isfinite(one) and one >= 0 for one in late):
        return None
    n, inputs = len(form.states), len(form.drives)
    first = theta.size - trends

    def of(*given: Any) -> F64:
        x, v, z, t = given
        words: Any = t, list(x), list(v), [], [*theta[:first], *z]
        return np.array([*form.rates(*words), *form.outputs(*words)], dtype=float)

    none: list[Any] = [np.zeros(n), np.zeros(inputs), np.zeros(trends)]
    level = of(*none, 1.0)  # when a drift by time is 1, too
    moved = [
        np.array([of(*none[:k], one, *none[k + 1 :], 1.0) - level for one in np.eye(size)])
        .reshape(size, level.size)
        .T
        for k, size in enumerate((n, inputs, trends))
    ]
    x, v = np.linspace(1, 2, n), np.linspace(-1, 3, inputs)
    there, told = of(x, v, none[2], 2.0), level + moved[0] @ x + moved[1] @ v
    if not np.allclose(there, told, rtol=AFFINE, atol=AFFINE * float(np.abs(told).max(initial=0.0))):
        return None
    whole = np.column_stack([moved[1], level])
    matrices = tuple(np.ascontiguousarray(m) for m in (moved[0][:n], whole[:n], moved[0][n:], whole[n:]))
    return matrices, late, [one.input for one in form.drives], (moved[2][:n], moved[2][n:])


def _least(rec: Record, forced: F64, basis: F64) -> F64:
    """The initial state and trend that follow samples best, outputs weighed by what is left of them."""
    own = sample_weights(rec.mask, rec.sigma, rec.y.shape)
    spread, left = np.std(rec.y, axis=1), rec.y - forced
    weight = own / np.where(spread > 0, spread, 1.0)[:, None]
    rows = basis.reshape(len(basis), -1)
    found = regress(left.ravel(), rows, weight.ravel())
    for _ in range(WEIGHINGS if len(rec.outputs) > 1 else 0):
        e = own * (left - found.fitted.reshape(left.shape))
        level = np.sqrt(np.sum(e**2, axis=1) / np.maximum(np.count_nonzero(own, axis=1), 1))
        weight = own / np.maximum(level, 1e-9 * np.max(np.abs(rec.y)))[:, None]
        found = regress(left.ravel(), rows, weight.ravel())
    return found.coefficients
