"""Rivals compute the right thing: modfun's estimates on the same noise, and alike in distribution."""

import modfun as mf
import numpy as np
import setting as s

SAME = 1e-8


def reference(noise: np.ndarray) -> np.ndarray:
    """θ (replicate, 3) by modfun's `awls` with five reweightings, from unit normals (replicate, 257)."""
    batch = mf.Batch(y=(s.Y + s.SIGMA * noise)[:, None], u=s.U[None], dt=s.DURATION / s.INTERVALS)
    return mf.fit_many(
        batch, mf.TransferFunction(poles=2, zeros=0), method="awls", harmonics=s.HARMONICS, trend=None,
        rule="trapezoid", tol=1e-300, maxiter=s.STEPS,
    ).params  # fmt: skip


def same_estimates(rival, replicates: int = 500) -> float:
    """Largest relative difference from modfun, from samples and from coefficients; raises above SAME."""
    noise = np.random.default_rng(7).standard_normal((replicates, s.SAMPLES))
    normals = np.linalg.solve(s.COLOUR, s.NOISE @ noise.T).T  # those that give the same coefficients
    want = reference(noise)
    worst = max(
        float(np.max(np.abs(found / want - 1)))
        for found in (rival.from_noise(noise), rival.from_normals(normals))
    )
    if not worst <= SAME:
        raise AssertionError(
            f"{type(rival).__name__}: estimates differ from modfun's by {worst:.1e}, not {SAME:.0e}"
        )
    return worst


def same_distribution(draw, replicates: int = 4096) -> None:
    """Means and covariances of drawn estimates against NumPy's own noise, each within 5.5 standard errors.

    Nine comparisons a call at 4e-8 each: false alarms in 3e-7 of runs.
    """
    want = reference(np.random.default_rng(8).standard_normal((replicates, s.SAMPLES)))
    found = draw(replicates)
    products = [np.column_stack([x, _products(x - x.mean(axis=0))]) for x in (found, want)]
    error = np.sqrt(sum(p.var(axis=0) for p in products) / replicates)
    away = np.abs(products[0].mean(axis=0) - products[1].mean(axis=0)) / error
    if not np.all(away < 5.5):
        raise AssertionError(
            f"{draw}: moments differ by {np.array2string(away, precision=1)} standard errors"
        )


def _products(x: np.ndarray) -> np.ndarray:
    return np.stack([x[:, i] * x[:, j] for i in range(3) for j in range(i, 3)], axis=1)
