"""Feedback of the reduced state: placement, quadratic cost, and the sampled controller that is safe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arguments import complexes, public, real, reals
from ..base.arrays import C128, F64
from ..base.tables import Table
from ..errors import SpecError
from .plant import Plant
from .transformation import Transformation, integrals, matrix_exponential, reduced, said

__all__ = ["Controller", "Design", "as_design", "placed", "quadratic", "sampled_words", "seconds"]

WEAK = 1e-9  # part of its size that a root's input vector must have to be controllable
POINTS = 4  # samples whose polynomial stands for x between two of them


@public
@dataclass(frozen=True, eq=False, repr=False)
class Design:
    """u = −Kz for a delay system; an array K wherever one is expected.

    Attributes
    ----------
    K : ndarray, shape (inputs, n)
    transformation : Transformation
        What z is.
    moved : ndarray of complex
        Eigenvalues of A − BK: where the kept roots go.
    left : ndarray of complex
        The plant's other roots, which stay in the loop.
    """

    K: F64
    transformation: Transformation
    moved: C128
    left: C128

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> F64:
        return np.array(self.K, dtype=dtype)

    def poles(self) -> C128:
        """Roots of the closed loop, rightmost first: those that were moved and those that stay."""
        return _falling(np.concatenate([self.moved, self.left]))

    def controller(self, dt: float) -> Controller:
        """The law for samples of x every dt seconds, u held between them.

        Parameters
        ----------
        dt : float
            Sampling interval, s.

        Returns
        -------
        Controller
        """
        return Controller(self.transformation, self.K, dt)

    def table(self) -> Table:
        """One row per root of the closed loop."""
        values = np.concatenate([self.moved, self.left])
        order = np.argsort(-values.real, kind="stable")
        word = np.array(["placed"] * self.moved.size + ["of the plant"] * self.left.size)[order]
        values = values[order]
        return Table(
            {"root": list(word), "real": values.real, "imag": values.imag}, title=f"u = -Kz, K = {self.K}"
        )

    def __repr__(self) -> str:
        return repr(self.table())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


@public
class Controller:
    """u = −Kz from samples of x, u held over each interval; `step` in real time.

    The integral over past u is exact, since u is piecewise constant, and that over x takes polynomials
    through four samples. So z(k+1) = e^{A dt} z(k) + ∫e^{As}ds B u(k) holds as far as x is resolved, and no
    value of u depends on itself.

    Parameters
    ----------
    transformation : Transformation
    K : array_like, shape (inputs, n)
    dt : float
        Sampling interval, s.

    Attributes
    ----------
    K : ndarray
    dt : float
    states : ndarray, shape (past, n, n)
        Weights of x(k), x(k−1), … in z.
    inputs : ndarray, shape (past, n, inputs)
        Weights of u(k−1), u(k−2), … in z.
    z : ndarray, shape (n,)
        As of the last step; zero before the first.
    """

    def __init__(self, transformation: Transformation, K: ArrayLike, dt: float) -> None:
        plant, dt = transformation.plant, seconds(dt)
        self.K, self.dt, self.transformation = gain(K, plant.shape[1], plant.order), dt, transformation
        a, n = transformation.A, plant.order
        reach = [int(np.ceil(lag / dt - 1e-9)) for lag, _ in (plant.a[-1], plant.b[-1])]
        self.states = np.zeros((reach[0] + 1, n, n))
        self.inputs = np.zeros((reach[1], n, plant.shape[1]))
        self.states[0] += np.eye(n)
        for lag, m in plant.a:
            if lag > 0:
                ages, weights = integrals(a, lag, m, _grid(lag, dt))
                for part, at in _cardinal(ages / dt, reach[0]):
                    np.add.at(self.states, at, part[:, None, None] * weights)
        for lag, m in plant.b:
            if lag > 0:
                ages, weights = integrals(a, lag, m, _grid(lag, dt))
                np.add.at(self.inputs, (ages / dt).astype(int), weights)
        self.reset()

    def poles(self) -> C128:
        """Where the kept roots go when u is held: log eig(e^{A dt} − ∫e^{As}ds BK)/dt."""
        a, b = self.transformation.A, self.transformation.B
        n, m = b.shape
        block = matrix_exponential(self.dt * np.block([[a, b], [np.zeros((m, n + m))]]))
        found = np.linalg.eigvals(block[:n, :n] - block[:n, n:] @ self.K).astype(np.complex128)
        with np.errstate(divide="ignore"):
            found = np.log(found)
        return _falling(found / self.dt)

    def reset(self, x: ArrayLike | None = None, u: ArrayLike | None = None) -> None:
        """Forget, or take a past: the samples x(−1), x(−2), … as columns, and u(−1), u(−2), …; default 0."""
        self._x = _past("x", x, len(self.states), self.states.shape[2])
        self._u = _past("u", u, len(self.inputs), self.inputs.shape[2])
        self.z: F64 = np.zeros(self.states.shape[1])

    def step(self, x: ArrayLike) -> F64:
        """Take the sample of x, return the u to hold until the next.

        Parameters
        ----------
        x : array_like, shape (n,)

        Returns
        -------
        ndarray, shape (inputs,)
        """
        sample = reals("Controller.step", "x", x)
        if sample.shape != self.z.shape or not np.all(np.isfinite(sample)):
            raise SpecError(
                f"Controller.step: x has shape {sample.shape}; give {self.z.size} numbers, one per state"
            )
        self._x[1:] = self._x[:-1]
        self._x[0] = sample
        self.z = np.einsum("kij,kj->i", self.states, self._x)
        self.z += np.einsum("kij,kj->i", self.inputs, self._u)
        u: F64 = -self.K @ self.z
        if len(self._u):
            self._u[1:] = self._u[:-1]
            self._u[0] = u
        return u


def placed(transformation: Transformation, poles: ArrayLike, line: float) -> Design:
    """The gain that moves the kept roots to `poles`.

    Raises
    ------
    SpecError
        As `DelaySystem.place`.
    """
    from scipy.signal import place_poles

    n = transformation.plant.order
    wanted = np.atleast_1d(complexes("place", "poles", poles))
    if wanted.shape != (n,) or not np.all(np.isfinite(wanted)):
        raise SpecError(
            f"place: {wanted.size} poles for the {n} roots that can be moved; give {n} finite numbers"
        )
    if not np.allclose(_falling(wanted), _falling(wanted.conj()), atol=1e-9 * np.abs(wanted).max()):
        raise SpecError(f"place: {said(wanted)} are not pairs; give each complex pole with its conjugate")
    _need(transformation, line, "place", wanted)
    try:
        gain_ = place_poles(transformation.A, transformation.B, wanted).gain_matrix
    except ValueError as error:
        raise SpecError(
            f"place: {said(wanted)} cannot be placed: {error}; take poles that differ (as many equal ones "
            f"as B has independent columns, {np.linalg.matrix_rank(transformation.B)}, are possible)"
        ) from None
    return _design(transformation, gain_)


def quadratic(transformation: Transformation, q: ArrayLike, r: ArrayLike, line: float) -> Design:
    """The gain that minimises ∫ z'Qz + u'Ru.

    Raises
    ------
    SpecError
        As `DelaySystem.lqr`.
    """
    from scipy.linalg import solve_continuous_are

    n, m = transformation.B.shape
    weights = _weight("Q", q, n, definite=False), _weight("R", r, m, definite=True)
    _need(transformation, line, "lqr", None)
    try:
        with np.errstate(all="ignore"):
            cost = solve_continuous_are(transformation.A, transformation.B, *weights)
        design = _design(transformation, np.linalg.solve(weights[1], transformation.B.T @ cost))
        if not design.moved.real.max() < 0:
            raise ValueError("roots on the imaginary axis stay there")
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SpecError(
            f"lqr: the Riccati equation has no stabilising solution ({error}); Q must weigh what the roots "
            f"{said(transformation.kept)} move, R must not be tiny beside it"
        ) from None
    return design


def gain(given: ArrayLike, inputs: int, n: int) -> F64:
    """K as a matrix, checked."""
    k = np.atleast_2d(reals("design", "K", given))
    if k.shape != (inputs, n) or not np.all(np.isfinite(k)):
        raise SpecError(
            f"K has shape {k.shape}; with {inputs} input(s) and {n} states it is ({inputs}, {n}), finite"
        )
    return k


def seconds(dt: Any) -> float:
    """A sampling interval, checked."""
    if not real("design", "dt", dt) > 0:
        raise SpecError(f"dt={dt!r} must be a sampling interval in seconds above 0")
    return float(dt)


def _need(transformation: Transformation, line: float, what: str, wanted: C128 | None) -> None:
    """Refuse where roots right of the line cannot be moved."""
    if not np.isfinite(line):
        raise SpecError(f"{what}: line={line} must be a real part in 1/s")
    stay = transformation.left[transformation.left.real >= line]
    if stay.size:
        raise SpecError(
            f"{what}: the roots {said(stay)} lie right of the line {line:g} and would stay: the reduced "
            f"state has {len(transformation.A)} roots, {said(transformation.kept)}; move the line, or keep "
            "other roots with transformation(keep=...)"
        )
    a, b = transformation.A, transformation.B
    values, vectors = np.linalg.eig(a.T)  # left eigenvectors
    inputs = np.linalg.norm(vectors.T @ b, axis=1) / max(np.linalg.norm(b, 2), np.finfo(float).tiny)
    stuck = values[(inputs < WEAK) | (not b.any())]
    if wanted is not None:
        moved = [v for v in stuck if np.abs(wanted - v).min() > 1e-6 * max(abs(v), 1.0)]
    else:
        moved = [v for v in stuck if v.real >= line]
    if moved:
        raise SpecError(
            f"{what}: no input reaches the root(s) {said(moved)} (q·B(λ) = 0 for the left null vector q); "
            + ("want them where they are" if wanted is not None else "they cannot be stabilised")
            + ", or give another B"
        )


def _design(transformation: Transformation, k: F64) -> Design:
    k = np.array(k, dtype=np.float64)
    k.flags.writeable = False
    moved = np.linalg.eigvals(transformation.A - transformation.B @ k).astype(np.complex128)
    return Design(k, transformation, _falling(moved), transformation.left)


def _weight(name: str, given: ArrayLike, size: int, *, definite: bool) -> F64:
    w = reals("lqr", name, given)
    w = w * np.eye(size) if w.ndim == 0 else np.diag(w) if w.ndim == 1 else w
    word = "positive definite" if definite else "positive semidefinite"
    if w.shape != (size, size) or not np.all(np.isfinite(w)) or not np.allclose(w, w.T):
        raise SpecError(
            f"lqr: {name} has shape {w.shape}; give a number, {size} numbers or a symmetric ({size}, {size}) "
            "matrix, finite"
        )
    least = float(np.linalg.eigvalsh(w)[0])
    if least < -1e-12 * np.abs(w).max() or (definite and least <= 0):
        raise SpecError(f"lqr: {name} has the eigenvalue {least:.3g}; it must be {word}")
    return w


def _grid(lag: float, dt: float) -> F64:
    return np.append(np.arange(0.0, lag * (1 - 1e-9), dt), lag)


def _cardinal(ages: F64, last: int) -> list[tuple[F64, NDArray[np.int64]]]:
    """Weights of the samples whose polynomial stands for x at these ages (in samples), and which they are."""
    count = min(POINTS, last + 1)
    first = np.clip(ages.astype(int) - (count - 1) // 2, 0, last + 1 - count)
    out = []
    for k in range(count):
        weight = np.ones_like(ages)
        for j in range(count):
            if j != k:
                weight *= (ages - first - j) / (k - j)
        out.append((weight, first + k))
    return out


def _past(name: str, given: ArrayLike | None, count: int, width: int) -> F64:
    """Samples before the first step, the latest first, (past, channel)."""
    out = np.zeros((count, width))
    if given is not None:
        values = reals("Controller.reset", name, given)
        if not width or values.size % width or not np.all(np.isfinite(values)):
            raise SpecError(
                f"Controller.reset: {name} has shape {values.shape}; give finite samples, ({width}, past)"
            )
        rows = values.reshape(width, -1).T[:count]
        out[: len(rows)] = rows
    return out


def _falling(values: C128) -> C128:
    return values[np.lexsort((-values.imag, np.abs(values.imag), -np.round(values.real, 9)))]


def sampled_words(poles: C128, dt: float) -> str:
    """What to say of a loop that holding u destabilises."""
    return (
        f"with u held for dt = {dt:g} s the loop's roots are {said(poles)}: unstable; sample faster, or ask "
        "for slower poles"
    )


def as_design(plant: Plant, given: Any) -> tuple[F64, Transformation]:
    """K and the transformation it belongs to."""
    if isinstance(given, Design):
        return given.K, given.transformation
    return gain(given, plant.shape[1], plant.order), reduced(plant)
