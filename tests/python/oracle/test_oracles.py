"""The oracles proven by identities and by each other, before anything is held against them."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from oracle import banded, lines, systems
from oracle.coefficients import coefficients, gregory_end_weights, weights
from oracle.output_error import OutputError


def record(seed, order, zeros, inputs=1, intervals=160, noise=0.05):
    """A noisy record of a random system from a random initial state, and its true θ."""
    rng = np.random.default_rng(seed)
    den, nums = systems.random_system(rng, order, zeros, inputs)
    drives = systems.random_inputs(rng, inputs)
    y, u = systems.simulate(den, nums, drives, 0.08, intervals, rng.normal(size=order))
    y = y + noise * np.std(y) * rng.normal(size=y.size)
    return lines.Record(y, u, 0.08, ("smooth",) * inputs), systems.parameters(den, nums)


def test_gregory_end_weights_are_the_classical_fractions():
    assert [str(x) for x in gregory_end_weights()] == ["251/720", "299/240", "211/240", "739/720"]


DEGREES = {"staircase": 0, "trapezoid": 1, "parabolic": 3, "gregory": 3}


@pytest.mark.parametrize(("rule", "degree"), DEGREES.items())
def test_rules_are_exact_for_polynomials_of_their_degree_and_no_more(rule, degree):
    n = 24
    k = np.arange(n + 1) / n
    errors = [abs(weights(rule, n) @ k**p / n - 1 / (p + 1)) for p in range(degree + 2)]
    assert max(errors[:-1]) < 1e-14
    assert errors[-1] > 1e-7


@pytest.mark.parametrize("kind", ["zoh", "foh"])
@pytest.mark.parametrize(("delay", "lead"), [(0.0, 0), (2.0, 3), (1.37, 2)])
def test_held_inputs_are_integrated_exactly(kind, delay, lead):
    v = np.random.default_rng(1).normal(size=13)
    breaks = [x for x in np.arange(13) + delay if lead < x < 12]

    def signal(x):  # time in samples
        k = int(np.clip(np.floor(x - delay), 0, 11))
        return v[k] if kind == "zoh" else v[k] + (x - delay - k) * (v[k + 1] - v[k])

    def integral(f):
        whole = quad(lambda x: signal(x) * f(x), lead, 12, points=breaks, limit=200, epsabs=1e-12)[0]
        return whole / (12 - lead)

    found = coefficients(v, 3, kind, delay, lead)
    for m in (0, 1, 3):
        turn = 2 * np.pi * m / (12 - lead)
        re = integral(lambda x, w=turn: np.cos(w * (x - lead)))
        im = integral(lambda x, w=turn: np.sin(w * (x - lead)))
        assert found[m] == pytest.approx(re - 1j * im, abs=1e-10)


def test_a_delayed_smooth_signal_is_interpolated():
    t = np.arange(65) / 64
    found = coefficients(np.cos(3 * t), 2, "gregory", 1.4, 4)
    exact = coefficients(np.cos(3 * (t - 1.4 / 64)), 2, "gregory", 0.0, 4)
    assert found == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("held", [False, True])
def test_simulation_agrees_with_an_adaptive_integrator(held):
    den, nums, dt, n = [1.0, 1.2, 5.0, 2.0], [[1.0, -2.0], [3.0]], 0.1, 40
    inputs = [np.sin, lambda t: np.cos(2.3 * t)]
    samples = np.array([f(dt * np.arange(n + 1)) for f in inputs])
    y, u = systems.simulate(den, nums, inputs, dt, n, [0.4, -1.0, 2.0], samples if held else None)
    a, b, c, _ = systems.state_space(den, nums)
    state, expected = systems.initial_state(a, c, [0.4, -1.0, 2.0]), []
    for k in range(n + 1):  # sample by sample: held inputs jump
        expected.append(state[0])
        drive = (lambda t, k=k: u[:, k]) if held else (lambda t: np.array([f(t) for f in inputs]))
        span = (k * dt, k * dt + dt)
        run = solve_ivp(lambda t, x, f=drive: a @ x + b @ f(t), span, state, rtol=1e-11, atol=1e-13)
        state = run.y[:, -1]
    assert y == pytest.approx(np.array(expected), abs=1e-8)
    slope = a[0] @ systems.initial_state(a, c, [0.4, -1.0, 2.0])
    assert slope == pytest.approx(-1.0)  # the second number is y' of the free response


def test_rao_garnier_input_is_a_maximal_sequence():
    u = systems.prbs()
    assert u.size == 7161
    spectrum = np.abs(np.fft.fft(u[::7])) ** 2
    assert np.allclose(spectrum[1:], 1024)  # flat but for the mean
    assert abs(u[::7].sum()) == 1
    y, _ = systems.simulate(*systems.RAO_GARNIER, None, 0.01, 7161, held=[np.append(u, u[0])])
    assert 10**-0.5 * np.std(y[:-1]) == pytest.approx(1.06204, rel=2e-3)  # published noise at 10 dB


@pytest.mark.parametrize(("order", "zeros"), [(1, 0), (2, 1), (3, 1)])
@pytest.mark.parametrize("extended", [True, False])
def test_lines_and_differences_are_the_same_problem(order, zeros, extended):
    r, _ = record(order, order, zeros, inputs=2)
    numerators = [zeros, 0]
    difference = banded.Differenced(r, order, numerators, 9, extended)
    problem = lines.Problem([r], order, numerators, 9 + order, extended=extended)
    for method in ("wls", "awls", "ml"):
        theta = getattr(banded, method)(difference)
        found = lines.result(problem, getattr(lines, method)(problem), method)
        assert found.theta == pytest.approx(theta, rel=1e-5 if method == "ml" else 1e-9)
        cost, df, cov = banded.covariance(difference, found.theta, method)
        assert (found.cost, found.df) == (pytest.approx(cost, rel=1e-8), df)
        assert np.sqrt(np.diag(found.cov)) == pytest.approx(np.sqrt(np.diag(cov)), rel=1e-8)


def test_the_matrix_at_denoised_columns_is_the_jacobian():
    r, _ = record(5, 3, 2, inputs=2)
    problem = lines.Problem([r, r], 3, [2, 1], 14, trend="linear")
    x = lines.awls(problem)
    jacobian = problem.system(x, x, turned=True)[0]
    for i in range(x.size):
        h = 1e-6 * np.abs(x).max()
        step = h * np.eye(x.size)[i]
        slope = (problem.residual(x + step) - problem.residual(x - step)) / (2 * h)
        assert slope == pytest.approx(jacobian[:, i], abs=1e-5 * np.linalg.norm(jacobian[:, i]))


def test_without_noise_the_lines_give_the_truth():
    r, theta = record(8, 4, 2, inputs=2, intervals=640, noise=0.0)
    for extended in (True, False):
        problem = lines.Problem([r], 4, [2, 2], 20, extended=extended)
        assert lines.result(problem, lines.awls(problem)).theta == pytest.approx(theta, rel=2e-4)


def test_a_constant_trend_is_left_out():
    r, _ = record(11, 2, 1)
    moved = lines.Record(r.y + 3.0, r.u, r.dt, r.kinds)  # trapezoid: a constant has no line but 0
    both = [lines.Problem([x], 2, [1], 15, trend="constant", rule="trapezoid") for x in (r, moved)]
    first, second = (lines.result(p, lines.ml(p)).theta for p in both)
    assert first == pytest.approx(second, rel=1e-6)


def test_a_linear_trend_is_left_out():
    r, _ = record(11, 2, 1)
    t = 0.08 * np.arange(161)
    problem = lines.Problem([r], 2, [1], 15, trend="linear")
    without = lines.result(problem, lines.ml(problem)).theta
    ((m, s, y, u, n),) = problem.lines
    problem.lines[0] = (m, s, y - 0.7 / s, u, n)  # (1/T)∫ t exp(-st) dt = -1/s on the lines
    assert lines.result(problem, lines.ml(problem)).theta == pytest.approx(without, rel=1e-6)
    sampled = lines.Problem([lines.Record(r.y + 0.7 * t, r.u, r.dt, r.kinds)], 2, [1], 15, trend="linear")
    assert sampled.lines[0][2] == pytest.approx(y - 0.7 / s, abs=2e-4)  # quadrature


def test_output_error_responds_exactly_and_finds_the_truth():
    den, nums = systems.EQ24
    y, _ = systems.simulate(den, nums, [systems.chirp], 10 / 256, 256, [1.0, 0.5])
    model = OutputError(systems.chirp, 10 / 256, 256)
    truth = np.array([3.0, 8.0, 5.0, 1.0, 3.5])  # observer state: y, y' + a1 y
    assert model.response(truth) == pytest.approx(y, abs=1e-12)
    assert model.fit(y, 1.2 * truth)[:3] == pytest.approx([3, 8, 5], rel=1e-7)
    third = OutputError(np.sin, 0.05, 100, order=3, zeros=1)
    y, _ = systems.simulate([1, 2, 5, 3], [[1.0, -2.0]], [np.sin], 0.05, 100)
    assert third.response(np.array([2, 5, 3, 1, -2, 0, 0, 0.0])) == pytest.approx(y, abs=1e-12)


def test_the_bound_is_that_of_the_published_table():
    model = OutputError(systems.chirp, 10 / 256, 256)
    y, _ = systems.simulate(*systems.EQ24, [systems.chirp], 10 / 256, 256)
    cov = model.bound([3, 8, 5, 0, 0], 0.2 * np.sqrt(np.mean(y**2)))
    percent = 100 * np.sqrt(np.mean(np.diag(cov) / np.array([3, 8, 5]) ** 2))
    assert percent == pytest.approx(3.29, abs=0.01)  # an independent computation
