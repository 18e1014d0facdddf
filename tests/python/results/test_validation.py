"""Scores, free responses and tests of residual lines, against values known otherwise."""

import modfun as mf
import numpy as np
import pytest
from modfun.results import line_tests, regression, scores


def test_scores_of_a_known_error():
    y = 20.0 + np.array([1.0, -1.0, 1.0, -1.0])
    simulated = y + 0.1
    assert scores.signal_to_error(y, simulated) == pytest.approx(20.0)  # about the mean: 20 does not flatter
    assert scores.fit_percent(y, simulated) == pytest.approx(90.0)
    assert scores.r2(y, simulated) == pytest.approx(0.99)
    assert scores.theil(y, simulated) == pytest.approx(0.1 / (np.sqrt(401) + np.sqrt(np.mean(simulated**2))))


def test_scores_of_a_perfect_simulation_and_of_a_flat_output():
    y = np.sin(np.arange(50.0))
    assert scores.signal_to_error(y, y) == np.inf
    assert scores.fit_percent(y, y) == 100
    flat = np.ones(50)
    assert scores.signal_to_error(flat, flat + 0.1) == -np.inf
    assert np.isnan(scores.signal_to_error(flat, flat))


def test_scores_survive_extreme_scales():
    y = np.sin(np.arange(50.0))
    assert scores.signal_to_error(1e200 * y, 1.1e200 * y) == pytest.approx(scores.signal_to_error(y, 1.1 * y))
    assert scores.signal_to_error(1e-200 * y, 1.1e-200 * y) == pytest.approx(
        scores.signal_to_error(y, 1.1 * y)
    )


@pytest.mark.parametrize("other", [np.zeros(49), np.zeros((1, 50)), np.zeros(1)])
def test_scores_refuse_series_that_do_not_pair(other):
    with pytest.raises(mf.DataError, match="equal length"):
        scores.signal_to_error(np.zeros(50) if other.size > 1 else np.zeros(1), other)


@pytest.mark.parametrize("uneven", [False, True])
def test_free_response_solves_its_equation(uneven):
    t = np.linspace(0, 5, 101)
    if uneven:
        t = t + 0.01 * np.sin(9 * t)
        t -= t[0]
    rows = regression.free_response(np.array([1.0, 3.0, 8.0]), t)
    w = np.sqrt(8 - 2.25)
    decay = np.exp(-1.5 * t)
    np.testing.assert_allclose(rows[0], decay * (np.cos(w * t) + 1.5 / w * np.sin(w * t)), atol=1e-12)
    np.testing.assert_allclose(rows[1], decay * np.sin(w * t) / w, atol=1e-12)


def test_free_response_of_integrators_and_of_fast_systems():
    t = np.linspace(0, 2, 41)
    rows = regression.free_response(np.array([1.0, 0.0, 0.0, 0.0]), t)
    np.testing.assert_allclose(rows, [np.ones(41), t, t**2 / 2], atol=1e-12)
    fast = regression.free_response(np.array([1.0, 3e6, 8e12]), t * 1e-6)
    slow = regression.free_response(np.array([1.0, 3.0, 8.0]), t)
    np.testing.assert_allclose(fast * [[1], [1e6]], slow, rtol=1e-9, atol=1e-12)


def test_regression_has_the_textbook_covariance_and_survives_twins():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((2, 200)) * [[1.0], [1e8]]
    y = np.array([2.0, -3e-8]) @ x + 0.1 * rng.standard_normal(200)
    found = regression.regress(y, x, np.ones_like(y))
    exact, rest = np.linalg.lstsq(x.T, y, rcond=None)[:2]
    np.testing.assert_allclose(found.coefficients, exact, rtol=1e-10)
    np.testing.assert_allclose(found.covariance, rest / 198 * np.linalg.inv(x @ x.T), rtol=1e-8)
    twins = regression.regress(y, np.vstack([x[0], x[0]]), np.ones_like(y))
    alone = regression.regress(y, x[:1], np.ones_like(y))
    np.testing.assert_allclose(twins.coefficients, [alone.coefficients[0], 0.0], rtol=1e-10)
    assert np.isnan(twins.covariance[1, 1])
    np.testing.assert_allclose(twins.covariance[0, 0], alone.covariance[0, 0], rtol=1e-10)
    np.testing.assert_allclose(twins.fitted, alone.fitted, atol=1e-10)
    with pytest.raises(mf.DataError, match="window"):
        regression.regress(y, np.full((1, 200), np.inf), np.ones_like(y))


def lines(seed, count=400):
    rng = np.random.default_rng(seed)
    return rng.standard_normal(count) + 1j * rng.standard_normal(count)


def test_white_lines_pass_at_the_stated_rate():
    tests = [
        (line_tests.correlation_of_lines([lines(s)])[0], line_tests.colour_of_lines([lines(s)])[0])
        for s in range(300)
    ]
    for k in (0, 1):
        rejected = np.mean([pair[k].p_value < 0.05 for pair in tests])
        assert 0.01 < rejected < 0.10  # 0.05 and 4 standard errors of 300 trials


def test_neighbours_and_levels_are_found():
    e = lines(1)
    near, r = line_tests.correlation_of_lines([e + 0.5 * np.roll(e, 1)])
    assert near.p_value < 1e-6
    assert r[0] == pytest.approx(0.4, abs=0.1)
    tilted, ratio = line_tests.colour_of_lines([e * np.linspace(2, 0.5, e.size)])
    assert tilted.p_value < 1e-6
    assert ratio == pytest.approx(1.9, abs=0.3)
    assert line_tests.correlation_of_lines([e * np.linspace(2, 0.5, e.size)])[0].p_value > 1e-3


def test_records_are_not_joined_across_their_ends():
    e = lines(2, 40)
    both = line_tests.correlation_of_lines([e, e])[1]
    alone = line_tests.correlation_of_lines([e])[1]
    np.testing.assert_allclose(both, alone)


def test_few_lines_have_no_verdict():
    assert np.isnan(line_tests.correlation_of_lines([lines(0, 3)])[0].p_value)
    assert np.isnan(line_tests.colour_of_lines([lines(0, 3)])[0].p_value)


def test_a_validation_may_start_from_a_state_that_is_known():
    """A fitted initial state fits some noise, too; from the true one, errors are the noise itself."""
    system = mf.tf([5], [1, 3, 8])
    make = {"input": "sin(t**2/5)", "duration": 10.0, "intervals": 256}
    fit = mf.fit(mf.simulate(system, **make, nsr=0.1, seed=0), mf.TransferFunction(poles=2, zeros=0))
    other = mf.simulate(system, **make, nsr=0.1, seed=1)
    free, rest = fit.score(other), fit.score(other, initial_state="zero")
    assert rest["signal_to_error"][0] < free["signal_to_error"][0] < rest["signal_to_error"][0] + 0.3
    np.testing.assert_allclose(
        fit.errors(other, initial_state=[1, 0])[0],
        other.y[0] - fit.predict(other, initial_state=[1, 0]).y[0],
    )
