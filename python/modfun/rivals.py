"""Established estimators to compare with, on SciPy: continuous output error, discrete prediction error, ARX.

Each is made from a structure and called with a record; it returns its parameters by name and raises
`FitError` where it finds none, so that a Monte Carlo study can count the failures.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from .base.arguments import public, reals, whole
from .base.arrays import F64
from .base.least_squares import scaled_lstsq
from .base.words import TRENDS
from .errors import DataError, FitError, SpecError
from .experiments.discrete import Discrete
from .experiments.sensitivities import Sensitivities, trend_rows
from .models.options import MOST
from .models.transfer_function import TransferFunction
from .records.record import Record
from .records.samples import refuse_own_noise
from .responses.coefficients import regressors
from .systems.polynomials import roots, time_unit
from .systems.propagate import Inputs

__all__ = ["ARX", "OutputError", "PredictionError", "arx", "output_error", "pem"]

HUGE = 1e100  # stands for an overflowed residual: refused by the step control, harmless to its sums


@public
def output_error(
    model: TransferFunction,
    *,
    initial_state: str = "free",
    trend: str | None = None,
    start: Mapping[str, float] | None = None,
    maxiter: int = 100,
) -> OutputError:
    """Continuous-time output error: least squares between measured and exactly simulated output.

    Levenberg–Marquardt (SciPy's MINPACK) with exact derivatives, from the report's one-shot estimate,
    eq. (19), unstable poles mirrored, or from a given point. Under white noise it is maximum likelihood.

    Parameters
    ----------
    model : TransferFunction
        What is fitted.
    initial_state : {"free", "zero"}
        Whether the initial state is estimated, too.
    trend : {None, "constant", "linear"}
        Offset, or offset and slope, of the output, estimated, too.
    start : mapping of str to float, optional
        Parameters to start from, all of them (a Fit's ``dict(zip(fit.param_names, fit.params))``).
    maxiter : int
        Most evaluations of the output.

    Returns
    -------
    OutputError
        Call it with a record.

    See Also
    --------
    modfun.rivals.pem : A discrete model.
    modfun.fit : What it is compared with.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999.

    Examples
    --------
    >>> import modfun as mf
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> estimate = output_error(mf.TransferFunction(poles=2, zeros=0))
    >>> {name: round(value, 3) for name, value in estimate(rec).items()}
    {'a1': 3.0, 'a2': 8.0, 'b0': 5.0}
    """
    _check(model, "output_error", initial_state, ("free", "zero"), trend, maxiter)
    return OutputError(model, initial_state, trend, None if start is None else dict(start), maxiter)


@public
def pem(
    model: TransferFunction,
    *,
    initial_state: str = "estimated",
    trend: str | None = None,
    maxiter: int = 100,
) -> PredictionError:
    """Discrete-time output-error model of the same order, converted to continuous time.

    y_k = Σ B(q)/F(q) u_k + e_k with n coefficients in F and in each B (one more where the structure feeds
    through), fitted by Levenberg–Marquardt (SciPy's MINPACK) from ARX least squares and ten steps of
    Steiglitz and McBride, then converted as a sampled system with held input. The conversion gives a
    numerator of degree n − 1 whatever the structure; its coefficients of the structure's degree and below
    are kept, among them the gain at rest. Delays are rounded to whole samples.

    Parameters
    ----------
    model : TransferFunction
        What is fitted.
    initial_state : {"estimated", "zero"}
        Whether the n initial conditions are estimated, too.
    trend : {None, "constant", "linear"}
        Offset, or offset and slope, of the output, estimated, too.
    maxiter : int
        Most evaluations of the output.

    Returns
    -------
    PredictionError
        Call it with a record.

    See Also
    --------
    modfun.rivals.output_error : White noise at the output.
    modfun.fit : What it is compared with.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.0)
    >>> estimate = mf.rivals.pem(mf.TransferFunction(poles=2, zeros=0))
    >>> sorted(estimate(rec))
    ['a1', 'a2', 'b0']
    """
    _check(model, "pem", initial_state, ("estimated", "zero"), trend, maxiter)
    return PredictionError(model, initial_state, trend, maxiter)


@public
def arx(model: TransferFunction) -> ARX:
    """Discrete-time ARX least squares, converted to continuous time as `pem` does it.

    Cheap, and biased under output noise, the more so the faster the sampling.

    Parameters
    ----------
    model : TransferFunction
        What is fitted.

    Returns
    -------
    ARX
        Call it with a record.

    See Also
    --------
    modfun.rivals.output_error : White noise at the output.
    modfun.fit : What it is compared with.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.0)
    >>> estimate = mf.rivals.arx(mf.TransferFunction(poles=2, zeros=0))
    >>> sorted(estimate(rec))
    ['a1', 'a2', 'b0']
    """
    _check(model, "arx", "zero", ("zero",), None, 1)
    return ARX(model)


# Continuous time ---------------------------------------------------------------------------------


@public
@dataclass(frozen=True)
class OutputError:
    """Continuous-time output error; made by `output_error`.

    See Also
    --------
    modfun.rivals.output_error : Makes it.
    modfun.MonteCarlo : Compares it with estimators of this package.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.0)
    >>> estimate = mf.rivals.output_error(mf.TransferFunction(poles=2, zeros=0))
    >>> sorted(estimate(rec))
    ['a1', 'a2', 'b0']
    """

    model: TransferFunction
    initial_state: str
    trend: str | None
    start: dict[str, float] | None
    maxiter: int

    @property
    def name(self) -> str:
        """What tables call it."""
        return "output error" if self.initial_state == "free" else "output error (from rest)"

    def __call__(self, rec: Record, rng: Any = None) -> dict[str, float]:
        """Estimate the parameters from a record; raises FitError where that fails."""
        _check_record(rec, self.model, self.name)
        layout = self.model.plain_layout(rec.inputs, self.name)
        names, degrees, delays = layout.param_names, layout.numerators[0], layout.delays(np.zeros(0))
        n, count = layout.orders[0], len(names)
        extra = trend_rows(self.trend, rec.intervals + 1)
        theta = self._start(rec, names, extra)
        theta[:n] = _mirrored(theta[:n])
        prepared = _inputs(
            rec.u.tobytes(), len(rec.inputs), rec.dt or 0.0, rec.intervals, rec.intersample, delays
        )
        engine = Sensitivities(n, degrees, prepared, time_unit(np.concatenate([[1.0], theta[:n]])))
        y = rec.y[0]
        free = n if self.initial_state == "free" else 0

        def output(x: F64) -> tuple[F64, F64]:
            transient = x[count : count + free] if free else None
            simulated, columns = engine.run(x[:count], transient)
            return simulated + x[count + free :] @ extra, np.vstack([columns[: count + free], extra])

        x = np.zeros(count + free + len(extra))
        x[:count] = theta * engine.scale
        # What enters linearly, numerators, transient and trend, starts at its best for these poles.
        x[n:] = scaled_lstsq(output(x)[1][n:].T, y)
        found = _least_squares(output, x, y, self.maxiter, self.name)
        return dict(zip(names, (found[:count] / engine.scale).tolist(), strict=True))

    def _start(self, rec: Record, names: tuple[str, ...], extra: F64) -> F64:
        if self.start is not None:
            missing, more = set(names) - set(self.start), set(self.start) - set(names)
            if missing or more:
                said = f"lacks {_joined(missing)}" if missing else f"names {_joined(more)}"
                raise SpecError(f"output_error: start= {said}; give {', '.join(names)}, all and only these")
            return reals("output_error", "start", [self.start[name] for name in names])
        n = self.model.plain_layout(rec.inputs, self.name).orders[0]
        harmonics = max(0, min(3 * len(names), rec.intervals // 4 - n))
        r = regressors(rec, self.model, harmonics=harmonics)
        size = np.linalg.norm(r.gamma, axis=0)
        if not np.all(size > 0):
            raise FitError(f"{self.name}: an input or the output is zero, its parameters cannot be found")
        # Under A(p) an offset stays a constant and a slope a line: their coefficients are further columns.
        lines = np.zeros((len(extra), harmonics + n + 1), dtype=np.complex128)
        lines[:1, 0] = 1.0
        lines[1:, 1:] = 1j / np.arange(1, lines.shape[1])
        columns = np.column_stack([r.gamma, r.differenced(lines)])
        return scaled_lstsq(columns, r.target)[: len(names)]


@lru_cache(maxsize=16)
def _inputs(
    data: bytes, inputs: int, dt: float, intervals: int, kinds: tuple[str, ...], delays: tuple[float, ...]
) -> Inputs:
    """The inputs evaluated for simulation; replicates of a study share theirs."""
    u = np.frombuffer(data, dtype=np.float64).reshape(inputs, intervals + 1)
    return Inputs(list(u), dt, intervals, kinds, delays)


# Discrete time -----------------------------------------------------------------------------------


@public
@dataclass(frozen=True)
class PredictionError:
    """Discrete-time output-error model, converted to continuous time; made by `pem`.

    See Also
    --------
    modfun.rivals.pem : Makes it.
    modfun.MonteCarlo : Compares it with estimators of this package.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.0)
    >>> estimate = mf.rivals.pem(mf.TransferFunction(poles=2, zeros=0))
    >>> sorted(estimate(rec))
    ['a1', 'a2', 'b0']
    """

    model: TransferFunction
    initial_state: str
    trend: str | None
    maxiter: int

    @property
    def name(self) -> str:
        """What tables call it."""
        return "pem" if self.initial_state == "estimated" else "pem (from rest)"

    def __call__(self, rec: Record, rng: Any = None) -> dict[str, float]:
        """Estimate the parameters from a record; raises FitError where that fails."""
        _check_record(rec, self.model, self.name)
        transient = self.initial_state == "estimated"
        fit = Discrete(rec, self.model, transient, self.trend)
        y = rec.y[0]
        starts = [fit.search(y)]
        if transient:
            # In loud noise one record in five ends at a spurious fast pole when the initial conditions
            # are free from the beginning; the best fit from rest is a second start.
            rest = Discrete(rec, self.model, False, self.trend)
            x = rest.completed(rest.search(y), y)
            with suppress(FitError):
                starts.append(_least_squares(rest.output, x, y, self.maxiter, self.name)[: rest.n])
        x = min((fit.completed(f, y) for f in starts), key=lambda point: fit.cost(point, y))
        found = _least_squares(fit.output, x, y, self.maxiter, self.name)
        return fit.continuous(found, self.name)


@public
@dataclass(frozen=True)
class ARX:
    """Discrete-time ARX least squares, converted to continuous time; made by `arx`.

    See Also
    --------
    modfun.rivals.arx : Makes it.
    modfun.MonteCarlo : Compares it with estimators of this package.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999.

    Examples
    --------
    >>> import modfun as mf
    >>> system = mf.tf([5], [1, 3, 8])
    >>> rec = mf.simulate(system, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.0)
    >>> estimate = mf.rivals.arx(mf.TransferFunction(poles=2, zeros=0))
    >>> sorted(estimate(rec))
    ['a1', 'a2', 'b0']
    """

    model: TransferFunction
    name: str = field(default="arx", init=False)

    def __call__(self, rec: Record, rng: Any = None) -> dict[str, float]:
        """Estimate the parameters from a record; raises FitError where that fails."""
        _check_record(rec, self.model, self.name)
        fit = Discrete(rec, self.model, False, None)
        return fit.continuous(fit.start(rec.y[0]), self.name)


# Common to all -----------------------------------------------------------------------------------


def _least_squares(output: Any, x: F64, y: F64, maxiter: int, what: str) -> F64:
    """SciPy's least squares with the output and its derivatives from one call."""
    from scipy.optimize import least_squares

    last: list[Any] = [None, None]

    def evaluate(point: F64) -> tuple[F64, F64]:
        if last[0] is None or not np.array_equal(last[0], point):
            with np.errstate(all="ignore"):
                simulated, columns = output(point)
                bounded = np.nan_to_num(simulated - y, nan=HUGE, posinf=HUGE, neginf=-HUGE)
                slopes = np.nan_to_num(columns.T, nan=0.0, posinf=HUGE, neginf=-HUGE)
            last[:] = point.copy(), (np.clip(bounded, -HUGE, HUGE), np.clip(slopes, -HUGE, HUGE))
        pair: tuple[F64, F64] = last[1]
        return pair

    if not np.all(np.isfinite(x)):
        raise FitError(f"{what}: no finite start; the record does not tell the parameters apart")
    try:
        found = least_squares(
            lambda p: evaluate(p)[0],
            x,
            jac=lambda p: evaluate(p)[1],
            method="lm",
            x_scale="jac",
            ftol=1e-10,
            xtol=1e-8,
            max_nfev=maxiter,
        )
    except (ValueError, np.linalg.LinAlgError) as error:
        raise FitError(f"{what}: the least-squares search failed ({error})") from error
    # A noise-free record is fitted down to rounding, where the search sees no decrease to stop at.
    if found.status <= 0 and 2 * found.cost > 1e-18 * np.sum(y**2):
        raise FitError(
            f"{what}: not converged after {found.nfev} evaluations; raise maxiter= or give a start"
        )
    if not np.all(np.isfinite(found.x)) or found.cost >= HUGE:
        raise FitError(f"{what}: the search ran away from every finite answer; give a start or lower poles=")
    result: F64 = found.x
    return result


