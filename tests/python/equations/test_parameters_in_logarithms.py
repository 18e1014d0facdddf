"""log(K/x) is log(K) - log(x): a parameter of a quotient leaves the signal."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest


def gompertz(seed: int) -> mf.Record:
    """Growth from 0.3 to 10, 49 samples, 5 % noise."""
    t = np.linspace(0.0, 12.0, 49)
    clean = 10 * np.exp(np.log(0.03) * np.exp(-0.6 * t))
    noise = np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y=clean + 0.05 * clean.std() * noise, t=t, outputs=["N"])


def test_growth_by_gompertz_is_that_of_its_sum() -> None:
    """Ten of ten fits settle in silence at the estimate of a*N - r*N*log(N); three had warned."""
    for seed in range(10):
        fit = mf.fit(gompertz(seed), mf.Equation("N' = r*N*log(K/N)"))
        plain = mf.fit(gompertz(seed), mf.Equation("N' = a*N - r*N*log(N)"))
        assert fit.success
        assert fit["r"] == pytest.approx(plain["r"], rel=1e-4)
        assert fit["K"] == pytest.approx(np.exp(plain["a"] / plain["r"]), rel=1e-4)


@pytest.mark.parametrize(
    ("text", "signals"),
    [
        ("N' = r*N*log(K/N)", {"N", "N*log(N)"}),
        ("N' = r*log(N/K)", {"1", "log(N)"}),
        ("N' = r*log(-K*N)", {"1", "log(-N)"}),
        ("N' = r*log(N/(K*u))*N", {"N", "N*log(N/u)"}),
        ("N' = r*log(1 + N/K)", {"log(1 + N/K)"}),
    ],
)
def test_signals_of_logarithms(text: str, signals: set[str]) -> None:
    import sympy

    model = mf.Equation(text, outputs=["N"], inputs=["u"] if "u" in text else [])
    found = {sympy.simplify(term.signal) for term in model.compiled().terms if term.order == 0}
    names = {s.name: s for x in found for s in x.free_symbols}
    wanted = {sympy.sympify(x, names) for x in signals}
    assert len(found) == len(wanted)
    assert all(any(sympy.simplify(x - y) == 0 for y in wanted) for x in found)


def test_what_is_simulated_stays_as_it_was_written() -> None:
    model = mf.Equation("N' = r*N*log(K/N)").model({"r": 0.6, "K": 10.0})
    rec = mf.simulate(model, duration=12.0, intervals=48, initial_state=[0.3])
    np.testing.assert_allclose(rec["N"][-1], 10 * np.exp(np.log(0.03) * np.exp(-7.2)), rtol=1e-6)
