"""Characteristic roots of x' = Σ A_k x(t − h_k): found by collocation, made exact by Newton, and counted."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.arrays import C128, F64
from ..base.tables import Table
from ..errors import DataError, ModfunWarning
from . import drawing

__all__ = ["Lagged", "Roots", "characteristic", "count_right", "left_null", "rightmost", "slope", "span"]

Lagged = tuple[tuple[float, F64], ...]  # matrices with their lags, s, rising

DEGREES = (16, 32, 64, 128, 256)  # of the collocation polynomials, until all roots are found
LARGEST = 2000  # rows of the largest eigenvalue problem
NEWTON = 60  # steps at most: a double root needs one per digit
EXACT = 1e-10  # residual of a root, relative to the matrices
SAME = 1e-5  # roots closer than this, relative to their size, may be one
TURN = 0.7  # rad that the determinant may turn from one point of the contour to the next
POINTS = 4_000_000  # of a contour, at most
DEEPEST = 30.0  # roots further left than this over the longest lag are made by rounding


@dataclass(frozen=True, eq=False, repr=False)
class Roots:
    """Rightmost characteristic roots, rad/s; an array of complex numbers wherever one is expected.

    Attributes
    ----------
    values : ndarray of complex, shape (root,)
        By falling real part; multiple roots as often as they count.
    residual : ndarray, shape (root,)
        Smallest singular value of the characteristic matrix there, relative to the sizes of its terms.
    line : float
        All roots right of this real part are listed.
    counted : int
        How many roots lie there by the argument principle, independently of how they were found.
    """

    values: C128
    residual: F64
    line: float
    counted: int

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> C128:
        return np.array(self.values, dtype=dtype)

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, k: Any) -> Any:
        return self.values[k]

    @property
    def real(self) -> F64:
        """Real parts, 1/s."""
        return self.values.real

    @property
    def imag(self) -> F64:
        """Imaginary parts, rad/s."""
        return self.values.imag

    def table(self) -> Table:
        """One row per root: real and imaginary part, damping ratio, residual."""
        size = np.abs(self.values)
        with np.errstate(invalid="ignore", divide="ignore"):
            damping = np.where(size > 0, -self.values.real / size, np.nan)
        found = f"{len(self)} roots; the argument principle counts {self.counted} right of {self.line:.4g}"
        return Table(
            {"real": self.real, "imag": self.imag, "damping": damping, "residual": self.residual},
            title=found,
            units={"real": "rad/s", "imag": "rad/s"},
        )

    def __repr__(self) -> str:
        return repr(self.table())

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()

    def plot(self, ax: Any = None) -> Any:
        """Draw the roots in the complex plane (extra ``plot``); returns Axes."""
        return drawing.roots(self.values, self.line, ax)


def span(a: Lagged) -> float:
    """Longest lag, s."""
    return a[-1][0]


def characteristic(a: Lagged, s: C128) -> C128:
    """The matrices sI − Σ A_k e^{−s h_k}, one per entry of s."""
    s = np.asarray(s, dtype=np.complex128)[..., None, None]
    found: C128 = s * np.eye(len(a[0][1])) - sum(np.exp(-s * h) * m for h, m in a)
    return found


def slope(a: Lagged, s: C128) -> C128:
    """Derivative of `characteristic` over s."""
    s = np.asarray(s, dtype=np.complex128)[..., None, None]
    found: C128 = np.eye(len(a[0][1])) + np.sum([h * np.exp(-s * h) * m for h, m in a], axis=0)
    return found


def left_null(a: Lagged, root: complex) -> C128:
    """Orthonormal left null vectors of the characteristic matrix at a root, as rows."""
    u, sizes, _ = np.linalg.svd(characteristic(a, np.array(root)))
    count = max(int(np.sum(sizes < np.sqrt(EXACT) * _terms(a, np.array([root]))[0])), 1)
    found: C128 = u[:, -count:].conj().T
    return found


def rightmost(a: Lagged, count: int) -> Roots:
    """At least `count` rightmost roots (fewer where there are no more), pairs never cut.

    Warns
    -----
    ModfunWarning
        The argument principle counts other than what was found.
    """
    found = Roots(np.empty(0, np.complex128), np.empty(0), np.nan, -1)
    n = len(a[0][1])
    if span(a) == 0 or not any(m.any() for h, m in a if h > 0):
        values = _sorted(np.linalg.eigvals(np.sum([m for _, m in a], axis=0)).astype(np.complex128))
        alone = ((0.0, np.sum([m for _, m in a], axis=0)),)
        return Roots(values, _residual(alone, values), -np.inf, n)
    for degree in DEGREES:
        if degree > DEGREES[0] and n * (degree + 1) > LARGEST:
            break
        found = _found(a, count, _collocated(a, degree))
        if found.counted == len(found) and (len(found) >= count or degree == DEGREES[-1]):
            return found
    if len(found) < count and found.counted == len(found):
        return found  # a finite spectrum: there are no more
    counts = str(found.counted) if found.counted >= 0 else "none for sure"
    warnings.warn(
        f"poles: {len(found)} roots were found right of {found.line:.4g}, the argument principle counts "
        f"{counts} there; ask for fewer than {count}, or scale the states so that entries are alike",
        ModfunWarning,
        stacklevel=4,
    )
    return found


def count_right(a: Lagged, line: float) -> int:
    """Number of roots with real part above `line`, by the turns of the determinant around them.

    Raises
    ------
    DataError
        A root lies on the line, or too far left for a contour.
    """
    # A root there is no larger than the sum of the norms; twice that, the leading power rules.
    with np.errstate(over="ignore"):
        size = 2 * sum(np.linalg.norm(m, 2) * np.exp(-min(line, 0.0) * h) for h, m in a) + abs(line) + 1.0
    corners = [complex(size, 0.0), complex(size, size), complex(line, size), complex(line, 0.0)]
    pieces = []
    for one, other in pairwise(corners):
        steps = abs(other - one) * (span(a) + 1 / size) * 4 + 16
        if not steps < POINTS:
            raise DataError(
                f"poles: roots right of {line:.4g} may be as large as {size:.3g} rad/s, too many to be "
                "counted; ask for fewer"
            )
        pieces.append(one + (other - one) * np.linspace(0, 1, int(steps))[:-1])
    path = np.append(np.concatenate(pieces), corners[-1])
    turns = _turn(a, path) / np.pi  # the lower half is the mirror image
    if abs(turns - round(turns)) > 1e-3:
        raise DataError(f"poles: the argument principle found {turns:.3f} roots right of {line:.6g}")
    return round(turns)


def _turn(a: Lagged, path: C128) -> float:
    """How far the determinant turns along a path, rad; points are added where it turns fast."""
    sign, rate = _determinant(a, path)
    for _ in range(60):
        turned = np.angle(sign[1:] / sign[:-1])
        expected = 0.5 * ((rate[1:] + rate[:-1]) * np.diff(path)).imag
        fast = np.flatnonzero((np.abs(turned) > TURN) | (np.abs(turned - expected) > TURN))
        if not fast.size:
            return float(turned.sum())
        if path.size + fast.size > POINTS:
            break
        between = 0.5 * (path[fast] + path[fast + 1])
        more, speed = _determinant(a, between)
        path = np.insert(path, fast + 1, between)
        sign, rate = np.insert(sign, fast + 1, more), np.insert(rate, fast + 1, speed)
    raise DataError(
        f"poles: a root lies on the contour of the argument principle, near {path[fast[0]]:.6g}; "
        "ask for another count"
    )


def _determinant(a: Lagged, s: C128) -> tuple[C128, C128]:
    """Direction of the determinant, and its logarithmic derivative."""
    matrix = characteristic(a, s)
    sign = np.linalg.slogdet(matrix)[0]
    if not np.all(np.abs(sign) > 0.5):
        raise DataError("poles: a root lies on the contour of the argument principle; ask for another count")
    return sign, np.trace(np.linalg.solve(matrix, slope(a, s)), axis1=-2, axis2=-1)


def _collocated(a: Lagged, degree: int) -> C128:
    """Eigenvalues of the generator on polynomials in Chebyshev's points of [−longest lag, 0]."""
    n, longest = len(a[0][1]), span(a)
    k = np.arange(degree + 1)
    x = np.cos(np.pi * k / degree)  # from 1, which is now, to −1
    w = np.where(k % 2, -1.0, 1.0) * np.where((k == 0) | (k == degree), 0.5, 1.0)
    gaps = x[:, None] - x + np.eye(degree + 1)
    d = w / w[:, None] / gaps
    d -= np.diag(d.sum(axis=1))
    matrix = np.kron(2 / longest * d, np.eye(n))
    matrix[:n] = 0
    for h, m in a:
        matrix[:n] += np.kron(_lagrange(x, w, 1 - 2 * h / longest), m)
    found: C128 = np.linalg.eigvals(matrix).astype(np.complex128)
    return found


