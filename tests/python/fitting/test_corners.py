"""Smooth inputs with corners, at samples or between: actuators that follow commands through a lag."""

import modfun as mf
import numpy as np
import pytest
from modfun.base.corners import corners
from modfun.records.corners import driving
from scipy.linalg import expm

TRUTH = np.array([1.5, 8.0, 5.0])
SECOND = mf.TransferFunction(poles=2, zeros=0)
STATES = mf.StateSpace([[0, 1], ["-a2", "-a1"]], [[0], ["b0"]], [[1, 0]], states=["x", "v"], outputs=["y"])


def flown(tau, dt, every, noise=0.0, seed=0, count=600, part=0.0):
    """5/(s² + 1.5 s + 8) behind an actuator 1/(tau s + 1), whose position is the input; exact.

    The command steps `part` of a step after samples.
    """
    levels = np.random.default_rng(1000 + seed).normal(size=count // every + 2)
    command = levels[np.arange(count) // every]
    system = np.array([[-1 / tau, 0, 0, 1 / tau], [0, 0, 1, 0], [5, -8, -1.5, 0], [0, 0, 0, 0]])
    before, after = expm(system * dt * part), expm(system * dt * (1 - part))
    x = np.zeros((count + 1, 4))
    for k, level in enumerate(command):
        x[k + 1] = before @ x[k]
        x[k + 1, 3] = level
        x[k + 1] = after @ x[k + 1]
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


@pytest.mark.parametrize(("tau", "every"), [(0.025, 10), (0.05, 12), (0.25, 50)])
def test_commands_that_step_between_samples_leave_none(tau, every):
    # Taken for smooth, they put estimates up to 1.2e-2 off.
    for part in (0.1, 0.3, 0.5, 0.7, 0.9):
        fit = mf.fit(flown(tau, 0.05, every, part=part), SECOND)
        assert np.abs(fit.params / TRUTH - 1).max() < 5e-5, part
        assert not fit.remarks()


@pytest.mark.parametrize("tau", [0.5, 1.0, 5.0])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.75])
def test_sums_of_an_actuators_position_are_its_integrals(tau, part):
    # A step at the sample 20 + part through a lag of tau samples, whose transform is known.
    since = np.arange(60.0) - 20 - part
    u = np.where(since > 0, -np.expm1(-since.clip(0) / tau), 0.0)
    found = corners(u)
    assert found.at + found.part == pytest.approx([20 + part], abs=1e-9)
    z = np.exp(-1j * (x := 0.8))
    lost = (1 / (1 - z) - 1) - np.exp((part - 1) / tau) * z / (1 - np.exp(-1 / tau) * z)
    if part == 0:
        lost = 1 / (1 - z) - 1 / (1 - np.exp(-1 / tau) * z)
    wanted = z**part / (1j * x * (1 + 1j * x * tau)) - lost
    told = found.taps[0] @ z ** (found.at[0] - 20 + np.arange(-2, 4))
    assert abs(told - wanted) < 3e-4 * abs(z**part / (1j * x * (1 + 1j * x * tau)))


def test_noise_and_sines_have_no_corners():
    # The threshold is twice what 80,000 samples of each reach: false alarms are below 1e-3.
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(4000)
    for signal in (
        noise,
        np.cumsum(noise),
        np.round(np.cumsum(noise)),
        30 * np.sin(np.arange(4000) / 9) + noise,
    ):
        assert corners(signal) is None
    for period in (4.5, 6.3, 8.0, 20.0, 300.0):
        assert corners(np.sin(2 * np.pi * np.arange(200) / period)) is None


def test_errors_are_those_of_the_noise():
    # a2 was 5.6 standard errors off in the root mean square, in silence from 2 % noise on.
    fits = [mf.fit(flown(0.1, 0.05, 10, 0.005, seed), SECOND) for seed in range(20)]
    scores = np.array([(fit.params - TRUTH) / fit.bse for fit in fits])
    assert np.sqrt((scores**2).mean(axis=0)).max() < 1.6  # false alarm 1e-3 for scores of t with 30 degrees


def test_errors_behind_steps_between_samples_are_those_of_the_noise():
    # a2 was 5.2 standard errors off in the root mean square, as far with 0.1 % noise of the position.
    for own in (0.0, 1e-3):
        scores = []
        for seed in range(100, 120):
            rec = flown(0.05, 0.05, 20, 0.01, seed, part=0.4)
            noise = own * rec.u.std() * np.random.default_rng(seed).standard_normal(rec.u.shape)
            fit = mf.fit(mf.Record(y=rec.y, u=rec.u + noise, dt=rec.dt, intersample="smooth"), SECOND)
            scores.append((fit.params - TRUTH) / fit.bse)
        assert np.sqrt((np.array(scores) ** 2).mean(axis=0)).max() < 1.6  # false alarm 1e-3, as above


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


@pytest.mark.parametrize("part", [0.0, 0.4])
def test_the_response_is_simulated_with_corners(part):
    rec = flown(0.1, 0.05, 20, part=part)
    fit = mf.fit(rec, SECOND)
    left = rec.y - fit.simulate(rec)[0]
    assert np.sqrt((left**2).mean()) < 2e-4 * rec.y.std()


def test_inputs_without_corners_keep_their_samples():
    rec = mf.simulate(
        mf.tf([5], [1, 1.5, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.02, seed=1
    )
    assert driving(rec) is rec.u
    assert driving(flown(0.1, 0.05, 10))[0] != pytest.approx(flown(0.1, 0.05, 10)["u"])
