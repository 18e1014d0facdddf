"""The initial state of a fit's simulation, where few samples make a cycle."""

import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.results.initial_state import find_state
from scipy.integrate import solve_ivp

PREY = mf.Equation(
    ["hare' = a*hare - b*hare*lynx", "lynx' = -c*lynx + d*hare*lynx"], outputs=["hare", "lynx"]
)


@pytest.mark.parametrize("seed", range(3))
def test_eighteen_samples_a_cycle_are_scored(seed):
    """Polynomials through the first two cycles began at fewer than no hares, and no fit could be drawn."""
    t = np.linspace(0, 30, 61)

    def slopes(_, x):
        return [0.9 * x[0] - 0.05 * x[0] * x[1], -0.6 * x[1] + 0.02 * x[0] * x[1]]

    y = solve_ivp(slopes, (0, 30), [30.0, 8.0], t_eval=t, rtol=1e-9, atol=1e-9).y
    y += 0.02 * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).standard_normal(y.shape)
    rec = mf.Record(y=dict(zip(PREY.outputs, y, strict=True)), t=t)
    fit = mf.fit(rec, PREY)
    assert min(fit.score()["fit_percent"]) > 90.0
    assert fit.initial_state().state == pytest.approx([30.0, 8.0], rel=0.1)


def test_a_fit_with_dry_friction_prints():
    """The look at where a record begins differentiated sign() to an impulse, and print(fit) raised."""
    t = np.arange(0.0, 4.0, 0.005)
    rng = np.random.default_rng(5)
    current = np.repeat(rng.choice([-1.0, 1.0], 40), 20)
    w, x = np.zeros(t.size), 0.0
    for k in range(t.size):
        w[k] = x
        for _ in range(10):
            x += 0.0005 * (25 * current[k] - 0.5 * x - 10 * np.sign(x))
    rec = mf.Record(
        y={"w": w + 0.02 * w.std() * rng.standard_normal(t.size)}, u={"i": current}, t=t, intersample="zoh"
    )
    with pytest.warns(mf.ModfunWarning, match=r"sign\(w\) takes the sign of noise.*output_error"):
        fit = mf.fit(rec, mf.Equation("w' = g*i - d*w - c*sign(w)", outputs="w", inputs="i"))
    assert fit.params == pytest.approx([25.0, 0.5, 10.0], rel=0.2)
    assert "g=" in repr(fit)


def test_a_response_beyond_the_range_of_numbers_is_refused_in_words_alone():
    """The squares of its derivatives overflowed, and NumPy said so first."""
    model = mf.Equation("y' = a*y + b*sin(y)", outputs="y").model({"a": 13.0, "b": 1.0})
    t = 0.02 * np.arange(1501)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(mf.DataError, match="leaves"):
            find_state(model, mf.Record(y={"y": 1 + 0.1 * np.sin(t)}, t=t))
