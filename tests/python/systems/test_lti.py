"""Systems with numbers: forms, frequency responses and exact simulation against SciPy and closed forms."""

import itertools
import pickle

import modfun as mf
import numpy as np
import pytest
from modfun.systems.gains import SchurForm
from scipy import integrate, signal

EQ24 = mf.tf([5], [1, 3, 8])


def response_by_quadrature(num, den, u, t, x0=None):
    """Output by an adaptive integrator on the observable form, the input as a function of time."""
    system = mf.tf(num, den).to_ss()
    a, b, c, d = system.A, system.B[:, 0], system.C[0], system.D[0, 0]
    start = np.zeros(a.shape[0]) if x0 is None else np.asarray(x0, float)
    found = integrate.solve_ivp(
        lambda s, x: a @ x + b * u(s), (t[0], t[-1]), start, t_eval=t, rtol=1e-12, atol=1e-13, method="DOP853"
    )
    return c @ found.y + d * u(t)


# Forms -------------------------------------------------------------------------------------------


def test_polynomials_are_monic_and_stripped():
    system = mf.tf([0, 0, 10], [2, 6, 16], delay=0.1)
    np.testing.assert_array_equal(system.num, [5])
    np.testing.assert_array_equal(system.den, [1, 3, 8])
    assert system.delay == 0.1
    assert system.shape == (1, 1)
    assert system.order == 2
    assert system.dcgain() == 5 / 8
    assert system.is_stable
    assert not mf.tf([1], [1, 0]).is_stable
    assert mf.tf([1], [1, 0]).dcgain() == np.inf


def test_poles_and_zeros():
    system = mf.tf([1, 4], [1, 3, 8])
    np.testing.assert_allclose(system.zeros(), [-4])
    np.testing.assert_allclose(
        np.sort_complex(system.poles()), [-1.5 - 2.3979158j, -1.5 + 2.3979158j], rtol=1e-7
    )
    np.testing.assert_allclose(np.sort_complex(system.to_ss().poles()), np.sort_complex(system.poles()))
    np.testing.assert_allclose(system.to_ss().zeros(), [-4], rtol=1e-10)


def test_nested_forms():
    miso = mf.tf([[5], [1, 2]], [1, 3, 8], delay=[0.1, 0.0])
    assert miso.shape == (1, 2)
    assert miso.delay == (0.1, 0.0)
    assert miso.order == 2
    mimo = mf.tf([[[5], [1, 2]], [[1], None]], [1, 3, 8])
    assert mimo.shape == (2, 2)
    assert mimo.order == 4
    np.testing.assert_array_equal(mimo.den, [1, 3, 8])
    np.testing.assert_allclose(mimo.dcgain(), [[5 / 8, 2 / 8], [1 / 8, 0]])
    scalar = mf.tf([[[5], [1]]], [[[1, 3, 8], [1, 1]]])
    assert scalar.order == 3
    assert len(scalar.den) == 1
    assert len(scalar.den[0]) == 2
    assert len(scalar.poles()) == 3


@pytest.mark.parametrize(
    ("num", "den"),
    [([5], [1, 3, 8]), ([1, 2, 3], [1, 3, 8]), ([2, 1], [1, 2, 3, 4]), ([3], [1]), ([1], [1, 0, 0])],
)
def test_frequency_response_of_both_forms(num, den):
    omega = np.array([0.3, 1.0, 5.0, 20.0])
    expected = np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega)
    found = mf.tf(num, den).frequency_response(omega)
    np.testing.assert_allclose(found.response[0, 0], expected, rtol=1e-13)
    if len(den) > 1:
        state = mf.tf(num, den).to_ss()
        np.testing.assert_allclose(state.frequency_response(omega).response[0, 0], expected, rtol=1e-11)
        np.testing.assert_allclose(state.num, mf.tf(num, den).num, atol=1e-10)
        np.testing.assert_allclose(state.den, den, atol=1e-10)


def test_delay_turns_the_phase():
    omega = np.array([0.5, 2.0])
    ratio = (
        mf.tf([5], [1, 3, 8], delay=0.37).frequency_response(omega).response
        / EQ24.frequency_response(omega).response
    )
    np.testing.assert_allclose(ratio[0, 0], np.exp(-0.37j * omega), rtol=1e-13)