def _lagrange(x: F64, w: F64, at: float) -> F64:
    """Values of the cardinal polynomials of nodes x, barycentric weights w."""
    near = np.abs(at - x) < 1e-14
    if near.any():
        return near.astype(np.float64)
    parts = w / (at - x)
    found: F64 = parts / parts.sum()
    return found


def _found(a: Lagged, count: int, starts: C128) -> Roots:
    """The rightmost roots that the starts lead to, and their count."""
    order = np.argsort(-starts.real)[: 2 * count + 2 * len(a[0][1]) + 8]
    roots = _newton(a, starts[order])
    sound = (_residual(a, roots) < EXACT) & (roots.real > -DEEPEST / span(a))
    values = _sorted(_distinct(a, roots[sound]))
    if not values.size:
        return Roots(values, np.empty(0), np.inf, -1)
    real = values.real
    wide = 1e-3 / span(a)  # the cut goes where no root is near
    cuts = [k for k in range(min(count, real.size), real.size) if real[k - 1] - real[k] > wide]
    cut = cuts[0] if cuts else real.size
    line = 0.5 * (real[cut - 1] + real[cut]) if cuts else real[-1] - 1 / span(a)
    values = values[:cut]
    try:
        counted = count_right(a, float(line))
    except DataError:
        counted = -1
    return Roots(values, _residual(a, values), float(line), counted)


