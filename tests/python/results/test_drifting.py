"""A drift of an equation's free constant is named before terms that are not linear, and its words work."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest

W, Z = 0.22, 0.06


def phugoid(seed: int, drift: float) -> mf.Record:
    rng, t = np.random.default_rng(seed), np.arange(0, 90, 0.1)
    motion = 8 * np.exp(-Z * W * t) * np.cos(W * np.sqrt(1 - Z * Z) * t + rng.uniform(0, 2 * np.pi))
    return mf.Record(y=motion + 62 + drift * t + 0.4 * rng.normal(size=t.size), dt=0.1, outputs="V")


@pytest.mark.parametrize("drift", [0.003, 0.01, 0.03])
def test_the_drift_of_a_constant_is_named_first_and_its_words_work(drift: float) -> None:
    rec = phugoid(100, drift)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the smallest drift is for check alone
        fit = mf.fit(rec, mf.Equation("V'' + a1*V' + a2*V = c", inputs=[]))
    said = str(fit.check())
    assert "V**" not in said
    assert "cube" not in said
    found = re.search(r'mf\.Equation\("([^"]*drift\*t)"', said)
    assert found is not None
    better = mf.fit(rec, mf.Equation(found[1], outputs="V", inputs=[]))
    assert abs(better["a1"] - 2 * Z * W) < 3 * better.bse[better.param_names.index("a1")]
    assert abs(better["a2"] - W * W) < 3 * better.bse[better.param_names.index("a2")]
    assert better["drift"] == pytest.approx(drift * W * W, rel=0.3)


def test_a_spring_that_hardens_stays_one_beside_a_constant() -> None:
    from scipy.integrate import solve_ivp

    t = np.arange(0, 20, 0.02)
    x = solve_ivp(
        lambda _, s: [s[1], -0.2 * s[1] - 4 * s[0] - 2 * s[0] ** 3], (0, 20), [1, 0], t_eval=t, rtol=1e-9
    )
    noise = 0.003 * np.random.default_rng(1).normal(size=t.size)
    rec = mf.Record(y=x.y[0] + noise, dt=0.02, outputs="x")
    with pytest.warns(mf.ModfunWarning, match="cube"):
        mf.fit(rec, mf.Equation("x'' + a1*x' + a2*x = c", inputs=[]))