def test_states_of_a_transfer_function_are_the_derivatives_of_the_free_response():
    t = np.linspace(0, 5, 501)
    y = mf.tf([2, 1], [1, 3, 8]).simulate(u=np.zeros(501), dt=0.01, initial_state=[1.0, 0.5])
    p = np.array([-1.5 + 1j * np.sqrt(23 / 4), -1.5 - 1j * np.sqrt(23 / 4)])
    amplitude = np.linalg.solve(np.vander(p, 2, increasing=True).T, [1.0, 0.5])
    np.testing.assert_allclose(y, (np.exp(np.outer(t, p)) @ amplitude).real, atol=1e-12)


def test_print():
    assert repr(EQ24) == "      5\n-------------\ns^2 + 3 s + 8"
    assert "e^(-0.1 s)" in repr(mf.tf([1, -2], [1, 0, 1], delay=0.1))
    assert "input 2 to output 1" in repr(mf.tf([[1], [2]], [1, 1]))
    assert "A =" in repr(mf.ss([[-1.0]], [1.0], [1.0]))
    assert EQ24._repr_latex_() == r"$$G(s) = \frac{5}{s^{2} + 3 s + 8}$$"


def test_frozen_and_pickled():
    with pytest.raises(AttributeError):
        EQ24.delays = (1.0,)
    with pytest.raises(ValueError, match="read-only"):
        EQ24.num[0] = 1.0
    again = pickle.loads(pickle.dumps(EQ24))
    np.testing.assert_array_equal(again.den, EQ24.den)


# Exact simulation --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("num", "den", "x0"),
    [([5], [1, 3, 8], [1.0, 0.5]), ([2, 1], [1, 3, 8], None), ([1, 2, 3], [1, 3, 8], [0.0, 1.0])],
)
def test_smooth_text_input_is_exact(num, den, x0):
    t = np.linspace(0, 10, 257)
    y = mf.tf(num, den).simulate(u="sin(t**2/5)", dt=10 / 256, intervals=256, initial_state=x0)
    expected = response_by_quadrature(num, den, lambda s: np.sin(s**2 / 5), t, x0)
    np.testing.assert_allclose(y, expected, atol=2e-10)


def test_smooth_samples_go_through_a_spline():
    t = np.linspace(0, 10, 1025)
    exact = EQ24.simulate(u="sin(t**2/5)", dt=10 / 1024, intervals=1024)
    np.testing.assert_allclose(EQ24.simulate(u=np.sin(t**2 / 5), dt=10 / 1024), exact, atol=1e-8)


@pytest.mark.parametrize(("kind", "hold"), [("zoh", 0), ("foh", 1)])
def test_held_and_interpolated_inputs_equal_scipy(kind, hold):
    rng = np.random.default_rng(3)
    u = rng.standard_normal(300)
    t = np.arange(300) * 0.05
    system = mf.tf([1, 2], [1, 3, 8])
    expected = signal.lsim(([1, 2], [1, 3, 8]), u, t, interp=bool(hold))[1]
    np.testing.assert_allclose(system.simulate(u=u, dt=0.05, intersample=kind), expected, atol=1e-12)


@pytest.mark.parametrize("kind", ["smooth", "zoh", "foh"])
@pytest.mark.parametrize("delay", [0.2, 0.37, 0.011])
def test_delays_whole_and_fractional(kind, delay):
    dt, n = 0.05, 200

    def u(s):
        return np.sin(3 * s) + 0.3 * s

    samples = u(np.arange(-400, n + 1) * dt)

    def between(s):
        if kind == "smooth":
            return u(s)
        at = np.asarray(s) / dt + 400
        if kind == "zoh":
            return samples[np.floor(at + 1e-9).astype(int)]
        return np.interp(at, np.arange(samples.size), samples)

    y = mf.tf([1, 2], [1, 3, 8], delay=delay).simulate(u=u, dt=dt, intervals=n, intersample=kind)
    # Piecewise by hand: integrate the convolution between all break points with many nodes.
    p = np.roots([1, 3, 8])
    r = np.polyval([1, 2], p) / np.polyval([2, 3], p)
    x, w = np.polynomial.legendre.leggauss(20)
    state = np.zeros(2, complex)
    expected = [0.0]
    for k in range(n):
        breaks = [k * dt, (k + 1) * dt]
        inside = delay + dt * np.ceil((k * dt - delay) / dt)
        if k * dt + 1e-9 < inside < (k + 1) * dt - 1e-9:
            breaks.insert(1, inside)
        for lo, hi in itertools.pairwise(breaks):
            s = (lo + hi) / 2 + (hi - lo) / 2 * x
            forced = np.exp(np.outer(p, hi - s)) @ (w * between(s - delay)) * (hi - lo) / 2
            state = np.exp(p * (hi - lo)) * state + forced
        expected.append((r @ state).real)
    np.testing.assert_allclose(y, expected, atol=1e-11)


