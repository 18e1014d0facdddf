"""Output error of state spaces, equations, several outputs and records: exact, and right in noise."""

import modfun as mf
import numpy as np
import pytest
from modfun.rivals import output_error
from oracle import state_output_error

PLANT = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["alpha", "q"], inputs=["de"])
TRUTH = {"Za": -1.2, "Ma": -4.0, "Mq": -1.5, "Zd": -0.2, "Md": -6.0}
SIGMA = np.array([[0.04, 0.018], [0.018, 0.09]])  # of white noise, correlation 0.3


def doublets(intervals=400, dt=0.05, seed=0):
    rng = np.random.default_rng(seed)
    return np.repeat(rng.choice([-1.0, 0.0, 1.0], 1 + intervals // 10), 10)[: intervals + 1]


def plant_record(cov=None, seed=0, state=(0.1, -0.2), offset=(0.0, 0.0), intervals=400):
    u = doublets(intervals, seed=seed)
    rec = mf.simulate(
        PLANT.model(TRUTH), input=u, duration=0.05 * intervals, intervals=intervals, intersample="foh",
        initial_state=list(state),
    )  # fmt: skip
    y = rec.y + np.array(offset)[:, None]
    if cov is not None:
        y += np.linalg.cholesky(cov) @ np.random.default_rng(100 + seed).standard_normal(y.shape)
    names = {"outputs": ["alpha", "q"], "inputs": ["de"]}
    return mf.Record(y=y, u=rec.u, dt=rec.dt, intersample="foh", **names)


def close(found, truth, tolerance):
    assert set(found) == set(truth)
    for name, value in truth.items():
        assert found[name] == pytest.approx(value, abs=tolerance * max(1.0, abs(value))), name


# Without noise -----------------------------------------------------------------------------------


def test_state_space_with_bias_is_exact():
    rec = plant_record(offset=(1.0, -3.0))
    found = output_error(PLANT, trend="constant").solve(rec)
    close(found.params, TRUTH, 1e-6)
    np.testing.assert_allclose(found.trends[0][:, 0], [1.0, -3.0], atol=1e-6)
    np.testing.assert_allclose(found.initial_states[0], [0.1, -0.2], atol=1e-6)


def test_records_have_their_own_states_and_biases():
    first = plant_record(seed=1, offset=(1.0, 0.0))
    second = plant_record(seed=2, state=(-0.5, 0.3), offset=(0.0, 2.0))
    found = output_error(PLANT, trend="constant").solve([first, second])
    close(found.params, TRUTH, 1e-6)
    np.testing.assert_allclose(found.initial_states, [[0.1, -0.2], [-0.5, 0.3]], atol=1e-6)
    np.testing.assert_allclose(np.array(found.trends)[:, :, 0], [[1, 0], [0, 2]], atol=1e-6)


def test_state_that_is_not_measured():
    rec = plant_record().select(outputs=["q"])
    model = mf.StateSpace(
        PLANT.A, PLANT.B, [[0, 1]], states=["alpha", "q"], inputs=["de"], params={"Zd": -0.2}
    )
    close(output_error(model)(rec), {k: v for k, v in TRUTH.items() if k != "Zd"}, 1e-6)


@pytest.mark.parametrize("denominator", ["common", "separate"])
def test_transfer_functions_of_several_outputs(denominator):
    structure = mf.TransferFunction(poles=2, denominator=denominator, zeros=1)
    rec = plant_record(state=(0.0, 0.0))
    found = output_error(structure)(rec)
    poles = np.roots([1, TRUTH["Za"] * -1 - TRUTH["Mq"], TRUTH["Za"] * TRUTH["Mq"] - TRUTH["Ma"]])
    for a1, a2 in zip(*(sorted(k for k in found if k.startswith(p)) for p in ("a1", "a2")), strict=True):
        np.testing.assert_allclose([found[a1], found[a2]], np.poly(poles)[1:], rtol=1e-5)


def test_held_coefficient_and_free_delay():
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8], delay=0.13), input="sin(t**2/5)", duration=10.0, intervals=256
    )  # fmt: skip
    late = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(max=0.5), params={"a1": 3.0})
    close(output_error(late)(rec), {"a2": 8.0, "b0": 5.0, "delay": 0.13}, 1e-5)


def test_nonlinear_equation_and_bounds():
    duffing = mf.Equation(
        "y'' + d*y' + a*y + b*y**3 = u", params={"d": mf.Free(min=0.0, max=2.0), "b": mf.Free(min=0.0)}
    )
    truth = {"d": 0.3, "a": 1.0, "b": 0.5}
    rec = mf.simulate(
        duffing.model(truth), input="2*sin(t)+cos(2.3*t)", duration=20.0, intervals=400,
        initial_state=[0.5, 0.1],
    )  # fmt: skip
    close(output_error(duffing)(rec), truth, 1e-5)
    tight = mf.Equation("y'' + d*y' + a*y + b*y**3 = u", params={"d": mf.Free(min=0.4, max=2.0)})
    assert output_error(tight)(rec)["d"] == 0.4


# In noise ----------------------------------------------------------------------------------------


