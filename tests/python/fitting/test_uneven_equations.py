"""Nonlinear equations at random sample times: sums over these err on high lines, which a fit leaves out."""

import modfun as mf
import numpy as np
from scipy.integrate import solve_ivp

PREY = mf.Equation(["H' = a*H - b*H*L", "L' = -c*L + d*H*L"], outputs=["H", "L"])
TRUTH = np.array([0.55, 0.028, 0.84, 0.026])


def prey(seed):
    """Prey and predators, counted at 201 random times with an error of 2 %."""
    rng = np.random.default_rng(seed)
    t = np.sort(np.r_[0, 20, rng.uniform(0, 20, 199)])
    a, b, c, d = TRUTH
    path = solve_ivp(
        lambda _, x: [a * x[0] - b * x[0] * x[1], -c * x[1] + d * x[0] * x[1]],
        (0, 20),
        [30, 4],
        t_eval=t,
        rtol=1e-9,
    ).y
    size = np.sqrt(np.mean(path**2, axis=1, keepdims=True))
    return mf.Record(y=path + 0.02 * size * rng.standard_normal(path.shape), outputs=["H", "L"], t=t)


def test_lines_on_which_sums_err_are_left_out():
    """Of 30 records 2 were 10 to 30 standard errors off in silence: errors of 2 to 10 %, now 0.5 %. At the
    stated level one of 32 estimates is beyond 4.5 errors, of some 15 degrees of freedom, once in 70 runs.
    """
    for seed in (*range(1000, 1006), 1009, 1012):
        fit = mf.fit(prey(seed), PREY)
        assert np.all(np.abs(fit.params - TRUTH) < 4.5 * fit.bse)
        assert np.all(np.abs(fit.params / TRUTH - 1) < 0.02)
        if seed in (1004, 1009):  # a search by samples went on from there
            assert fit.band_rule["narrowed"] == 1.0
            assert fit.options.band is None
        if seed in (1000, 1012):
            assert "narrowed, as sums over uneven samples err beyond" in str(fit.summary())


def test_runs_at_random_instants_are_fitted_together_by_their_samples():
    """Sums over the longest steps erred, alike on the few lines: estimates were up to 5 standard errors off
    in silence, and errors twice those of the samples. One of 12 numbers is beyond 3.5 once in 180 tests.
    """
    truth = np.array([0.5, 0.1, 0.15])
    reaction = mf.Equation(
        ["A' = -k1*A + k2*B", "B' = k1*A - k2*B - 2*k3*B**2", "C' = k3*B**2"], outputs=["A", "B", "C"]
    )
    for seed, runs in ((2021, SEVERAL), (2025, SEVERAL), (2003, TWO), (2023, TWO)):
        rng = np.random.default_rng(seed)
        fit = mf.fit([run_of(rng, x) for x in runs], reaction)
        assert np.all(np.abs(fit.params - truth) < 3.5 * fit.bse)
        assert np.all(np.abs(fit.params / truth - 1) < 0.025)
        assert "least squares of the response" in str(fit.summary())


SEVERAL, TWO = ([1, 0, 0], [0, 1, 0], [0.5, 0.8, 0]), ([1, 0, 0], [2, 0, 0])


def run_of(rng, start):
    """A goes to B and back, 2 B to C: 61 random instants in 20 s with 1 % of noise."""
    t = np.append(0, np.sort(rng.uniform(0, 20, 60)))
    path = solve_ivp(
        lambda _, x: [
            -0.5 * x[0] + 0.1 * x[1], 0.5 * x[0] - 0.1 * x[1] - 0.3 * x[1] ** 2, 0.15 * x[1] ** 2
        ],
        (0, t[-1]), start, t_eval=t, rtol=1e-10, atol=1e-12, method="DOP853",
    ).y  # fmt: skip
    size = np.sqrt(np.mean(path**2, axis=1, keepdims=True))
    return mf.Record(y=path + 0.01 * size * rng.standard_normal(path.shape), outputs=["A", "B", "C"], t=t)
