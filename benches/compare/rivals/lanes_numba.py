"""numba, sixteen replicates side by side: inner loops run over lanes and are straight-line code for LLVM.

Work arrays are one-dimensional, value after value of sixteen lanes, so that all offsets are constants.
Loops of constant length inside a loop over lanes are unrolled (by the threshold below), which lets lanes be
vectorised; simple loops over lanes have a length unknown to LLVM, `width`, lest they be unrolled instead.
"""

import numba
import numpy as np
import setting as s
from llvmlite import binding

from .normals_numba import PAIRS, normals, seeded

binding.set_option("", "-unroll-threshold=4000")
binding.set_option("", "-runtime-memory-check-threshold=64")

W = 16
JIT = {"fastmath": {"contract"}, "error_model": "numpy", "boundscheck": False}
n = s.LINES
HALF = tuple(np.where(s.M == 0, 0.5, 1.0))  # ½/h
H = tuple(s.H)
X, Z, Z3 = tuple(s.Z**2), tuple(s.Z), tuple(s.Z**3)
UR, UI = tuple(s.UR), tuple(s.UI)
UU, ZUI = tuple(s.UR**2 + s.UI**2), tuple(s.Z * s.UI)
STEPS, SAMPLES, COEFFICIENTS, N = s.STEPS, s.SAMPLES, s.COEFFICIENTS, s.INTERVALS
UNIT1, UNIT2, UNIT3 = s.UNIT
CLEAN = s.Y0.copy()


# Sums --------------------------------------------------------------------------------------------

HALF_N, QUARTER = N // 2, N // 4
_PHASE = 2 * np.pi * np.outer(s.M, np.arange(QUARTER + 1)) / N
COS, SIN = s.SIGMA / N * np.cos(_PHASE), -s.SIGMA / N * np.sin(_PHASE)


@numba.njit(**JIT)
def fold(e, f, width):
    """Normals (257, W) into sums and differences (4, 65·W), k with N - k and then with N/2 - k.

    For cosines of even and odd m, sines of even and odd m.
    """
    first, last, middle, low, high = e[0], e[N], e[HALF_N], e[QUARTER], e[N - QUARTER]
    f0, f1, f2, f3 = f[0], f[1], f[2], f[3]
    for lane in range(width):
        ends = 0.5 * (first[lane] + last[lane])  # the trapezoidal rule
        f0[lane] = ends + middle[lane]
        f1[lane] = ends - middle[lane]
        f0[QUARTER * W + lane] = low[lane] + high[lane]
        f3[QUARTER * W + lane] = low[lane] - high[lane]
    for k in range(1, QUARTER):
        e0, e1, e2, e3 = e[k], e[N - k], e[HALF_N - k], e[HALF_N + k]
        f0, f1, f2, f3 = f[0, k * W :], f[1, k * W :], f[2, k * W :], f[3, k * W :]
        for lane in range(width):
            a, b, c, d = e0[lane], e1[lane], e2[lane], e3[lane]
            plus, minus, other, less = a + b, a - b, c + d, c - d
            f0[lane] = plus + other
            f1[lane] = plus - other
            f2[lane] = minus - less
            f3[lane] = minus + less


@numba.njit(**JIT)
def sums(f, y, width):
    """Coefficients (17, W) from what `fold` made, the noise-free ones added."""
    for m in range(n):
        weighted(CLEAN[m], COS[m], f[m % 2], y[m], width)
    for m in range(1, n):
        weighted(CLEAN[n + m - 1], SIN[m], f[2 + m % 2], y[n + m - 1], width)


@numba.njit(**JIT)
def weighted(start, c, rows, out, width):
    """start + Σ c_k rows_k, sixteen terms between stores."""
    last = rows[QUARTER * W :]
    for lane in range(width):
        out[lane] = start + c[QUARTER] * last[lane]
    for low in range(0, QUARTER, 16):
        part, block = c[low : low + 16], rows[low * W : (low + 16) * W]
        for lane in range(width):
            total = out[lane]
            for k in range(16):
                total += part[k] * block[k * W + lane]
            out[lane] = total


# Sines are independent; cosines are not quite, because of the end weights.
RE_ROWS = np.ascontiguousarray(s.COLOUR[:n, :n])
IM_SCALE = np.diag(s.COLOUR)[n:].copy()


@numba.njit(**JIT)
def colour(z, y, width):
    """Coefficients (17, W) from normals."""
    block = z.reshape(z.size)
    for m in range(n):
        row, to = RE_ROWS[m], y[m]
        for lane in range(width):
            total = CLEAN[m]
            for k in range(n):
                total += row[k] * block[k * W + lane]
            to[lane] = total
    for m in range(n, COEFFICIENTS):
        normal, to = z[m], y[m]
        for lane in range(width):
            to[lane] = CLEAN[m] + IM_SCALE[m - n] * normal[lane]


# Estimates ---------------------------------------------------------------------------------------


