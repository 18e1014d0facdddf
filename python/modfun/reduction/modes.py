"""State-space models of a given order fitted to frequency responses: modes with a row of B, a column of C.

The poles and B are the unknowns of a Levenberg–Marquardt iteration; C is solved for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.least_squares import levenberg_marquardt
from .fractions import Region
from .gramians import Realisation

__all__ = ["fit_modes"]


# Weight of a response that shall be met exactly over that of all lines.
HEAVY = 1e5


@dataclass(frozen=True)
class _Lines:
    s: C128
    data: C128  # (omega, output, input)
    amplitude: F64

    @cached_property
    def target(self) -> F64:
        """Weighted real rows (omega and input), a column an output."""
        return _real(self.amplitude[:, None, None] * self.data.transpose(0, 2, 1))


@dataclass(frozen=True)
class _Solved:
    """Least squares of the target on the states, whose scaled rows are `rows` = QR."""

    rows: F64
    r: F64
    size: F64
    found: F64  # in units of the scaled rows
    cost: float

    @property
    def orthonormal(self) -> F64:
        """Q."""
        from scipy.linalg import solve_triangular

        pivots = np.abs(np.diag(self.r))
        if pivots.min(initial=1.0) < 1e-8 * pivots.max(initial=0.0):  # R says too little of Q
            return np.asarray(np.linalg.qr(self.rows)[0])
        return np.asarray(solve_triangular(self.r, self.rows.T, trans="T", check_finite=False).T)


@dataclass(frozen=True)
class _Modes:
    """Real blocks of A (one state, or two of a pair), B, and the best C."""

    a: F64
    b: F64
    pairs: tuple[tuple[int, int], ...]  # first state and size of each block
    lines: _Lines

    @cached_property
    def resolvent(self) -> list[C128]:
        """(sI − A)⁻¹ of each block: (omega,) or (omega, 2, 2)."""
        found = []
        for first, size in self.pairs:
            if size == 1:
                found.append(1 / (self.lines.s - self.a[first, first]))
            else:
                re, im = self.a[first, first], self.a[first, first + 1]
                x = self.lines.s - re
                top = np.array([[x, np.full_like(x, im)], [np.full_like(x, -im), x]])
                found.append((top / (x**2 + im**2)).transpose(2, 0, 1))
        return found

    @cached_property
    def states(self) -> C128:
        """(sI − A)⁻¹ B, (omega, state, input)."""
        found = np.empty((self.lines.s.size, *self.b.shape), dtype=np.complex128)
        for (first, size), x in zip(self.pairs, self.resolvent, strict=True):
            if size == 1:
                found[:, first] = x[:, None] * self.b[first]
            else:
                found[:, first : first + 2] = x @ self.b[first : first + 2]
        return found

    @cached_property
    def _solved(self) -> _Solved:
        rows = _real(self.lines.amplitude[:, None, None] * self.states.transpose(0, 2, 1))
        size = np.linalg.norm(rows, axis=0)
        size[size == 0] = 1.0
        rows /= size
        n = size.size
        r: F64 = np.asarray(np.linalg.qr(np.hstack([rows, self.lines.target]), mode="r"))
        found: F64 = np.asarray(np.linalg.lstsq(r[:n, :n], r[:n, n:], rcond=1e-14)[0])
        return _Solved(rows, r[:n, :n], size, found, float(np.sum(r[n:, n:] ** 2)))

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

    def normal(self) -> tuple[F64, F64]:
        """JᵀJ and Jᵀe over moves of the poles (A − uδᵀ) and of B; C follows.

        For output i and input j the columns of J are d_i S_j for the poles, with S = (s − A)⁻¹B and
        d = C(s − A)⁻¹u, and −C_i(s − A)⁻¹ for the column j of B, less their part in the span of S. J is never
        put together: its products are those of matrices (omega, n).
        """
        solved, (n, inputs) = self._solved, self.b.shape
        outputs, count = solved.found.shape[1], self.lines.s.size
        amplitude = self.lines.amplitude[:, None]
        q = _complex(solved.orthonormal, inputs)
        left = _complex(self.lines.target - solved.rows @ solved.found, inputs)  # orthogonal to all of S
        by_output = np.empty((outputs, count, n), dtype=np.complex128)  # C (sI − A)⁻¹
        for (first, size), x in zip(self.pairs, self.resolvent, strict=True):
            c = self.c[:, first : first + size]
            by_output[:, :, first : first + size] = (
                c[:, None] * x[:, None] if size == 1 else (c @ x).transpose(1, 0, 2)
            )
        drive = by_output @ self.drive
        by_output *= -amplitude
        moves = n * (1 + inputs if inputs > 1 else 1)
        gram, slope, part = np.zeros((moves, moves)), np.zeros(moves), np.zeros((outputs, n, moves))
        together = np.sqrt(np.sum(np.abs(drive) ** 2, axis=0))[:, None]
        crossed = _real(np.sum(drive.conj()[:, :, None] * by_output, axis=0))
        outward = [_real(one) for one in by_output]
        own = sum(one.T @ one for one in outward)
        for j in range(inputs):
            states, ahead = amplitude * self.states[:, :, j], _real(q[:, j])
            inward, rows = _real(states), _real(together * states)
            gram[:n, :n] += rows.T @ rows
            slope[:n] += inward.T @ _real(np.sum(drive.conj().T * left[:, j], axis=1, keepdims=True))[:, 0]
            for i in range(outputs):
                part[i, :, :n] += ahead.T @ _real(drive[i][:, None] * states)
            if inputs > 1:
                at = slice(n + j * n, n + (j + 1) * n)
                gram[:n, at] = inward.T @ crossed
                gram[at, :n] = gram[:n, at].T
                gram[at, at] = own
                for i in range(outputs):
                    part[i, :, at] = ahead.T @ outward[i]
                    slope[at] += outward[i].T @ _real(left[:, j, i : i + 1])[:, 0]
        for one in part:
            gram -= one.T @ one
        return gram, slope

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
) -> tuple[Realisation, int]:
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
    nit : int
    """
    s, weight = (1j * omega).astype(np.complex128), amplitude
    if dcgain is not None:
        size = HEAVY * np.sqrt(np.sum(amplitude**2))
        s, weight = np.append(s, 0), np.append(weight, size)
        data = np.concatenate([data, dcgain[None].astype(np.complex128)])
    here = _modes(start.a, start.b, _Lines(np.asarray(s, dtype=np.complex128), data, weight))

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
    return Realisation(here.a, here.b, c, np.zeros((c.shape[0], here.b.shape[1]))), nit + (ended == "settled")


def _step(_: _Modes, normal: tuple[F64, F64], damping: float) -> tuple[F64, float]:
    """The damped move, and the fall of the cost that it promises."""
    gram, slope = normal
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram / np.outer(scale, scale)
    step = np.linalg.lstsq(scaled + damping * np.eye(scale.size), -slope / scale, rcond=1e-15)[0]
    return step / scale, -float(step @ (2 * slope / scale + scaled @ step))


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


def _complex(rows: F64, inputs: int) -> C128:
    """Real rows as (omega, input, column)."""
    half = len(rows) // 2
    return np.asarray(rows[:half] + 1j * rows[half:]).reshape(-1, inputs, rows.shape[1])


def _real(rows: Any) -> F64:
    """(omega, input, column) as real rows, a column each."""
    flat = rows.reshape(-1, rows.shape[-1])
    return np.concatenate([flat.real, flat.imag])
