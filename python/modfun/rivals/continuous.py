"""Continuous-time output error: of one output by least squares, of others by maximum likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..base.arguments import public, reals
from ..base.arrays import F64
from ..base.least_squares import scaled_lstsq
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import FitError, SpecError
from ..experiments.sensitivities import Sensitivities, trend_rows
from ..models.free import Free
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..responses.coefficients import regressors
from ..systems.polynomials import roots, time_unit
from ..systems.propagate import Inputs
from .common import Found, check, check_record, errors_of, joined, least_squares
from .likelihood import OutputErrorFit, most_likely

__all__ = ["OutputError", "output_error"]


@public
def output_error(
    model: TransferFunction | StateSpace | Equation,
    *,
    initial_state: str = "free",
    trend: str | None = None,
    start: Mapping[str, float] | None = None,
    maxiter: int = 100,
) -> OutputError:
    """Continuous-time output error: least squares between measured and exactly simulated output.

    Of a transfer function to one output of one record: Levenberg–Marquardt (SciPy's MINPACK) with exact
    derivatives, from the report's one-shot estimate, eq. (19), unstable poles mirrored, or from a given
    point. Of anything else, maximum likelihood under noise that is white in time and correlated between
    outputs: each record has a covariance of its residuals, estimated with the parameters, and an initial
    state and trend of its own; damped Gauss–Newton steps from the better of `fit`'s "wls" and "ls", or from a
    given point. Derivatives of linear systems are exact, those of nonlinear equations differences on common
    steps. Under white noise both are maximum likelihood. Records of an `Equation` may be sampled at uneven
    times; of all but transfer functions of one output, samples may be masked, for all outputs at once.

    Parameters
    ----------
    model : TransferFunction, StateSpace or Equation
        What is fitted; bounds of `Free` are kept by a `StateSpace` and an `Equation`.
    initial_state : {"free", "zero"}
        Whether the initial state is estimated, too.
    trend : {None, "constant", "linear"}
        Offset, or offset and slope, of each output, estimated, too. A constant in the equations of a
        linear system is such an offset; one of nonlinear equations is a parameter to write there.
    start : mapping of str to float, optional
        Parameters to start from, all of them (a Fit's ``dict(zip(fit.param_names, fit.params))``).
    maxiter : int
        Most evaluations of the output.

    Returns
    -------
    OutputError
        Call it with a record, or a list of records of one system, for parameters by name; ``solve``
        tells covariances, initial states and trends, too.

    Raises
    ------
    SpecError
        Arguments that do not fit; when called, records that do not fit the model.
    FitError
        When called: no finite response at the start, or no convergence.

    See Also
    --------
    modfun.rivals.pem : A discrete model.
    modfun.fit : What it is compared with.

    References
    ----------
    L. Ljung, System Identification: Theory for the User, Prentice-Hall, 1999. R. E. Maine, K. W. Iliff,
    Application of Parameter Estimation to Aircraft Stability and Control, NASA RP-1168, 1986.

    Examples
    --------
    >>> import modfun as mf
    >>> rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    >>> estimate = output_error(mf.TransferFunction(poles=2, zeros=0))
    >>> {name: round(value, 3) for name, value in estimate(rec).items()}
    {'a1': 3.0, 'a2': 8.0, 'b0': 5.0}
    """
    kinds = (TransferFunction, StateSpace, Equation)
    check(model, "output_error", initial_state, ("free", "zero"), trend, maxiter, kinds)
    return OutputError(model, initial_state, trend, None if start is None else dict(start), maxiter)


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

    model: TransferFunction | StateSpace | Equation
    initial_state: str
    trend: str | None
    start: dict[str, float] | None
    maxiter: int

    @property
    def name(self) -> str:
        """What tables call it."""
        return "output error" if self.initial_state == "free" else "output error (from rest)"

    def __call__(self, rec: Record | Sequence[Record], rng: Any = None) -> Found:
        """Estimate the parameters from a record or several; raises FitError where that fails.

        The answer is a dict that has standard errors beside it, ``estimate(rec).bse["a1"]``, for white noise.
        """
        model = self.model
        if (
            isinstance(model, TransferFunction)
            and isinstance(rec, Record)
            and len(rec.outputs) == 1
            and not (model.params or isinstance(model.delay, Free))
        ):
            return self._plain(rec, model)
        solved = self.solve(rec)
        return Found(solved.params, solved.bse)

    def solve(self, rec: Record | Sequence[Record]) -> OutputErrorFit:
        """Parameters with standard errors, covariances of residuals, initial states and trends.

        Parameters
        ----------
        rec : Record or sequence of Record

        Returns
        -------
        OutputErrorFit

        Raises
        ------
        FitError
            No finite response at the start, or no convergence.
        """
        records = list(rec) if isinstance(rec, Sequence) else [rec]
        free = self.initial_state == "free"
        return most_likely(self.model, records, free, self.trend, self.start, self.maxiter)

    def _plain(self, rec: Record, model: TransferFunction) -> Found:
        check_record(rec, model, self.name)
        layout = model.plain_layout(rec.inputs, self.name)
        names, degrees, delays = layout.param_names, layout.numerators[0], layout.delays(np.zeros(0))
        n, count = layout.orders[0], len(names)
        extra = trend_rows(self.trend, rec.intervals + 1)
        theta = self._start(rec, model, names, extra)
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
        found = least_squares(output, x, y, self.maxiter, self.name)
        simulated, columns = output(found)
        freedom = max(y.size - found.size, 1)
        bse = np.sqrt(np.sum((simulated - y) ** 2) / freedom) * errors_of(columns.T)
        values = [(one[:count] / engine.scale).tolist() for one in (found, bse)]
        return Found(*[dict(zip(names, own, strict=True)) for own in values])

    def _start(self, rec: Record, model: TransferFunction, names: tuple[str, ...], extra: F64) -> F64:
        if self.start is not None:
            missing, more = set(names) - set(self.start), set(self.start) - set(names)
            if missing or more:
                said = f"lacks {joined(missing)}" if missing else f"names {joined(more)}"
                raise SpecError(f"output_error: start= {said}; give {', '.join(names)}, all and only these")
            return reals("output_error", "start", [self.start[name] for name in names])
        n = model.plain_layout(rec.inputs, self.name).orders[0]
        harmonics = max(0, min(3 * len(names), rec.intervals // 4 - n))
        r = regressors(rec, model, harmonics=harmonics)
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


def _mirrored(a: F64) -> F64:
    """Denominator a1 … an with its poles in the left half plane: a start must not explode."""
    found = roots(np.append(1.0, a))
    if np.all(found.real < 0):
        return a
    real = -np.maximum(np.abs(found.real), 1e-3 * np.abs(found))
    return np.real(np.poly(real + 1j * found.imag))[1:]
