"""JAX, jit and vmap, float64, one thread: a replicate in scalars, solves unrolled by hand, fused by XLA."""

import os
from functools import partial

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import jax.numpy as jnp
import numpy as np
import setting as s

from .expert_numpy import Banded
from .polynomials import COS, LOG, ROOT, SIN

jax.config.update("jax_enable_x64", True)

BLOCK = 512
n = s.LINES


class JaxVmap:
    """One form ("lines" or "banded")."""

    def __init__(self, form):
        one = {"lines": lines, "banded": banded}[form]
        self.counter = np.uint64(1)

        def estimate(matrix, unit):
            """θ (3, R) from unit normals (…, R)."""
            y = jnp.asarray(matrix) @ unit + s.Y0[:, None]
            return jax.vmap(one, in_axes=1, out_axes=1)(y) * s.UNIT[:, None]

        sizes = {m.shape[1]: m for m in (s.NOISE, s.COLOUR)}
        self._estimate = {k: jax.jit(partial(estimate, m)) for k, m in sizes.items()}
        self._normals = {k: jax.jit(partial(normals, k)) for k in sizes}

    def _run(self, size, count):
        theta = np.empty((3, -(-count // BLOCK) * BLOCK))
        for first in range(0, count, BLOCK):
            self.counter, unit = self._normals[size](self.counter)
            theta[:, first : first + BLOCK] = self._estimate[size](unit)
        return theta.T[:count]

    def samples(self, count):
        """Draw, transform, estimate."""
        return self._run(s.SAMPLES, count)

    def coefficients(self, count):
        """Draw the coefficients, estimate."""
        return self._run(s.COEFFICIENTS, count)

    def from_noise(self, noise):
        """θ (replicate, 3) from unit normals (replicate, 257)."""
        return np.asarray(self._estimate[s.SAMPLES](noise.T)).T

    def from_normals(self, normals):
        """θ (replicate, 3) from unit normals (replicate, 17)."""
        return np.asarray(self._estimate[s.COEFFICIENTS](normals.T)).T


def normals(size, counter):
    """The next counter, and unit normals (size, BLOCK): SplitMix64, then Box and Muller by polynomials.

    jax.random.normal (an erfinv) and XLA's own log, sine and cosine of doubles take many times as long.
    """
    shape = (2, (size + 1) // 2, BLOCK)
    count = np.prod(shape)
    bits = (counter + jnp.arange(count, dtype=jnp.uint64)) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> 30)) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> 27)) * np.uint64(0x94D049BB133111EB)
    bits = (bits ^ (bits >> 31)).reshape(shape)
    one, mantissa = np.uint64(0x3FF0000000000000), np.uint64(0x000FFFFFFFFFFFFF)
    low = np.float64(ROOT).view(np.uint64)
    to_float = partial(jax.lax.bitcast_convert_type, new_dtype=jnp.float64)
    unit = to_float((bits >> 12) | one)
    u = jax.lax.bitcast_convert_type(2.0 - unit[0], jnp.uint64) + (one - low)
    exponent = to_float((u >> 52) | np.uint64(0x4330000000000000)) - (2.0**52 + 1023.0)
    g = to_float((u & mantissa) + low) - 1.0
    radius = jnp.sqrt(-2.0 * (exponent * np.log(2.0) + (g + g * g * (g * horner(LOG, g) - 0.5))))
    half = (unit[1] - 1.5) * (np.pi / 2)
    sine = half * horner(SIN, half * half)
    cosine = horner(COS, half * half)
    radius = jnp.where(bits[1] & 1, radius, -radius)
    both = jnp.concatenate([radius * (cosine * cosine - sine * sine), radius * (2.0 * sine * cosine)])
    return counter + count.astype(np.uint64), both[:size]


def horner(coefficients, x):
    """A polynomial, ascending."""
    total = coefficients[-1]
    for c in coefficients[-2::-1]:
        total = total * x + c
    return total


