"""Channels slower than their record, with the samples between masked: what is put there decides nothing."""

import warnings

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.statistics

PLANE = mf.ss([[-2.1, 1], [-18, -3.2]], [[-0.25], [-35]], np.eye(2), np.zeros((2, 1)))
FREE = mf.StateSpace(
    [["Za", 1], ["Ma", "Mq"]],
    [["Zde"], ["Mde"]],
    states=["alpha", "q"],
    inputs=["de"],
    outputs=["alpha", "q"],
)
TRUTH = [-2.1, -18, -3.2, -0.25, -35]


def rhythm(kind: str, seed: int) -> np.ndarray:
    """Samples of a vane that count: every so many, those of its own clock, or random ones."""
    k = np.arange(401)
    if kind == "clock":  # 12.3 Hz in a log of 50 Hz
        return np.r_[True, np.diff(np.floor(k * 12.3 / 50 + 0.1 * seed)) > 0]
    if kind == "random":
        return np.random.default_rng(seed).random(401) > 0.6
    return k % int(kind) == 0


def plane(kind: str, seed: int, word: str = "smooth") -> mf.Record:
    """A short period moved by an elevator, undeclared, with few samples of the angle of attack."""
    t = 0.02 * np.arange(401)
    u = 3 * np.sin(t * (2 + 1.2 * t)) * np.sin(np.pi * t / 8)
    rng = np.random.default_rng(seed)
    y = PLANE.simulate(u=u, dt=0.02, intersample=word) + rng.normal(size=(2, 401)) * [[0.15], [0.5]]
    rec = mf.Record(y=y, u=u, dt=0.02, outputs=["alpha", "q"], inputs=["de"])
    return rec.weigh(mask={"alpha": rhythm(kind, seed)})


@pytest.mark.parametrize("kind", ["3", "5", "6", "clock", "random"])
def test_a_motion_stays_smooth_beside_a_masked_output(kind):
    """Errors of what was put between had been explained by a hold, and Mde was 7 standard errors off.

    The root mean square of 20 normal errors is below 1.6 with probability 0.9998.
    """
    scores = []
    for seed in range(4):
        fit = mf.fit(plane(kind, seed), FREE)
        assert fit.intersample == ("smooth",)
        scores.append((fit.params - TRUTH) / fit.bse)
    assert np.sqrt(np.mean(np.square(scores))) < 1.6


def test_a_command_is_read_as_held_beside_a_masked_output():
    fits = [mf.fit(plane("clock", seed, "zoh"), FREE) for seed in range(4)]
    assert all(fit.intersample == ("zoh",) for fit in fits)


@pytest.mark.parametrize("every", [8, 14, 20])
def test_a_state_of_nonlinear_equations_may_be_measured_seldom(every):
    """From every eighth sample on, estimates had been absurd, with status ok and warnings of NumPy.

    The root mean square of 12 normal errors that go together is below 1.9.
    """
    t = np.linspace(0, 20, 401)
    y = solve_ivp(
        lambda t, x: [x[0] - 0.5 * x[0] * x[1], 0.4 * x[0] * x[1] - x[1]],
        (0, 20),
        [3, 1],
        t_eval=t,
        rtol=1e-9,
    ).y
    equations = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x", "z"])
    scores = []
    for seed in range(2):
        mask = np.array([np.ones(401, bool), np.arange(401) % every == 0])
        noisy = y + 0.1 * np.random.default_rng(seed).normal(size=y.shape)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            fit = mf.fit(mf.Record(y=noisy, t=t, mask=mask, outputs=["x", "z"]), equations)
        assert fit.success
        assert np.all(fit.bse < 0.03)
        scores.append((fit.params - [1, 0.5, 1, 0.4]) / fit.bse)
    assert np.sqrt(np.mean(np.square(scores))) < 1.9
