"""Equations from which a hidden signal is eliminated say when products of noise bend their estimates."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

LORENZ = mf.Equation(
    ["x' = s*(y-x)", "y' = r*x - x*z - y", "z' = x*y - b*z"], outputs=["x", "y"], hidden=["z"]
)
PREY = mf.Equation(["x' = a*x - b*x*w", "w' = c*x*w - d*w"], outputs=["x"], hidden=["w"])


def seen(rates, start, duration, noise, seed):
    """Solution at 1,000 instants with white noise, a row per state."""
    t = np.linspace(0, duration, 1000)
    y = solve_ivp(lambda _, x: rates(*x), (0, duration), start, t_eval=t, rtol=1e-9, atol=1e-9).y
    rng = np.random.default_rng(seed)
    return y + noise * rng.standard_normal(y.shape), t[1]


def remarks(rec, model):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = mf.fit(rec, model)
    return fit, [str(one.message) for one in caught]


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_lorenz_system_without_its_third_state_warns(seed):
    """Estimates are 4 to 20 standard errors off; of 8 records 7 warn."""
    start = np.random.default_rng(seed).normal(size=3) * 5 + [0, 0, 25]
    y, dt = seen(
        lambda x, y, z: [10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z], start, 10.0, 0.05, seed + 100
    )
    fit, said = remarks(mf.Record(y={"x": y[0], "y": y[1]}, dt=dt), LORENZ)
    assert np.max(np.abs(fit.params - [10, 28, 8 / 3]) / fit.bse) > 4
    assert len(said) == 1
    assert "First measure z" in said[0]


@pytest.mark.parametrize("seed", range(5))
def test_prey_without_predators_stay_silent(seed):
    y, dt = seen(lambda x, w: [0.6 * x - 0.03 * x * w, 0.02 * x * w - 0.8 * w], [35.0, 15.0], 30.0, 0.5, seed)
    fit, said = remarks(mf.Record(y={"x": y[0]}, dt=dt), PREY)
    assert fit.status == "ok"
    assert not said


SEIR = mf.Equation(
    ["S' = -beta*S*I", "E' = beta*S*I - sigma*E", "I' = sigma*E - gamma*I"], outputs=["I"], hidden=["S", "E"]
)


def test_no_constant_is_named_where_an_elimination_is_the_cause():
    """A constant lowers BIC by 32, and the first warning was of gravity or trim that the model lacks.

    Of some records the search goes on to the response, which has no products; rounding decides of which.
    """
    t = np.arange(121.0)
    y = solve_ivp(
        lambda _, x: [-0.6 * x[0] * x[2], 0.6 * x[0] * x[2] - 0.25 * x[1], 0.25 * x[1] - 0.2 * x[2]],
        (0, 120), [0.999, 0.0005, 0.0005], t_eval=t, rtol=1e-9, atol=1e-10,
    ).y[2]  # fmt: skip
    eliminated = 0
    for seed in range(4):
        noise = 0.03 * y.std() * np.random.default_rng(seed).normal(size=y.size)
        fit, said = remarks(mf.Record(y=y + noise, dt=1.0, outputs=["I"]), SEIR)
        if not fit.by_response:
            eliminated += 1
            assert "First measure S, E" in said[0]
        assert "gravity" not in str(fit.check())
    assert eliminated
