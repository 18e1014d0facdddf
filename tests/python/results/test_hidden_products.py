"""What fits say where a signal that is not measured was eliminated from equations with products."""

import modfun as mf
import numpy as np
import pytest
from flights import warned
from scipy.integrate import solve_ivp

LORENZ = mf.Equation(["x' = sg*(y-x)", "y' = x*(r-z) - y", "z' = x*y - be*z"], outputs=["x", "y"])
PREY = mf.Equation(["a' = p*a - q*a*b", "b' = 0.4*a*b - r*b"], outputs=["a"])


def record(rate, start, t, outputs, nsr, seed):
    y = solve_ivp(rate, (0, t[-1]), start, t_eval=t, rtol=1e-9, atol=1e-9).y[: len(outputs)]
    noise = nsr * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=dict(zip(outputs, y + noise, strict=True)), dt=t[1])


@pytest.mark.parametrize("nsr", [0.003, 0.01])
def test_lorenz_without_z_is_warned_of(nsr):
    """r and be are 8 to 20 standard errors off there, in silence until now."""

    def rate(t, x):
        return [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]]

    for seed in range(2):
        rec = record(rate, [1, 1, 20], np.linspace(0, 10, 1001), ["x", "y"], nsr, seed)
        fit, text = warned(rec, LORENZ)
        assert np.max(np.abs(fit.params - [10, 28, 8 / 3]) / fit.bse) > 5
        assert "The equation that is left without z has products of noisy signals" in text
        assert text.endswith("First measure z, or record with less noise.")


@pytest.mark.parametrize("nsr", [0.01, 0.05, 0.2])
def test_prey_alone_is_not(nsr):
    for seed in range(5):
        rec = record(
            lambda t, x: [x[0] * (1 - 0.5 * x[1]), x[1] * (0.4 * x[0] - 0.8)],
            [2, 1],
            np.linspace(0, 20, 401),
            ["a"],
            nsr,
            seed,
        )
        fit, text = warned(rec, PREY)
        assert text == ""
        assert np.all(np.abs(fit.params - [1.0, 0.8]) < 4.5 * fit.bse)
