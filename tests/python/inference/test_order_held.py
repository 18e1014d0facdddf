"""Orders beside an input that nobody declared, and that looks like a motion."""

import modfun as mf
import numpy as np
import pytest
from scipy import signal

MOTOR = ([600.0], [1.0, 30.0, 380.0])
DT, N, FINE = 0.01, 2000, 8  # s, samples, of each of which so many parts
SAID = "Input 'u' is read as zoh, which the fit prefers."


def driven(u: np.ndarray, seed: int) -> mf.Record:
    """The motor driven by an input at N samples, held, or at each of their parts, moving; 2 % noise."""
    held = u.size == N
    t = np.arange(u.size) * (DT if held else DT / FINE)
    if held:
        a = signal.cont2discrete(MOTOR, DT, "zoh")
        y = signal.lfilter(a[0].ravel(), a[1], u)
    else:
        y, u = signal.lsim(MOTOR, u, t)[1][::FINE], u[::FINE]
    y = y + 0.02 * y.std() * np.random.default_rng(seed).standard_normal(N)
    return mf.Record(y=y, u=u, dt=DT)


def chirp(t: np.ndarray, seed: int) -> np.ndarray:
    return 6 * np.sin(2 * np.pi * (0.2 * t + 0.195 * t**2))


def multisine(t: np.ndarray, seed: int) -> np.ndarray:
    phases = np.random.default_rng(seed).uniform(0, 6.28, 39)
    return np.sum([np.cos(2 * np.pi * 0.2 * k * t + p) for k, p in enumerate(phases, 1)], axis=0)


@pytest.mark.parametrize(("made", "seed"), [(chirp, 2), (chirp, 6), (multisine, 0), (multisine, 7)])
def test_a_hold_is_no_further_pole(made, seed):
    """Read as a motion, half a sample of delay was a pole at -3/dt and a zero, and nothing told."""
    rec = driven(made(np.arange(N) * DT, seed), seed)
    assert rec._seen == {"u": "smooth"}
    found = mf.select_order(rec, poles=[2, 3], progress=False)
    assert SAID in found.notes
    assert found.best.intersample == ("zoh",)
    assert np.all(np.abs(found.best.model.poles()) == pytest.approx(np.sqrt(380.0), rel=0.01))


@pytest.mark.parametrize("made", [chirp, multisine])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_motion_keeps_its_order(made, seed):
    """So do 20 records of each."""
    rec = driven(made(np.arange(N * FINE) * DT / FINE, seed), seed)
    found = mf.select_order(rec, poles=[2, 3], progress=False)
    assert found.best.intersample == ("smooth",)
    assert found.best.model.order == 2
