"""State-space models of a given order fitted to frequency responses: modes with a row of B, a column of C.

The poles and B are the unknowns of a Levenberg–Marquardt iteration; C is solved for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import C128, F64
from ..base.cached import cached_property
from ..base.least_squares import levenberg_marquardt
from .fractions import Region
from .gramians import Realisation

__all__ = ["fit_modes"]


# Weight of a response that shall be met exactly over that of all lines.
HEAVY = 1e5


@dataclass(frozen=True)
class _Lines:
    omega: F64
    data: C128  # (omega, output, input)
    amplitude: F64

    @cached_property
    def target(self) -> F64:
        """Weighted real rows: (input, output, row), row = (part, omega)."""
        weighted = self.amplitude * self.data.transpose(2, 1, 0)
        return np.concatenate([weighted.real, weighted.imag], axis=2)


@dataclass(frozen=True)
class _Solved:
    """Least squares of the target on the states, whose columns of `size` are scaled."""

    triangle: F64  # of the functions, from QR
    size: F64
    found: F64  # in units of the scaled columns
    cost: float


@dataclass(frozen=True)
class _Modes:
    """Real blocks of A (one state, or two of a pair), B, and the best C.

    (sI − A)⁻¹ is made of as many functions of s as there are states: 1/(s − a) of a real pole, (s − re)/q and
    im/q of a pair with q = (s − re)² + im². Inputs and outputs only mix these, so that all that is as long as
    the lines is done once for the functions, and what a path adds is a product of small matrices.
    """

    a: F64
    b: F64
    pairs: tuple[tuple[int, int], ...]  # first state and size of each block
    lines: _Lines

    def _firsts(self, size: int) -> NDArray[np.int64]:
        """First states of the blocks of a size."""
        return np.array([first for first, own in self.pairs if own == size], dtype=np.int64)

    @cached_property
    def functions(self) -> F64:
        """(function, part, omega), real parts before imaginary ones."""
        omega, single, upper = self.lines.omega, self._firsts(1), self._firsts(2)
        found = np.empty((len(self.a), 2, omega.size))
        re = self.a[single, single][:, None]
        square = re**2 + omega**2
        found[single, 0], found[single, 1] = -re / square, -omega / square
        re, im = self.a[upper, upper][:, None], self.a[upper, upper + 1][:, None]
        x, y = re**2 + (im - omega) * (im + omega), -2 * re * omega  # q
        square = x**2 + y**2
        x, y = x / square, -y / square
        found[upper, 0], found[upper, 1] = -re * x - omega * y, omega * x - re * y
        found[upper + 1, 0], found[upper + 1, 1] = im * x, im * y
        return found

    @cached_property
    def _rows(self) -> F64:
        """Weighted real rows of the functions, behind them those of the target: (function or path, row)."""
        n, target = len(self.a), self.lines.target
        found = np.empty((n + target.shape[0] * target.shape[1], target.shape[2]))
        np.multiply(self.functions, self.lines.amplitude, out=found[:n].reshape(n, 2, -1))
        found[n:] = target.reshape(-1, target.shape[2])
        return found

    @property
    def weighted(self) -> F64:
        """The functions' rows, (function, row)."""
        return self._rows[: len(self.a)]

    def _mixed(self, by: F64, sign: float) -> F64:
        """Functions as a column of B (sign 1) or a row of C (−1) mixes them, (column, function, state)."""
        single, upper = self._firsts(1), self._firsts(2)
        found = np.zeros((by.shape[1], len(by), len(by)))
        found[:, single, single] = by[single].T
        found[:, upper, upper], found[:, upper, upper + 1] = by[upper].T, by[upper + 1].T
        found[:, upper + 1, upper], found[:, upper + 1, upper + 1] = (
            sign * by[upper + 1].T,
            -sign * by[upper].T,
        )
        return found

    @cached_property
    def states(self) -> F64:
        """(sI − A)⁻¹ B of each input in the functions, (input, function, state)."""
        return self._mixed(self.b, 1.0)

    @cached_property
    def _solved(self) -> _Solved:
        n, (inputs, outputs, _) = len(self.a), self.lines.target.shape
        r = _triangle(self._rows.T)
        columns = (r[:n, :n] @ self.states).reshape(-1, n)
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        ahead = r[:n, n:].reshape(-1, inputs, outputs).transpose(1, 0, 2).reshape(-1, outputs)
        small = _triangle(np.hstack([columns / size, ahead]))
        found = np.asarray(np.linalg.lstsq(small[:n, :n], small[:n, n:], rcond=1e-14)[0])
        cost = np.sum(r[n:, n:] ** 2) + np.sum(small[n:, n:] ** 2)
        return _Solved(r[:n, :n], size, found, float(cost))

    @property
    def poles(self) -> C128:
        """One a block: of pairs the upper."""
        return np.array(
            [complex(self.a[k, k], self.a[k, k + 1] if size == 2 else 0) for k, size in self.pairs],
            dtype=np.complex128,
        )

    @property
    def c(self) -> F64:
        return (self._solved.found / self._solved.size[:, None]).T

    @property
    def cost(self) -> float:
        """Squares that are left of the target."""
        return self._solved.cost if np.isfinite(self._solved.cost) else float("inf")

    def _orthonormal(self) -> tuple[F64, F64]:
        """Q as rows, and R, of the weighted functions."""
        from scipy.linalg.blas import dtrsm

        r = self._solved.triangle
        pivots = np.abs(np.diag(r)) / np.maximum(np.linalg.norm(r, axis=0), 1e-300)
        if len(r) < len(self.a) or pivots.min(initial=1.0) < 1e-8:  # R says too little of Q
            q, r = np.linalg.qr(self.weighted.T)
            return q.T, r
        return np.asarray(dtrsm(1.0, r, self.weighted.T, side=1)).T, r

    def normal(self) -> tuple[F64, F64]:
        """JᵀJ and Jᵀe over moves of the poles (A − uδᵀ) and of B; C follows.

        For output i and input j the columns of J are d_i S_j for the poles, with S = (s − A)⁻¹B and
        d = C(s − A)⁻¹u, and −C_i(s − A)⁻¹ for the column j of B, less their part in the span of S. With Q
        and R of the functions S_j is Q·inward_j and C_i(s − A)⁻¹ is Q·outward_i: what is left to be summed
        over lines are Q's products with itself, weighted by d.
        """
        n, (inputs, outputs, rows) = len(self.a), self.lines.target.shape
        q, r = self._orthonormal()
        at_outputs = self._mixed(self.c.T, -1.0)
        inward, outward = r @ self.states, r @ at_outputs
        scaled = (inward / self._solved.size).reshape(-1, n)
        back = np.linalg.qr(scaled)[0].reshape(inputs, len(r), -1).transpose(0, 2, 1)  # to the span of S
        model = (self.states @ self.c.T).transpose(0, 2, 1)
        left = self.lines.target - (model.reshape(-1, n) @ self.weighted).reshape(self.lines.target.shape)
        drive = ((at_outputs @ self.drive) @ self.functions.reshape(n, -1)).reshape(outputs, 2, -1)

        parts = q.reshape(len(r), 2, -1)
        whole = (parts * np.sqrt(np.sum(drive**2, axis=(0, 1)))).reshape(q.shape)
        one = np.empty_like(parts)
        turned = np.empty((outputs, len(r), len(r)))  # Q* d Q of each output
        for to, (re, im) in zip(turned, drive, strict=True):
            twist = np.multiply(parts[:, 1], im, out=one[:, 1]) @ parts[:, 0].T
            np.multiply(parts, re, out=one)
            to[:] = one.reshape(q.shape) @ q.T + twist - twist.T
        errors = left[:, :, : rows // 2] + 1j * left[:, :, rows // 2 :]
        pulled = np.sum((drive[:, 0] - 1j * drive[:, 1]) * errors, axis=1)

        moves = n * (1 + inputs if inputs > 1 else 1)
        gram, slope = np.zeros((moves, moves)), np.zeros(moves)
        part = np.zeros((outputs, back.shape[1], moves))
        gram[:n, :n] = np.sum(inward.transpose(0, 2, 1) @ (whole @ whole.T) @ inward, axis=0)
        slope[:n] = np.ravel(np.hstack([pulled.real, pulled.imag]) @ q.T) @ inward.reshape(-1, n)
        part[:, :, :n] = np.sum(back @ (turned[:, None] @ inward), axis=1)
        if inputs > 1:
            crossed = np.sum(turned.transpose(0, 2, 1) @ outward, axis=0)
            stacked = outward.reshape(-1, n)
            own, ahead = stacked.T @ stacked, left @ q.T
            for j in range(inputs):
                at = slice(n + j * n, n + (j + 1) * n)
                gram[:n, at] = -inward[j].T @ crossed
                gram[at, :n] = gram[:n, at].T
                gram[at, at] = own
                part[:, :, at] = -back[j] @ outward
                slope[at] = -ahead[j].ravel() @ stacked
        together = part.reshape(-1, moves)
        gram -= together.T @ together
        return gram, slope

    def gains(self, c: F64) -> C128:
        """C(sI − A)⁻¹B, (omega, output, input)."""
        count, paths = self.lines.omega.size, (self.states @ c.T).transpose(0, 2, 1)
        found = (paths @ self.functions.reshape(len(self.a), -1)).transpose(2, 1, 0)
        return np.asarray(found[:count] + 1j * found[count:])

    @property
    def drive(self) -> F64:
        u = np.zeros(self.b.shape[0])
        for first, size in self.pairs:
            u[first + size - 1] = 1.0
        return u

    def moved(self, step: F64) -> _Modes:
        n, inputs = self.b.shape
        b = self.b + step[n:].reshape(inputs, n).T if inputs > 1 else self.b
        return _modes(self.a - np.outer(self.drive, step[:n]), b, self.lines)


def fit_modes(
    omega: F64,
    data: C128,
    amplitude: F64,
    start: Realisation,
    region: Region,
    *,
    dcgain: F64 | None = None,
    tol: float = 1e-10,
    maxiter: int = 100,
) -> tuple[Realisation, C128, int]:
    """The stable model of the order of a start with the least Σ amplitude²‖G(iω) − C(iω − A)⁻¹B‖².

    Parameters
    ----------
    omega : ndarray, shape (omega,)
    data : ndarray of complex, shape (omega, output, input)
    amplitude : ndarray, shape (omega,)
    start : Realisation
        A stable model; its D is not looked at.
    region : Region
        Where poles may go.
    dcgain : ndarray, shape (output, input), optional
        Gain at s = 0 that is met exactly.
    tol : float
        Relative fall of the cost at which the iteration ends.

    Returns
    -------
    model : Realisation
        A in real blocks of one or two states, D = 0.
    gains : ndarray, shape (omega, output, input)
        The model's.
    nit : int
    """
    weight = amplitude
    if dcgain is not None:
        size = HEAVY * np.sqrt(np.sum(amplitude**2))
        omega, weight = np.append(omega, 0.0), np.append(weight, size)
        data = np.concatenate([data, dcgain[None].astype(np.complex128)])
    here = _modes(start.a, start.b, _Lines(omega, data, weight))

    def moved(at: _Modes, move: F64) -> _Modes | None:
        trial = at.moved(move)
        return trial if np.all(np.isfinite(trial.a)) and region.holds(trial.poles) else None

    enough = 1e-26 * float(np.sum(here.lines.target**2))
    here, nit, ended = levenberg_marquardt(
        here, _Modes.normal, _step, moved, enough=enough, tol=tol, maxiter=maxiter
    )
    c = here.c
    if dcgain is not None:  # what the heavy weight has left
        inner = -np.linalg.solve(here.a, here.b)
        c = c + (dcgain - c @ inner) @ np.linalg.pinv(inner)
    model = Realisation(here.a, here.b, c, np.zeros((c.shape[0], here.b.shape[1])))
    return model, here.gains(c)[: amplitude.size], nit + (ended == "settled")


def _triangle(columns: F64) -> F64:
    """R of QR."""
    return np.asarray(np.linalg.qr(columns, mode="r"))


def _step(_: _Modes, normal: tuple[F64, F64], damping: float) -> tuple[F64, float, float]:
    """The damped move, the fall of the cost that it promises, and its squared length in scaled columns."""
    gram, slope = normal
    size = np.diag(gram)
    scale = np.sqrt(np.where(size > 0, size, np.inf))  # what changes nothing does not move
    scaled = gram / np.outer(scale, scale)
    step = np.linalg.solve(scaled + damping * np.eye(scale.size), -slope / scale)
    return step / scale, -float(step @ (2 * slope / scale + scaled @ step)), float(step @ step)


def _modes(a: F64, b: F64, lines: _Lines) -> _Modes:
    """The same system in real blocks."""
    values, vectors = np.linalg.eig(a)
    columns, blocks, diagonal = [], [], np.zeros_like(a)
    first = 0
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < 0:
            continue
        if value.imag == 0:
            columns.append(vector.real)
            diagonal[first, first] = value.real
        else:
            columns += [vector.real, vector.imag]
            re, im = value.real, value.imag
            diagonal[first : first + 2, first : first + 2] = [[re, im], [-im, re]]
        size = 1 if value.imag == 0 else 2
        blocks.append((first, size))
        first += size
    if first == 0:
        return _Modes(a, b, (), lines)
    own = np.linalg.lstsq(np.array(columns).T, b, rcond=None)[0]
    for first, size in blocks:
        norm = np.linalg.norm(own[first : first + size])
        own[first : first + size] /= norm if norm > 0 else 1.0
    if b.shape[1] == 1:  # of one input any row that drives the mode serves
        for first, size in blocks:
            own[first : first + size] = [[1.0]] if size == 1 else [[0.0], [1.0]]
    return _Modes(diagonal, own, tuple(blocks), lines)
