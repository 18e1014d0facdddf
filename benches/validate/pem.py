"""The report's prediction-error rival in the structures that it may have had: what each gives on its example."""

from __future__ import annotations

from collections.abc import Iterator

import modfun as mf
import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

TRUE = np.array([3.0, 8.0, 5.0])
# Lags of the input in the numerator, in samples.
NUMERATORS = {"b u(t)": (0,), "b u(t − 1)": (1,), "b u(t) + c u(t − 1)": (0, 1)}
# From the poles z of the discrete model to those of the continuous one.
CONVERSIONS = {
    "logarithm": lambda z, dt: np.log(z) / dt,
    "forward difference": lambda z, dt: (z - 1) / dt,
    "backward difference": lambda z, dt: (z - 1) / (z * dt),
    "Tustin": lambda z, dt: 2 * (z - 1) / ((z + 1) * dt),
}


def fitted(rec: mf.Record, lags: tuple[int, ...]) -> np.ndarray:
    """Discrete-time output error from rest: f1, f2 and a coefficient a lag."""
    y, u, dt = rec.y[0], rec.u[0], rec.dt
    late = [np.concatenate([np.zeros(k), u[: u.size - k]]) for k in lags]
    f = np.poly(np.exp(np.roots([1.0, 3.0, 8.0]) * dt)).real[1:]
    first = [*f, *[(1 + f.sum()) * 5 / 8 / len(lags)] * len(lags)]

    def misfit(x: np.ndarray) -> np.ndarray:
        driven = sum(b * v for b, v in zip(x[2:], late, strict=True))
        return np.asarray(lfilter([1.0], [1.0, x[0], x[1]], driven) - y)

    return np.asarray(least_squares(misfit, first, method="lm", x_scale="jac").x)


def converted(x: np.ndarray, dt: float, way: str) -> np.ndarray:
    """a1, a2, b0, the gain at rest kept, over their true values."""
    den = np.poly(CONVERSIONS[way](np.roots([1.0, *x[:2]]).astype(complex), dt)).real
    return np.array([den[1], den[2], x[2:].sum() / (1 + x[:2].sum()) * den[2]]) / TRUE


def rms(values: np.ndarray) -> float:
    """In %, over the parameters."""
    return 100 * float(np.sqrt(np.mean(values**2)))


def rows(setting, runs: int, spread: float) -> Iterator[tuple[str, ...]]:
    """Bias without noise by each conversion; bias and sd at NSR 60 %, and the method's sd over it."""
    for name, lags in NUMERATORS.items():
        quiet = setting(0.0)
        x = fitted(quiet, lags)
        biases = [f"{rms(converted(x, quiet.dt, way) - 1):.1f}" for way in CONVERSIONS]
        noisy = [setting(0.6, k) for k in range(runs)]
        theta = np.array([converted(fitted(rec, lags), rec.dt, "logarithm") for rec in noisy])
        sd = rms(theta.std(axis=0))
        yield f"`{name}`", *biases, f"{rms(theta.mean(axis=0) - 1):.1f}", f"{sd:.1f}", f"{spread / sd:.2f}"
