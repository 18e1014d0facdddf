"""Expert NumPy: sums by one matrix product, replicate last, solves unrolled by hand, blocks for the cache."""

import numpy as np
import setting as s


class ExpertNumPy:
    """Draws and transforms; the form ("lines" or "banded") estimates."""

    def __init__(self, form, block=2048):
        self.rng = np.random.Generator(np.random.SFC64(1))  # NumPy's fastest
        self.block = block
        self.estimate = {"lines": Lines, "banded": Banded}[form](block)
        self.noise = np.empty((s.SAMPLES, block))
        self.normals = np.empty((s.COEFFICIENTS, block))
        self.y = np.empty((s.COEFFICIENTS, block))

    def _run(self, count, matrix, unit):
        """θ (3, count) of normals drawn into `unit`, `matrix` @ unit being the coefficients' noise."""
        theta = np.empty((3, count))
        for first in range(0, count, self.block):
            self.rng.standard_normal(out=unit)
            self._one(matrix, unit, theta[:, first : first + self.block])
        return theta

    def _one(self, matrix, unit, theta):
        np.matmul(matrix, unit, out=self.y)
        self.y += s.Y0[:, None]
        np.multiply(self.estimate(self.y)[:, : theta.shape[1]], s.UNIT[:, None], out=theta)

    def samples(self, count):
        """Draw, transform, estimate."""
        return self._run(count, s.NOISE, self.noise).T

    def coefficients(self, count):
        """Draw the coefficients, estimate."""
        return self._run(count, s.COLOUR, self.normals).T

    def _given(self, matrix, unit):
        theta = np.empty((3, len(unit)))
        for first in range(0, len(unit), self.block):
            part = unit[first : first + self.block]
            padded = np.zeros((self.block, unit.shape[1]))
            padded[: len(part)] = part
            self._one(matrix, padded.T, theta[:, first : first + self.block])
        return theta.T

    def from_noise(self, noise):
        """θ (replicate, 3) from unit normals (replicate, 257)."""
        return self._given(s.NOISE, noise)

    def from_normals(self, normals):
        """θ (replicate, 3) from unit normals (replicate, 17)."""
        return self._given(s.COLOUR, normals)


def solve3(h, g, out):
    """Symmetric 3 × 3 systems by LDLᵀ, elementwise; h = (11, 12, 13, 22, 23, 33)."""
    h11, h12, h13, h22, h23, h33 = h
    r1 = 1 / h11
    l2, l3 = h12 * r1, h13 * r1
    r2 = 1 / (h22 - l2 * h12)
    c = h23 - l2 * h13
    l32 = c * r2
    g2 = g[1] - l2 * g[0]
    g3 = g[2] - l3 * g[0] - l32 * g2
    out[2] = g3 / (h33 - l3 * h13 - l32 * c)
    out[1] = g2 * r2 - l32 * out[2]
    out[0] = g[0] * r1 - l2 * out[1] - l3 * out[2]


def level(theta, out):
    """|A|² on the lines: z⁴ + (a1² - 2 a2) z² + a2²."""
    x = (s.Z**2)[:, None]
    a1, a2 = theta[0], theta[1]
    np.add(x, a1 * a1 - 2 * a2, out=out)
    out *= x
    out += a2 * a2


class Lines:
    """Sums over lines as one product of a constant matrix with w·(1, |Y|², Re Y, Im Y)."""

    def __init__(self, block):
        n = s.LINES
        x, half = s.Z**2, np.where(s.M == 0, 0.5, 1.0)
        one, power, re, im = (np.arange(n), n + np.arange(n), 2 * n + np.arange(n), 3 * n + np.arange(n))
        m = np.zeros((14, 4 * n))
        m[0, one], m[1, one] = half, half * x  # Σw, Σwz²
        m[2, one], m[3, one] = half * s.UR, half * s.Z * s.UI  # Σw Re U, Σwz Im U
        m[4, one] = half * (s.UR**2 + s.UI**2)
        m[5, power], m[6, power] = half, half * x  # Σw|Y|², Σwz²|Y|²
        m[7, re], m[8, re] = half, half * x
        m[9, im], m[10, im] = half * s.Z, half * s.Z**3
        m[11, re], m[11, im] = half * s.UR, half * s.UI  # Σw Re(conj(Y) U), with z², and Σwz Im(conj(Y) U)
        m[12, re], m[12, im] = half * x * s.UR, half * x * s.UI
        m[13, re], m[13, im] = half * s.Z * s.UI, -half * s.Z * s.UR
        self.matrix = np.delete(m, 3 * n, axis=1)  # Im of line 0
        self.w = np.empty((n, block))
        self.data = np.empty((4 * n - 1, block))
        self.power, self.squares = np.empty((n, block)), np.empty((n - 1, block))
        self.sums = np.empty((14, block))
        self.theta = np.empty((3, block))

    def __call__(self, y):
        """Scaled θ (3, block) from coefficients (17, block)."""
        n = s.LINES
        np.multiply(y[:n], y[:n], out=self.power)
        np.multiply(y[n:], y[n:], out=self.squares)
        self.power[1:] += self.squares
        self.data[:n] = 1
        self.data[n : 2 * n] = self.power
        self.data[2 * n :] = y
        self.step()
        for _ in range(s.STEPS):
            w = self.data[:n]
            level(self.theta, w)
            np.divide(1.0, w, out=w)
            np.multiply(w, self.power, out=self.data[n : 2 * n])
            np.multiply(w, y[:n], out=self.data[2 * n : 3 * n])
            np.multiply(w[1:], y[n:], out=self.data[3 * n :])
            self.step()
        return self.theta

    def step(self):
        """Normal equations, the two end terms eliminated."""
        np.matmul(self.matrix, self.data, out=self.sums)
        w0, w2, u0, u1, uu, p0, p2, r0, r2, i1, i3, c0, c2, d1 = self.sums
        e, f = 1 / w0, 1 / w2
        i1e, r0e, u0e, r2f, i1f, u1f = i1 * e, r0 * e, u0 * e, r2 * f, i1 * f, u1 * f
        h = (
            p2 - i1 * i1e - r2 * r2f,
            i1 * r0e - r2 * i1f,
            r2 * u1f - i1 * u0e - d1,
            p0 - r0 * r0e - i1 * i1f,
            r0 * u0e + i1 * u1f - c0,
            uu - u0 * u0e - u1 * u1f,
        )
        g = (i1e * r2 - r2f * i3, p2 - r0e * r2 - i1f * i3, u0e * r2 + u1f * i3 - c2)
        solve3(h, g, self.theta)


