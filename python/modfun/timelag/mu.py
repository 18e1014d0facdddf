"""Structured uncertainty in the loop: the upper bound of μ by diagonal scaling, over frequency.

Errors in the matrices of the plant add w = Σ ΔA_k x(t − h_k) + Σ ΔB_r u(t − r) to x', and to z' the same w:
z' = (A − BK)z + w. The delayed x and u follow from z by Z x = (I + VK) z, where Z(s) is the identity and
Σ∫e^{A(σ−h)}A_h e^{−sσ}dσ, V(s) alike. So the map from w to what multiplies the errors is known at each
frequency without approximation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import public
from ..base.arrays import C128, F64
from ..base.tables import Table
from ..errors import SpecError
from . import drawing
from .plant import Plant, matrices_of
from .transformation import Transformation, integrals

__all__ = ["Margin", "Uncertainty", "bound", "margin"]


FREQUENCIES = 160
NARROWED = 12  # further ones about the peak, so many times:
ROUNDS = 3
POWERS = (4.0, 32.0, 256.0)  # of the singular values whose sum stands for the largest
QUICK = (16.0,)  # where the peak is only looked for
STEPS = 60  # of each search for scales
NOTHING = 1e-12  # of the largest singular value of an error: rank
PIECES = 96  # of each lag's integral


@public
@dataclass(frozen=True, eq=False)
class Uncertainty:
    """One error of a plant's matrices, for `DelaySystem.mu`.

    A scalar δ, `|δ| ≤ 1`, that is "real" or "complex", times the matrices given: A_k + δ·A[k], B_r + δ·B[r],
    the same δ in all of them, as a physical parameter has it. Or a "full" block: any matrix Δ with
    ‖Δ‖₂ ≤ 1, as A_k + Δ·A[k], B_r + Δ·B[r].

    Parameters
    ----------
    A, B : mapping of float to array_like, optional
        Matrices by lag, s.
    kind : {"real", "complex", "full"}, default "real"

    Raises
    ------
    SpecError
        Another kind, or matrices that are none.

    See Also
    --------
    modfun.timelag.errors : Those of a fit.
    modfun.timelag.DelaySystem.mu : What they may do.

    References
    ----------
    A. E. Pearson, NASA NAG-1-1065 final report, 1993, section 4.10; Y. A. Fiagbedzi, A. E. Pearson,
    Feedback stabilization of linear autonomous time lag systems, IEEE Trans. Autom. Control 31, 1986.

    Examples
    --------
    >>> import modfun as mf
    >>> change = mf.timelag.Uncertainty(A={0: 0.1})
    >>> change.kind
    'real'
    """

    A: Mapping[float, Any] = field(default_factory=dict)
    B: Mapping[float, Any] = field(default_factory=dict)
    kind: str = "real"

    def __post_init__(self) -> None:
        if self.kind not in ("real", "complex", "full"):
            raise SpecError(f'Uncertainty: kind={self.kind!r}; choose among "real", "complex", "full"')
        object.__setattr__(self, "A", matrices_of("Uncertainty: A", self.A))
        object.__setattr__(self, "B", matrices_of("Uncertainty: B", self.B))
        if not self.A and not self.B:
            raise SpecError("Uncertainty: give A= or B=, matrices by lag")


@dataclass(frozen=True, eq=False, repr=False)
class Margin:
    """How much structured uncertainty the loop bears; made by `DelaySystem.mu`.

    Attributes
    ----------
    omega : ndarray, shape (frequency,)
        rad/s.
    upper : ndarray, shape (frequency,)
        Upper bound of μ.
    peak, peak_omega : float
        Its largest value, and where.
    margin : float
        1/peak: all errors may be so many times those given, together, and the loop stays stable.
    scaling : ndarray
        Scales d of the blocks' channels at the peak, the first at 1.
    """

    omega: F64
    upper: F64
    peak: float
    peak_omega: float
    margin: float
    scaling: F64

    def table(self) -> Table:
        """The peak in a row."""
        return Table(
            {"peak of mu": [self.peak], "at omega": [self.peak_omega], "margin": [self.margin]},
            title="Upper bound of mu by D-scaling",
        )

    def __repr__(self) -> str:
        return repr(self.table())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()

    def plot(self, ax: Any = None, *, hz: bool = False) -> Any:
        """Draw the bound over frequency (extra ``plot``); returns Axes."""
        return drawing.margin(self.omega, self.upper, ax, hz=hz)


@dataclass(frozen=True, eq=False)
class _Structure:
    """Where errors enter and what they multiply: w = left Δ (right ψ), ψ the delayed x and u."""

    left: C128
    right: C128
    rows: NDArray[np.int64]  # scale of each channel that goes into Δ
    columns: NDArray[np.int64]  # scale of each channel that comes out of Δ


def margin(
    plant: Plant,
    k: F64,
    transformation: Transformation,
    blocks: Sequence[Uncertainty],
    omega: F64 | None,
) -> Margin:
    """`DelaySystem.mu`."""
    structure = _structure(plant, blocks)
    moved = np.linalg.eigvals(transformation.A - transformation.B @ k)
    left = transformation.left
    if moved.real.max() >= 0 or (left.size and left.real.max() >= 0):
        raise SpecError(
            f"mu: the loop is not stable without errors (rightmost root "
            f"{max([*moved.real, *left.real]):.4g}); its margin is nothing: take another K"
        )
    loop = _Loop(plant, k, transformation)
    grid = np.sort(_frequencies(plant, k, transformation) if omega is None else omega)
    upper, scales = _sweep(loop, structure, grid, QUICK)
    exact = np.zeros(grid.size, dtype=bool)
    for _ in range(ROUNDS):
        while not exact[at := int(np.argmax(upper))]:
            upper[at : at + 1], scales[at : at + 1] = _sweep(loop, structure, grid[at : at + 1], POWERS)
            exact[at] = True
        if omega is not None:
            break
        more = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)], NARROWED + 2)[1:-1]
        extra, found = _sweep(loop, structure, more, POWERS)
        order = np.argsort(np.append(grid, more), kind="stable")
        grid, upper = np.append(grid, more)[order], np.append(upper, extra)[order]
        scales, exact = np.concatenate([scales, found])[order], np.append(exact, extra > 0)[order]
    at = int(np.argmax(upper))
    peak = float(upper[at])
    return Margin(
        omega=grid,
        upper=upper,
        peak=peak,
        peak_omega=float(grid[at]),
        margin=1 / peak if peak > 0 else np.inf,
        scaling=np.exp(scales[at]),
    )


def bound(
    m: C128,
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    start: F64 | None = None,
    powers: tuple[float, ...] = POWERS,
) -> tuple[float, F64]:
    """Least largest singular value of D M D⁻¹ over positive diagonal D that the structure allows.

    Parameters
    ----------
    m : ndarray of complex, shape (r, c)
    rows, columns : ndarray of int
        Which scale each row and each column has.
    start : ndarray, optional
        Logarithms of the scales to begin with.
    powers : tuple of float
        Sums of such powers of the singular values are minimised in turn; the bound holds for any.

    Returns
    -------
    float, ndarray
        The bound, and the logarithms of the scales, the first at 0.
    """
    from scipy.optimize import minimize

    count = int(max(rows.max(), columns.max())) + 1
    size = np.abs(m).max()
    x = np.zeros(count) if start is None else start
    if not size > 0 or count == 1:
        return float(np.linalg.norm(m, 2)), np.zeros(count)
    m = m / size

    def cost(x: F64, power: float) -> tuple[float, F64]:
        scaled = m * np.exp(x[rows])[:, None] / np.exp(x[columns])
        u, s, vh = np.linalg.svd(scaled, full_matrices=False)
        part = (s / s[0]) ** (2 * power)
        total = part.sum()
        along = part / total
        slope: F64 = np.bincount(rows, np.abs(u) ** 2 @ along, count).astype(np.float64)
        slope -= np.bincount(columns, along @ np.abs(vh) ** 2, count)
        return float(np.log(s[0]) + np.log(total) / (2 * power)), slope

    def largest(x: F64) -> float:
        scaled = m * np.exp(x[rows])[:, None] / np.exp(x[columns])
        return float(np.linalg.norm(scaled, 2))

    best, least = x, largest(x)
    limits = [(-60.0, 60.0)] * count  # channels without a loop may be scaled away
    words = {"maxiter": STEPS, "ftol": 1e-10, "gtol": 1e-7}
    for power in powers:
        found = minimize(cost, x, args=(power,), jac=True, method="L-BFGS-B", bounds=limits, options=words)
        x = found.x
        if (value := largest(x)) < least:
            best, least = x, value
    return least * float(size), best - best[0]


class _Loop:
    """From w to the delayed x and u, at any frequency."""

    def __init__(self, plant: Plant, k: F64, transformation: Transformation) -> None:
        self.plant, self.k, self.transformation = plant, k, transformation
        self.states = [self._integral(lag, m) for lag, m in plant.a if lag > 0]
        self.inputs = [self._integral(lag, m) for lag, m in plant.b if lag > 0]

    def _integral(self, lag: float, m: F64) -> tuple[F64, F64]:
        return integrals(self.transformation.A, lag, m, np.linspace(0, lag, PIECES + 1))

    def __call__(self, omega: F64) -> C128:
        """ψ = (x(t − h_k) …, u(t − r) …) of w: (frequency, channel, n)."""
        plant, k = self.plant, self.k
        s = 1j * omega
        n, m = self.transformation.B.shape
        z, v = np.eye(n) + 0j, np.zeros((n, m)) + 0j
        for ages, weights in self.states:
            z = z + np.tensordot(np.exp(-s[:, None] * ages), weights, axes=1)
        for ages, weights in self.inputs:
            v = v + np.tensordot(np.exp(-s[:, None] * ages), weights, axes=1)
        closed = s[:, None, None] * np.eye(n) - self.transformation.A + self.transformation.B @ k
        reduced = np.linalg.inv(closed)
        x = np.linalg.solve(np.broadcast_to(z, closed.shape), (np.eye(n) + v @ k) @ reduced)
        u = -k @ reduced
        late = [np.exp(-s * lag)[:, None, None] * x for lag, _ in plant.a]
        late += [np.exp(-s * lag)[:, None, None] * u for lag, _ in plant.b]
        return np.concatenate(late, axis=1)


def _sweep(loop: _Loop, structure: _Structure, omega: F64, powers: tuple[float, ...]) -> tuple[F64, F64]:
    """The bound at each frequency, each begun from its neighbour's scales."""
    matrices = structure.right @ loop(omega) @ structure.left
    upper, scales, start = [], [], None
    for m in matrices:
        value, start = bound(m, structure.rows, structure.columns, start, powers)
        upper.append(value)
        scales.append(start)
    return np.array(upper), np.array(scales)