def test_covariance_of_correlated_outputs():
    """5 standard deviations of a covariance of 2000 normal samples: one seed in 10⁶ fails."""
    rec = plant_record(SIGMA, intervals=2000)
    found = output_error(PLANT).solve(rec)
    deviation = np.sqrt((SIGMA**2 + np.outer(np.diag(SIGMA), np.diag(SIGMA))) / rec.t.size)
    assert np.all(np.abs(found.noise_cov[0] - SIGMA) < 5 * deviation)
    z = [(found.params[name] - TRUTH[name]) / found.bse[name] for name in TRUTH]
    assert np.max(np.abs(z)) < 5


def test_agrees_with_the_slow_twin():
    rec = plant_record(SIGMA, seed=3, offset=(1.0, -1.0), intervals=120)

    def matrices(v):
        za, ma, mq, zd, md = v
        return np.array([[za, 1.0], [ma, mq]]), np.array([zd, md])

    start = [TRUTH[name] for name in ("Za", "Ma", "Mq", "Zd", "Md")]
    values, cov = state_output_error.output_error(matrices, start, rec.y, rec.u[0], rec.dt)
    found = output_error(PLANT, trend="constant").solve(rec)
    expected = dict(zip(("Za", "Ma", "Mq", "Zd", "Md"), values, strict=True))
    for name, value in expected.items():
        assert abs(found.params[name] - value) < 1e-3 * found.bse[name], name
    np.testing.assert_allclose(found.noise_cov[0], cov, rtol=1e-4)


def test_agrees_with_the_fit():
    """Both are efficient up to the lines left out and the ends: 0.25 standard errors rms between them."""
    apart = []
    for seed in range(4):
        rec = plant_record(SIGMA / 16, seed=seed, intervals=1000)
        fit, found = mf.fit(rec, PLANT), output_error(PLANT, trend="constant").solve(rec)
        theirs = np.array([found.params[name] for name in fit.param_names])
        apart.append((fit.params - theirs) / fit.bse)
    assert np.sqrt(np.mean(np.square(apart))) < 0.4


def test_a_loud_record_does_not_spoil_a_good_one():
    good, loud = plant_record(SIGMA / 100, seed=5), plant_record(SIGMA * 25, seed=6)
    alone, both = output_error(PLANT).solve(good), output_error(PLANT).solve([good, loud])
    for name in TRUTH:
        assert both.bse[name] < 1.001 * alone.bse[name]
        assert abs(both.params[name] - alone.params[name]) < 0.5 * alone.bse[name]


# Refusals ----------------------------------------------------------------------------------------


def test_failures_are_said():
    rec = plant_record(SIGMA)
    with pytest.raises(mf.FitError, match="not converged after 1"):
        output_error(PLANT, maxiter=1)(rec)
    with pytest.raises(mf.SpecError, match="lacks Md"):
        output_error(PLANT, start={k: v for k, v in TRUTH.items() if k != "Md"})(rec)
    with pytest.raises(mf.FitError, match="no start with a finite response"):
        output_error(PLANT, start={**TRUTH, "Ma": 1e9})(rec)
    with pytest.raises(mf.SpecError, match="there is no record"):
        output_error(PLANT)([])
    with pytest.raises(mf.SpecError, match="got a str"):
        output_error(PLANT)(["x"])


TANK = mf.TransferFunction(poles=2, zeros=0, delay=mf.Free(min=0, max=120))
TWO = mf.StateSpace(
    [["-1/T1", "1/T1"], [0, "-1/T2"]], [[0], ["K/T2"]], [[1, 0]], delay="d", outputs=["y"], inputs=["u"],
    params={"d": mf.Free(min=0, max=120), "T1": mf.Free(200.0), "T2": mf.Free(20.0), "K": mf.Free(0.5)},
)  # fmt: skip


def _warm(seed):
    """A tank behind a pipe that is not at rest, its heater in steps from 40 % on."""
    t, before = 5.0 * np.arange(-800, 1081.0), 800
    levels, times = np.array([30.0, 40, 60, 45, 55, 40]), np.array([-420.0, 0, 600, 2000, 3200, 4400])
    u = levels[np.maximum(np.searchsorted(times, t, side="right") - 1, 0)]
    y = mf.tf([0.6], [7500, 325, 1], delay=30.0).simulate(u=u - 30, dt=5.0, intersample="zoh")[before:]
    y = y + 0.08 * np.random.default_rng(seed).standard_normal(y.shape)
    return mf.Record(y=y + 20, u=u[before:], dt=5.0, intersample="zoh")


@pytest.mark.parametrize(("model", "delay"), [(TANK, "delay"), (TWO, "d")])
def test_a_free_delay_of_an_input_that_stood_before_the_record_is_found(model, delay):
    """The derivative had the input jump to its first value: 100 evaluations and no end."""
    for seed in range(3):
        rec = _warm(seed)
        start = None if model is TANK else {"T1": 200.0, "T2": 20.0, "K": 0.5, "d": 20.0}
        solved = mf.rivals.output_error(model, trend="constant", start=start).solve(rec)
        assert solved.nit < 20
        assert abs(solved.params[delay] - 30.0) < 3.5 * solved.bse[delay]  # by chance in 1 of 700
        assert solved.bse[delay] < 2.0