class Banded:
    """Second differences; LDLᵀ of their pentadiagonal covariances, those of Re and Im rows side by side."""

    def __init__(self, block):
        re, im = s.differences()
        n, rows = s.LINES, len(re)
        im_columns = im[:, 1:]
        matrix = np.zeros((rows, 2, 3, s.COEFFICIENTS))
        for column, (power, turn) in enumerate(((1, True), (0, False), (2, False))):
            d_re, d_im = re * s.Z**power, im_columns * s.Z[1:] ** power
            if turn:  # times i: Re of iV is -Im V, Im of iV is Re V
                matrix[:, 0, column, n:] = -(re[:, 1:] * s.Z[1:] ** power)
                matrix[: rows - 1, 1, column, :n] = im * s.Z**power
            else:
                matrix[:, 0, column, :n], matrix[: rows - 1, 1, column, n:] = d_re, d_im
        self.matrix = matrix.reshape(-1, s.COEFFICIENTS)
        bands = np.zeros((rows, 3, 2, n))  # row, how far below the diagonal, Re or Im
        for part, d in enumerate((re, im)):
            for i in range(len(d)):
                for k in range(min(i, 2) + 1):
                    bands[i, k, part] = d[i] * d[i - k] * s.H
        self.bands = bands.reshape(-1, n)
        self.fill = np.zeros((rows * 6, 1))
        self.fill.reshape(rows, 3, 2)[rows - 1, 0, 1] = 1  # Im has a row less: its last pivot is 1
        self.rows = np.zeros((rows, 2, 4, block))  # iωY, Y, -U, target
        self.rows[:, 0, 2] = -(re @ s.UR)[:, None]
        self.rows[: rows - 1, 1, 2] = -(im @ s.UI)[:, None]
        self.flat = np.empty((len(self.matrix), block))
        self.level = np.empty((n, block))
        self.solved = np.empty_like(self.rows)
        self.over = np.empty_like(self.rows)
        self.product = np.empty_like(self.rows[0])
        self.theta = np.empty((3, block))

    def __call__(self, y):
        """Scaled θ (3, block) from coefficients (17, block)."""
        np.matmul(self.matrix, y, out=self.flat)
        parts = self.flat.reshape(len(self.rows), 2, 3, -1)
        self.rows[:, :, :2], self.rows[:, :, 3] = parts[:, :, :2], parts[:, :, 2]
        self.level[:] = 1
        self.step()
        for _ in range(s.STEPS):
            level(self.theta, self.level)
            self.step()
        return self.theta

    def step(self):
        """Factorise, solve forward, normal equations."""
        c = (self.bands @ self.level + self.fill).reshape(len(self.rows), 3, 2, -1)
        z, over, product = self.solved, self.over, self.product
        pivots, below = [], []
        for i, (diagonal, one, two) in enumerate(c):
            z[i] = self.rows[i]
            if i > 1:
                l2 = two * pivots[i - 2]
                one = one - l2 * below[i - 1]
                diagonal = diagonal - l2 * two
                z[i] -= np.multiply(l2[:, None], z[i - 2], out=product)
            if i > 0:
                l1 = one * pivots[i - 1]
                diagonal = diagonal - l1 * one
                z[i] -= np.multiply(l1[:, None], z[i - 1], out=product)
            below.append(one)
            pivots.append(1 / diagonal)
            np.multiply(z[i], pivots[i][:, None], out=over[i])
        z, over = z.reshape(-1, 4, z.shape[-1]), over.reshape(-1, 4, z.shape[-1])
        h = [
            np.einsum("kr,kr->r", z[:, i], over[:, j])
            for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
        ]
        solve3(h, [np.einsum("kr,kr->r", z[:, i], over[:, 3]) for i in range(3)], self.theta)
