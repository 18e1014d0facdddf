"""Two sensors that lag unlike: what they share looks like an input that acts late."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lfilter

MODEL = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zde"], ["Mde"]], states=["alpha", "q"], inputs=["de"])
PLANT = mf.ss([[-2.1, 1.0], [-18.0, -3.2]], [[-0.25], [-35.0]], np.eye(2))
FINE, DT, N = 10, 0.02, 401


def flown(seed: int, vane: float, gyro: float, late: float = 0.0) -> mf.Record:
    """A 3-2-1-1 of an elevator whose position is measured, with lags of both sensors, s, or of the input."""
    rng, h = np.random.default_rng(seed), DT / FINE
    t = h * np.arange((N - 1) * FINE + 1)
    steps = 3 * np.select([t < 0.6, t < 1.5, t < 2.1, t < 2.4, t < 2.7], [0, 1, -1, 1, -1], 0)
    de = _behind(_behind(steps, 0.03, h), 0.03, h)
    y = PLANT.simulate(u=_behind(de, late, h), dt=h, intersample="foh")
    seen = np.array([_behind(y[0], vane, h), _behind(y[1], gyro, h)])[:, ::FINE]
    noise = np.array([[0.15], [0.5]]) * rng.standard_normal(seen.shape)
    return mf.Record(y=seen + noise, u=de[::FINE], dt=DT, outputs=["alpha", "q"], inputs=["de"])


def _behind(x: np.ndarray, lag: float, h: float) -> np.ndarray:
    return lfilter([1 - np.exp(-h / lag)], [1, -np.exp(-h / lag)], x) if lag else x


@pytest.mark.parametrize("seed", range(3))
def test_lags_of_both_sensors_are_named_and_not_the_input(seed):
    """The lag of an actuator was advised, and with it Za was 14 standard errors off."""
    with pytest.warns(mf.ModfunWarning, match="lags of the sensors of alpha .* and of q, each as a state"):
        mf.fit(flown(seed, 0.05, 0.02), MODEL)


@pytest.mark.parametrize("seed", range(3))
def test_a_late_input_is_still_one(seed):
    with pytest.warns(mf.ModfunWarning, match="de seems to act") as said:
        mf.fit(flown(seed, 0.0, 0.0, late=0.03), MODEL)
    assert "sensors" not in str(said[0].message)
