"""Searches that leave the range of floating point are told by what may be the cause."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp


def test_exchanged_columns_have_no_logarithm():
    """They were told to look for log or sqrt, of which the equations have none."""
    t = np.linspace(0, 10, 501)
    y = solve_ivp(lambda t, x: [x[1], -0.2 * x[1] - 14 * np.sin(x[0])], (0, 10), [1.5, 0], t_eval=t).y
    y += 0.03 * y.std(axis=1, keepdims=True) * np.random.default_rng(1).standard_normal(y.shape)
    rec = mf.Record(y={"om": y[0], "th": y[1]}, t=t)
    model = mf.Equation(["th' = om", "om' = -c*om - k*sin(th)"], outputs=["th", "om"])
    with pytest.warns(mf.ModfunWarning) as caught:
        fit = mf.fit(rec, model)
    assert fit.status == "nonfinite"
    assert "log" not in str(caught[0].message)
    assert "column" in str(caught[0].message)


def test_roots_that_have_values_are_no_cause():
    """Levels of tanks in each other's columns, both far above zero: no sample is without a root."""
    t, rng = np.arange(901.0), np.random.default_rng(0)
    u = np.repeat(rng.uniform(2.0, 5.5, 16), 60)[:901]

    def flows(at, h):
        out = [0.28, 0.25] * np.sqrt(np.maximum(h, 0))
        return [0.22 * u[min(int(at), 900)] - out[0], out[0] - out[1]]

    h = solve_ivp(flows, (0, 900), [9, 6], t_eval=t, max_step=1.0).y
    h += 0.05 * rng.standard_normal(h.shape)
    assert h.min() > 2
    rec = mf.Record(y={"h1": h[1], "h2": h[0]}, u={"u": u}, dt=1.0, intersample="zoh")
    model = mf.Equation(
        ["h1' = K*u - k1*sqrt(h1)", "h2' = k1*sqrt(h1) - k2*sqrt(h2)"], outputs=["h1", "h2"], inputs=["u"]
    )
    with pytest.warns(mf.ModfunWarning) as caught:
        fit = mf.fit(rec, model)
    assert fit.status == "nonfinite"
    assert "sqrt" not in str(caught[0].message)
    assert "h1, h2, u; two may be exchanged" in str(caught[0].message)
