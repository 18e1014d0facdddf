"""Discrete-time rivals: prediction error and ARX, converted to continuous time."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from ..base.arguments import public
from ..errors import FitError
from ..experiments.discrete import Discrete
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .common import check, check_record, least_squares

__all__ = ["ARX", "PredictionError", "arx", "pem"]


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
    check(model, "pem", initial_state, ("estimated", "zero"), trend, maxiter)
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
    check(model, "arx", "zero", ("zero",), None, 1)
    return ARX(model)


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
        check_record(rec, self.model, self.name)
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
                starts.append(least_squares(rest.output, x, y, self.maxiter, self.name)[: rest.n])
        x = min((fit.completed(f, y) for f in starts), key=lambda point: fit.cost(point, y))
        found = least_squares(fit.output, x, y, self.maxiter, self.name)
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
        check_record(rec, self.model, self.name)
        fit = Discrete(rec, self.model, False, None)
        return fit.continuous(fit.start(rec.y[0]), self.name)
