"""The reducing transformation: a delay system as x' = Ax + Bu in n of its roots, exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import complexes
from ..base.arrays import C128, F64
from ..base.tables import Table
from ..errors import SpecError
from .plant import Plant
from .roots import Lagged, left_null

__all__ = ["Transformation", "integrals", "matrix_exponential", "reduced", "said"]


INDEPENDENT = 1e-7  # sine of the angle above which a null vector is no combination of the others
POLISH = 12  # Newton steps on the matrix equation
SETTLED = 1e-14
SAME = 1e-6  # roots given by hand are met within this part of their size
GAUSS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False, repr=False)
class Transformation:
    """z' = Az + Bu, exact for the delay system; made by `DelaySystem.transformation`.

    z(t) = x(t) + Σ ∫ e^{A(t−h−τ)} A_h x(τ) dτ over [t−h, t] + Σ ∫ e^{A(t−r−τ)} B_r u(τ) dτ over [t−r, t],
    with A the solution of A = A_0 + Σ e^{−Ah} A_h, and B = Σ e^{−Ar} B_r.

    Attributes
    ----------
    plant : DelaySystem
    A : ndarray, shape (n, n)
    B : ndarray, shape (n, inputs)
    kept : ndarray of complex, shape (n,)
        Roots of the plant that are the eigenvalues of A: those that feedback of z moves.
    left : ndarray of complex
        The other roots that were found, rightmost first: feedback of z leaves them where they are.
    residual : float
        Of A = A_0 + Σ e^{−Ah} A_h, relative to its terms.
    condition : float
        Condition number of the kept roots' left null vectors.
    """

    plant: Plant
    A: F64
    B: F64
    kept: C128
    left: C128
    residual: float
    condition: float

    def z(
        self,
        t: float,
        x: Callable[[F64], ArrayLike],
        u: Callable[[F64], ArrayLike] | None = None,
        *,
        step: float | None = None,
    ) -> F64:
        """The reduced state from histories.

        Parameters
        ----------
        t : float
            Now, s.
        x, u : callable
            States and inputs (channel, time) of an array of instants in [t − longest lag, t], as
            `Trajectory.state` and `Trajectory.input`; u may be left out without inputs' lags.
        step : float, optional
            Length of the pieces, counted back from t, on which the integrals are taken to order 16; held
            inputs want their sampling interval. Default: a 64th of each lag.

        Returns
        -------
        ndarray, shape (n,)
        """
        found = np.array(np.asarray(x(np.array([t])), dtype=np.float64).reshape(len(self.A), -1)[:, 0])
        if u is None and any(r > 0 for r, _ in self.plant.b):
            raise SpecError("z: the plant has input lags; give the input's history, u=")
        for matrices, history in ((self.plant.a, x), (self.plant.b, u)):
            for lag, m in matrices:
                if lag == 0:
                    continue
                edges = _edges(lag, step)
                ages, weights = integrals(self.A, lag, m, edges)
                values = np.asarray(history(t - ages), dtype=np.float64).reshape(m.shape[1], -1)  # type: ignore[misc]
                found += np.einsum("qij,jq->i", weights, values)
        return found

    def table(self) -> Table:
        """One row per root: kept, or left where it is."""
        values = np.concatenate([self.kept, self.left])
        place = ["kept"] * self.kept.size + ["left"] * self.left.size
        title = (
            f"A of {len(self.A)} roots, residual {self.residual:.1e}, condition {self.condition:.3g}; "
            "feedback of z moves the kept ones"
        )
        return Table({"root": place, "real": values.real, "imag": values.imag}, title=title)

    def __repr__(self) -> str:
        return repr(self.table())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def reduced(plant: Plant, keep: Sequence[complex] | None = None, count: int | None = None) -> Transformation:
    """The transformation of the roots asked for, or of the rightmost with independent null vectors.

    Raises
    ------
    SpecError
        No n roots with independent left null vectors; the roots at fault are named.
    """
    n = plant.order
    roots = plant.poles(4 * n + 8 if count is None else count)
    chosen = _chosen(plant.a, roots.values, n, keep)
    values = np.array([root for root, _ in chosen])
    q = np.array([row for _, row in chosen])
    first = np.linalg.solve(q, values[:, None] * q).real
    a, residual = _polished(plant.a, first)
    left = list(roots.values)
    for root in values:
        left.pop(int(np.argmin(np.abs(np.array(left) - root))))
    b = sum((matrix_exponential(-a * r) @ m for r, m in plant.b), np.zeros((n, plant.shape[1])))
    a.flags.writeable = b.flags.writeable = False
    return Transformation(
        plant=plant,
        A=a,
        B=b,
        kept=values,
        left=np.array(left, dtype=np.complex128),
        residual=residual,
        condition=float(np.linalg.cond(q)),
    )


def integrals(a: F64, lag: float, matrix: F64, edges: F64) -> tuple[F64, F64]:
    """Ages σ and weights of ∫ e^{A(σ − lag)} M v(t − σ) dσ over [0, lag], Gauss points in each piece.

    Returns
    -------
    ages : ndarray, shape (point,)
    weights : ndarray, shape (point, rows, columns)
    """
    half = 0.5 * np.diff(edges)[:, None]
    ages = (edges[:-1, None] + half * (1 + GAUSS[0])).ravel()
    # Most pieces are of one length: few exponentials, and products of them from piece to piece.
    lengths, which = np.unique(np.round(np.diff(edges) / edges[-1], 12), return_inverse=True)
    lengths = lengths[:, None, None, None] * edges[-1]
    inner = matrix_exponential(a * (0.5 * lengths * (1 + GAUSS[0])[:, None, None]))
    whole = matrix_exponential(a * lengths)[:, 0]
    starts = [matrix_exponential(-a * lag)]
    for k in which[:-1]:
        starts.append(starts[-1] @ whole[k])
    values = np.array(starts)[:, None] @ inner[which] @ matrix
    sizes = (half * GAUSS[1]).reshape(-1, 1, 1)
    return ages, sizes * values.reshape(-1, *matrix.shape)


def _edges(lag: float, step: float | None) -> F64:
    if step is None:
        return np.linspace(0, lag, 65)
    if not (np.isfinite(step) and step > 0):
        raise SpecError(f"z: step={step} must be a time in seconds above 0")
    whole = np.arange(0.0, lag * (1 - 1e-9), step)
    return np.append(whole, lag)


def matrix_exponential(a: F64) -> F64:
    from scipy.linalg import expm

    found: F64 = expm(a)
    return found


def _chosen(a: Lagged, roots: C128, n: int, keep: Sequence[complex] | None) -> list[tuple[complex, C128]]:
    """n roots, pairs together, with independent left null vectors."""
    order = roots if keep is None else _named(roots, keep, n)
    chosen: list[tuple[complex, C128]] = []
    real: list[F64] = []
    dependent: list[complex] = []
    upper = [complex(r) for r in order if r.imag >= 0]
    for root in dict.fromkeys(upper):
        vectors = left_null(a, root)
        if len(vectors) < upper.count(root):
            dependent.append(root)
        for vector in vectors:
            parts = [vector.real, vector.imag] if root.imag else [(vector / _phase(vector)).real]
            if len(real) + len(parts) > n:
                continue
            more = [*real, *parts]
            if np.linalg.svd(np.array(more), compute_uv=False)[-1] < INDEPENDENT:
                dependent.append(root)
                continue
            real = more
            chosen.append((root, vector))
            if root.imag:
                chosen.append((root.conjugate(), vector.conj()))
    if len(chosen) == n:
        return chosen
    if keep is not None:
        why = f"the left null vectors of {said(order)} are not independent, or a pair is cut"
    elif dependent:
        why = f"the null vectors of {said(dependent)} depend on those of the roots before them"
    else:
        why = f"the roots found, {said(roots[:6])}, come in pairs that do not make up {n}"
    raise SpecError(
        f"transformation: {n} characteristic roots with independent left null vectors are needed and "
        f"{len(chosen)} were found: {why}; there is no real matrix A of these roots"
    )


def _named(roots: C128, keep: Sequence[complex], n: int) -> C128:
    wanted = np.atleast_1d(complexes("transformation", "keep", keep))
    if wanted.size != n:
        raise SpecError(f"transformation: keep= has {wanted.size} roots, the system has {n} states; give {n}")
    found = []
    for one in wanted:
        gaps = np.abs(roots - one)
        at = int(np.argmin(gaps))
        if not gaps[at] <= SAME * max(abs(one), 1.0):
            raise SpecError(
                f"transformation: keep= has {one:.6g}, which is not a root of the system (the nearest of "
                f"{roots.size} is {roots[at]:.6g}); take them from poles(count)"
            )
        found.append(roots[at])
    return np.array(found)


def _phase(vector: C128) -> complex:
    largest = vector[np.argmax(np.abs(vector))]
    return complex(largest / abs(largest))


def _polished(a: Lagged, x: F64) -> tuple[F64, float]:
    """Newton on X − A_0 − Σ e^{−Xh} A_h from near a solution, and the residual left."""
    from scipy.linalg import expm_frechet

    n = len(x)

    def error(x: F64) -> tuple[F64, float]:
        parts = [x, *(-matrix_exponential(-x * h) @ m for h, m in a)]
        found: F64 = np.sum(parts, axis=0)
        size = max(sum(np.linalg.norm(p) for p in parts), np.finfo(float).tiny)
        return found, float(np.linalg.norm(found) / size)

    off, residual = error(x)
    for _ in range(POLISH):
        if residual < SETTLED:
            break
        slopes = np.empty((n * n, n * n))
        for k, unit in enumerate(np.eye(n * n)):
            e = unit.reshape(n, n)
            parts = [expm_frechet(-x * h, -e * h, compute_expm=False) @ m for h, m in a if h > 0]
            slopes[:, k] = (e - np.sum(parts, axis=0)).ravel() if parts else unit
        try:
            nearer = x - np.linalg.solve(slopes, off.ravel()).reshape(n, n)
        except np.linalg.LinAlgError:
            break
        off, reached = error(nearer)
        if not reached < residual:
            break
        x, residual = nearer, reached
    return x, residual


def said(roots: Any) -> str:
    return ", ".join(f"{complex(r).real:.5g}" if complex(r).imag == 0 else f"{complex(r):.5g}" for r in roots)
