"""Least squares: linear ones with scaled columns, nonlinear ones by Levenberg–Marquardt steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["damped_step", "levenberg_marquardt", "scaled_lstsq"]

F64 = NDArray[np.float64]


def scaled_lstsq(columns: F64, target: F64) -> F64:
    """Least squares with columns of unit norm; what cannot be found is 0."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    solution: F64 = np.linalg.lstsq(columns / size, target, rcond=1e-13)[0] / size
    return solution


class Point(Protocol):
    """Where a search stands."""

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""


P = TypeVar("P", bound=Point)
Slopes = TypeVar("Slopes")
Move = TypeVar("Move")


def levenberg_marquardt(
    here: P,
    slopes: Callable[[P], Slopes],
    step: Callable[[P, Slopes, float], tuple[Move, float, float]],
    moved: Callable[[P, Move], P | None],
    *,
    enough: float,
    tol: float,
    maxiter: int,
    damping: float = 1e-3,
) -> tuple[P, int, str]:
    """Search for the least sum of squares.

    Parameters
    ----------
    here
        Start, with its `cost`.
    slopes : callable
        What steps from a point need beside it; made once a point.
    step : callable
        From a point, its slopes and a damping, beside which columns have unit norm: a move, the fall of the
        cost that it promises without the damping, and its squared length in these columns.
    moved : callable
        The point after a move, None where it is not allowed.
    enough : float
        Cost that is as good as zero.
    tol : float
        Relative fall of the cost; a step that promises less ends the search.
    maxiter : int
    damping : float
        To begin with.

    Returns
    -------
    point
        The best.
    nit : int
        Steps tried.
    ended : {"enough", "settled", "maxiter"}
    """
    own = slopes(here)
    for nit in range(maxiter):
        if here.cost <= enough:
            return here, nit, "enough"
        move, promised, length = step(here, own, damping)
        if promised <= tol * here.cost and damping <= 1.0:
            return here, nit, "settled"
        trial = moved(here, move)
        if trial is None:
            damping *= 5.0
        else:
            # The least damping with which the step's model has the curvature that the cost shows along the
            # move: squared slopes lack what the residuals' own curvature adds.
            fall = here.cost - trial.cost
            least = (promised - fall) / max(length, 1e-300)
            if fall > 0:
                damping = max(min(least, 10.0 * damping), 0.2 * damping, 1e-12)
                here, own = trial, slopes(trial)
            else:
                damping = max(min(least, 1e3 * damping), 5.0 * damping)
        if damping > 1e8:
            return here, nit, "settled"
    return here, maxiter, "maxiter"


class WeightedPoint(Point, Protocol):
    """The same with its weighted residuals."""

    @property
    def residual(self) -> F64:
        """What is left, row by row of the Jacobian."""


def damped_step(here: WeightedPoint, jacobian: F64, damping: float) -> tuple[F64, float, float]:
    """The `step` of `levenberg_marquardt` for a dense Jacobian (row, unknown)."""
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0, size, 1.0)
    rows = np.vstack([jacobian / size, np.sqrt(damping) * np.eye(size.size)])
    step = np.linalg.lstsq(rows, np.append(here.residual, np.zeros(size.size)), rcond=None)[0]
    left = here.residual - jacobian @ (step / size)
    return step / size, here.cost - float(left @ left), float(step @ step)
