"""Default bands of equations: as wide as lines lower standard errors, though the core's rule looks at few."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.signal import cont2discrete

TRUTH = {"J1": 0.8e-3, "J2": 1.2e-3, "k": 45.0, "c": 0.01, "b1": 2e-3, "b2": 1e-3}
MASSES = mf.StateSpace(
    A=[["-(b1 + c)/J1", "c/J1", "-k/J1"], ["c/J2", "-(b2 + c)/J2", "k/J2"], [1, -1, 0]],
    B=[["1/J1"], [0], [0]],
    C=[[1, 0, 0], [0, 1, 0]],
    states=["w1", "w2", "twist"],
    inputs=["torque"],
    outputs=["w1", "w2"],
    params={name: mf.Free(1.4 * value, min=0) for name, value in TRUTH.items()},
)


def masses(seed: int) -> mf.Record:
    """Two masses on a shaft, with a mode at 306 rad/s that the torque excites; 4 s at 1 kHz."""
    rng = np.random.default_rng(seed)
    u = 0.4 * np.sign(rng.standard_normal(1001)).repeat(4)[:4000]
    system = MASSES.model(TRUTH)
    a, b, *_ = cont2discrete((system.A, system.B, np.eye(3), np.zeros((3, 1))), 1e-3, method="zoh")
    x = np.zeros((3, 4000))
    for k in range(3999):
        x[:, k + 1] = a @ x[:, k] + b[:, 0] * u[k]
    y = x[:2] + 0.3 * rng.standard_normal((2, 4000))
    return mf.Record(y=y, u=u, dt=1e-3, outputs=["w1", "w2"], inputs=["torque"], intersample="zoh")


@pytest.mark.statistics
def test_a_resonance_beyond_the_lines_of_the_rule_is_used() -> None:
    """The band ended at 201 rad/s: errors of c were 35 times as large, and of two records one friction was 0.

    The largest of 24 estimates in standard errors is above 3.6 once in 130 tests.
    """
    for seed in range(4):
        fit = mf.fit(masses(seed), MASSES)
        error = np.array([fit[name] - TRUTH[name] for name in fit.param_names]) / fit.bse
        assert fit.band[1] > 390
        assert fit["c"] / fit.bse[list(fit.param_names).index("c")] > 100
        assert np.max(np.abs(error)) < 3.6
        assert not any("Standard errors still fall" in text for text in fit.check())


def test_many_fits_take_the_band_of_a_single_one() -> None:
    rng = np.random.default_rng(0)
    t = 0.01 * np.arange(4001)
    u = sum(np.sin(w * t + p) for w, p in zip(rng.uniform(1, 60, 40), rng.uniform(0, 6, 40), strict=True))
    position = mf.Equation("m*y'' + d*y' + k*y = u", params={"m": mf.Free(1.0)})
    truth = position.model({"m": 1.0, "d": 1.5, "k": 2500.0})
    clean = truth.simulate(u=u, dt=0.01).ravel()
    records = [
        mf.Record(
            y=clean + 0.1 * clean.std() * rng.standard_normal(t.size), u=u, dt=0.01, intersample="smooth"
        )
        for _ in range(3)
    ]
    single = mf.fit(records[0], position)
    many = mf.fit_many(records, position, progress=False)
    assert single.band[1] > 1.5 * 128 * 2 * np.pi / 40
    np.testing.assert_allclose(many.params[0], single.params, rtol=1e-6)
    np.testing.assert_allclose(single.params, [1.0, 1.5, 2500.0], rtol=0.05)
