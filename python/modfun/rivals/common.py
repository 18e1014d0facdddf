"""What all rivals check and search by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.arguments import whole
from ..base.arrays import F64
from ..base.words import TRENDS
from ..errors import DataError, FitError, SpecError
from ..models.options import MOST
from ..models.transfer_function import TransferFunction
from ..records.mask import refuse_own_noise
from ..records.record import Record

__all__ = ["HUGE", "Found", "check", "check_record", "errors_of", "joined", "least_squares"]

HUGE = 1e100  # stands for an overflowed residual: refused by the step control, harmless to its sums


class Found(dict[str, float]):
    """Parameters by name, which know their standard errors: `bse`, by the same names."""

    def __init__(self, params: Mapping[str, float], bse: Mapping[str, float]) -> None:
        super().__init__(params)
        self.bse = dict(bse)

    def __repr__(self) -> str:
        return f"{{{', '.join(f'{n!r}: {value:.5g} ± {self.bse[n]:.2g}' for n, value in self.items())}}}"


def errors_of(jacobian: F64) -> F64:
    """Standard errors of unknowns (unknown,) by the derivatives (row, unknown) of rows with unit variance."""
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0] = 1.0
    root = np.linalg.pinv(jacobian / size, rcond=1e-13) / size[:, None]
    return np.asarray(np.sqrt(np.sum(root**2, axis=1)))


def least_squares(output: Any, x: F64, y: F64, maxiter: int, what: str) -> F64:
    """SciPy's least squares with the output and its derivatives from one call."""
    from scipy import optimize

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
        found = optimize.least_squares(
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


def joined(names: set[str]) -> str:
    """Names in order, with commas."""
    return ", ".join(sorted(names))


def check(
    model: Any,
    what: str,
    state: str,
    states: tuple[str, ...],
    trend: str | None,
    maxiter: int,
    kinds: tuple[type, ...] = (TransferFunction,),
) -> None:
    """Refuse arguments that no rival takes."""
    if not isinstance(model, kinds):
        others = "".join(f" or mf.{kind.__name__}" for kind in kinds[1:])
        raise SpecError(
            f"{what}: the model is a {type(model).__name__}; give a structure, "
            f"TransferFunction(poles=, zeros=){others}"
        )
    if state not in states:
        raise SpecError(
            f"{what}: initial_state={state!r} is unknown; choose {' or '.join(map(repr, states))}"
        )
    if trend not in TRENDS:
        raise SpecError(f"{what}: trend={trend!r} is unknown; choose None, 'constant' or 'linear'")
    whole(what, "maxiter", maxiter, 1, MOST)


def check_record(rec: Record, model: TransferFunction, what: str) -> None:
    """Refuse a record that a rival of one output cannot take."""
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
