"""From data to delay systems: the equations to fit, and what a fit says as matrices, errors included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.arguments import public
from ..base.arrays import F64
from ..base.student import confidence
from ..equations.equation import Equation
from ..equations.nonlinear import NonlinearModel
from ..equations.written import channel_names
from ..errors import SpecError
from ..results.fit import Fit
from ..systems.lti import LTI
from ..systems.making import linear
from .mu import Uncertainty
from .system import DelaySystem

__all__ = ["equation", "errors", "from_fit"]

LINEAR = 1e-9  # part of its size by which a linear right side may miss the sum of its parts


@public
def equation(
    A: Mapping[float | str, Any],
    B: Mapping[float | str, Any] | None = None,
    *,
    states: Sequence[str] | None = None,
    inputs: Sequence[str] | None = None,
    params: Mapping[str, Any] | None = None,
) -> Equation:
    """The equations x'(t) = Σ A_k x(t − h_k) + Σ B_r u(t − r) with parameters, states measured, to be fitted.

    Needs the extra ``symbolic``. Records with offsets want ``mf.fit(..., trend="constant")``.

    Parameters
    ----------
    A : mapping of float or str to matrices of str and float
        By lag: a number in s, or the name of a parameter that `params` gives bounds. Entries are names,
        expressions of names as text, or numbers.
    B : mapping of float or str to matrices of str and float, optional
        Likewise; a list of entries is one input. Default: no inputs.
    states, inputs : sequence of str, optional
        Names; default x1, x2, … and u or u1, u2, ….
    params : mapping of str to float or Free, optional
        Parameters held, or with start and bounds, as in `mf.Equation`. A lag needs a largest value, and is
        best kept above 0, where x(t − h) is x(t).

    Returns
    -------
    Equation

    Raises
    ------
    SpecError
        Matrices that do not fit each other, and what `mf.Equation` refuses.

    See Also
    --------
    modfun.timelag.from_fit : The system that a fit found.
    modfun.Equation : Any equations.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10; Y. A. Fiagbedzi, A. E. Pearson,
    Feedback stabilization of linear autonomous time lag systems, IEEE Trans. Autom. Control 31, 1986.

    Examples
    --------
    >>> import modfun as mf
    >>> model = mf.timelag.equation(A={0: "a", "h": "c"}, B={0: "b"}, params={"h": mf.Free(min=0.1, max=2)})
    >>> model.param_names()
    ('a', 'c', 'h', 'b')
    """
    if not isinstance(A, Mapping) or not A or not isinstance(B, Mapping | None):
        raise SpecError('timelag.equation: A and B map lags to matrices, as {0: [["a"]], "h": [["c"]]}')
    first = _table("A", next(iter(A.values())), None)
    n = len(first)
    width = 0 if not B else len(_table("B", next(iter(B.values())), n)[0])
    own = channel_names("timelag.equation", "states", states, n, "x", always=True)
    drives = channel_names("timelag.equation", "inputs", inputs, width, "u")
    lines = [[] for _ in range(n)]  # type: list[list[str]]
    for name, given, signals in (("A", A, own), ("B", B or {}, drives)):
        for lag, matrix in given.items():
            late = f"(t - {lag})" if isinstance(lag, str) or lag else ""
            for line, row in zip(lines, _table(name, matrix, n, len(signals)), strict=True):
                line += [f"({e})*{s}{late}" for e, s in zip(row, signals, strict=True) if e != 0]
    text = [f"{x}' = {' + '.join(line) or '0'}" for x, line in zip(own, lines, strict=True)]
    return Equation(text, outputs=own, inputs=drives, params=params)


def _table(name: str, given: Any, rows: int | None, columns: int | None = None) -> list[list[Any]]:
    """A matrix of names and numbers; an entry alone is 1 by 1, a list of entries a column."""
    if isinstance(given, str) or np.ndim(given) == 0:
        given = [given]
    table = [[row] if isinstance(row, str) or np.ndim(row) == 0 else list(row) for row in given]
    if not table:
        raise SpecError(f"timelag.equation: {name} has a matrix without rows; leave it out")
    rows = len(table) if rows is None else rows
    columns = columns if columns is not None else rows if name == "A" else len(table[0])
    if len(table) != rows or any(len(row) != columns for row in table):
        raise SpecError(
            f"timelag.equation: {name} has a matrix of {len(table)} rows of {[len(row) for row in table]} "
            f"entries; beside the others it must be {rows} by {columns}"
        )
    return table


@public
def from_fit(fit: Any) -> DelaySystem:
    """The delay system that a fit found.

    Parameters
    ----------
    fit : Fit, NonlinearModel or LTI, or a system of python-control or SciPy
        Of `equation`, of any linear `mf.Equation` with delays known or estimated, of a `mf.StateSpace`, or
        of transfer functions; or its model. Constants in the equations are left out: x is counted from
        where the system rests.

    Returns
    -------
    DelaySystem

    Raises
    ------
    SpecError
        The model is not linear, varies with time, or holds derivatives of inputs.

    See Also
    --------
    modfun.timelag.equation : What was fitted.
    modfun.timelag.errors : What is uncertain.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10; Y. A. Fiagbedzi, A. E. Pearson,
    Feedback stabilization of linear autonomous time lag systems, IEEE Trans. Autom. Control 31, 1986.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> model = mf.timelag.equation(A={0: "a", 0.5: "c"}, B={0: "b"})
    >>> plant = mf.timelag.DelaySystem(A={0: -1.0, 0.5: -0.5}, B={0: 1.0})
    >>> u = "sin(t**2/5)"
    >>> rec = mf.simulate(plant, input=u, duration=10.0, intervals=400, nsr=0.02, seed=0, outputs="x1")
    >>> fit = mf.fit(rec, model)
    >>> found = mf.timelag.from_fit(fit)
    >>> found.order
    1
    """
    fit = linear(fit, "timelag.from_fit")
    model = fit if isinstance(fit, LTI | NonlinearModel) else getattr(fit, "model", None)
    if isinstance(model, LTI):
        sys = model.to_ss()
        late: dict[float, F64] = {}
        for k, lag in enumerate(sys.input_delays("timelag.from_fit")):
            late.setdefault(lag, np.zeros_like(sys.B))[:, k] = sys.B[:, k]
        return DelaySystem({0: sys.A}, late, sys.C)
    if not isinstance(model, NonlinearModel):
        raise SpecError(
            f"timelag.from_fit: {type(fit).__name__} has no model with numbers; give a fit of "
            "mf.timelag.equation(...), mf.Equation or mf.StateSpace, or its .model"
        )
    form, theta = model.form, list(model.params.values())
    lags = [float(h) for h in form.delays(theta)]
    x, v, c = _parts(model, theta)
    n, first = len(form.states), len(form.drives)
    a: dict[float, F64] = {0.0: x}
    b: dict[float, F64] = {0.0: np.zeros((n, len(model.inputs)))}
    for k, (lag, column) in enumerate(zip(lags, v.T, strict=True)):
        if k < first:
            b.setdefault(lag, np.zeros((n, len(model.inputs))))[:, form.drives[k].input] += column
        else:
            a.setdefault(lag, np.zeros((n, n)))[:, form.pasts[k - first].state] += column
    named = all(s.isidentifier() for s in form.states)
    return DelaySystem(
        a,
        b,
        None if np.array_equal(c, np.eye(n)) else c,
        states=form.states if named else None,
        inputs=model.inputs or None,
    )


@public
def errors(fit: Fit, level: float = 0.95) -> list[Uncertainty]:
    """What a fit leaves uncertain of the matrices, for `DelaySystem.mu`.

    One error an axis of the estimates' covariance, so long that the box of all holds the joint confidence
    region of this level; estimated lags are treated as exact.

    Parameters
    ----------
    fit : Fit
        Of `equation` or of a linear `mf.Equation`.
    level : float, default 0.95

    Returns
    -------
    list of Uncertainty

    Raises
    ------
    SpecError
        No standard errors, or as `from_fit`.

    See Also
    --------
    modfun.timelag.DelaySystem.mu : What they may do.
    modfun.Fit.cov_params : What they are made of.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10; Y. A. Fiagbedzi, A. E. Pearson,
    Feedback stabilization of linear autonomous time lag systems, IEEE Trans. Autom. Control 31, 1986.

    Examples
    --------
    >>> import numpy as np
    >>> import modfun as mf
    >>> model = mf.timelag.equation(A={0: "a", 0.5: "c"}, B={0: "b"})
    >>> plant = mf.timelag.DelaySystem(A={0: -1.0, 0.5: -0.5}, B={0: 1.0})
    >>> u = "sin(t**2/5)"
    >>> rec = mf.simulate(plant, input=u, duration=10.0, intervals=400, nsr=0.02, seed=0, outputs="x1")
    >>> fit = mf.fit(rec, model)
    >>> found = mf.timelag.errors(fit)
    >>> len(found)
    3
    """
    from scipy.stats import chi2

    level = confidence("timelag.errors", level)
    model = fit.model
    if not isinstance(model, NonlinearModel):
        raise SpecError("timelag.errors: give a fit of mf.timelag.equation(...) or of a linear mf.Equation")
    plant = from_fit(fit)
    names = list(fit.param_names)
    held = {str(d) for d in _lag_names(model)}
    free = [k for k, name in enumerate(names) if name not in held]
    cov = np.asarray(fit.cov_params())[np.ix_(free, free)]
    if not np.all(np.isfinite(cov)):
        raise SpecError("timelag.errors: the fit has no finite standard errors")
    slopes = []
    for k in free:
        size = 1e-4 * max(abs(fit.params[k]), float(fit.bse[k]), 1e-6)
        sides = []
        for sign in (1.0, -1.0):
            values = dict(model.params)
            values[names[k]] += sign * size
            x, v, _ = _parts(model, list(values.values()))
            sides.append(np.concatenate([x, v], axis=1))
        slopes.append((sides[0] - sides[1]) / (2 * size))
    sizes, axes = np.linalg.eigh(cov)
    reach = np.sqrt(float(chi2.ppf(level, len(free))) * np.maximum(sizes, 0))
    blocks = []
    for axis, own in zip(axes.T, reach, strict=True):
        change = own * np.tensordot(axis, np.array(slopes), axes=1)
        if np.abs(change).max() > 1e-12:
            blocks.append(_block(model, plant, change))
    return blocks


def _block(model: NonlinearModel, plant: DelaySystem, change: F64) -> Uncertainty:
    """A change of the coefficients of x, inputs and the past as matrices by lag."""
    form = model.form
    n, first = plant.order, len(form.drives)
    lags = [float(h) for h in form.delays(list(model.params.values()))]
    a: dict[float, F64] = {0.0: change[:, :n].copy()}
    b: dict[float, F64] = {}
    for k, (lag, column) in enumerate(zip(lags, change[:, n:].T, strict=True)):
        if k < first:
            b.setdefault(lag, np.zeros((n, plant.shape[1])))[:, form.drives[k].input] += column
        else:
            a.setdefault(lag, np.zeros((n, n)))[:, form.pasts[k - first].state] += column
    return Uncertainty(A=a, B=b)


def _lag_names(model: NonlinearModel) -> set[Any]:
    delays = [d.delay for d in model.form.drives] + [p.delay for p in model.form.pasts]
    return {s for delay in delays for s in delay.free_symbols}


def _parts(model: NonlinearModel, theta: list[float]) -> tuple[F64, F64, F64]:
    """Coefficients of x and of v in x', and of x in y.

    Raises
    ------
    SpecError
        The equations are not linear, vary with time, or hold derivatives of inputs.
    """
    form = model.form
    n, m = len(form.states), len(form.drives) + len(form.pasts)
    known = [0.0] * len(model._known)

    def rates(x: F64, v: F64, t: float = 0.0) -> F64:
        return np.array(form.rates(t, x.tolist(), v.tolist(), known, theta), dtype=np.float64)

    def outputs(x: F64, v: F64) -> F64:
        return np.array(form.outputs(0.0, x.tolist(), v.tolist(), known, theta), dtype=np.float64)

    rest = rates(np.zeros(n), np.zeros(m))
    a = np.array([rates(unit, np.zeros(m)) - rest for unit in np.eye(n)]).T
    b = np.array([rates(np.zeros(n), unit) - rest for unit in np.eye(m)]).reshape(m, n).T
    c = np.array([outputs(unit, np.zeros(m)) - outputs(np.zeros(n), np.zeros(m)) for unit in np.eye(n)]).T
    fed = [outputs(np.zeros(n), unit) - outputs(np.zeros(n), np.zeros(m)) for unit in np.eye(m)]
    if any(d.order for d in form.drives) or model._known or np.any(fed):
        raise SpecError(
            "timelag.from_fit: derivatives of inputs, inputs that feed through at once, or coefficients that "
            "vary with time stand in the equations; a DelaySystem has none"
        )
    x, v = np.linspace(0.7, -1.3, n), np.linspace(-0.9, 1.1, m)
    found, wanted = rates(x, v, 0.37), rest + a @ x + b @ v
    if not np.allclose(found, wanted, rtol=0, atol=LINEAR * (np.abs(a).sum() + np.abs(b).sum() + 1)):
        raise SpecError(
            "timelag.from_fit: the equations are not linear in states and inputs with constant coefficients; "
            "a DelaySystem is"
        )
    return a, b, c