def test_before_the_record_samples_are_zero():
    late, t = mf.tf([1], [1, 1], delay=0.5), np.arange(101) * 0.05
    y = late.simulate(u=np.ones(101), dt=0.05, intersample="zoh")
    np.testing.assert_allclose(y, np.where(t < 0.5, 0, 1 - np.exp(0.5 - t)), atol=1e-12)
    y = late.simulate(u="step(t)", dt=0.05, intervals=100, intersample="zoh")
    np.testing.assert_allclose(y[:11], 0.0, atol=1e-15)


def test_several_inputs_of_different_kinds_superpose():
    rng = np.random.default_rng(1)
    u = np.vstack([np.sin(np.arange(200) * 0.05), rng.standard_normal(200), rng.standard_normal(200)])
    dens = [[1, 3, 8]] * 3
    system = mf.tf([[5], [1, 2], [3]], [1, 3, 8], delay=[0.0, 0.1, 0.033])
    kinds = ("smooth", "zoh", "foh")
    y = system.simulate(u=u, dt=0.05, initial_state=[1.0, -1.0], intersample=kinds)
    parts = [
        mf.tf(n, d, delay=late).simulate(u=v, dt=0.05, intersample=kind)
        for n, d, late, v, kind in zip([[5], [1, 2], [3]], dens, [0.0, 0.1, 0.033], u, kinds, strict=True)
    ]
    free = EQ24.simulate(u=np.zeros(200), dt=0.05, initial_state=[1.0, -1.0])
    np.testing.assert_allclose(y, sum(parts) + free, atol=1e-11)


def test_several_outputs():
    system = mf.tf([[[5], [1, 2]], [[1], None]], [1, 3, 8])
    u = np.random.default_rng(0).standard_normal((2, 100))
    y = system.simulate(u=u, dt=0.1, intersample="zoh")
    assert y.shape == (2, 100)
    np.testing.assert_allclose(
        y[1], mf.tf([1], [1, 3, 8]).simulate(u=u[0], dt=0.1, intersample="zoh"), atol=1e-12
    )


def test_time_scale_does_not_matter():
    t = np.linspace(0, 10, 257)
    slow = EQ24.simulate(u=np.sin(t**2 / 5), dt=10 / 256, initial_state=[1.0, 0.5])
    fast = mf.tf([5e18], [1, 3e9, 8e18]).simulate(
        u=np.sin(t**2 / 5), dt=10e-9 / 256, initial_state=[1.0, 0.5e9]
    )
    np.testing.assert_allclose(fast, slow, rtol=1e-9, atol=1e-12)


