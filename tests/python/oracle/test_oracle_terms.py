"""The oracle of general terms proven by identities, by SciPy's minimiser and by the oracle of the lines."""

import numpy as np
import pytest
from scipy.stats import f as fisher

from oracle import lines, nonlinear, systems, terms

CASES = {
    "duffing": (nonlinear.duffing, 15, [0.0, 1.0, 0.0]),
    "short period": (nonlinear.short_period, 14, [-1.0] * 5),
}


def noisy(case, seed, nsr, intervals=256, **options):
    """The case, one noisy record of it as a problem, and a start."""
    make, top, start = CASES[case]
    system = make(intervals)
    sigma = nsr * np.sqrt(np.mean(system.v**2, axis=1))
    v = system.v + sigma[:, None] * np.random.default_rng(seed).standard_normal(system.v.shape)
    return system, terms.Problem(system.terms, v, system.t[1], sigma, top, **options), start


def cost(problem, theta):
    whiten, _, residual = problem.at_theta(theta, theta)
    return np.sum((whiten @ residual) ** 2)


@pytest.mark.parametrize("case", CASES)
def test_ml_ends_at_the_minimum_of_its_criterion(case):
    system, problem, start = noisy(case, 3, 0.2)
    found = terms.ml(problem, terms.wls(problem, start))
    least = terms.minimum(problem, system.true)
    assert found == pytest.approx(least, rel=1e-6)
    assert cost(problem, found) <= cost(problem, least) * (1 + 1e-12)


@pytest.mark.parametrize("case", CASES)
def test_denoised_columns_give_the_gradient(case):
    system, problem, _ = noisy(case, 4, 0.2)
    theta = system.true * 1.05
    whiten, _, residual = problem.at_theta(theta, theta)
    columns = problem.columns(theta, problem.noise(theta, whiten, residual))
    exact = 2 * (whiten @ columns).T @ (whiten @ residual)
    for i, h in enumerate(1e-5 * np.abs(theta)):
        up, down = theta.copy(), theta.copy()
        up[i] += h
        down[i] -= h
        assert (cost(problem, up) - cost(problem, down)) / (2 * h) == pytest.approx(exact[i], rel=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_sensitivities_are_those_of_the_error(case):
    system, problem, _ = noisy(case, 5, 0.1, correct=False)
    shift = 1e-5 * np.random.default_rng(6).standard_normal(system.v.shape)
    moved = [
        terms.Problem(system.terms, problem.v + x, system.t[1], problem.sigma, problem.m[-1], correct=False)
        for x in (shift, -shift)
    ]
    change = (moved[0].error(system.true) - moved[1].error(system.true)) / 2
    found = np.einsum("crk,ck->r", problem.sensitivity(system.true), shift)
    assert found == pytest.approx(change, abs=1e-9 * np.max(np.abs(change)))
    assert problem.moved(system.true, shift) == pytest.approx(found, abs=1e-12 * np.max(np.abs(change)))


def test_bias_is_taken_from_signals():
    sigma = np.array([0.3, 0.2])
    v = np.random.default_rng(7).standard_normal((2, 33))
    x, y = v
    signals = [
        (lambda v, t, theta: v[0] ** 3, {0: None}, x**3 - 3 * 0.09 * x),
        (lambda v, t, theta: v[0] ** 4, {0: None}, x**4 - 6 * 0.09 * x**2 + 3 * 0.09**2),
        (lambda v, t, theta: v[0] ** 2 * v[1], {0: None, 1: None}, (x**2 - 0.09) * y),
        (lambda v, t, theta: np.sin(2 * v[1]), {1: None}, np.exp(2 * 0.04) * np.sin(2 * y)),
        (lambda v, t, theta: np.exp(v[0]), {0: None}, np.exp(x - 0.045)),
    ]
    for function, slopes, wanted in signals:
        term = terms.Term(lambda theta: 1.0, 0, function, slopes)
        problem = terms.Problem([term], v, 0.1, sigma, 4)
        assert problem.signal(term, None) == pytest.approx(wanted, abs=1e-10)
        plain = terms.Problem([term], v, 0.1, sigma, 4, correct=False)
        assert plain.signal(term, None) == pytest.approx(function(v, None, None), abs=1e-15)


def test_differences_annihilate_the_end_terms():
    for case in CASES:
        _, problem, _ = noisy(case, 8, 0.1)
        d = problem.differences()
        assert np.max(np.abs(d @ problem.ends)) < 1e-12
        assert d.shape == (len(problem.ends) - sum(problem.orders), len(problem.ends))


def test_a_linear_model_is_that_of_the_lines():
    """`wls` to rounding; `ml` but for the rows' slight correlation through the ends of the record."""
    y, u = systems.simulate(*systems.EQ24, [systems.chirp], 10 / 256, 256, [1.0, 0.5])
    y = y + 0.02 * np.random.default_rng(9).standard_normal(y.size)
    model = [
        nonlinear.linear(lambda theta: 1.0, 2),
        nonlinear.linear(lambda theta: theta[0], 1),
        nonlinear.linear(lambda theta: theta[1], 0),
        nonlinear.known(lambda theta: -theta[2], systems.chirp),
    ]
    problem = terms.Problem(model, y, 10 / 256, 0.02, 12)
    other = lines.Problem([lines.Record(y, u, 10 / 256, ("smooth",))], 2, [0], 12)
    assert terms.wls(problem, [1.0, 1.0, 1.0]) == pytest.approx(lines.wls(other)[:3] * other.unit, rel=1e-9)
    found, wanted = terms.fit(problem, "ml", systems.parameters(*systems.EQ24)), lines.ml(other)
    known = lines.result(other, wanted)
    bse = np.sqrt(np.diag(known.cov))
    assert np.all(np.abs(found.theta - known.theta) < 0.2 * bse)
    assert np.sqrt(np.diag(found.cov)) == pytest.approx(bse, rel=0.05)
    assert found.df == known.df


@pytest.mark.statistics
def test_correction_removes_the_bias_of_the_duffing_equation():
    """Zero bias at NSR .3 by Hotelling on 20 records, false alarm .001; uncorrected 17 times the limit."""
    values = {}
    for correct in (True, False):
        rows = []
        for seed in range(20):
            system, problem, start = noisy("duffing", 100 + seed, 0.3, 512, correct=correct)
            rows.append(terms.ml(problem, terms.wls(problem, start)) - system.true)
        mean, cov = np.mean(rows, axis=0), np.cov(np.array(rows).T)
        n, p = np.shape(rows)
        values[correct] = n * mean @ np.linalg.solve(cov, mean) * (n - p) / (p * (n - 1))
    limit = fisher.ppf(0.999, p, n - p)
    assert values[True] < limit < values[False]
