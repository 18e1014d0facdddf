"""The benchmarks of weak-form methods, beside the Cramér–Rao bound with unknown initial state."""

import modfun as mf
import numpy as np
from fit_studies import Study, response, table

WEAK = {
    "logistic": (
        mf.Equation(["x' = w1*x + w2*x**2"], outputs=["x"]),
        [1.0, -1.0],
        [0.01],
        10.0,
        512,
        (0.014, 0.028, 0.055),
        lambda w: lambda t, x: [w[0] * x[0] + w[1] * x[0] ** 2],
    ),
    "Lotka–Volterra": (
        mf.Equation(["x' = w1*x + w2*x*z", "z' = w3*z + w4*x*z"], outputs=["x", "z"]),
        [3.0, -1.0, -6.0, 1.0],
        [1.0, 1.0],
        5.0,
        256,
        (0.0067, 0.014, 0.034),
        lambda w: lambda t, x: [w[0] * x[0] + w[1] * x[0] * x[1], w[2] * x[1] + w[3] * x[0] * x[1]],
    ),
    "FitzHugh–Nagumo": (
        mf.Equation(["v' = w1*v + w2*v**3 + w3*r", "r' = w4*v + w5 + w6*r"], outputs=["v", "r"]),
        [3.0, -3.0, 3.0, -1 / 3, 0.34 / 3, 0.2 / 3],
        [0.0, 0.1],
        25.0,
        256,
        (0.014, 0.044, 0.161),
        lambda w: (
            lambda t, x: [w[0] * x[0] + w[1] * x[0] ** 3 + w[2] * x[1], w[3] * x[0] + w[4] + w[5] * x[1]]
        ),
    ),
}


def least_error(rhs, w, x0, period, intervals, sigma):
    """Mean of ‖ŵ − w‖/‖w‖ under the Cramér–Rao bound, initial state unknown."""
    unknowns = np.concatenate([w, x0])
    columns = []
    for i in range(unknowns.size):
        h = 1e-5 * max(abs(unknowns[i]), 0.01)
        step = h * (np.arange(unknowns.size) == i)
        sides = [
            response(rhs(v[: len(w)]), v[len(w) :], period, intervals)
            for v in (unknowns + step, unknowns - step)
        ]
        columns.append((sides[0] - sides[1]).ravel() / (2 * h))
    j = np.array(columns).T
    cov = sigma**2 * np.linalg.inv(j.T @ j)[: len(w), : len(w)]
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(len(w)), cov, 20000)
    return np.mean(np.linalg.norm(draws, axis=1)) / np.linalg.norm(w)


def weak(replicates, figures=None):
    """Logistic, Lotka–Volterra, FitzHugh–Nagumo, states measured with noise of 5, 10, 20 % of their rms."""
    table(
        "system, noise",
        "lines | mean relative error | bound | WENDy | half of it | HC3 covers, % | classical covers, % "
        "| failures |",
    )
    for name, (model, w, x0, period, intervals, reference, rhs) in WEAK.items():
        clean = response(rhs(w), x0, period, intervals)
        rms = np.sqrt(np.mean(clean**2))
        truth = {f"w{k + 1}": value for k, value in enumerate(w)}
        for ratio, other in zip((0.05, 0.1, 0.2), reference, strict=True):
            found = Study(
                model, truth, clean, period / intervals, ratio * rms, (list(model.outputs), None), replicates
            )
            errors = np.linalg.norm(found.params - found.truth, axis=1) / np.linalg.norm(w)
            bound = least_error(rhs, w, x0, period, intervals, ratio * rms)
            print(
                f"| {name}, {100 * ratio:.0f} % | {found.harmonics:.0f} | {errors.mean():.4f} ± "
                f"{errors.std() / np.sqrt(len(errors)):.4f} | {bound:.4f} | {other:g} | {other / 2:g} | "
                f"{found.covers()} | {found.failures} |",
                flush=True,
            )
