"""Balanced truncation: factors of Gramians, Hankel singular values, the part that cannot be balanced."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.cached import cached_property
from ..errors import DataError
from ..systems.gains import SchurForm

__all__ = ["AXIS", "Balanced", "Realisation", "balance", "split"]


# Hankel singular values below this part of the largest are rounding.
NEGLIGIBLE = 1e-13
# Poles nearer to the axis than this part of the fastest pole count as being on it.
AXIS = 1e-13


@dataclass(frozen=True, eq=False)
class Realisation:
    """x' = Ax + Bu, y = Cx + Du; A may be sparse."""

    a: Any
    b: F64
    c: F64
    d: F64

    @property
    def order(self) -> int:
        return int(self.a.shape[0])

    @cached_property
    def poles(self) -> C128:
        return np.linalg.eigvals(self.a).astype(np.complex128) if self.order else np.zeros(0, np.complex128)

    @cached_property
    def schur(self) -> SchurForm:
        """What `response` is computed with."""
        return SchurForm(self.a, self.b, self.c, self.d)

    def response(self, omega: F64) -> C128:
        """G(iω), (omega, output, input)."""
        return self.schur.gains(omega)

    def minus(self, other: Realisation) -> Realisation:
        """The difference of two systems."""
        n = self.order
        a = np.zeros((n + other.order, n + other.order))
        a[:n, :n], a[n:, n:] = self.a, other.a
        return Realisation(
            a,
            np.vstack([self.b, other.b]),
            np.hstack([self.c, -other.c]),
            self.d - other.d,
        )

    def plus(self, other: Realisation) -> Realisation:
        """The sum of two systems."""
        return self.minus(Realisation(other.a, other.b, -other.c, -other.d))


@dataclass(frozen=True, eq=False)
class Balanced:
    """A balanced realisation of what is not rounding, and all Hankel singular values that were found."""

    system: Realisation
    hankel: F64

    def truncated(self, order: int) -> Realisation:
        """The leading states."""
        one = self.system
        k = min(order, one.order)
        return Realisation(one.a[:k, :k], one.b[:k], one.c[:, :k], one.d)


def split(system: Realisation) -> tuple[Realisation, Realisation]:
    """The stable part (with D), and what has poles on or right of the axis."""
    from scipy.linalg import schur, solve_sylvester

    size = float(np.max(np.abs(system.poles), initial=0.0))
    edge = AXIS * size
    t, z, stable = schur(system.a, sort=lambda re, im: re < -edge)
    b, c = z.T @ system.b, system.c @ z
    k = int(stable)
    x = solve_sylvester(t[:k, :k], -t[k:, k:], -t[:k, k:]) if 0 < k < system.order else np.zeros((k, 0))
    if x.size == 0:
        x = np.zeros((k, system.order - k))
    left = Realisation(t[:k, :k], b[:k] - x @ b[k:], c[:, :k], system.d)
    right = Realisation(t[k:, k:], b[k:], c[:, :k] @ x + c[:, k:], np.zeros_like(system.d))
    return left, right


def balance(system: Realisation) -> Balanced:
    """Balance a stable system by the square-root method.

    Raises
    ------
    DataError
        The system is not stable, so that it has no Gramians.
    """
    reach, watch = (_sparse if hasattr(system.a, "tocsc") else _dense)(system)
    u, hankel, vt = np.linalg.svd(watch.T @ reach, full_matrices=False)
    rank = int(np.sum(hankel > NEGLIGIBLE * hankel[0])) if hankel.size and hankel[0] > 0 else 0
    root = np.sqrt(hankel[:rank])
    left, right = watch @ (u[:, :rank] / root), reach @ (vt[:rank].T / root)
    own = Realisation(left.T @ (system.a @ right), left.T @ system.b, system.c @ right, system.d)
    return Balanced(own, hankel[: system.order])