def test_step():
    t, y = mf.tf([2], [1, 2]).step(3.0, 300)
    np.testing.assert_allclose(y, 1 - np.exp(-2 * t), atol=1e-13)
    assert mf.tf([[[5], [1, 2]], [[1], None]], [1, 3, 8]).step(1.0, 10)[1].shape == (2, 2, 11)


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: mf.tf([1, 0, 0, 0], [1, 3, 8]), "degree 3.*denominator 2"),
        (lambda: mf.tf([1], [0, 0]), "denominator is zero"),
        (lambda: mf.tf([1], [1, 1], delay=-0.1), "not causal"),
        (lambda: mf.tf([1], [1, 1], delay=[0.1, 0.2]), "2 delays for 1 input"),
        (lambda: mf.tf([1], [1, np.nan]), "finite"),
        (lambda: mf.tf([1], [1, "x"]), "text; give real numbers"),
        (lambda: mf.tf([], [1]), "empty"),
        (lambda: mf.tf([[1], [2]], [[1, 1], [1, 2], [1, 3]]), "one per path"),
        (lambda: mf.tf("5/(s+1)"), "give num and den"),
        (lambda: mf.ss(np.eye(2), np.ones(3), np.ones((1, 2))), "must be"),
        (lambda: mf.ss([[np.inf]], [1.0], [1.0]), "finite"),
        (lambda: EQ24.simulate(u=np.ones(10), dt=0.1, initial_state=[1.0]), "2 states"),
        (lambda: EQ24.simulate(u="t", dt=0.1), "intervals=N"),
        (lambda: EQ24.simulate(u=np.ones(10), dt=0.1, intersample="linear"), "'zoh'"),
        (lambda: EQ24.simulate(u=np.ones((2, 10)), dt=0.1), "2 signal"),
        (lambda: EQ24.simulate(u=np.ones(10), dt=0.1, intersample=["zoh", "zoh"]), "2 entries for 1"),
    ],
)
def test_mistakes_in_systems(make, said):
    with pytest.raises(mf.SpecError, match=said):
        make()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: EQ24.simulate(u=np.ones(10), dt=0.0), "sampling interval"),
        (lambda: EQ24.simulate(u=np.ones(1), dt=0.1), "two samples"),
        (lambda: EQ24.simulate(u=np.array([1.0, np.nan, 0.0]), dt=0.1), "not finite|is nan"),
        (lambda: mf.tf([1], [1, -800]).simulate(u=np.ones(1001), dt=0.01), "shorter time"),
        (lambda: EQ24.step(-1.0), "duration"),
        (lambda: EQ24.frequency_response([np.nan]), "finite"),
        (lambda: mf.FrequencyResponse(omega=[1.0, 2.0], response=np.ones((2, 2))), "output, input, omega"),
    ],
)
def test_mistakes_in_numbers(make, said):
    with pytest.raises(mf.DataError, match=said):
        make()


def test_the_response_of_a_state_space_keeps_its_digits_where_it_has_fallen_by_many_powers():
    n = 8
    chain = mf.ss(np.eye(n, k=1) - np.eye(n), np.eye(n)[:, -1:], np.eye(n)[:1])  # 1/(s + 1)⁸
    omega = np.array([0.1, 1.0, 1e3])
    found = chain.frequency_response(omega).response[0, 0]
    np.testing.assert_allclose(found, (1 + 1j * omega) ** -float(n), rtol=1e-13)
    many = SchurForm(*chain.matrices).gains(omega)[:, 0, 0]
    np.testing.assert_allclose(many, found, rtol=1e-12, atol=1e-14)


# A delay per path --------------------------------------------------------------------------------

LATE = [[0.1, 0.0], [0.35, 0.2]]
PATHS = [[[1], [2, 1]], [[3], [1, 0]]]


@pytest.mark.parametrize("den", [[1, 2, 3], [[[1, 1], [1, 2, 3]], [[1, 4], [1, 0.5]]]], ids=["one", "each"])
def test_a_delay_per_path_is_that_of_paths_taken_alone(den):
    system = mf.tf(PATHS, den, delay=LATE)
    assert system.delay == ((0.1, 0.0), (0.35, 0.2))
    u = np.random.default_rng(0).standard_normal((2, 101))
    omega = np.array([0.0, 0.7, 3.0])
    y, step = system.simulate(u=u, dt=0.05, intersample="foh"), system.step(4.0, 50)[1]
    for i in range(2):
        total = 0.0
        for j in range(2):
            own = mf.tf(PATHS[i][j], den if den[0] == 1 else den[i][j], delay=LATE[i][j])
            total = total + own.simulate(u=u[j], dt=0.05, intersample="foh")
            np.testing.assert_allclose(step[i, j], own.step(4.0, 50)[1], atol=1e-12)
            np.testing.assert_allclose(
                system.frequency_response(omega).response[i, j], own.frequency_response(omega).response[0, 0]
            )
        np.testing.assert_allclose(y[i], total, atol=1e-12)
    bare = mf.tf(PATHS, den)
    assert system.order == bare.order
    np.testing.assert_array_equal(system.poles(), bare.poles())
    assert "e^(-0.35 s)" in repr(system)


def test_equal_rows_of_delays_are_delays_of_inputs():
    assert mf.tf(PATHS, [1, 2, 3], delay=[[0.1, 0.2], [0.1, 0.2]]).delays == (0.1, 0.2)


def test_an_initial_state_is_not_late():
    late, bare = mf.tf(PATHS, [1, 2, 3], delay=LATE), mf.tf(PATHS, [1, 2, 3])
    words = {"u": np.zeros((2, 50)), "dt": 0.1, "initial_state": [1.0, -0.5, 0.2, 2.0]}
    np.testing.assert_array_equal(late.simulate(**words), bare.simulate(**words))