def _newton(a: Lagged, roots: C128) -> C128:
    """Newton on the smallest singular value of the characteristic matrix, all roots at once."""
    for _ in range(NEWTON):
        with np.errstate(all="ignore"):
            matrix, rate = characteristic(a, roots), slope(a, roots)
            sound = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(rate).all(axis=(1, 2))
            roots, matrix, rate = roots[sound], matrix[sound], rate[sound]
            u, sizes, vh = np.linalg.svd(matrix)
            speed = np.einsum("ki,kij,kj->k", u[:, :, -1].conj(), rate, vh[:, -1].conj())
            step = sizes[:, -1] / speed
        step = np.where(np.isfinite(step), step, 0)
        step *= np.minimum(1, 0.5 * (1 / span(a) + np.abs(roots)) / np.maximum(np.abs(step), 1e-300))
        roots = roots - step
        if np.all(np.abs(step) <= 4e-16 * np.abs(roots)):
            break
    return np.where(np.abs(roots.imag) < 1e-9 / span(a), roots.real, roots).astype(np.complex128)


def _distinct(a: Lagged, roots: C128) -> C128:
    """Each root of the upper half plane as often as it counts, with its conjugate."""
    left = roots[roots.imag >= 0]
    out: list[complex] = []
    while left.size:
        own = left[0]
        near = np.abs(left - own) < SAME * (1 / span(a) + abs(own))
        group, left = left[near], left[~near]
        middle = complex(np.mean(group))
        real = middle.imag < SAME * (1 / span(a) + abs(own))
        middle = complex(middle.real) if real else middle
        times = _multiplicity(a, middle) if group.size > 1 or (real and own.imag) else 1
        out += ([middle] if real else [middle, middle.conjugate()]) * times
    return np.array(out, dtype=np.complex128)


def _multiplicity(a: Lagged, root: complex) -> int:
    """Turns of the determinant on a small circle."""
    radius = 20 * SAME * (1 / span(a) + abs(root))
    circle = root + radius * np.exp(2j * np.pi * np.linspace(0, 1, 33))
    try:
        return max(round(_turn(a, circle) / (2 * np.pi)), 1)
    except DataError:
        return 1


def _residual(a: Lagged, roots: C128) -> F64:
    if not roots.size:
        return np.empty(0)
    with np.errstate(all="ignore"):
        matrix = characteristic(a, roots)
        sound = np.isfinite(matrix).all(axis=(1, 2))
        out = np.full(roots.size, np.inf)
        sizes = np.linalg.svd(matrix[sound], compute_uv=False)[:, -1]
        out[sound] = sizes / _terms(a, roots[sound])
    return out


def _terms(a: Lagged, roots: C128) -> F64:
    """Size of the terms of the characteristic matrix."""
    with np.errstate(over="ignore"):
        parts = [np.linalg.norm(m, 2) * np.exp(-roots.real * h) for h, m in a]
    found: F64 = np.maximum(np.abs(roots) + np.sum(parts, axis=0), np.finfo(float).tiny)
    return found


def _sorted(roots: C128) -> C128:
    return roots[np.lexsort((roots.imag < 0, np.abs(roots.imag), -np.round(roots.real, 9)))]
