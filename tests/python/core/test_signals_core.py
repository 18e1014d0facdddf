"""The compiled core from samples to coefficients and from inputs to responses, against slow twins."""

from math import comb

import numpy as np
import pytest
from modfun import _core
from modfun.errors import DataError, SpecError
from oracle import coefficients as naive
from oracle import systems
from oracle.modulating import phi, real_functions
from scipy.integrate import quad, solve_ivp

RULES = naive.RULES
KINDS = (*naive.RULES, *naive.HOLDS)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(160)


def coefficients(v, harmonics, kind="gregory", delay=0.0, lead=0, t=None):
    return _core.coefficients(np.array(v, float)[None], harmonics, [kind], [delay], lead, t)[0]


def noise(count, seed=0):
    return np.random.default_rng(seed).standard_normal(count)


# Quadrature weights ----------------------------------------------------------------------------


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("intervals", [8, 30, 31])
def test_weights_are_those_of_the_oracle(rule, intervals):
    if rule == "parabolic" and intervals % 2:
        with pytest.raises(SpecError, match="even number of intervals, the window has 31"):
            _core.quadrature_weights(rule, intervals, None)
        return
    got = _core.quadrature_weights(rule, intervals, None)
    np.testing.assert_allclose(got, naive.weights(rule, intervals), rtol=0, atol=1e-15)


def test_uneven_weights_integrate_a_signal_at_the_order_of_their_rule():
    exact = quad(lambda t: np.exp(np.sin(3 * t)), 0, 2, epsabs=1e-13)[0]
    order = {"staircase": 1, "trapezoid": 2, "parabolic": 3, "gregory": 4}
    for rule in RULES:
        errors = []
        for n in (64, 128, 256, 512):
            s = np.linspace(0, 1, n + 1)
            t = 2 * (s + 0.12 * np.sin(2 * np.pi * s))
            errors.append(abs(_core.quadrature_weights(rule, n, t) @ np.exp(np.sin(3 * t)) - exact))
        slope = np.log2(errors[0] / errors[-1]) / 3
        assert slope > order[rule] - 0.25, (rule, errors)


def test_gauss_legendre_is_numpys():
    nodes, weights = _core.gauss_legendre()
    x, w = np.polynomial.legendre.leggauss(6)
    np.testing.assert_allclose(nodes, (x + 1) / 2, rtol=0, atol=2e-16)
    np.testing.assert_allclose(weights, w / 2, rtol=0, atol=4e-16)


