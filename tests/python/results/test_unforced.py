"""Equations without an input: what drives a motion that they do not follow is named, and no right one."""

import warnings

import modfun as mf
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

T = np.arange(0, 20.001, 0.02)
SWING = "y'' + c*y' + w2*sin(y) = 0"


def _pendulum(torque: float, start: float) -> NDArray[np.float64]:
    def slope(t: float, x: NDArray[np.float64]) -> list[float]:
        acts = 3 * np.sin(1.3 * t) + 2 * np.sin(3.1 * t + 0.5) + 1.5 * np.sin(5 * t)
        return [x[1], -0.25 * x[1] - 9 * np.sin(x[0]) + torque * acts]

    found = solve_ivp(slope, (0, T[-1]), [start, 0], t_eval=T, rtol=1e-8, atol=1e-10)
    return np.asarray(found.y[0])


def _warned(y: NDArray[np.float64], text: str) -> str:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        mf.fit(mf.Record(y=y, dt=0.02), mf.Equation(text))
    return str(said[0].message) if said else ""


@pytest.mark.parametrize("text", [SWING, "y'' + c*y' + k*y = 0"])
def test_a_forgotten_torque_is_named(text: str) -> None:
    """Two of ten records of a pendulum were silent at 160 times the noise; an offset was named of others."""
    clean = _pendulum(1.2, 1.0)
    for seed in range(6):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(T.size)
        said = _warned(clean + noise, text)
        assert "The equations have no input" in said
        assert "First add what acts to the record" in said


@pytest.mark.parametrize("offset", [0.0, 0.3])
def test_a_free_pendulum_is_not_doubted(offset: float) -> None:
    """Eight records each: a free motion is followed, and where its zero is off, that is what is said."""
    clean = _pendulum(0.0, 1.5)
    for seed in range(8):
        noise = 0.03 * np.random.default_rng(seed).standard_normal(T.size)
        said = _warned(clean + offset + noise, SWING)
        assert "no input" not in said
        assert ("offset" in said) == bool(offset)