def _dense(system: Realisation) -> tuple[F64, F64]:
    """Factors of both Gramians by the sign iteration, which needs inverses only.

    A ← (cA + A⁻¹/c)/2 tends to −I where A is stable; the factors go along.
    """
    a, reach, watch = np.array(system.a, dtype=np.float64), system.b, system.c.T
    n = system.order
    last = False
    for _ in range(100):
        try:
            inverse = np.linalg.inv(a)
        except np.linalg.LinAlgError:
            raise _unstable() from None
        distance = np.linalg.norm(a + np.eye(n))
        c = float(np.sqrt(np.linalg.norm(inverse) / np.linalg.norm(a))) if distance > 0.1 else 1.0
        reach = _compressed(np.hstack([np.sqrt(c) * reach, inverse @ reach / np.sqrt(c)]) / np.sqrt(2))
        watch = _compressed(np.hstack([np.sqrt(c) * watch, inverse.T @ watch / np.sqrt(c)]) / np.sqrt(2))
        if last:
            return reach / np.sqrt(2), watch / np.sqrt(2)
        a = (c * a + inverse / c) / 2
        if not np.all(np.isfinite(a)):
            break
        last = bool(np.linalg.norm(a + np.eye(n)) < 1e-6 * np.sqrt(n))  # squared by the last step
    raise _unstable()


def _sparse(system: Realisation) -> tuple[F64, F64]:
    """Factors of both Gramians by the alternating direction iteration, a sparse solve a shift."""
    return _low_rank(system.a.tocsc(), system.b), _low_rank(system.a.T.tocsc(), system.c.T)


def _low_rank(a: Any, b: F64, tol: float = 1e-16, most: int = 400) -> F64:
    """Z with ZZᵀ solving AP + PAᵀ + BBᵀ = 0; shifts are Ritz values of A on the last columns."""
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    eye = identity(a.shape[0], format="csc")
    left = b.copy()
    parts: list[F64] = []
    goal = tol * np.linalg.norm(b, 2) ** 2
    shifts: list[complex] = []
    while np.linalg.norm(left, 2) ** 2 > goal:
        if len(parts) >= most:
            raise DataError(
                f"reduce: the Gramian of this sparse system is not found within {most} solves (residual "
                f"{np.linalg.norm(left, 2) ** 2 / np.linalg.norm(b, 2) ** 2:.1g} of its right side); give A "
                "as a dense array, or a system with fewer inputs and outputs"
            )
        if not shifts:
            recent = np.hstack(parts[-2:]) if parts else left
            basis = np.linalg.qr(recent)[0]
            values = np.linalg.eigvals(basis.T @ (a @ basis))
            if not parts and np.all(values.real >= 0):
                raise _unstable()
            shifts = [complex(-abs(v.real), abs(v.imag)) for v in values if v.imag >= 0 and v.real != 0]
            if not shifts:
                raise _unstable()
        p = shifts.pop(0)
        if abs(p.imag) < 1e-12 * abs(p):
            v = splu(a + p.real * eye).solve(left)
            left = left - 2 * p.real * v
            parts.append(np.sqrt(-2 * p.real) * v)
        else:
            v = splu((a + p * eye).astype(np.complex128)).solve(left.astype(np.complex128))
            ratio = p.real / p.imag
            mixed = v.real + ratio * v.imag
            gain = 2 * np.sqrt(-p.real)
            left = left + gain**2 * mixed
            parts.append(gain * np.hstack([mixed, np.sqrt(ratio**2 + 1) * v.imag]))
        if not np.all(np.isfinite(left)):
            raise _unstable()
    return _compressed(np.hstack(parts))


def _compressed(factor: F64) -> F64:
    """Fewer columns with the same product FFᵀ."""
    if factor.shape[1] <= 8:
        return factor
    if factor.shape[1] > factor.shape[0]:
        return np.ascontiguousarray(np.transpose(np.linalg.qr(factor.T, mode="r")))
    u, s, _ = np.linalg.svd(factor, full_matrices=False)
    keep = int(np.sum(s > 1e-16 * s[0])) if s[0] > 0 else 1
    return np.asarray(u[:, :keep] * s[:keep])


def _unstable() -> DataError:
    return DataError(
        "reduce: the system is not stable, so it has no Gramians; of dense systems the poles that are not "
        "stable are kept, a sparse one must be stable (split it, or give A as a dense array)"
    )
