"""Time constants beside a free delay: a negative one later is nearly a positive one earlier."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest

TRUE = {"T1": 300.0, "T2": 25.0, "d": 30.0}
TANK = mf.Equation(
    ["T2*v' + v = K*u(t - d)", "T1*y' + y = v"],
    outputs="y",
    inputs=["u"],
    hidden=["v"],
    params={"d": mf.Free(min=0, max=120)},
)


LEVELS, TIMES = np.array([30.0, 40, 60, 45, 55, 40]), np.array([-420.0, 0, 600, 2000, 3200, 4400])


def heated(seed: int, gain: float) -> mf.Record:
    """A tank of two time constants behind a pipe, every 5 s for 90 minutes, not at rest when it begins."""
    dt, before = 5.0, 800
    t = dt * np.arange(-before, 1081.0)
    u = LEVELS[np.maximum(np.searchsorted(TIMES, t, side="right") - 1, 0)]
    plant = mf.tf([gain], [TRUE["T1"] * TRUE["T2"], TRUE["T1"] + TRUE["T2"], 1], delay=TRUE["d"])
    y = plant.simulate(u=u - 30, dt=dt, intersample="zoh")[before:]
    noise = 0.08 * np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=y + 20 + noise, u=u[before:], dt=dt, intersample="zoh")


@pytest.mark.parametrize("gain", [0.6, -0.6])
def test_time_constants_are_positive(gain: float) -> None:
    """Half of these ended at -20 s beside a delay of 72 s."""
    for seed in range(4):
        with pytest.warns(mf.ModfunWarning, match="the equations are the same"):  # with T1 and T2 exchanged
            fit = mf.fit(heated(seed, gain), TANK, trend="constant")
        assert fit.success
        assert sorted([fit["T1"], fit["T2"]]) == pytest.approx([25.0, 300.0], rel=0.3)
        assert fit["d"] == pytest.approx(30.0, abs=6.0)
        assert fit["K"] == pytest.approx(gain, rel=0.01)