@numba.njit(inline="always", **JIT)
def solve3(h11, h12, h13, h22, h23, h33, g1, g2, g3):
    """LDLᵀ of a symmetric 3 × 3 system."""
    r1 = 1.0 / h11
    l2, l3 = h12 * r1, h13 * r1
    r2 = 1.0 / (h22 - l2 * h12)
    c = h23 - l2 * h13
    l32 = c * r2
    g2 = g2 - l2 * g1
    g3 = g3 - l3 * g1 - l32 * g2
    x3 = g3 / (h33 - l3 * h13 - l32 * c)
    x2 = g2 * r2 - l32 * x3
    return g1 * r1 - l2 * x2 - l3 * x3, x2, x3


@numba.njit(**JIT)
def lines(y, work, q):
    """Scaled θ into q from coefficients y: fourteen weighted sums, end terms eliminated, 3 × 3 solved."""
    for lane in range(W):
        for m in range(n):
            re = y[m * W + lane]
            if m == 0:
                work[lane], work[n * W + lane], work[2 * n * W + lane] = re * re, re * UR[0], 0.0
            else:
                im = y[(n + m - 1) * W + lane]
                work[m * W + lane] = re * re + im * im
                work[(n + m) * W + lane] = re * UR[m] + im * UI[m]
                work[(2 * n + m) * W + lane] = Z[m] * (re * UI[m] - im * UR[m])
    for step in range(STEPS + 1):
        if step == 0:
            for i in range(n):
                for lane in range(W):
                    q[(3 + i) * W + lane] = HALF[i]
        else:
            for lane in range(W):
                a1, a2 = q[lane], q[W + lane]
                q1, q0 = a1 * a1 - 2 * a2, a2 * a2
                for m in range(n):
                    q[(3 + m) * W + lane] = HALF[m] / (q0 + X[m] * (q1 + X[m]))
        for lane in range(W):
            w0 = w2 = u0 = u1 = uu = p0 = p2 = r0 = r2 = i1 = i3 = c0 = c2 = d1 = 0.0
            for m in range(n):
                w = q[(3 + m) * W + lane]
                power, cross = work[m * W + lane], work[(n + m) * W + lane]
                re = y[m * W + lane]
                w0 += w
                u0 += w * UR[m]
                uu += w * UU[m]
                p0 += w * power
                r0 += w * re
                c0 += w * cross
                if m > 0:
                    wx, im = w * X[m], y[(n + m - 1) * W + lane]
                    w2 += wx
                    p2 += wx * power
                    r2 += wx * re
                    c2 += wx * cross
                    u1 += w * ZUI[m]
                    d1 += w * work[(2 * n + m) * W + lane]
                    wim = w * im
                    i1 += Z[m] * wim
                    i3 += Z3[m] * wim
            e, f = 1.0 / w0, 1.0 / w2
            i1e, r0e, u0e, r2f, i1f, u1f = i1 * e, r0 * e, u0 * e, r2 * f, i1 * f, u1 * f
            a1, a2, b = solve3(
                p2 - i1 * i1e - r2 * r2f,
                i1 * r0e - r2 * i1f,
                r2 * u1f - i1 * u0e - d1,
                p0 - r0 * r0e - i1 * i1f,
                r0 * u0e + i1 * u1f - c0,
                uu - u0 * u0e - u1 * u1f,
                i1e * r2 - r2f * i3,
                p2 - r0e * r2 - i1f * i3,
                u0e * r2 + u1f * i3 - c2,
            )
            q[lane], q[W + lane], q[2 * W + lane] = a1, a2, b


RE, ROWS = n - 1, 2 * n - 3  # rows m = -1 … 6 of Re, then m = 0 … 6 of Im
_D = s.differences()
B = tuple(np.concatenate([-(_D[0] @ s.UR), -(_D[1] @ s.UI)]))


@numba.njit(**JIT)
def differenced(y, values, rows):
    """Second differences (15 · 3, W) of iωY, Y and ω²Y, Re and then Im, from coefficients y."""
    for lane in range(W):
        for m in range(n):
            re = y[m * W + lane]
            im = 0.0 if m == 0 else y[(n + m - 1) * W + lane]
            values[(0 * n + m) * W + lane] = -Z[m] * im
            values[(1 * n + m) * W + lane] = re
            values[(2 * n + m) * W + lane] = X[m] * re
            values[(3 * n + m) * W + lane] = Z[m] * re
            values[(4 * n + m) * W + lane] = im
            values[(5 * n + m) * W + lane] = X[m] * im
    for i in range(ROWS):
        m = abs(i - 1) if i < RE else i - RE
        middle, last = (i, i + 1) if i < RE else (m + 1, m + 2)
        for column in range(3):
            at = (column if i < RE else 3 + column) * n
            a, b, c = values[(at + m) * W :], values[(at + middle) * W :], values[(at + last) * W :]
            to = rows[(3 * i + column) * W :]
            for lane in range(W):
                to[lane] = a[lane] - 2 * b[lane] + c[lane]