def solve3(h11, h12, h13, h22, h23, h33, g1, g2, g3):
    """LDLᵀ of a symmetric 3 × 3 system."""
    l2, l3 = h12 / h11, h13 / h11
    d2 = h22 - l2 * h12
    c = h23 - l2 * h13
    l32 = c / d2
    g2 = g2 - l2 * g1
    g3 = g3 - l3 * g1 - l32 * g2
    x3 = g3 / (h33 - l3 * h13 - l32 * c)
    x2 = g2 / d2 - l32 * x3
    return g1 / h11 - l2 * x2 - l3 * x3, x2, x3


def levels(a1, a2):
    """|A|² on each line."""
    q1, q0 = a1 * a1 - 2 * a2, a2 * a2
    return [q0 + x * (q1 + x) for x in s.Z**2]


def lines(y):
    """Scaled θ of one replicate, end terms eliminated."""
    re, im = [y[m] for m in range(n)], [0.0] + [y[n + m] for m in range(n - 1)]
    power = [a * a + b * b for a, b in zip(re, im, strict=True)]

    def step(w):
        def total(factor, values):
            return sum(float(f) * wm * v for f, wm, v in zip(factor, w, values, strict=True) if f)

        one, x = np.ones(n), s.Z**2
        w0, w2 = total(one, one), total(x, one)
        u0, u1, uu = total(s.UR, one), total(s.Z * s.UI, one), total(s.UR**2 + s.UI**2, one)
        p0, p2 = total(one, power), total(x, power)
        r0, r2, i1, i3 = total(one, re), total(x, re), total(s.Z, im), total(s.Z**3, im)
        c0, c2 = total(s.UR, re) + total(s.UI, im), total(x * s.UR, re) + total(x * s.UI, im)
        d1 = total(s.Z * s.UI, re) - total(s.Z * s.UR, im)
        i1e, r0e, u0e, r2f, i1f, u1f = i1 / w0, r0 / w0, u0 / w0, r2 / w2, i1 / w2, u1 / w2
        return solve3(
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

    theta = step([1 / h for h in s.H])
    return reweighted(lambda t: step([1 / (h * q) for h, q in zip(s.H, levels(*t[:2]), strict=True)]), theta)


def reweighted(step, theta):
    """Five steps; a loop keeps XLA from fusing, and so repeating, one step in the next."""
    return jnp.stack(jax.lax.fori_loop(0, s.STEPS, lambda _, t: step(t), theta))


def banded(y):
    """Scaled θ of one replicate: LDLᵀ of the pentadiagonal covariances, unrolled."""
    constants = Banded(1)
    rows = constants.rows.shape[0]
    data = (jnp.asarray(constants.matrix) @ y).reshape(rows, 2, 3)
    fixed = constants.rows[:, :, 2, 0]
    bands = constants.bands.reshape(rows, 3, 2, n)

    def step(level):
        h = [0.0] * 6
        g = [0.0] * 3
        for part in range(2):
            pivot, below, solved = [], [], []
            for i in range(rows - part):
                diagonal, one, two = (
                    sum(float(c) * q for c, q in zip(bands[i, k, part], level, strict=True) if c)
                    for k in range(3)
                )
                z = [data[i, part, 0], data[i, part, 1], float(fixed[i, part]), data[i, part, 2]]
                if i > 1:
                    l2 = two * pivot[i - 2]
                    one, diagonal = one - l2 * below[i - 1], diagonal - l2 * two
                    z = [a - l2 * b for a, b in zip(z, solved[i - 2], strict=True)]
                if i > 0:
                    l1 = one * pivot[i - 1]
                    diagonal = diagonal - l1 * one
                    z = [a - l1 * b for a, b in zip(z, solved[i - 1], strict=True)]
                pivot.append(1 / diagonal)
                below.append(one)
                solved.append(z)
                w = [pivot[i] * a for a in z]
                for k, (a, b) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
                    h[k] = h[k] + w[a] * z[b]
                g = [g[a] + w[a] * z[3] for a in range(3)]
        return solve3(*h, *g)

    return reweighted(lambda t: step(levels(*t[:2])), step([1.0] * n))
