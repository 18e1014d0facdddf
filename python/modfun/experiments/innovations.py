"""What samples tell of a linear system that noise drives: a Kalman filter and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..errors import SpecError
from ..records.mask import sample_weights
from ..records.record import Record
from .driven import NoiseModel, noise_model
from .slopes import Equations, Known

__all__ = ["Innovations"]

STEP = 1e-4  # of a parameter's size


class Innovations:
    """Independent samples of unit variance made of those of an output that noise drives.

    With mean m(θ) and covariance Σ(θ, λ), λ the logarithms of all noise levels, the Fisher information of
    Gaussian samples is mᵢᵀ Σ⁻¹ mⱼ + ½ tr(Σ⁻¹ Σᵢ Σ⁻¹ Σⱼ). A Kalman filter turns Σ^(-½) m into a recursion; the
    derivatives of its innovations, whose own covariance follows from another one, give the second part
    (A. Klein, G. Mélard, T. Zahaf, Linear Algebra and its Applications 321, 2000).

    Parameters
    ----------
    known : Transfers or States
    process_noise : as `simulate` takes it
    cov : ndarray, shape (output, output)
        Covariance of the noise of the samples.
    dt : float
        Sampling interval, s.
    free : bool
        Whether the state of the system at t = 0 is unknown; else what noise adds to it is stationary.
    """

    def __init__(self, known: Known, process_noise: Any, cov: F64, dt: float, *, free: bool) -> None:
        if isinstance(known, Equations):
            raise SpecError(
                "crlb: process_noise= is for linear systems: mf.tf, mf.ss, a TransferFunction or a StateSpace"
            )
        here = noise_model(known.system(known.values), process_noise, "crlb")
        self.cov = cov
        self.parts = list(_parts(here, dt, free))
        n, q, levels = len(here.a), len(cov), here.enters.shape[1]
        count = known.values.size + q + levels
        self.slopes = [np.zeros((count, *own.shape)) for own in self.parts]
        self.cov_slopes = np.zeros((count, q, q))
        self.states = n

        def differ(k: int, step: float, ends: Sequence[NoiseModel]) -> None:
            up, down = (_parts(end, dt, free) for end in ends)
            for slope, a, b in zip(self.slopes, up, down, strict=True):
                slope[k] = (a - b) / (2 * step)

        for k, value in enumerate(known.values):
            step = STEP * (abs(value) or 1.0)
            moved = known.values + step * np.outer([1.0, -1.0], np.arange(known.values.size) == k)
            differ(k, step, [noise_model(known.system(one), process_noise, "crlb") for one in moved])
        for k in range(q):
            self.cov_slopes[known.values.size + k, k] += cov[k]
            self.cov_slopes[known.values.size + k, :, k] += cov[:, k]
        for k in range(levels):
            sizes = 1 + STEP * np.outer([1.0, -1.0], np.arange(levels) == k)
            differ(known.values.size + q + k, STEP, [replace(here, enters=here.enters * s) for s in sizes])

    def filtered(self, columns: F64, rec: Record) -> tuple[F64, F64]:
        """Columns (unknown, output, time) with noise of unit variance, (row, unknown), and the information
        on parameters and levels in the covariance of the samples."""
        (f, q, h, p), (df, dq, dh, dp) = self.parts, self.slopes
        weights = sample_weights(rec.mask, rec.sigma, columns.shape[1:])
        n, count = self.states, len(df)
        rows, information = [], np.zeros((count, count))
        mean = np.zeros((n, len(columns)))
        # Second moments of the predicted state and of its derivatives.
        moments = np.zeros(((1 + count) * n,) * 2)
        for k in range(columns.shape[2]):
            seen = np.flatnonzero(weights[:, k] > 0)
            own, c, dc = weights[seen, k], h[seen], dh[:, seen]
            r = self.cov[np.ix_(seen, seen)] / np.outer(own, own)
            dr = self.cov_slopes[:, seen[:, None], seen] / np.outer(own, own)
            s = c @ p @ c.T + r
            half = dc @ p @ c.T
            ds = half + half.transpose(0, 2, 1) + c @ dp @ c.T + dr
            lower = np.linalg.inv(np.linalg.cholesky(s))
            inverse = lower.T @ lower
            gain = f @ p @ c.T @ inverse
            dgain = (df @ p @ c.T + f @ dp @ c.T + f @ p @ dc.transpose(0, 2, 1) - gain @ ds) @ inverse
            # Innovations of the columns, and what moves those of noise with the parameters.
            left = columns[:, seen, k].T - c @ mean
            rows.append(lower @ left)
            seen_by = np.hstack([dc.reshape(-1, n), np.kron(np.eye(count), c)]).reshape(
                count, seen.size, len(moments)
            )
            white = (lower @ seen_by).reshape(-1, len(moments))
            both = (white @ moments @ white.T).reshape(count, seen.size, count, seen.size)
            information += np.einsum("aibi->ab", both)
            scaled = lower @ ds @ lower.T
            information += 0.5 * np.einsum("aij,bij->ab", scaled, scaled)
            # To the next sample.
            phi = np.kron(np.eye(1 + count), f - gain @ c)
            phi[:n, :n] = f
            phi[n:, :n] = (df - gain @ dc).reshape(count * n, n)
            drive = np.concatenate([gain[None], dgain]).reshape((1 + count) * n, seen.size)
            moments = phi @ moments @ phi.T + drive @ s @ drive.T
            mean = f @ mean + gain @ left
            half = df @ p @ f.T - dgain @ s @ gain.T
            dp = half + half.transpose(0, 2, 1) + f @ dp @ f.T - gain @ ds @ gain.T + dq
            p = f @ p @ f.T - gain @ s @ gain.T + q
            p = (p + p.T) / 2
        return np.concatenate(rows), information


def _parts(model: NoiseModel, dt: float, free: bool) -> tuple[F64, F64, F64, F64]:
    """Transition of the state over a sample, covariance of its noise, output matrix, first covariance."""
    step, cov = model.over(dt)
    return step, cov, model.c, model.start(model.own if free else 0)
