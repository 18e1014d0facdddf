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
