"""Simulated records, coefficients and regressors, against closed forms and each other."""

import modfun as mf
import numpy as np
import pytest
from modfun.experiments.simulation import experiment
from scipy import integrate

EQ24 = mf.tf([5], [1, 3, 8])
TF2 = mf.TransferFunction(poles=2, zeros=0)
CHIRP = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}


def test_noise_free_record():
    rec = mf.simulate(EQ24, **CHIRP)
    assert rec.intervals == 256
    assert rec.duration == pytest.approx(10.0)
    np.testing.assert_allclose(rec.u[0], np.sin(rec.t**2 / 5), atol=1e-15)
    found = integrate.solve_ivp(
        lambda t, x: [x[1], 5 * np.sin(t**2 / 5) - 3 * x[1] - 8 * x[0]],
        (0, 10), [0, 0], t_eval=rec.t, rtol=1e-12, atol=1e-13, method="DOP853",
    )  # fmt: skip
    np.testing.assert_allclose(rec.y[0], found.y[0], atol=1e-10)


def test_noise_has_the_asked_level_and_its_address():
    quiet = mf.simulate(EQ24, **CHIRP)
    loud = mf.simulate(EQ24, **CHIRP, nsr=0.5, seed=3)
    e = (loud.y - quiet.y)[0] / np.sqrt(np.mean(quiet.y**2))
    assert abs(np.std(e) - 0.5) < 3 * 0.5 / np.sqrt(2 * 257)
    # The same numbers at any level; others for another seed and another replicate.
    less = mf.simulate(EQ24, **CHIRP, nsr=0.1, seed=3)
    np.testing.assert_allclose(less.y - quiet.y, (loud.y - quiet.y) / 5, atol=1e-12)
    assert not np.allclose(loud.y, mf.simulate(EQ24, **CHIRP, nsr=0.5, seed=4).y)
    assert not np.allclose(loud.y, mf.simulate(EQ24, **CHIRP, nsr=0.5, seed=3, replicate=1).y)


def test_initial_states():
    rest = mf.simulate(EQ24, **CHIRP)
    free = mf.simulate(EQ24, **CHIRP, initial_state=[1.0, 0.5]).y - rest.y
    expected = EQ24.simulate(u=np.zeros(257), dt=10 / 256, initial_state=[1.0, 0.5])
    np.testing.assert_allclose(free[0], expected, atol=1e-12)
    drawn = [
        mf.simulate(EQ24, **CHIRP, initial_state="random", replicate=k).y[0, 0] - rest.y[0, 0]
        for k in range(200)
    ]
    rms = np.sqrt(np.mean(rest.y**2))
    assert np.std(drawn) == pytest.approx(rms, rel=0.2)


def test_states_are_scaled_by_the_derivatives_of_the_response():
    found = experiment(EQ24, input="sin(t**2/5)", duration=10.0, intervals=2000)
    slope = np.gradient(found.y[0], found.dt, edge_order=2)
    np.testing.assert_allclose(found.state_rms, np.sqrt([np.mean(found.y**2), np.mean(slope**2)]), rtol=1e-4)
    assert found.free.shape == (2, 1, 2001)


def test_several_inputs_and_names():
    system = mf.tf([[5], [1, 2]], [1, 3, 8])
    rec = mf.simulate(
        system, input=["sin(t)", np.cos], duration=5.0, intervals=100, intersample=["smooth", "zoh"],
        inputs=["de", "da"], outputs=["q"],
    )  # fmt: skip
    assert rec.inputs == ("de", "da")
    assert rec.intersample == ("smooth", "zoh")
    np.testing.assert_allclose(rec.u[1], np.cos(rec.t), atol=1e-15)


