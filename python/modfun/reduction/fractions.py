"""Rational functions with given poles: real bases that stay independent over many decades and orders.

Powers of s over a wide band are as good as dependent from order ten on. Here s^k/A is replaced by fractions
over the roots of A themselves, one for a real pole, two for a complex pair.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import C128, F64
from ..base.cached import cached_property

__all__ = ["Fractions", "Numerators", "Region", "mirrored", "monic"]


# Poles nearer than this part of their size make nearly equal fractions; the second is then the product.
CLOSE = 0.03


@dataclass(frozen=True)
class _Section:
    """A real pole p, 1/(s − p), or a pair, w/q and s/q with q = s² + d s + w²; behind another if chained."""

    pole: complex
    size: int
    parent: int | None

    @property
    def gain(self) -> float:
        """What makes the section's own function one at s = 0."""
        return abs(self.pole) or 1.0

    @property
    def quadratic(self) -> F64:
        p = self.pole
        return np.array([1.0, -p.real]) if self.size == 1 else np.array([1.0, -2 * p.real, abs(p) ** 2])

    def at(self, s: C128) -> C128:
        """The denominator at points s."""
        p = self.pole
        return s - p.real if self.size == 1 else (s - 2 * p.real) * s + abs(p) ** 2


def _sections(poles: C128) -> list[_Section]:
    kept = [complex(p) for p in poles if p.imag >= 0]
    kept.sort(key=lambda p: (abs(p), p.imag))
    found: list[_Section] = []
    for p in kept:
        size = 2 if p.imag > 0 else 1
        near = [
            k
            for k, other in enumerate(found)
            if other.size == size and abs(other.pole - p) <= CLOSE * max(abs(p), abs(other.pole))
        ]
        found.append(_Section(p, size, near[-1] if near else None))
    return found


class Fractions:
    """A real basis of the strictly proper rational functions with given poles.

    Parameters
    ----------
    poles : ndarray of complex, shape (n,)
        In conjugate pairs.
    """

    def __init__(self, poles: C128) -> None:
        self.poles = np.asarray(poles, dtype=np.complex128)
        self.sections = _sections(self.poles)
        self.size = sum(section.size for section in self.sections)

    def values(self, s: C128) -> C128:
        """The functions at points s, (point, function)."""
        found = np.empty((s.size, self.size), dtype=np.complex128)
        outputs: list[C128] = []
        at = 0
        for section in self.sections:
            drive = outputs[section.parent] if section.parent is not None else np.ones_like(s)
            own = drive / section.at(s)
            if section.size == 1:
                found[:, at] = own
            else:
                found[:, at], found[:, at + 1] = abs(section.pole) * own, s * own
            outputs.append((section.gain**section.size * own).astype(np.complex128))
            at += section.size
        return found

    @cached_property
    def state(self) -> tuple[F64, F64]:
        """A and b with (sI − A)⁻¹ b equal to the functions."""
        a, b = np.zeros((self.size, self.size)), np.zeros(self.size)
        starts = np.cumsum([0, *(section.size for section in self.sections)])
        for k, section in enumerate(self.sections):
            first, last = starts[k], starts[k + 1] - 1
            if section.size == 1:
                a[first, first] = section.pole.real
            else:
                w = abs(section.pole)
                a[first : last + 1, first : last + 1] = [[0, w], [-w, 2 * section.pole.real]]
            if section.parent is None:
                b[last] = 1.0
            else:
                # The parent's first state is its own function (times w for a pair).
                a[last, starts[section.parent]] = self.sections[section.parent].gain
        return a, b

    @cached_property
    def polynomials(self) -> F64:
        """Each function times Π(s − p): descending coefficients, (function, n)."""
        found = np.zeros((self.size, max(self.size, 1)))
        at = 0
        for k, section in enumerate(self.sections):
            chain, gain = {k}, 1.0
            up = section.parent
            while up is not None:
                chain.add(up)
                gain *= self.sections[up].gain ** self.sections[up].size
                up = self.sections[up].parent
            rest = np.array([gain])
            for j, other in enumerate(self.sections):
                if j not in chain:
                    rest = np.convolve(rest, other.quadratic)
            if section.size == 1:
                found[at, -rest.size :] = rest
            else:
                found[at, -rest.size :] = abs(section.pole) * rest
                found[at + 1, -rest.size - 1 : -1] = rest
            at += section.size
        return found[:, : self.size]

    def zeros_with(self, coefficients: F64) -> C128:
        """Zeros of 1 + Σ c_j φ_j(s)."""
        a, b = self.state
        return np.linalg.eigvals(a - np.outer(b, coefficients)).astype(np.complex128)


