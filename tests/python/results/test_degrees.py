"""Angles in degrees of which an equation takes the sine."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

PENDULUM = mf.Equation("th'' + d*th' + w2*sin(th) = b*u")
TRUE = np.array([0.2, 6.0, 2.0])


def swung(seed: int, amplitude: float, unit: float = 1.0) -> mf.Record:
    """A driven pendulum, d = 0.2, w2 = 6, b = 2, its angle in radians times `unit`."""

    def torque(t):
        return amplitude * (np.sin(0.9 * t) + np.sin(2.3 * t + 1))

    t = 0.02 * np.arange(2000)
    path = solve_ivp(
        lambda t, x: [x[1], -0.2 * x[1] - 6 * np.sin(x[0]) + 2 * torque(t)],
        (0, t[-1]),
        [1.2 * amplitude, 0],
        t_eval=t,
        rtol=1e-8,
        atol=1e-8,
    )
    th = path.y[0] + 0.02 * path.y[0].std() * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y=unit * th, u=torque(t), dt=0.02, outputs=["th"], inputs=["u"])


@pytest.mark.parametrize("amplitude", [0.1, 0.3, 1.0, 2.0])
def test_degrees_that_nobody_declared_are_named_with_what_mends_them(amplitude):
    rec = swung(1, amplitude, unit=180 / np.pi)
    with pytest.warns(mf.ModfunWarning, match=r"sin\(\) of th, which goes to .* read as degrees") as told:
        mf.fit(rec, PENDULUM)
    assert "First give radians, rec.assign(th=np.deg2rad(rec['th']))" in str(told[0].message)
    fit = mf.fit(rec.assign(th=np.deg2rad(rec["th"])), PENDULUM)
    assert np.all(abs(fit.params - TRUE) < 4 * fit.bse)  # false alarm: 2e-4


def test_a_pendulum_that_turns_over_is_not_in_degrees():
    rec = swung(2, 2.0)
    assert np.abs(rec["th"]).max() > 10
    fit = mf.fit(rec, PENDULUM)
    assert np.all(abs(fit.params - TRUE) < 4 * fit.bse)
    assert "degrees" not in str(fit.check())
