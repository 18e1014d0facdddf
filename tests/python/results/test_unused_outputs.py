"""Motions that a record has and equations leave out: a dutch roll without roll rate and bank angle."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter, lsim

STEP, FINE = 0.02, 20
T = np.arange(18 * 50 * FINE + 1) * STEP / FINE
ROLL = [[-0.16, 0.03, -1, 0.127], [-9.0, -3.2, 1.1, 0], [4.2, -0.12, -0.42, 0], [0, 1, 0.03, 0]]
MOVED = [[0, 0.04], [-12.0, 1.2], [-0.35, -2.6], [0, 0]]
TWO = mf.StateSpace([["Yb", -1], ["Nb", "Nr"]], [["Yd"], ["Ndr"]], states=["beta", "r"], inputs=["dr"])
SHORT = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])


def surface(pattern, start):
    """Steps (duration, sign) of 3 degrees, behind an actuator."""
    u = np.zeros(T.size)
    for duration, sign in pattern:
        first, last = np.searchsorted(T, [start - 1e-9, start + duration - 1e-9])
        u[first:last] = sign * np.radians(3)
        start += duration
    return lsim(([400.0], [1, 28, 400]), u, T)[1]


def lateral(seed):
    dr = surface([(2.1, 1), (1.4, -1), (0.7, 1), (0.7, -1)], 1)
    da = surface([(0.7, 1), (0.7, -1)], 8.5)
    u = np.c_[da, dr]
    y = lsim((np.array(ROLL), np.array(MOVED), np.eye(4), np.zeros((4, 2))), u, T)[1][::FINE]
    y = y + np.random.default_rng(seed).standard_normal(y.shape) * np.radians([0.1, 0.2, 0.1, 0.1])
    return mf.Record(y=y.T, u=u[::FINE].T, dt=STEP, outputs=["beta", "p", "r", "phi"], inputs=["da", "dr"])


@pytest.mark.parametrize("seed", range(4))
def test_unused_motions_are_named(seed):
    """Nb was 4.9 ± 0.03 instead of 4.2, residuals eleven times the noise, and nothing was said."""
    with pytest.warns(mf.ModfunWarning, match="The record has p, phi and da, the model has not") as said:
        fit = mf.fit(lateral(seed), TWO)
    assert len(said) == 1
    assert "First write them into the model, as states or inputs" in str(said[0].message)
    assert abs(fit["Nb"] - 4.2) > 10 * fit.bse["Nb"]
    assert "The record has p, phi and da" in next(iter(fit.check()))


def pitching(seed, kind):
    """A short period with pitch and normal acceleration, which its equations of two states need not have."""
    rng = np.random.default_rng(seed)
    de = surface([(1.8, 1), (1.2, -1), (0.6, 1), (0.6, -1)], 1)
    gust = np.zeros(T.size)
    if kind == "gust":
        gust = lsim(([0.03], [0.5, 1]), np.repeat(rng.standard_normal(T.size // 20 + 1), 20)[: T.size], T)[1]
    a = np.array([[-0.9, 1, 0], [-6.0, -1.4, 0], [0, 1, 0]])
    b = np.array([[-0.08, -0.9], [-9.0, -6.0], [0, 0]])
    c, d = np.vstack([np.eye(3), [-72.0, 0, 0]]), np.vstack([np.zeros((3, 2)), 80 * b[:1]])
    y = lsim((a, b, c, d), np.c_[de, gust], T)[1][::FINE]
    noise = rng.standard_normal(y.shape)
    if kind == "slow":
        noise = lfilter([1], [1, -0.97], noise, axis=0)
    y = y + noise * [*np.radians([0.1, 0.1, 0.1]), 0.05]
    return mf.Record(y=y.T, u=de[::FINE], dt=STEP, outputs=["alpha", "q", "theta", "az"], inputs=["de"])


@pytest.mark.parametrize("kind", ["white", "slow", "gust"])
def test_unused_motions_are_no_cause_of_noise_or_gusts(kind):
    """Fixed seeds; an accelerometer explains what a gust does to the others, and is no state."""
    for seed in range(4):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            fit = mf.fit(pitching(seed, kind), SHORT)
        assert all("seems to drive the equations" in str(one.message) for one in said)
        assert len(said) == (kind == "gust")
        assert "The record has" not in str(fit.check())


@pytest.mark.parametrize("seed", [0, 1, 4])
def test_states_that_equations_lack_are_told_from_more_poles(seed):
    """The same without the motions in the record; nothing next to the equations explains what is left."""
    rec = lateral(seed).select(outputs=["beta", "r"])
    with pytest.warns(mf.ModfunWarning, match="a linear system of 4 poles from da and dr leaves the noise"):
        fit = mf.fit(rec, TWO)
    text = next(iter(fit.check()))
    assert "they lack a state" in text
    assert "mf.TransferFunction(poles=4, zeros=3, denominator='common')" in text


@pytest.mark.parametrize("kind", ["white", "slow", "gust"])
def test_noise_and_gusts_are_no_states(kind):
    """Fixed seeds; noise is left by any number of poles."""
    for seed in range(4):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mf.ModfunWarning)
            fit = mf.fit(pitching(seed, kind).select(outputs=["alpha", "q"]), SHORT)
        assert "lack a state" not in str(fit.check())