# Fourier coefficients --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("intervals", "harmonics"), [(256, 8), (255, 31), (90, 45), (9001, 64), (400, 65), (1009, 200)]
)
def test_folded_sums_blocks_and_fft_equal_the_naive_sum(kind, intervals, harmonics):
    if kind == "parabolic" and intervals % 2:
        intervals += 1
    if kind in naive.HOLDS and intervals > 1000:
        intervals = 1000
    v = noise(intervals + 1)
    want = naive.coefficients(v, min(harmonics, intervals // 2), kind)
    np.testing.assert_allclose(coefficients(v, want.size - 1, kind), want, rtol=0, atol=3e-15)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("delay", "lead"), [(0.0, 3), (2.0, 2), (2.0, 5), (0.3, 1), (1.75, 4), (2.999, 3)])
@pytest.mark.parametrize("harmonics", [7, 66])
def test_delays_and_late_windows(kind, delay, lead, harmonics):
    v = noise(160 + lead + 1, 3)
    want = naive.coefficients(v, harmonics, kind, delay, lead)
    np.testing.assert_allclose(coefficients(v, harmonics, kind, delay, lead), want, rtol=0, atol=3e-14)


@pytest.mark.parametrize("kind", naive.HOLDS)
def test_a_held_input_with_a_fractional_delay_against_adaptive_quadrature(kind):
    u, n, delay, lead = noise(8, 5), 4, 1.4, 3

    def held(x):  # x counts samples from the start of the window
        at = x - delay + lead
        k = int(np.floor(at))
        return u[k] if kind == "zoh" else u[k] + (u[k + 1] - u[k]) * (at - k)

    kinks = np.arange(n) + delay % 1
    for m, got in enumerate(coefficients(u, 2, kind, delay, lead)):
        re = quad(lambda x, m=m: held(x) * np.cos(2 * np.pi * m * x / n), 0, n, points=kinks, limit=200)[0]
        im = quad(lambda x, m=m: -held(x) * np.sin(2 * np.pi * m * x / n), 0, n, points=kinks, limit=200)[0]
        assert abs(got - (re + 1j * im) / n) < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_uneven_samples_against_direct_sums_and_cells(kind):
    rng = np.random.default_rng(8)
    t = 3.0 + np.cumsum(rng.uniform(0.02, 0.2, 61))
    v = rng.standard_normal(61)
    span = t[-1] - t[0]
    got = coefficients(v, 12, kind, t=t)
    for m in range(13):
        if kind in RULES:
            q = _core.quadrature_weights(kind, 60, t)
            want = np.sum(q * v * np.exp(-2j * np.pi * m * (t - t[0]) / span)) / span
        else:
            want = 0
            for k in range(60):
                inside = 0.5 * (NODES + 1)
                rise = v[k + 1] - v[k] if kind == "foh" else 0.0
                x = t[k] + (t[k + 1] - t[k]) * inside - t[0]
                f = (v[k] + rise * inside) * np.exp(-2j * np.pi * m * x / span)
                want += 0.5 * (t[k + 1] - t[k]) * np.sum(WEIGHTS * f) / span
        assert abs(got[m] - want) < 1e-14


def test_an_even_grid_given_as_times_agrees_to_the_order_of_the_rule():
    t = np.linspace(0, 10, 257)
    y = np.exp(-0.3 * t) * np.sin(t**2 / 5)
    even, uneven = coefficients(y, 8), coefficients(y, 8, t=t)
    assert np.abs(even - uneven).max() < 1e-6 < np.abs(even).max()


def test_several_channels_keep_their_order_and_kinds():
    v = noise(3 * 101).reshape(3, 101)
    got = _core.coefficients(v, 5, ["gregory", "zoh", "foh"], [0.0, 1.5, 2.0], 2, None)
    for row, kind, delay, record in zip(got, ("gregory", "zoh", "foh"), (0.0, 1.5, 2.0), v, strict=True):
        np.testing.assert_allclose(row, naive.coefficients(record, 5, kind, delay, 2), rtol=0, atol=1e-14)


# Properties 1 and 2 of the modulating functions, on sampled signals -----------------------------

PERIOD = 4.0
OMEGA0 = 2 * np.pi / PERIOD
Z = -0.4 + 1.7j


def signal(t, derivative=0):
    return np.real((0.8 - 0.3j) * Z**derivative * np.exp(Z * t))


def integrate(f):
    t = 0.5 * PERIOD * (NODES + 1)
    return 0.5 * PERIOD * np.sum(WEIGHTS * f(t))


def sampled(f, harmonics):
    """V(m), m of either sign, from 4,001 samples."""
    v = coefficients(f(np.linspace(0, PERIOD, 4001)), harmonics)
    return lambda m: v[m] if m >= 0 else np.conj(v[-m])


def difference(f, m, order):
    return sum((-1) ** (order - j) * comb(order, j) * f(m + j) for j in range(order + 1))


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("m", [-2, 0, 5])
def test_property_1_on_sampled_signals(order, m):
    v = sampled(signal, 12)
    for k in range(order + 1):
        want = integrate(lambda t, k=k: phi(t, m, order, PERIOD) * signal(t, k))
        got = difference(lambda i, k=k: (1j * i * OMEGA0) ** k * v(i), m, order)
        assert abs(got - want) < 1e-9 * (8 * OMEGA0) ** k


@pytest.mark.parametrize("m", [-1, 0, 4])
def test_property_2_on_sampled_signals(m):
    # F = 1 + 2 cos(2ω₀t) − sin ω₀t is three harmonics a side: the convolution over k is finite.
    order, weights = 2, {0: 1.0, 2: 1.0, -2: 1.0, 1: 0.5j, -1: -0.5j}
    v = sampled(signal, 14)

    def factor(t):
        return np.real(sum(w * np.exp(1j * k * OMEGA0 * t) for k, w in weights.items()))

    want = integrate(lambda t: phi(t, m, order, PERIOD) * factor(t) * signal(t, 2))
    got = sum(w * difference(lambda i: -((i * OMEGA0) ** 2) * v(i), m - k, order) for k, w in weights.items())
    assert abs(got - want) < 1e-7


@pytest.mark.parametrize("order", [1, 2, 3])
def test_real_modulating_functions_move_derivatives_to_sampled_signals(order):
    """∫ Σ c_k cos kω₀t · v⁽ᵈ⁾ dt = T Re Σ c_k (ikω₀)ᵈ V(k), and −T Im for sines: the ends do not enter."""
    v = sampled(signal, 8)
    k = np.arange(9)
    parts = np.array([v(i) for i in k])
    cosines, sines = real_functions(order, 8)
    for d in range(order + 1):
        moved = PERIOD * (1j * k * OMEGA0) ** d * parts
        for rows, wave, got in (
            (cosines, np.cos, cosines @ moved.real),
            (sines, np.sin, -(sines @ moved.imag)),
        ):
            for row, value in zip(rows, got, strict=True):
                want = integrate(
                    lambda t, row=row, d=d, wave=wave: row @ wave(np.outer(k * OMEGA0, t)) * signal(t, d)
                )
                assert abs(value - want) < 1e-9 * (np.abs(row) @ (1 + k * OMEGA0) ** d)


# Noise level -----------------------------------------------------------------------------------


def test_the_noise_level_is_unbiased_and_ignores_the_signal():
    t = np.linspace(0, 10, 513)
    y = np.exp(-0.5 * t) + np.sin(t**2 / 5) * 0.1
    e = np.random.default_rng(1).standard_normal((60, 513)) * 0.02
    levels = _core.noise_level(np.ascontiguousarray(y + e), 2)
    assert abs(np.sqrt(np.mean(levels**2)) / 0.02 - 1) < 0.03
    # By the definition: differences of order q = 4 over m = N/4 … N/2 − q.
    v = naive.coefficients(y + e[0], 256, "trapezoid")
    lines = np.diff(v[128:], 4)
    assert abs(levels[0] - np.sqrt(512 * np.mean(np.abs(lines) ** 2) / comb(8, 4))) < 1e-3 * levels[0]


# Responses -------------------------------------------------------------------------------------


def random_model(rng, states, inputs, outputs):
    a = rng.standard_normal((states, states))
    a -= (np.linalg.eigvals(a).real.max() + 0.2) * np.eye(states)
    shapes = [(states, inputs), (outputs, states), (outputs, inputs)]
    return [a, *(rng.standard_normal(shape) for shape in shapes)]


@pytest.mark.parametrize("kind", ["zoh", "foh", "smooth"])
@pytest.mark.parametrize(("states", "inputs", "outputs"), [(1, 1, 1), (3, 2, 2), (5, 1, 3)])
def test_responses_agree_with_an_adaptive_integrator(kind, states, inputs, outputs):
    rng = np.random.default_rng(states)
    model = random_model(rng, states, inputs, outputs)
    a, b, c, d = model
    dt, n = 0.1, 20
    t = np.arange(n + 1) * dt
    x0 = rng.standard_normal(states)
    phase = rng.uniform(0, 6, (inputs, 1))
    u = np.sin(2 * t + phase)
    s = (np.arange(n)[:, None] + _core.gauss_legendre()[0]) * dt
    nodes = np.sin(2 * s + phase[:, :, None])

    def value(x, k):
        if kind == "zoh":
            return u[:, k]
        if kind == "foh":
            return u[:, k] + (u[:, k + 1] - u[:, k]) * (x / dt - k)
        return np.sin(2 * x + phase[:, 0])

    states_over_time = [x0]
    for k in range(n):
        run = solve_ivp(
            lambda x, z, k=k: a @ z + b @ value(x, k),
            (t[k], t[k + 1]), states_over_time[-1], method="DOP853", rtol=1e-12, atol=1e-13,
        )  # fmt: skip
        states_over_time.append(run.y[:, -1])
    want = c @ np.array(states_over_time).T + d @ u
    got = _core.simulate(*model, x0, u, dt, kind, nodes if kind == "smooth" else None)
    np.testing.assert_allclose(got, want, rtol=0, atol=2e-10)


def test_time_scales_do_not_matter():
    den, num = np.array([1.0, 3.0, 8.0]), np.array([5.0])
    t = np.linspace(0, 10, 257)
    u = np.sin(t**2 / 5)[None]
    slow = [np.ascontiguousarray(m, float) for m in systems.state_space(den, [num])[:4]]
    fast = [slow[0] * 1e9, slow[1] * 1e9, slow[2], slow[3]]
    x0 = np.zeros(2)
    y = _core.simulate(*slow, x0, u, t[1], "zoh", None)
    np.testing.assert_allclose(_core.simulate(*fast, x0, u, t[1] * 1e-9, "zoh", None), y, rtol=0, atol=1e-13)


# What is refused -------------------------------------------------------------------------------

ONES = np.ones((2, 33))
GOOD = {"samples": ONES, "harmonics": 4, "kinds": ["zoh"] * 2, "delays": [0.0] * 2, "lead": 0, "t": None}
PLACE = np.arange(66).reshape(2, 33)
TIMES = np.arange(33.0)


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"samples": np.where(PLACE == 40, np.nan, 1.0)}, DataError, "channel 1 is NaN at index 7"),
        ({"samples": np.where(PLACE == 3, -np.inf, 1.0)}, DataError, "channel 0 is -inf at index 3"),
        ({"samples": np.ones((2, 0))}, DataError, "at least 2 samples"),
        ({"samples": np.asfortranarray(np.ones((2, 33)))}, DataError, "C-contiguous"),
        ({"harmonics": 17}, SpecError, "harmonics up to 16"),
        ({"harmonics": 2**64 - 1}, SpecError, "harmonics up to 16"),
        ({"kinds": ["zoh", "cubic"]}, SpecError, '"cubic"; use one of "staircase"'),
        ({"kinds": ["zoh"]}, SpecError, "got 1 kinds and 2 delays"),
        ({"kinds": ["gregory"] * 2, "samples": ONES[:, :3].copy()}, DataError, "at least 4 samples"),
        ({"delays": [0.0, 1.5], "lead": 1}, SpecError, "1.5 samples"),
        ({"delays": [0.0, -1.0]}, SpecError, "-1 samples"),
        ({"lead": 40}, DataError, "needs at least 42 samples, the record has 33"),
        ({"lead": 2**64 - 1}, DataError, "the record has 33"),
        ({"t": TIMES[:30]}, DataError, "30"),
        ({"t": TIMES[::-1].copy()}, DataError, "must increase"),
        ({"t": np.where(TIMES == 5, np.nan, TIMES)}, DataError, "sample time 5"),
        ({"t": TIMES, "delays": [0.0, 1.0], "lead": 1}, SpecError, "without delays"),
    ],
)  # fmt: skip
def test_bad_coefficient_calls_name_the_cure(change, error, text):
    _core.coefficients(**GOOD)
    with pytest.raises(error, match=text):
        _core.coefficients(**(GOOD | change))


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"a": np.zeros((2, 3))}, SpecError, "A is 2 × 3"),
        ({"c": np.zeros((1, 3))}, SpecError, "C is 1 × 3"),
        ({"d": np.zeros((2, 1))}, SpecError, "D is 2 × 1"),
        ({"a": np.full((2, 2), np.nan)}, SpecError, r"entry \(0, 0\) of A"),
        ({"u": np.zeros((2, 5))}, DataError, "u is 2 × 5"),
        ({"u": np.full((1, 5), np.inf)}, DataError, "u: channel 0 is inf at index 0"),
        ({"x0": np.zeros(3)}, DataError, "initial state has 3"),
        ({"x0": np.array([0.0, np.nan])}, DataError, r"x0\[1\]"),
        ({"dt": -1.0}, SpecError, "sampling interval is -1"),
        ({"kind": "spline"}, SpecError, "spline"),
        ({"kind": "smooth"}, SpecError, "pass nodes"),
        ({"kind": "smooth", "nodes": np.zeros((1, 4, 5))}, DataError, "20 numbers instead of 24"),
    ],
)
def test_bad_simulations_name_the_cure(change, error, text):
    good = {
        "a": np.eye(2), "b": np.ones((2, 1)), "c": np.ones((1, 2)), "d": np.zeros((1, 1)),
        "x0": np.zeros(2), "u": np.zeros((1, 5)), "dt": 0.1, "kind": "zoh", "nodes": None,
    }  # fmt: skip
    _core.simulate(**good)
    with pytest.raises(error, match=text):
        _core.simulate(**(good | change))


def test_short_records_have_no_noise_level():
    with pytest.raises(DataError, match="at least 27 samples, the record has 20"):
        _core.noise_level(np.ones((1, 20)), 2)
    with pytest.raises(DataError, match="channel 0 is NaN"):
        _core.noise_level(np.full((1, 200), np.nan), 2)


def test_held_signals_have_no_weights_and_times_must_be_complete():
    with pytest.raises(SpecError, match="held signal"):
        _core.quadrature_weights("zoh", 8, None)
    with pytest.raises(SpecError, match="2³⁰"):
        _core.quadrature_weights("trapezoid", 2**60, None)
    with pytest.raises(DataError, match="8 intervals have 9 times, got 4"):
        _core.quadrature_weights("trapezoid", 8, np.arange(4.0))
