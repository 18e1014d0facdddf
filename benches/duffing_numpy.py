"""`ml` of the Duffing equation in NumPy: the method of modfun, all records at once in every operation.

y'' + d y' + a y + b y³ = u on the lines 0..K; the cube freed of its bias, dense covariance from two spectra,
Gauss-Newton on denoised lines, once more with slopes where the noise was taken away.
"""

import numpy as np


class Duffing:
    """Records y (R, N+1) of one input, white noise of standard deviation `sigma`, lines 0..top."""

    def __init__(self, u, dt, top, sigma, weights):
        self.n = n = u.size - 1
        self.sigma, self.top = sigma, top
        self.m = np.arange(top + 1)
        self.s = 2j * np.pi * self.m / (n * dt)
        self.w = weights / n
        self.u = self.lines(u[None])[0]
        x = self.s / abs(self.s[-1])
        self.ends = np.stack([self.rows(np.ones_like(x)), self.rows(x)], axis=-1)
        self.gap = self.m[:, None] - self.m
        self.sum = self.m[:, None] + self.m

    def spectrum(self, v, top):
        """Σ v e^{-imω₀t}, m = 0..top, of samples with their weights."""
        folded = v[..., :-1].copy()
        folded[..., 0] += v[..., -1]
        return np.fft.rfft(folded)[..., : top + 1]

    def lines(self, v):
        return self.spectrum(self.w * v, self.top)

    def rows(self, z):
        """Re of all lines, Im of those above 0."""
        return np.concatenate([z.real, z.imag[..., 1:]], axis=-1)

    def pairs(self, slope):
        """Covariances of the noise on y and y³ between lines: (near, far) for yy, yc, cc."""
        w2 = (self.sigma * self.w) ** 2
        out = []
        for f in (np.ones_like(slope[:1]), slope, slope**2):
            r = self.spectrum(w2 * f, 2 * self.top)
            near = np.where(self.gap >= 0, r[:, np.abs(self.gap)], r[:, np.abs(self.gap)].conj())
            out.append((near, r[:, self.sum]))
        return out

    def whitened(self, theta, y, cube, pairs):
        """(inverse Cholesky factors, loads, whitened ends, residual) at θ (R, 3)."""
        d, a, b = theta.T[..., None]
        load = self.s**2 + d * self.s + a
        q = load * y + b * cube - self.u
        near, far = 0.0, 0.0
        left, right = (load, b + 0 * load), (load, b + 0 * load)
        for i in (0, 1):
            for j in (0, 1):
                n, f = pairs[i + j]
                near = near + left[i][:, :, None] * right[j].conj()[:, None] * n
                far = far + left[i][:, :, None] * right[j][:, None] * f
        c = np.empty((len(y), 2 * self.top + 1, 2 * self.top + 1))
        k = self.top + 1
        c[:, :k, :k] = (near + far).real
        c[:, k:, k:] = (near - far).real[:, 1:, 1:]
        c[:, :k, k:] = (far - near).imag[:, :, 1:]
        c[:, k:, :k] = c[:, :k, k:].transpose(0, 2, 1)
        white = np.linalg.inv(np.linalg.cholesky(0.5 * c))
        base = np.linalg.qr(white @ self.ends)[0]
        return white, load, base, self.project(base, (white @ self.rows(q)[..., None]))

    @staticmethod
    def project(base, x):
        return x - base @ (base.transpose(0, 2, 1) @ x)

    def noise(self, white, residual, load, b, pairs):
        """Smoothed noise on the lines of y and y³, and the dual lines it comes from."""
        dual = (white.transpose(0, 2, 1) @ residual)[..., 0]
        mu = dual[:, : self.top + 1] + 0j
        mu[:, 1:] += 1j * dual[:, self.top + 1 :]
        z = load.conj() * mu, b[:, None] * mu
        out = []
        for i in (0, 1):
            total = 0.0
            for j in (0, 1):
                near, far = pairs[i + j]
                total = total + near @ z[j][..., None] + far @ z[j].conj()[..., None]
            out.append(0.5 * total[..., 0])
        return out, z

    def minimum(self, theta, y, cube, pairs, tol, iterations=50):
        """Gauss-Newton for all records until each has settled."""
        theta = theta.copy()
        live = np.arange(len(y))
        for _ in range(iterations):
            own = [(n if len(n) == 1 else n[live], f if len(f) == 1 else f[live]) for n, f in pairs]
            white, load, base, residual = self.whitened(theta[live], y[live], cube[live], own)
            (e, c), _ = self.noise(white, residual, load, theta[live, 2], own)
            columns = [self.rows(self.s * (y[live] - e)), self.rows(y[live] - e), self.rows(cube[live] - c)]
            j = self.project(base, white @ np.stack(columns, axis=-1))
            t = j.transpose(0, 2, 1)
            step = np.linalg.solve(t @ j, t @ residual)[..., 0]
            theta[live] -= step
            live = live[np.max(np.abs(step) / np.abs(theta[live]), axis=1) > tol]
            if not live.size:
                break
        return theta

    def start(self, y, cube):
        """One step with the weights of equation noise."""
        h = np.sqrt(np.where(self.m == 0, 1.0, 0.5))
        scale = self.rows(1 / h + 1j / h)
        base = np.linalg.qr(scale[:, None] * self.ends)[0][None]
        columns = np.stack([scale * self.rows(c) for c in (self.s * y, y, cube)], axis=-1)
        target = scale * self.rows(self.u - self.s**2 * y)
        j, r = self.project(base, columns), self.project(base, target[..., None])
        t = j.transpose(0, 2, 1)
        return np.linalg.solve(t @ j, t @ r)[..., 0]

    def fit(self, samples):
        """θ = (d, a, b) of each record."""
        y = self.lines(samples)
        cube = self.lines(samples**3 - 3 * self.sigma**2 * samples)
        slope = 3 * (samples**2 - self.sigma**2)
        pairs = self.pairs(slope)
        theta = self.minimum(self.start(y, cube), y, cube, pairs, 1e-4)
        white, load, _, residual = self.whitened(theta, y, cube, pairs)
        _, z = self.noise(white, residual, load, theta[:, 2], pairs)
        turns = np.exp(2j * np.pi * np.outer(self.m, np.arange(self.n + 1)) / self.n)
        of_y, of_cube = ((part @ turns).real for part in z)
        clean = samples - self.sigma**2 * self.w * (of_y + slope * of_cube)
        pairs = self.pairs(3 * (clean**2 - self.sigma**2))
        return self.minimum(theta, y, cube, pairs, 1e-9)
