"""Nonlinear equations whose sums have no answer, or a biased one, are led on by their response."""

from dataclasses import replace
from types import SimpleNamespace

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.by_response import by_response
from modfun.fitting.by_samples import _lines
from modfun.fitting.near_singular import near_singular
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from modfun.results.of_equations import parts_with_values
from scipy.integrate import solve_ivp
from scipy.special import chdtri

# Of each test, the part of seeds in which right code fails: chi-square of so many parameters, or 4 errors.
ALARM = 1e-3


def solved(rates, start, t):
    return solve_ivp(rates, (t[0], t[-1]), start, t_eval=t, rtol=1e-8, atol=1e-9, max_step=t[-1] / 100).y


def glucose(seed):
    """Bergman's minimal model after a bolus, every five minutes with noise of 3 % of the mean."""
    t = np.arange(0, 180.1, 5.0)
    insulin = 11 + 90 * np.exp(-t / 8) + 60 * (t / 25) * np.exp(1 - t / 25)

    def rates(s, x):
        return [-(0.03 + x[1]) * x[0] + 0.03 * 92, -0.025 * x[1] + 1.3e-5 * (np.interp(s, t, insulin) - 11)]

    g = solved(rates, [280.0, 0.0], t)[0]
    g = g + 0.03 * g.mean() * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y={"G": g}, u={"I": insulin}, dt=5.0, intersample="foh")


def epidemic(seed):
    """Infected with noise of 1 % of the peak, so that the last of them are below 0."""
    t = np.arange(101.0)
    infected = solved(lambda _, x: [-0.4 * x[0] * x[1], (0.4 * x[0] - 0.12) * x[1]], [0.99, 0.01], t)[1]
    noise = 0.01 * infected.max() * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y={"I": infected + noise}, dt=1.0)


GLUCOSE = mf.Equation(
    ["G' + (p1 + X)*G = p1*92", "X' + p2*X = p3*(I - 11)"], outputs="G", inputs="I", hidden="X"
)
EPIDEMIC = mf.Equation(["S' = -beta*S*I", "I' = beta*S*I - gamma*I"], outputs="I", hidden="S")


@pytest.mark.parametrize("seed", [8, 23, 38])
def test_glucose_settles_where_sums_did_not(seed):
    """21 of 40 ended without an answer, 6 of them with responses 40 times as far off as the noise."""
    rec = glucose(seed)
    assert not fit_quietly((rec,), GLUCOSE, Options()).success
    fit = mf.fit(rec, GLUCOSE)
    assert fit.success
    assert all(fit.params > 0)
    truth = mf.fit(rec, mf.Equation(GLUCOSE.texts, outputs="G", inputs="I", hidden="X", params=TRUE))
    left = [float(np.mean((rec.y - own.simulate(rec)[0]) ** 2)) for own in (truth, fit)]
    assert -1 < rec.t.size * np.log(left[0] / left[1]) < chdtri(3, ALARM)


TRUE = {"p1": 0.03, "p2": 0.025, "p3": 1.3e-5}


@pytest.mark.parametrize("seed", range(4))
def test_an_epidemic_whose_logarithm_has_no_value_is_answered(seed):
    """40 of 40 had no answer, as log(I) has no value; 4 standard errors are passed by 1 in 8,000."""
    fit = mf.fit(epidemic(seed), EPIDEMIC)
    assert fit.success
    assert "Least squares of the response" in str(fit.summary())
    assert np.all(np.abs(fit.params - [0.4, 0.12]) < 4 * fit.bse)
    assert fit.sigma == pytest.approx(0.01 * fit.records[0].y.max(), rel=0.3)


def test_standard_errors_of_the_response_hold():
    """Chi-square of the errors of 10 pairs: both ends together are passed by 1 in 1,000."""
    distance = 0.0
    for seed in range(10):
        fit = mf.fit(epidemic(seed), EPIDEMIC)
        apart = fit.params - [0.4, 0.12]
        distance += apart @ np.linalg.solve(fit.cov_params(), apart)
    assert chdtri(20, 1 - ALARM / 2) < distance < chdtri(20, ALARM / 2)


def test_a_common_factor_of_sigma_changes_nothing():
    """The level of the noise was that of 1/50 of the output, and chi-square next to 0."""
    rec = epidemic(0)
    fit = mf.fit(rec, EPIDEMIC)
    same = mf.fit(rec._like(sigma=np.full(rec.y.shape, 50.0)), EPIDEMIC)
    assert same.by_response
    np.testing.assert_allclose(same.params, fit.params, rtol=1e-6)
    np.testing.assert_allclose([*same.bse, same.sigma, same.chi2], [*fit.bse, fit.sigma, fit.chi2], rtol=1e-3)


def test_residual_lines_of_masked_samples_have_unit_variance():
    """It was the part of the samples that count. 100,000 numbers are off by 2 % once in 100,000."""
    rng, own = np.random.default_rng(0), np.arange(101) % 3 > 0
    fit, left = SimpleNamespace(lines=[(0, 50)]), 2.0 * own * rng.standard_normal((1000, 101))
    (lines,) = _lines(fit, [left], [np.full(1000, 2.0)], [np.full(1000, own.sum())])
    numbers = np.concatenate([lines.real.ravel(), lines.imag[:, 1:].ravel()])
    assert np.var(numbers) == pytest.approx(1.0, abs=0.02)


