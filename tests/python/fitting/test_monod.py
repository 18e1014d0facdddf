"""Growth by Monod's law from noisy batches, without starts."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

MU, KS, YIELD, DECAY = 0.45, 0.8, 0.5, 0.02
MODEL = mf.Equation(["X' = mu*S/(Ks + S)*X - kd*X", "S' = -mu/Y*S/(Ks + S)*X"], outputs=["X", "S"])


def growth(t, state):
    biomass, substrate = state
    rate = MU * substrate / (KS + substrate) * biomass
    return [rate - DECAY * biomass, -rate / YIELD]


def batches(seed):
    """Three batches of 12 h, a sample every quarter of an hour, 5 % noise; S is used up in each."""
    rng, t = np.random.default_rng(seed), np.arange(49) * 0.25
    for start in ((0.2, 10), (0.5, 6), (0.3, 3)):
        x = solve_ivp(growth, (0, t[-1]), start, t_eval=t, method="LSODA", rtol=1e-9, atol=1e-10).y
        noise = 0.05 * np.sqrt(np.mean(x**2, axis=1, keepdims=True))
        yield mf.Record(y=x + noise * rng.standard_normal(x.shape), t=t, outputs=["X", "S"])


@pytest.mark.filterwarnings("ignore:fit. The noise of the outputs moves the terms:modfun.ModfunWarning")
@pytest.mark.parametrize("seed", [0, 3, 5])
def test_batches_are_fitted_without_starts(seed):
    """These three had ended as "rank" or "maxiter" at a straight line, mu/Ks, with Ks beyond 1e5."""
    fit = mf.fit(list(batches(seed)), MODEL)
    assert fit.status == "ok"
    assert [fit[name] for name in ("mu", "Y")] == pytest.approx([MU, YIELD], rel=0.1)
    assert fit["Ks"] == pytest.approx(KS, rel=0.3)
