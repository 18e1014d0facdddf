"""Angles in degrees of which an equation takes the sine."""

from __future__ import annotations

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

PENDULUM = mf.Equation("th'' + d*th' + w2*sin(th) = b*u")
RUBBED = mf.Equation(["th' = w", "w' = -k*sin(th) - c*w - fc*sign(w) + u"], outputs=["th", "w"], inputs=["u"])
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


def rubbed(unit: float, seed: int = 4) -> mf.Record:
    """A pendulum with dry friction, its angle and rate in radians times `unit`."""
    t = 0.01 * np.arange(2001)
    phase = np.random.default_rng(seed).uniform(0, 6, 4)
    u = np.sin(np.outer(t, [1.5, 2.7, 4.0, 5.2]) + phase) @ np.array([2.0, 2.4, 2.0, 1.2])
    y = RUBBED.model({"k": 19.6, "c": 0.15, "fc": 0.8}).simulate(u=u, t=t, initial_state=[0.3, 0.3])
    y = y + np.array([[0.01], [0.1]]) * np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=unit * y, u=u, t=t, outputs=["th", "w"], inputs=["u"], intersample="smooth")


def test_degrees_are_named_with_rates_and_where_more_than_noise_is_left():
    with pytest.warns(mf.ModfunWarning, match=r"th=np.deg2rad\(rec\['th'\]\), w=np.deg2rad\(rec\['w'\]\)"):
        mf.fit(rubbed(180 / np.pi), RUBBED)
    with pytest.warns(mf.ModfunWarning, match="takes the sign of noise"):
        fit = mf.fit(rubbed(1.0), RUBBED)
    assert "read as degrees" not in str(fit.check())
