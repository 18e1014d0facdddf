"""Rational functions fitted to frequency responses by weighted least squares.

The unknowns are the poles; numerators are solved for. First the equation is reweighted by the last
denominator (Sanathanan and Koerner), then Levenberg–Marquardt minimises the criterion itself. All in the
basis of `partial_fractions`; polynomials are made at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.cached import cached_property
from ..base.least_squares import levenberg_marquardt
from ..models.layout import Layout
from .fractions import Region, mirrored
from .problem import Point, Problem

__all__ = ["RationalFit", "fit_rational"]


SWEEPS = 20  # Sanathanan–Koerner steps from a start
# Relative moves of the poles: of steps that have settled, and to where the way from another start ended.
SETTLED, MET = 1e-2, 0.03


@dataclass(frozen=True, eq=False)
class RationalFit:
    """What `fit_rational` found.

    Attributes
    ----------
    theta : ndarray, shape (parameter,)
        In the order of ``layout.param_names``.
    poles : tuple of ndarray of complex
        rad/s, of each denominator: one if it is common, else one per output.
    response : ndarray of complex, shape (output, input, omega)
        The fitted response, delays included.
    cost : float
        Σ over lines of r* W r.
    residuals : ndarray, shape (row,)
        Whitened, real and imaginary parts as rows of their own; cost is their sum of squares.
    nit : int
    status : {"ok", "maxiter", "rank", "nonfinite"}
    """

    theta: F64
    poles: tuple[C128, ...]
    response: C128
    cost: float
    residuals: F64
    nit: int
    status: str
    _problem: Problem = field(repr=False)
    _point: Point = field(repr=False)

    @property
    def success(self) -> bool:
        """True where the numbers allowed an answer."""
        return self.status == "ok"

    @property
    def free_poles(self) -> list[C128]:
        """`poles` without held integrators, as `start` of another fit takes them."""
        return [own * self._problem.unit for own in self._point.poles]

    @cached_property
    def _tangent(self) -> tuple[F64, F64]:
        """Rows and parameters over the same independent directions."""
        return self._problem.tangent(self._point)

    @cached_property
    def jacobian(self) -> F64:
        """Derivative of `residuals`, (row, parameter)."""
        rows, params = self._tangent
        return rows @ np.linalg.pinv(params, rcond=1e-15)

    @cached_property
    def cov(self) -> F64:
        """Inverse of JᵀJ, (parameter, parameter): the covariance where W is that of the noise, inverted."""
        rows, params = self._tangent
        size = np.linalg.norm(rows, axis=0)
        size[size == 0] = 1.0
        factor: F64 = np.linalg.qr(rows / size, mode="r")  # type: ignore[assignment]
        half = np.linalg.lstsq(factor.T, (params / size).T, rcond=None)[0]
        cov: F64 = half.T @ half
        return cov


def fit_rational(
    omega: F64,
    response: C128,
    layout: Layout,
    weight: Any = None,
    *,
    unstable: int | None = None,
    region: Region | None = None,
    dcgain: F64 | None = None,
    start: Sequence[C128] | None = None,
    tol: float = 1e-12,
    maxiter: int = 100,
) -> RationalFit:
    """Fit a structure to a frequency response: the least Σ_k r_k* W_k r_k with r = G(iω) − B/A.

    Parameters
    ----------
    omega : ndarray, shape (omega,)
        Angular frequencies, rad/s, at least 0.
    response : ndarray of complex, shape (output, input, omega)
    layout : Layout
        The structure for these channels: held and bounded coefficients, delays and which denominators are
        shared are kept.
    weight : ndarray, optional
        (omega,), or (output, input, omega): 1/variance of each gain; or (omega, path, path): the inverse
        covariance of the gains of a line, Hermitian, paths output after output. Default: ones.
    unstable : int, optional
        The most poles that may lie right of or on the axis, beside integrators that are held; 0: stable.
        Default: any number.
    region : Region, optional
        Where all poles have to be, beside integrators that are held.
    dcgain : ndarray, shape (output, input), optional
        Gain at s = 0 that the model has exactly; nan where none is asked for.
    start : sequence of ndarray of complex, optional
        Poles to begin with, of each denominator, held integrators left out. Default: several spreads over
        the band are tried.
    tol : float, default 1e-12
        Relative fall of the cost at which the iteration ends.
    maxiter : int, default 100

    Returns
    -------
    RationalFit

    Raises
    ------
    DataError
        Fewer numbers than parameters, or sizes that do not fit.
    SpecError
        A dc gain where the structure has an integrator.
    """
    problem = Problem(omega, response, layout, weight, dcgain)
    starts = problem.starts()
    if start is not None:
        starts = [[np.asarray(p, dtype=np.complex128) / problem.unit for p in start]]
    region = None if region is None else region.scaled(problem.unit)
    tried = []
    for delays in problem.delay_starts():
        ends: list[list[C128]] = []
        tried += [_sweep(problem, problem.point(poles, delays), unstable, region, ends) for poles in starts]
    best, sweeps = min(tried, key=lambda one: one[0].cost)
    best, nit, status = _descend(problem, best, unstable, region, tol, maxiter)
    if status == "ok" and problem.is_singular(best):
        status = "rank"
    shape = (len(layout.outputs), len(layout.inputs), problem.omega.size)
    return RationalFit(
        theta=problem.theta(best),
        poles=tuple(
            problem.unit * np.append(own, np.zeros(count)).astype(np.complex128)
            for own, count in zip(best.poles, problem.integrators, strict=True)
        ),
        response=best.response.reshape(shape),
        cost=best.cost,
        residuals=best.residuals,
        nit=sweeps + nit,
        status=status,
        _problem=problem,
        _point=best,
    )


def _sweep(
    problem: Problem, here: Point, unstable: int | None, region: Region | None, ends: list[list[C128]]
) -> tuple[Point, int]:
    """Sanathanan–Koerner steps; the best point on the way. `ends`: of earlier ways, and then its own."""
    best, nit, settled = here, 0, False
    while nit < SWEEPS and not settled:
        (poles, _), *_ = problem.step(here, problem.slopes(here, problem.data), 0.0)
        nit += 1
        if not all(np.all(np.isfinite(own)) for own in poles):
            break
        poles = [mirrored(own, unstable) for own in poles]
        if region is not None:
            poles = [region.tamed(own) for own in poles]
        settled = _change(poles, here.poles) < SETTLED or any(_change(poles, end) < MET for end in ends)
        here = problem.point(poles, here.delays)
        if here.cost < best.cost:
            best = here
    ends.append(here.poles)
    return best, nit


def _descend(
    problem: Problem, here: Point, unstable: int | None, region: Region | None, tol: float, maxiter: int
) -> tuple[Point, int, str]:
    """Levenberg–Marquardt on poles and delays, numerators always the best."""
    if not np.isfinite(here.cost):
        return here, 0, "nonfinite"
    size = sum(float(np.sum((one.residuals + one.columns @ one.coefficients) ** 2)) for one in here.blocks)

    def moved(_: Point, to: tuple[list[C128], F64]) -> Point | None:
        return problem.point(*to) if _allowed(to[0], unstable, region) else None

    here, nit, ended = levenberg_marquardt(
        here,
        lambda at: problem.slopes(at, at.response),
        problem.step,
        moved,
        enough=1e-28 * size,
        tol=tol,
        maxiter=maxiter,
    )
    return here, nit, "maxiter" if ended == "maxiter" else "ok"


def _allowed(poles: list[C128], unstable: int | None, region: Region | None) -> bool:
    """Whether all is finite and no more poles than declared lie right of the axis."""
    if not all(np.all(np.isfinite(own)) for own in poles):
        return False
    if region is not None and not all(region.holds(own) for own in poles):
        return False
    return unstable is None or all(np.sum(own.real >= 0) <= unstable for own in poles)


def _change(new: list[C128], old: list[C128]) -> float:
    """Largest relative move from the old poles to the nearest new ones."""
    moves = [
        np.min(np.abs(a - b[:, None]), axis=1) / np.maximum(np.abs(b), 1e-300)
        for a, b in zip(new, old, strict=True)
        if a.size
    ]
    return float(np.max(np.concatenate(moves))) if moves else 0.0