def test_what_sums_leave_is_no_doubt_of_a_response():
    """No sum of a sample stands in it, so none errs."""
    quiet = fit_quietly((epidemic(0),), EPIDEMIC, Options())
    fit = by_response(replace(quiet, unsettled=True))
    assert fit.by_response
    assert not fit.unsettled


def servo(seed, v, noise):
    t = np.arange(0, 10.005, 0.01)

    def torque(s):
        return 0.3 * np.sin(0.8 * np.pi * s) + 0.2 * np.sin(1.84 * np.pi * s)

    w = solved(lambda s, x: [(torque(s) - 0.02 * x[0] - 0.1 * np.tanh(x[0] / v)) / 0.05], [0.0], t)[0]
    w = w + noise * w.std() * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y={"w": w}, u={"u": torque(t)}, dt=0.01, intersample="foh")


SERVO = mf.Equation("J*w' + b*w + c*tanh(w/v) = u")


@pytest.mark.parametrize("seed", [0, 1, 8])
def test_friction_is_written_with_positive_parameters_and_not_bent_by_noise(seed):
    """c and v were below 0 in 7 of 12 records, and b, c and v up to 3.4 standard errors off together."""
    rec = servo(seed, 0.05, 0.02)
    fit = mf.fit(rec, SERVO)
    assert fit.success
    assert all(fit.params > 0)
    apart = fit.params - [0.05, 0.02, 0.1, 0.05]
    assert apart @ np.linalg.solve(fit.cov_params(), apart) < chdtri(4, ALARM)


RETURNING = mf.Equation(["S' = -b*S*I + w*(1 - S - I)", "I' = b*S*I - g*I"], outputs="I", hidden="S")


def returning(seed, noise):
    """An epidemic after which the immune become susceptible again; at first I is 0.01."""
    t = np.arange(0, 60.01, 0.25)

    def rates(_, x):
        return [-1.8 * x[0] * x[1] + 0.05 * (1 - x[0] - x[1]), 1.8 * x[0] * x[1] - 0.6 * x[1]]

    infected = solved(rates, [0.95, 0.01], t)[1]
    return mf.Record(y={"I": infected + noise * np.random.default_rng(seed).standard_normal(t.size)}, dt=0.25)


@pytest.mark.parametrize("seed", [1004, 1010, 1016])
def test_logarithms_of_what_noise_takes_near_to_zero_are_led_on(seed):
    """b was 3.8 to 8.3 standard errors off, and nothing wrong was found: log(I) is noisiest next to 0."""
    fit = mf.fit(returning(seed, 0.004), RETURNING)
    assert fit.by_response
    errors = dict(zip(fit.param_names, fit.bse, strict=True))
    truth = {"b": 1.8, "g": 0.6, "w": 0.05}
    assert all(abs(fit[name] - value) < 4 * errors[name] for name, value in truth.items())


def test_logarithms_far_above_the_noise_are_left_alone():
    rec = returning(1004, 0.0005)
    plain = fit_quietly((rec,), RETURNING, Options())
    assert plain.success
    assert not near_singular(plain)
    assert np.array_equal(mf.fit(rec, RETURNING).params, plain.params)


def test_a_right_fit_is_left_alone():
    rec = servo(0, 1.0, 0.01)
    fit, plain = mf.fit(rec, SERVO), fit_quietly((rec,), SERVO, Options())
    assert not fit.by_response
    assert np.array_equal(fit.params, plain.params)


def test_a_response_far_above_the_noise_is_no_answer():
    """An epidemic with a wave that the equations lack."""
    rec = epidemic(0)
    y = rec.y + 0.06 * np.sin(0.3 * rec.t)
    with pytest.warns(mf.ModfunWarning, match="has no value"):
        fit = mf.fit(mf.Record(y={"I": y[0]}, dt=1.0), EPIDEMIC)
    assert not fit.success
    assert not fit.by_response


def test_replicates_of_a_bootstrap_are_led_on_as_their_fit_was():
    """None of them had an answer. One of 8 numbers is beyond 4 standard errors once in 2,000 tests."""
    fit = mf.fit(epidemic(0), EPIDEMIC)
    again = mf.bootstrap(fit, replicates=4, progress=False)
    assert np.all(np.abs(again.params - np.asarray(fit.params)) < 4 * np.asarray(fit.bse))


def test_parts_with_values_are_records():
    """Of pieces shorter than a record an error came, and no response was asked."""
    rec = epidemic(0)
    fit = fit_quietly((rec._like(y=np.where(np.arange(101) % 5, 1.0 + rec.y, -1.0)),), EPIDEMIC, Options())
    assert parts_with_values(fit) == ()
    whole = fit_quietly((rec,), EPIDEMIC, Options())
    assert [part.t.size >= 8 for part in parts_with_values(whole)] == [True]