@numba.njit(**JIT)
def banded(y, work, q):
    """Scaled θ into q: LDLᵀ of the pentadiagonal covariances, rows solved forward as they come."""
    values, rows = work[: 6 * n * W], work[6 * n * W :]
    differenced(y, values, rows)
    for step in range(STEPS + 1):
        for lane in range(W):
            a1, a2 = q[lane], q[W + lane]
            q1, q0 = a1 * a1 - 2 * a2, a2 * a2
            for m in range(n):
                q[(3 + m) * W + lane] = H[m] if step == 0 else H[m] * (q0 + X[m] * (q1 + X[m]))
        for lane in range(W):
            h11 = h12 = h13 = h22 = h23 = h33 = g1 = g2 = g3 = 0.0
            pivot = before = below = 0.0
            x1 = x2 = x3 = x4 = 0.0
            z1 = z2 = z3 = z4 = 0.0
            for i in range(ROWS):
                m = i - 1 if i < RE else i - RE
                # variances of the lines of this row; Im has no line 0
                v0 = q[(3 + abs(m)) * W + lane] if i < RE or m > 0 else 0.0
                v1, v2 = q[(4 + m) * W + lane], q[(5 + m) * W + lane]
                if i == 0:
                    diagonal = 4 * v1 + 4 * v2
                    one = two = 0.0
                else:
                    diagonal = v0 + 4 * v1 + v2
                    one = -2 * v0 - (4 if i == 1 else 2) * v1
                    two = 2 * v0 if i == 2 else v0
                if i == RE:
                    one = 0.0
                if i == 1 or i == RE or i == RE + 1:
                    two = 0.0
                l2 = two * before
                one = one - l2 * below
                l1 = one * pivot
                diagonal = diagonal - l2 * two - l1 * one
                below, before, pivot = one, pivot, 1.0 / diagonal
                c1, c2, c4 = (
                    rows[3 * i * W + lane],
                    rows[(3 * i + 1) * W + lane],
                    rows[(3 * i + 2) * W + lane],
                )
                c1 = c1 - l1 * z1 - l2 * x1
                c2 = c2 - l1 * z2 - l2 * x2
                c3 = B[i] - l1 * z3 - l2 * x3
                c4 = c4 - l1 * z4 - l2 * x4
                x1, x2, x3, x4 = z1, z2, z3, z4
                z1, z2, z3, z4 = c1, c2, c3, c4
                w1, w2, w3 = pivot * c1, pivot * c2, pivot * c3
                h11 += w1 * c1
                h12 += w1 * c2
                h13 += w1 * c3
                h22 += w2 * c2
                h23 += w2 * c3
                h33 += w3 * c3
                g1 += w1 * c4
                g2 += w2 * c4
                g3 += w3 * c4
            a1, a2, b = solve3(h11, h12, h13, h22, h23, h33, g1, g2, g3)
            q[lane], q[W + lane], q[2 * W + lane] = a1, a2, b


# A run -------------------------------------------------------------------------------------------


@numba.njit(**JIT)
def estimate_all(kind, form, count, state, given, theta, width):
    """θ (count, 3): kind 0 draws samples, 1 coefficients; given normals (count, …) replace drawn ones."""
    e, f, y = np.empty((2 * PAIRS, W)), np.zeros((4, (QUARTER + 1) * W)), np.empty((COEFFICIENTS, W))
    pairs = e.reshape(PAIRS, 2 * W)
    work, q = np.empty((6 * n + 3 * ROWS) * W), np.zeros((3 + n) * W)
    size = SAMPLES if kind == 0 else COEFFICIENTS
    for first in range(0, count, W):
        if given.shape[0] > 0:
            e[:size, : min(W, count - first)] = given[first : first + W].T
        else:
            normals(state, (size + 1) // 2, pairs, width)
        if kind == 0:
            fold(e, f, width)
            sums(f, y, width)
        else:
            colour(e, y, width)
        if form == 0:
            lines(y.reshape(COEFFICIENTS * W), work, q)
        else:
            banded(y.reshape(COEFFICIENTS * W), work, q)
        for lane in range(min(W, count - first)):
            theta[first + lane, 0] = UNIT1 * q[lane]
            theta[first + lane, 1] = UNIT2 * q[W + lane]
            theta[first + lane, 2] = UNIT3 * q[2 * W + lane]


class NumbaLanes:
    """One form ("lines" or "banded")."""

    def __init__(self, form):
        self.form = ("lines", "banded").index(form)
        self.state = seeded(1)

    def _run(self, kind, count, given=None):
        theta = np.empty((count, 3))
        given = np.empty((0, 1)) if given is None else np.ascontiguousarray(given)
        estimate_all(kind, self.form, count, self.state, given, theta, W)
        return theta

    def samples(self, count):
        """Draw, transform, estimate."""
        return self._run(0, count)

    def coefficients(self, count):
        """Draw the coefficients, estimate."""
        return self._run(1, count)

    def from_noise(self, noise):
        """θ (replicate, 3) from unit normals (replicate, 257)."""
        return self._run(0, len(noise), noise)

    def from_normals(self, normals):
        """θ (replicate, 3) from unit normals (replicate, 17)."""
        return self._run(1, len(normals), normals)