def test_coefficients_against_integrals():
    rec = mf.Record(y=np.exp(-np.linspace(0, 2, 401)), u=np.linspace(0, 2, 401), dt=0.005, intersample="foh")
    found = mf.coefficients(rec, 5)
    s = 1j * found.omega
    np.testing.assert_allclose(found.omega, np.arange(6) * np.pi)
    np.testing.assert_allclose(found.y[0], (1 - np.exp(-2)) / (1 + s) / 2, atol=1e-10)
    np.testing.assert_allclose(found.u[0, 1:], -1 / s[1:], atol=1e-12)
    assert found.u[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("extended", [True, False])
@pytest.mark.parametrize(("num", "den"), [([5], [1, 3, 8]), ([1, 2], [1, 2, 3, 4]), ([2], [1, 1])])
def test_regressors_solve_the_noise_free_record(num, den, extended):
    system = mf.tf(num, den)
    structure = mf.TransferFunction.from_system(system)
    state = np.ones(len(den) - 1)
    rec = mf.simulate(system, **{**CHIRP, "intervals": 4096}, initial_state=state)
    r = mf.regressors(rec, structure, harmonics=8, extended=extended)
    n = structure.poles
    rows = 2 * 8 + n + 1 if extended else 2 * 9
    assert r.gamma.shape == (rows, len(structure.param_names()))
    truth = structure.theta(system)
    np.testing.assert_allclose(np.linalg.lstsq(r.gamma, r.target, rcond=None)[0], truth, rtol=1e-6)


def test_the_covariance_of_rows_does_not_depend_on_how_times_are_given():
    """Steps of 0.04 s but for the last one: quadrature weights of uneven samples are in seconds."""
    rec = mf.simulate(EQ24, **CHIRP)
    t = rec.t.copy()
    t[-1] += 0.004
    uneven = mf.Record(y=rec.y, u=rec.u, t=t)
    assert uneven.dt is None
    even, other = (mf.regressors(one, TF2, harmonics=6).covariance([3.0, 8.0, 5.0]) for one in (rec, uneven))
    np.testing.assert_allclose(np.diag(other), np.diag(even), rtol=0.01)


def test_regressors_with_a_delay_and_held_inputs():
    rng = np.random.default_rng(0)
    u = np.repeat(rng.choice([-1.0, 1.0], 150), 4)[:513]
    system = mf.tf([[5], [2]], [1, 3, 8], delay=[0.1234, 0.0])
    rec = mf.simulate(
        system, input=[u, "cos(t)"], duration=12.0, intervals=512, intersample=["zoh", "smooth"],
        initial_state=[0.3, -0.2],
    )  # fmt: skip
    structure = mf.TransferFunction.from_system(system)
    r = mf.regressors(rec, structure, harmonics=12)
    assert r.param_names == ("a1", "a2", "b0[u1]", "b0[u2]")
    np.testing.assert_allclose(np.linalg.lstsq(r.gamma, r.target, rcond=None)[0], [3, 8, 5, 2], rtol=2e-4)


@pytest.mark.parametrize("extended", [True, False])
@pytest.mark.parametrize("n", [1, 2, 3])
def test_covariance_of_the_rows(n, extended):
    structure = mf.TransferFunction(poles=n, zeros=0)
    theta = np.array([*[3.0, 8.0, 2.0][:n], 5.0])
    intervals, top = 256, 4
    columns = []
    for sample in np.eye(intervals + 1):  # the rows are linear in the samples: their exact covariance
        rec = mf.Record(y=sample, u=np.zeros(intervals + 1), dt=0.1)
        r = mf.regressors(rec, structure, harmonics=top, rule="staircase", extended=extended)
        columns.append(r.target - r.gamma @ theta)
    exact = np.array(columns).T @ np.array(columns)
    # Without the doubled end point the samples' exponentials are orthogonal: nothing is neglected.
    np.testing.assert_allclose(r.covariance(theta), exact, atol=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: mf.simulate("eq24", **CHIRP), "give mf.tf"),
        (lambda: mf.simulate(EQ24, **{**CHIRP, "duration": -1.0}), "duration"),
        (lambda: mf.simulate(EQ24, **{**CHIRP, "intervals": 2.5}), "intervals"),
        (lambda: mf.simulate(EQ24, **{**CHIRP, "intervals": 0}), "whole number from 1"),
        (lambda: mf.simulate(EQ24, **CHIRP, nsr=-0.1), "nsr"),
        (lambda: mf.simulate(EQ24, **CHIRP, seed=-1), "seed"),
        (lambda: mf.simulate(EQ24, **CHIRP, initial_state="rest"), "'zero', 'random'"),
        (lambda: mf.simulate(EQ24, **CHIRP, initial_state=[1.0]), "2 states"),
        (lambda: mf.simulate(EQ24, **CHIRP, intersample="held"), "'zoh'"),
        (lambda: mf.simulate(EQ24, **{**CHIRP, "input": ["t", "t"]}), "2 signal"),
        (lambda: mf.coefficients(mf.simulate(EQ24, **CHIRP), -1), "whole number from 0"),
        (
            lambda: mf.coefficients(mf.simulate(EQ24, **CHIRP), 4, rule="simpson"),
            "coefficients: rule='simpson' .* parabolic",
        ),
        (lambda: mf.regressors(mf.simulate(EQ24, **CHIRP), EQ24, harmonics=6), "give a TransferFunction"),
        (lambda: mf.regressors(mf.simulate(EQ24, **CHIRP), TF2, harmonics=6).covariance([1.0]), "a1, a2, b0"),
        (
            lambda: mf.regressors(mf.simulate(mf.tf([[[5]], [[1]]], [1, 3, 8]), **CHIRP), TF2, harmonics=6),
            "select",
        ),
    ],
)
def test_mistakes_in_calls(call, said):
    with pytest.raises(mf.SpecError, match=said):
        call()


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: mf.simulate(EQ24, **{**CHIRP, "input": "0*t"}, nsr=0.1), "response from rest is zero"),
        (lambda: mf.simulate(EQ24, **{**CHIRP, "input": np.ones(256)}), "N\\+1 samples"),
        (lambda: mf.coefficients(mf.simulate(EQ24, **CHIRP), 129), "up to 128, not 129"),
        (
            lambda: mf.regressors(
                mf.simulate(EQ24, **CHIRP), mf.TransferFunction(poles=2, zeros=0, delay=20.0), harmonics=3
            ),
            "leaves nothing",
        ),
    ],
)
def test_mistakes_in_samples(call, said):
    with pytest.raises(mf.DataError, match=said):
        call()


def test_samples_say_how_they_went():
    """A staircase of samples is held, as a Record of it is; one that is declared smooth stays so."""
    stairs = np.repeat([1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0], 33)[:257]
    plant = mf.tf([5], [1, 3, 8])
    words = {"duration": 10.0, "intervals": 256}
    rec = mf.simulate(plant, input=stairs, **words)
    assert rec.intersample == mf.Record(y=rec.y, u=rec.u, dt=rec.dt).intersample == ("zoh",)
    assert np.array_equal(rec.y, mf.simulate(plant, input=stairs, intersample="zoh", **words).y)
    assert mf.simulate(plant, input=stairs, intersample="smooth", **words).intersample == ("smooth",)
    study = mf.MonteCarlo(system=plant, input=stairs, nsr=0.02, estimators=["ml"], replicates=64, **words)
    res = study.run()
    assert np.all(np.abs(res.bias) < 4 * res.bias_mcse)
