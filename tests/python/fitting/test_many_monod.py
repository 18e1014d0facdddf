"""Many fits of a reactor begin where a single fit ends, and so do the refits of a bootstrap."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

TEXTS = ["X' = mu*S/(Ks+S)*X", "S' = -mu*S/(Ks+S)*X/Y"]
BOUNDS = {"mu": mf.Free(min=0, max=5), "Ks": mf.Free(min=0.01, max=10), "Y": mf.Free(min=0.01, max=2)}


def _reactor(seed: int) -> mf.Record:
    def slopes(_: float, x: np.ndarray) -> list[float]:
        growth = 0.45 * x[1] / (0.6 + x[1]) * x[0]
        return [growth, -growth / 0.5]

    t = np.linspace(0, 12, 73)
    x = solve_ivp(slopes, (0, 12), [0.1, 10.0], t_eval=t, rtol=1e-9, atol=1e-9).y
    noise = np.array([[0.05], [0.15]]) * np.random.default_rng(seed).standard_normal(x.shape)
    return mf.Record(y=x + noise, t=t, outputs=["X", "S"])


@pytest.mark.parametrize("params", [None, BOUNDS])
def test_estimates_are_those_of_single_fits(params: dict[str, mf.Free] | None) -> None:
    """With bounds all ended with "maxiter" at Ks = 8.6."""
    reactor = mf.Equation(TEXTS, outputs=["X", "S"], params=params)
    records = [_reactor(seed) for seed in range(4)]
    many = mf.fit_many(records, reactor)
    assert many.status.tolist() == ["ok"] * 4
    for k, rec in enumerate(records):
        np.testing.assert_allclose(many.params[k], mf.fit(rec, reactor).params, rtol=0.02)


def test_a_bootstrap_scatters_as_the_errors_say() -> None:
    """Its refits had Ks = 8.5 ± 0.05 beside an estimate of 0.6 ± 0.06."""
    fit = mf.fit(_reactor(1), mf.Equation(TEXTS, outputs=["X", "S"], params=BOUNDS))
    found = mf.bootstrap(fit, replicates=100, seed=1)
    np.testing.assert_allclose(found.sd, fit.bse, rtol=0.4)  # 7 % is the error of a standard deviation
    assert np.max(np.abs(found.bias) / fit.bse) < 0.5
