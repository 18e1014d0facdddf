"""Natural NumPy: rfft, einsum, batched solve; a replicate a row."""

import numpy as np
import setting as s

_BLOCK = 2048


class NaturalNumPy:
    """The form on the lines, written as one writes it down."""

    def __init__(self):
        self.rng = np.random.default_rng(1)
        self.u = s.U0[: s.LINES] + 1j * np.concatenate([[0.0], s.U0[s.LINES :]])

    def from_noise(self, noise):
        """θ (replicate, 3) from unit normals (replicate, 257)."""
        y = s.Y + s.SIGMA * noise
        y[:, 0] = (y[:, 0] + y[:, -1]) / 2  # the ends of the trapezoidal rule are one sample of the period
        return awls(np.fft.rfft(y[:, :-1])[:, : s.LINES] / s.INTERVALS, self.u)

    def from_normals(self, normals):
        """θ (replicate, 3) from unit normals (replicate, 17)."""
        v = s.Y0 + normals @ s.COLOUR.T
        y = v[:, : s.LINES].astype(complex)
        y[:, 1:] += 1j * v[:, s.LINES :]
        return awls(y, self.u)

    def samples(self, count):
        """Draw, transform, estimate."""
        return np.vstack([self.from_noise(self.rng.standard_normal((n, s.SAMPLES))) for n in blocks(count)])

    def coefficients(self, count):
        """Draw the coefficients, estimate."""
        return np.vstack(
            [self.from_normals(self.rng.standard_normal((n, s.COEFFICIENTS))) for n in blocks(count)]
        )


def blocks(count, size=_BLOCK):
    """Sizes of the blocks of a run."""
    return [size] * (count // size) + ([count % size] if count % size else [])


def awls(y, u):
    """From the weights of equation noise, five reweightings; y (replicate, line) complex."""
    z = 1j * s.Z
    columns = np.broadcast_arrays(z * y, y, -u, -np.ones_like(u), -z, -(z**2) * y)
    rows = np.stack(columns, axis=-1)
    rows = np.concatenate([rows.real, rows.imag[:, 1:]], axis=1)
    gamma, target = rows[..., :-1], rows[..., -1]
    level = np.ones(y.shape)
    for _ in range(s.STEPS + 1):
        weight = 1 / (s.H * level)
        weight = np.concatenate([weight, weight[:, 1:]], axis=1)
        left = np.einsum("rki,rk,rkj->rij", gamma, weight, gamma, optimize=True)
        right = np.einsum("rki,rk,rk->ri", gamma, weight, target, optimize=True)
        theta = np.linalg.solve(left, right[..., None])[:, :3, 0]
        level = np.abs(z**2 + theta[:, :1] * z + theta[:, 1:2]) ** 2
    return theta * s.UNIT
