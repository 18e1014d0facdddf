"""Causes that are named first: an offset before a bent actuator, and no loop where a pole is superfluous."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

STEP = 0.05


def record(system, u, seed, noise=0.05, offset=0.0):
    y = system.simulate(u=u, dt=STEP, intersample="zoh")
    y = y + noise * y.std() * np.random.default_rng(1000 + seed).standard_normal(y.size) + offset
    return mf.Record(y=y, u=u, dt=STEP)


@pytest.mark.parametrize("seed", range(4))
def test_an_offset_is_named_before_a_bent_actuator(seed):
    """u is 1 or -1, so that its square is a constant: 24 of 24 fits warned that the actuator saturates."""
    u = np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], 41), 10)[:401]
    rec = record(mf.tf([2, 20], [1, 2, 20]), u, seed, offset=0.3)
    with pytest.warns(mf.ModfunWarning, match="The model has no constant, and with one BIC falls") as said:
        fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1), trend=None)
    assert len(said) == 1
    assert 'trend="constant"' in str(said[0].message)
    assert "A tone near" not in str(fit.check())


def test_no_offset_is_named_where_there_is_none():
    """Fixed seeds."""
    for seed in range(8):
        u = np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], 41), 10)[:401]
        rec = record(mf.tf([2, 20], [1, 2, 20]), u, seed)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=1), trend=None)
        assert "no constant" not in str(fit.check())


def test_a_superfluous_pole_is_no_loop():
    """One pole and one zero too many, open loop: 8 of 24 fits warned of a loop (p = 1e-74)."""
    system = mf.tf([1, 3, 2], np.polymul(np.polymul([1, 0.05], [1, 2]), [1, 8]))
    t = np.arange(801) * STEP
    u = (t >= 1) * 1.0 - 2.0 * (t >= 2) + (t >= 3)
    unstable = 0
    for seed in range(16):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            fit = mf.fit(record(system, u, seed, 0.02), mf.TransferFunction(poles=3, zeros=2))
        unstable += bool(np.any(fit.model.poles().real > 0))
        assert not any("loop feeds" in str(one.message) for one in said)
        assert "loop feeds" not in str(fit.check())
    assert unstable >= 3


def test_a_light_mode_in_turbulence_is_not_called_nonlinear():
    """Nonlinear, drifting or changing was the one cause that was named; it is linear, and gusts move it."""
    rng, dt, fine = np.random.default_rng(5), 0.5, 50
    t = np.arange(0.0, 150.0, dt / fine)
    u = ((t > 2) & (t < 8)) * 1.0
    gust = lfilter([1.0], [1.0, -np.exp(-dt / fine / 0.5)], rng.standard_normal(t.size))
    state, rows = np.zeros(2), []
    step = expm(np.array([[0, 1, 0], [-0.0256, -0.016, 1], [0, 0, 0]]) * dt / fine)
    for force in u + 2.0 * gust / gust.std():
        rows.append(state[0])
        state = step[:2, :2] @ state + step[:2, 2] * force
    y = np.array(rows)[::fine]
    rec = mf.Record(
        y=y + 0.002 * y.std() * rng.standard_normal(y.size), u=u[::fine], dt=dt, intersample="zoh"
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mf.fit(rec, mf.TransferFunction(poles=2, zeros=1))
    (text,) = [str(one.message) for one in caught]
    assert "the system is not linear" not in text
    assert text.endswith('noise="process".')