def _structure(plant: Plant, blocks: Sequence[Uncertainty]) -> _Structure:
    left, right, rows, columns = [], [], [], []
    scale = 0
    for block in blocks:
        stacked = _stacked(plant, block)
        if block.kind == "full":
            left.append(np.eye(plant.order))
            right.append(stacked)
            rows += [scale] * len(stacked)
            columns += [scale] * plant.order
            scale += 1
            continue
        u, s, vh = np.linalg.svd(stacked, full_matrices=False)
        rank = int(np.sum(s > NOTHING * s[0]))
        left.append(u[:, :rank] * np.sqrt(s[:rank]))
        right.append(np.sqrt(s[:rank, None]) * vh[:rank])
        own = list(range(scale, scale + rank))
        rows += own
        columns += own
        scale += rank
    return _Structure(
        np.concatenate(left, axis=1).astype(np.complex128),
        np.concatenate(right).astype(np.complex128),
        np.array(rows),
        np.array(columns),
    )


def _stacked(plant: Plant, block: Uncertainty) -> F64:
    """An error's matrices beside each other, in the order of the delayed x and u."""
    rows = {len(m) for given in (block.A, block.B) for m in given.values()}
    if len(rows) != 1 or (block.kind != "full" and rows != {plant.order}):
        raise SpecError(
            f"mu: an error has matrices of {sorted(rows)} rows; give {plant.order}, one per state (of a full "
            "block any number, the same in all)"
        )
    parts = []
    count = rows.pop()
    for name, own, given in (("A", plant.a, block.A), ("B", plant.b, block.B)):
        lags = [lag for lag, _ in own]
        for lag, m in given.items():
            if lag not in lags or m.shape[1] != own[0][1].shape[1]:
                raise SpecError(
                    f"mu: an error of {name}[{lag:g}] with shape {m.shape} has no place: {name} has the lags "
                    f"{', '.join(f'{one:g}' for one in lags)} and {own[0][1].shape[1]} columns"
                )
        parts += [given.get(lag, np.zeros((count, m.shape[1]))) for lag, m in own]
    stacked = np.concatenate(parts, axis=1)
    if not stacked.any():
        raise SpecError("mu: an error is zero; give the size of what is uncertain")
    return stacked


def _frequencies(plant: Plant, k: F64, transformation: Transformation) -> F64:
    """Where the loop may respond: from well below its slowest root to where it only falls."""
    poles = np.concatenate([np.linalg.eigvals(transformation.A - transformation.B @ k), transformation.left])
    size = sum(float(np.linalg.norm(m, 2)) for _, m in plant.a)
    size += sum(float(np.linalg.norm(m @ k, 2)) for _, m in plant.b)
    top = 10 * max(size, float(np.abs(poles[: 2 * plant.order]).max()))
    low = 0.02 * float(np.abs(poles).min())
    near = np.abs(poles.imag[(poles.imag > 0) & (np.abs(poles) < top)])
    return np.concatenate([[0.0], np.geomspace(low, top, FREQUENCIES), near])