def test_random_initial_states_have_the_sizes_of_each_output():
    late = mf.tf(PATHS, [1, 2, 3], delay=LATE)
    words = {"input": ["sin(t**2/5)", "cos(t**2/7)"], "duration": 10.0, "intervals": 200}
    from modfun.experiments.simulation import experiment

    found = experiment(late, **words).state_rms
    for i in range(2):
        own = mf.tf([PATHS[i]], [1, 2, 3], delay=LATE[i])
        np.testing.assert_allclose(found[2 * i : 2 * i + 2], experiment(own, **words).state_rms, rtol=1e-12)


def test_a_structure_holds_a_delay_per_path():
    system = mf.tf(PATHS, [1, 2, 3], delay=LATE)
    structure = mf.TransferFunction.from_system(system)
    assert structure.delay == ((0.1, 0.0), (0.35, 0.2))
    again = structure.model(structure.theta(system), inputs=2, outputs=2)
    assert again.delays == system.delays
    with pytest.raises(mf.SpecError, match="other delays"):
        mf.TransferFunction.from_system(mf.tf(PATHS, [1, 2, 3], delay=0.1)).theta(system)


@pytest.mark.parametrize("call", [mf.ss, mf.LTI.to_ss, lambda late: mf.reduce(late, 1), mf.timelag.from_fit])
def test_what_needs_a_delay_per_input_says_so(call):
    with pytest.raises(mf.SpecError, match="delays differ from output to output"):
        call(mf.tf(PATHS, [1, 2, 3], delay=LATE))


def test_a_fit_with_a_delay_per_path_has_a_model():
    truth = mf.tf([[[1, 2]], [[0.5]]], [1, 1.2, 4], delay=[[0.2], [0.5]])
    rec = mf.simulate(
        truth, input="sin(t**2/6)", duration=20.0, intervals=400, nsr=0.02, outputs=["alpha", "q"]
    )
    late = mf.TransferFunction(
        poles=2, zeros=[[1], [0]], denominator="common", delay=[[mf.Free(max=0.6)], [mf.Free(max=0.8)]]
    )
    fit = mf.fit(rec, late)
    assert fit.model.outputs == ("alpha", "q")
    np.testing.assert_allclose(fit.model.path_delays, [[0.2], [0.5]], atol=0.03)
    omega = np.array([0.5, 2.0, 4.0])
    np.testing.assert_allclose(
        fit.model.frequency_response(omega).response, fit.frequency_response(omega)[0], rtol=1e-10
    )
    for i, y in enumerate(fit.model.simulate(u=rec.u, dt=rec.dt)):
        np.testing.assert_allclose(y, fit.path_model(i).simulate(u=rec.u, dt=rec.dt), atol=1e-9)


def test_call_is_the_transfer_function_at_complex_s():
    s = np.array([[1.0, 2j], [-0.5 + 1j, 0.3 - 2j]])
    late = mf.tf([5], [1, 3, 8], delay=0.2)
    expected = 5 / (s**2 + 3 * s + 8)
    np.testing.assert_allclose(late(s), expected * np.exp(-0.2 * s), rtol=1e-13)
    np.testing.assert_allclose(EQ24.to_ss()(s), expected, rtol=1e-13)
    assert EQ24(1j) == EQ24.frequency_response([1.0]).response[0, 0, 0]
    two = mf.tf([[[5]], [[1, 2]]], [1, 3, 8])
    assert two(s).shape == (2, 1, 2, 2)
    np.testing.assert_allclose(two(s)[1, 0], (s + 2) / 5 * expected, rtol=1e-13)
    assert np.isinf(abs(mf.tf([1], [1, 1])(-1)))


def test_c2d_takes_a_fit():
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    np.testing.assert_array_equal(mf.c2d(fit, 0.1).den, mf.c2d(fit.model, 0.1).den)


def test_a_free_motion_is_written_without_inputs():
    free = mf.fit(mf.Record(y=np.cos(3 * 0.05 * np.arange(200)), dt=0.05), mf.TransferFunction(poles=2)).model
    text = free._repr_latex_()
    assert "u" not in text.replace("quad", "")
    assert r"\begin{bmatrix}  \end{bmatrix}" not in text
