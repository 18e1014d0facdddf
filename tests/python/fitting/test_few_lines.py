"""Equations of short records: errors that one or two lines carry, and searches that end astray."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.special import lambertw

DECAY = mf.Equation("S' = -V*S/(K + S)", outputs=["S"])
TRUTH = np.array([1.0, 2.0])


def decay(seed: int, samples: int, noise: float) -> mf.Record:
    """Michaelis and Menten's decay from 10 at V = 1, K = 2, over 20 s."""
    t = np.linspace(0.0, 20.0, samples)
    clean = 2 * lambertw(5 * np.exp((10 - t) / 2)).real
    return mf.Record(y=clean + noise * np.random.default_rng(seed).normal(size=samples), t=t, outputs=["S"])


@pytest.mark.parametrize(("samples", "noise", "most"), [(24, 0.1, 6.0), (121, 0.2, 5.0), (30, 0.3, 5.0)])
def test_estimates_are_no_many_errors_off(samples: int, noise: float, most: float) -> None:
    """It was 13, 16 and 14 errors, with 2 degrees of freedom; intervals hold in fewer than 33 once in 200."""
    fits = [mf.fit(decay(seed, samples, noise), DECAY) for seed in range(40)]
    off = [abs(fit.params - TRUTH) / fit.bse for fit in fits]
    assert np.max(off) < most
    ends = np.array([fit.conf_int() for fit in fits])
    held = np.sum((ends[..., 0] <= TRUTH) & (ends[..., 1] >= TRUTH), axis=0)
    assert np.all(held >= 33)
    assert not any("samples a period" in text for fit in fits[:3] for text in fit.check())


@pytest.mark.parametrize("seed", [0, 5, 14, 58])
def test_no_search_ends_where_the_denominator_is_negative(seed: int) -> None:
    """K was -3.3 to -4.2, 11 to 14 standard errors off."""
    fit = mf.fit(decay(seed, 30, 0.3), DECAY)
    assert fit.success
    assert fit["K"] == pytest.approx(2.0, abs=1.0)
    low, high = fit.conf_int()[fit.param_names.index("K")]
    assert low < 2.0 < high


def test_many_fits_have_the_errors_of_single_ones() -> None:
    records = [decay(seed, 121, 0.2) for seed in range(4)]
    many, first = mf.fit_many(records, DECAY), mf.fit(records[0], DECAY)
    np.testing.assert_allclose(many.bse_even[0], first.bse, rtol=1e-6)
    np.testing.assert_allclose(many.degrees[0], first.degrees, rtol=1e-6)


def test_annual_records_of_prey_and_predators_raise_no_doubt() -> None:
    """Lines of 24 samples are few, and the signals reach into the upper half: 15 of 15 fits doubted that."""
    equation = mf.Equation(["H' = a*H - b*H*L", "L' = -c*L + d*H*L"], outputs=["H", "L"])
    model = equation.model({"a": 0.55, "b": 0.028, "c": 0.84, "d": 0.026})
    clean = model.simulate(dt=1.0, intervals=23, initial_state=[30.0, 5.0])
    noise = 2.0 * np.random.default_rng(5).normal(size=(6, *clean.shape))
    fits = [mf.fit(mf.Record(y=clean + own, dt=1.0, outputs=["H", "L"]), equation) for own in noise]
    assert not any(fit.check() for fit in fits)


def test_a_wide_band_of_a_method_without_a_rule_is_doubted():
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=30, nsr=0.05, seed=1
    )
    second = mf.TransferFunction(poles=2, zeros=0)
    said = "has 2.1 samples a period; below 8 quadrature errors grow"
    assert any(said in text for text in mf.fit(rec, second, method="wls").check())
    assert not mf.fit(rec, second).check()