def _mirrored(a: F64) -> F64:
    """Denominator a1 … an with its poles in the left half plane: a start must not explode."""
    found = roots(np.append(1.0, a))
    if np.all(found.real < 0):
        return a
    real = -np.maximum(np.abs(found.real), 1e-3 * np.abs(found))
    return np.real(np.poly(real + 1j * found.imag))[1:]


def _joined(names: set[str]) -> str:
    return ", ".join(sorted(names))


def _check(
    model: TransferFunction, what: str, state: str, states: tuple[str, ...], trend: str | None, maxiter: int
) -> None:
    if not isinstance(model, TransferFunction):
        raise SpecError(
            f"{what}: the model is a {type(model).__name__}; give a structure, "
            "TransferFunction(poles=, zeros=)"
        )
    if state not in states:
        raise SpecError(
            f"{what}: initial_state={state!r} is unknown; choose {' or '.join(map(repr, states))}"
        )
    if trend not in TRENDS:
        raise SpecError(f"{what}: trend={trend!r} is unknown; choose None, 'constant' or 'linear'")
    whole(what, "maxiter", maxiter, 1, MOST)


def _check_record(rec: Record, model: TransferFunction, what: str) -> None:
    if not isinstance(rec, Record):
        raise SpecError(f"{what}: got a {type(rec).__name__}; it takes one Record")
    if len(rec.outputs) != 1:
        raise SpecError(
            f"{what}: the record has {len(rec.outputs)} outputs; rec.select(outputs=[...]) takes one"
        )
    if not rec.inputs:
        raise SpecError(f"{what}: the record has no input")
    if rec.dt is None:
        raise DataError(f"{what}: the record is sampled unevenly; resample it")
    refuse_own_noise(rec, what, "take a piece without them, rec.window(start, stop), or use mf.fit")
    layout = model.plain_layout(rec.inputs, what)
    unknowns = layout.orders[0] + len(layout.param_names)
    if rec.intervals < 2 * unknowns:
        raise DataError(f"{what}: {rec.intervals} intervals for {unknowns} unknowns; give a longer record")
