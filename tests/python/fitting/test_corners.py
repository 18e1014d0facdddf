"""Smooth inputs with corners at samples: actuators that follow commands through a lag, periods of a sine."""

import modfun as mf
import numpy as np
import pytest
from modfun.records.corners import driving
from scipy.linalg import expm

TRUTH = np.array([1.5, 8.0, 5.0])
SECOND = mf.TransferFunction(poles=2, zeros=0)
STATES = mf.StateSpace([[0, 1], ["-a2", "-a1"]], [[0], ["b0"]], [[1, 0]], states=["x", "v"], outputs=["y"])


def flown(tau, dt, every, noise=0.0, seed=0, count=600):
    """5/(s² + 1.5 s + 8) behind an actuator 1/(tau s + 1), whose position is the input; exact."""
    levels = np.random.default_rng(1000 + seed).normal(size=count // every + 2)
    command = levels[np.arange(count) // every]
    system = np.array([[-1 / tau, 0, 0, 1 / tau], [0, 0, 1, 0], [5, -8, -1.5, 0], [0, 0, 0, 0]])
    step, x = expm(system * dt), np.zeros((count + 1, 4))
    for k, level in enumerate(command):
        x[k, 3] = level
        x[k + 1] = step @ x[k]
    y = x[:, 1] + noise * x[:, 1].std() * np.random.default_rng(seed).normal(size=count + 1)
    return mf.Record(y=y, u=x[:, 0], dt=dt)


@pytest.mark.parametrize(
    ("tau", "dt", "every"), [(0.1, 0.02, 25), (0.1, 0.05, 10), (0.05, 0.05, 10), (0.1, 0.05, 3)]
)
def test_an_actuator_that_lags_leaves_no_error(tau, dt, every):
    # The corners of its position at samples put estimates 4e-4 to 7e-3 off.
    fit = mf.fit(flown(tau, dt, every), SECOND)
    assert np.abs(fit.params / TRUTH - 1).max() < 2e-4
    assert not fit.remarks()


def test_errors_are_those_of_the_noise():
    # a2 was 5.6 standard errors off in the root mean square, in silence from 2 % noise on.
    fits = [mf.fit(flown(0.1, 0.05, 10, 0.005, seed), SECOND) for seed in range(20)]
    scores = np.array([(fit.params - TRUTH) / fit.bse for fit in fits])
    assert np.sqrt((scores**2).mean(axis=0)).max() < 1.6  # false alarm 1e-3 for scores of t with 30 degrees


def test_equations_and_state_spaces():
    rec = flown(0.1, 0.05, 10)
    for model in (STATES, mf.Equation("y'' + a1*y' + a2*y = b0*u")):
        fit = mf.fit(rec, model)
        found = [fit[name] for name in ("a1", "a2", "b0")]
        assert np.abs(found / TRUTH - 1).max() < 1e-3


def test_batches_and_studies_sum_the_same_inputs():
    rec = flown(0.1, 0.05, 10, 0.01)
    fit = mf.fit(rec, SECOND, harmonics=25)
    many = mf.fit_many([rec, rec], SECOND, harmonics=25)
    np.testing.assert_allclose(many.params, [fit.params] * 2, rtol=1e-9)
    batch = mf.Batch(y=rec.y[None], u=rec.u[None], dt=rec.dt)
    np.testing.assert_allclose(mf.fit_many(batch, SECOND, harmonics=25).params, [fit.params], rtol=1e-9)


def test_the_response_is_simulated_with_corners():
    rec = flown(0.1, 0.05, 10)
    fit = mf.fit(rec, SECOND)
    left = rec.y - fit.simulate(rec)[0]
    assert np.sqrt((left**2).mean()) < 2e-4 * rec.y.std()


def test_inputs_without_corners_keep_their_samples():
    rec = mf.simulate(
        mf.tf([5], [1, 1.5, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.02, seed=1
    )
    assert driving(rec) is rec.u
    assert driving(flown(0.1, 0.05, 10))[0] != pytest.approx(flown(0.1, 0.05, 10)["u"])