class Numerators:
    """A real basis of the rational functions B/A with given poles and a numerator of at most a degree.

    Parameters
    ----------
    poles : ndarray of complex, shape (n,)
    degree : int
        At most n.
    whole : Fractions, optional
        Those over the same poles, where there are.
    """

    def __init__(self, poles: C128, degree: int, whole: Fractions | None = None) -> None:
        self.degree = degree
        self.order = poles.size
        self.constant = degree == self.order
        chosen, left, self.rest = [], degree, []
        if degree >= self.order - 1:
            chosen, left = list(poles), 0
        else:
            # The slowest poles make fractions, the others a common factor that falls as it has to.
            for section in sorted(_sections(poles), key=lambda one: abs(one.pole)):
                own = [section.pole] if section.size == 1 else [section.pole, section.pole.conjugate()]
                if section.size <= left:
                    chosen += own
                    left -= section.size
                else:
                    self.rest += own
        if whole is None or self.order - 1 > degree:
            whole = Fractions(np.array(chosen, dtype=np.complex128))
        self.fractions = whole
        self.leading = [0, 1] if left else [0] if self.constant or self.rest else []
        self.size = len(self.leading) + self.fractions.size
        self.speed = max((abs(p) for p in self.rest), default=1.0) or 1.0

    def values(self, s: C128, known: C128 | None = None) -> C128:
        """The functions at points s, (point, function), from the fractions there where these are known."""
        fractions = self.fractions.values(s) if known is None else known
        if not self.leading:
            return fractions
        factor = np.ones_like(s)
        for p in self.rest:
            factor = factor * ((abs(p) or 1.0) / (s - p))
        lead = [factor * (s / self.speed) ** k for k in self.leading]
        return np.column_stack([*lead, factor[:, None] * fractions])

    @cached_property
    def polynomials(self) -> F64:
        """Each function times A: descending coefficients, (function, degree + 1)."""
        gain = float(np.prod([abs(p) or 1.0 for p in self.rest]))
        whole = gain * monic(self.fractions.poles)
        rows = []
        for k in self.leading:
            rows.append(np.concatenate([whole, np.zeros(k)]) / self.speed**k)
        rows += list(gain * self.fractions.polynomials)
        found = np.zeros((len(rows), self.degree + 1))
        for row, own in zip(found, rows, strict=True):
            row[self.degree + 1 - own.size :] = own
        return found


def monic(poles: C128) -> F64:
    """Coefficients of Π(s − p), descending."""
    found = np.ones(1)
    for section in _sections(poles):
        found = np.convolve(found, section.quadratic)
    return found


def mirrored(poles: C128, unstable: int | None) -> C128:
    """Poles with all but so many of those right of the axis mirrored at it; None: as they are."""
    if unstable is None:
        return poles
    kept: list[complex] = []
    for p in sorted((complex(p) for p in poles if p.imag >= 0), key=lambda p: -p.real):
        size = 2 if p.imag > 0 else 1
        if p.real >= 0 and size <= unstable:
            unstable -= size
        elif p.real >= 0:
            p = complex(-max(p.real, 1e-9 * abs(p), 1e-12), p.imag)
        kept += [p, p.conjugate()][:size]
    return np.array(kept, dtype=np.complex128)


@dataclass(frozen=True)
class Region:
    """Where the poles of a stable model may be: none so near to the axis that it hides between two lines.

    Attributes
    ----------
    decay, ratio : float
        Decay rate, rad/s, and damping ratio that all poles exceed.
    fastest : float
        The largest modulus, rad/s; a pole far beyond the others is a feedthrough in disguise.
    """

    decay: float
    ratio: float
    fastest: float

    def scaled(self, unit: float) -> Region:
        """The same in another unit of frequency."""
        return Region(self.decay / unit, self.ratio, self.fastest / unit)

    def holds(self, poles: C128) -> bool:
        """Whether all poles are inside."""
        size = np.abs(poles)
        slow = -poles.real <= np.maximum(self.decay, self.ratio * size)
        return not bool(np.any(slow) or np.any(size > self.fastest))

    def tamed(self, poles: C128) -> C128:
        """The same with poles outside moved in."""
        size = np.maximum(np.abs(poles), 1e-300)
        near = poles * np.minimum(1, 0.99 * self.fastest / size)
        least = 2 * np.maximum(self.decay, self.ratio * np.abs(near))
        found: C128 = np.minimum(near.real, -least) + 1j * near.imag
        return found
