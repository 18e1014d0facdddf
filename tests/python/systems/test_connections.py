"""Systems connected, sampled and written: beside frequency responses, python-control and SciPy."""

import control
import modfun as mf
import numpy as np
import pytest
from scipy import signal

S = 1j * np.array([0.3, 1.0, 2.0, 9.0])
G = mf.tf([5], [1, 3, 8])
H = mf.tf([1, 2], [1, 1], delay=0.2)
TWO = mf.tf([[[1], [2]], [[1, 0], [3]]], [1, 2, 5])
g, h = G(S), H(S)

CONNECTED = {
    "series": (lambda: G * H, g * h),
    "series of state spaces": (lambda: G.to_ss() * H, g * h),
    "gain": (lambda: np.float64(2) * G, 2 * g),
    "sum": (lambda: G + mf.tf([1], [1, 1]), g + 1 / (S + 1)),
    "sum with state space": (lambda: G.to_ss() + G, 2 * g),
    "sum of alike delays": (lambda: H + 2 * H, 3 * h),
    "difference": (lambda: 1 - G, 1 - g),
    "sign": (lambda: -G, -g),
    "quotient by a number": (lambda: G / 2, g / 2),
    "quotient": (lambda: G / mf.tf([1, 2], [1, 1]), g * (S + 1) / (S + 2)),
    "quotient with delays": (lambda: (H * H) / H, h),
    "quotient of state spaces": (lambda: G.to_ss() / mf.tf([1], [1, 3]).to_ss(), g * (S + 3)),
    "inverse": (lambda: 2 / mf.tf([1, 2], [1, 1]), 2 * (S + 1) / (S + 2)),
    "over one of python-control": (lambda: G / control.tf([1], [1, 1]), g * (S + 1)),
    "gain on the right": (lambda: G * 2, 2 * g),
    "number added on the right": (lambda: G + 3, 3 + g),
    "feedback": (lambda: G.feedback(), g / (1 + g)),
    "positive feedback": (lambda: G.feedback(G, 1), g / (1 - g * g)),
    "of python-control": (lambda: control.tf([1], [1, 1]) * G, g / (S + 1)),
}


@pytest.mark.parametrize("case", CONNECTED)
def test_connections_are_those_of_the_frequency_responses(case):
    make, wanted = CONNECTED[case]
    made = make()
    assert isinstance(made, mf.LTI)
    np.testing.assert_allclose(made(S), wanted, rtol=1e-9)


def test_several_channels_are_connected_as_matrices():
    np.testing.assert_allclose((TWO * TWO)(S), np.einsum("ijw,jkw->ikw", TWO(S), TWO(S)), rtol=1e-9)


@pytest.mark.parametrize("gain", [np.eye(2), [[0.5, 0], [1, 2]]])
def test_feedback_around_several_channels_is_a_state_space(gain):
    """python-control has none of transfer functions with several channels."""
    closed = TWO.feedback(gain)
    open_loop = np.moveaxis(TWO(S), -1, 0)
    wanted = np.linalg.solve(np.eye(2) + open_loop @ np.array(gain), open_loop)
    np.testing.assert_allclose(np.moveaxis(closed(S), -1, 0), wanted, rtol=1e-9)
    assert closed.matrices is not None


def test_systems_of_the_same_numbers_are_equal():
    assert mf.tf([5], [1, 3, 8]) == G
    assert {G: "one"}[mf.tf([10], [2, 6, 16])] == "one"
    assert G.to_ss() == mf.ss(G)
    for other in (
        mf.tf([5], [1, 3, 8], delay=0.1),
        mf.tf([5], [1, 3, 9]),
        mf.tf([0.5, 5], [1, 3, 8]),
        G.to_ss(),
        5,
    ):
        assert other != G
    assert G in [H, TWO, mf.tf([5], [1, 3, 8])]


def test_names_of_channels_stay():
    first = mf.tf(control.tf([1], [1, 1], inputs=["de"], outputs=["q"]))
    second = mf.tf(control.tf([2], [1, 2], inputs=["q"], outputs=["theta"]))
    chain = second * first
    assert (chain.inputs, chain.outputs) == (("de",), ("theta",))
    assert (2 * first).outputs == first.feedback().outputs == ("q",)
    assert (first + second).outputs is None
    level = mf.tf(control.tf([1, 2], [1, 1], inputs=["de"], outputs=["q"]))
    assert ((1 / level).inputs, (1 / level).outputs) == (("q",), ("de",))
    assert ((second / level).inputs, (second / level).outputs) == (("q",), ("theta",))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: H.feedback(), r"feedback of systems with delays \[0\.2\].*to_control\(pade=3\)"),
        (lambda: G + H, "sum of systems with delays"),
        (lambda: G.feedback(sign=2), "sign=2 must be -1"),
        (lambda: G / 0, "divisor is 0"),
        (lambda: 1 / G, "quotient of these systems is improper, with 2 zeros and 0 poles"),
        (lambda: 1 / H, r"quotient of systems with delays \[0\.0\] and \[0\.2\]"),
        (lambda: 1 / TWO, "quotient of these systems does not exist"),
        (lambda: G / "2", "divisor='2' must be a number"),
        (lambda: mf.tf([[[1]], [[1]]], [1, 1]) * TWO, "series of these systems does not exist"),
    ],
)
def test_what_cannot_be_connected_is_refused(make, words):
    with pytest.raises(mf.SpecError, match=words):
        make()


def test_without_python_control_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "control", None)
    with pytest.raises(ImportError, match=r"series of systems needs control: pip install 'modfun"):
        G * H
    assert mf.c2d(G, 0.1).dt == 0.1


def test_impulse_responses_are_those_of_scipy_and_late_by_the_delay():
    t, y = G.impulse(5.0)
    np.testing.assert_allclose(y, signal.impulse(([5], [1, 3, 8]), T=t)[1], atol=1e-13)
    t, y = mf.tf([1], [1, 1], delay=0.5).impulse(2.0, 400)
    np.testing.assert_allclose(y[t > 0.51], np.exp(0.5 - t[t > 0.51]), rtol=1e-9)
    assert not y[t < 0.49].any()
    assert TWO.impulse(1.0, 10)[1].shape == (2, 2, 11)


def test_zeros_poles_and_gain():
    made = mf.zpk([-0.5], [-1 + 2j, -1 - 2j], 3, delay=0.1)
    np.testing.assert_allclose(made(S), 3 * (S + 0.5) / ((S + 1) ** 2 + 4) * np.exp(-0.1 * S), rtol=1e-12)
    with pytest.raises(mf.SpecError, match=r"zeros=.* without its conjugate"):
        mf.zpk([1j], [-1], 1)
    with pytest.raises(mf.SpecError, match="numerator has degree 2"):
        mf.zpk([-1, -2], [-1], 1)


@pytest.mark.parametrize("method", ["zoh", "tustin"])
@pytest.mark.parametrize("system", [mf.tf([5, 1], [1, 3, 8]), TWO.to_ss()], ids=["tf", "ss"])
def test_sampling_and_back(system, method):
    sampled = mf.c2d(system, 0.1, method)
    other = control.sample_system(system.to_control(), 0.1, method)
    z = np.exp(0.7j)
    if system.matrices is None:
        assert np.polyval(sampled.num, z) / np.polyval(sampled.den, z) == pytest.approx(other(z), rel=1e-9)
    else:
        found = sampled.C @ np.linalg.inv(z * np.eye(4) - sampled.A) @ sampled.B + sampled.D
        np.testing.assert_allclose(found, other(z), rtol=1e-9)
    for given in (sampled, other):
        np.testing.assert_allclose(mf.d2c(given, method)(S), system(S), rtol=1e-8)


LATE = mf.tf([[[5], [1, 2]], [[1], [3]]], [1, 3, 8], delay=[0.3, 0.1])


@pytest.mark.parametrize("system", [H, H.to_ss(), G, LATE], ids=["tf", "ss", "none", "several inputs"])
@pytest.mark.parametrize("method", ["zoh", "tustin"])
def test_delays_of_whole_samples_are_sampled(system, method):
    sampled, plain = (mf.c2d(one, 0.1, method) for one in (system, system.without_delays()))
    for z in (np.exp(0.7j), 1.3 + 0.2j):
        late = z ** -np.round(np.asarray(system.input_delays("")) / 0.1)
        np.testing.assert_allclose(_gain(sampled, z), _gain(plain, z) * late, rtol=1e-9)


def test_a_sampled_system_responds_as_the_late_one_does():
    """To an input that a computer holds; SciPy runs the difference equation."""
    u = np.random.default_rng(0).standard_normal((2, 60))
    want = LATE.simulate(u=u, dt=0.1, intersample="zoh")
    found = signal.dlsim(mf.c2d(LATE, 0.1), u.T)[1]
    np.testing.assert_allclose(found.T, want, atol=1e-12)


@pytest.mark.parametrize("delay", [0.04, 0.2, 0.2432, 0.0])
@pytest.mark.parametrize(
    ("num", "den"), [([5], [1, 3, 8]), ([1, 2], [1, 1]), ([2], [1, 0]), ([1], [10, 1])], ids=str
)
@pytest.mark.parametrize("form", ["transfer function", "state space"])
def test_delays_between_samples_are_sampled_exactly(num, den, delay, form):
    """As a held input makes the response at the samples; a dead time is seldom a whole number of them."""
    system = mf.tf(num, den, delay=delay)
    system = system if form == "transfer function" else system.to_ss()
    u = np.random.default_rng(0).standard_normal(60)
    want = system.simulate(u=u, dt=0.1, intersample="zoh")
    sampled = mf.c2d(system, 0.1)
    assert hasattr(sampled, "num") == (form == "transfer function")
    np.testing.assert_allclose(signal.dlsim(sampled, u)[1].T, np.atleast_2d(want), atol=1e-11)


def test_several_inputs_have_delays_of_their_own_between_samples():
    system = mf.tf([[[5], [1, 2]], [[1], [3]]], [1, 3, 8], delay=[0.37, 0.1])
    u = np.random.default_rng(0).standard_normal((2, 60))
    sampled = mf.c2d(system, 0.1)
    found = signal.dlsim(sampled, u.T)[1]
    np.testing.assert_allclose(found.T, system.simulate(u=u, dt=0.1, intersample="zoh"), atol=1e-11)
    assert len(sampled.A) == len(system.to_ss().without_delays().matrices[0]) + 4 + 1


def _gain(sampled, z):
    if hasattr(sampled, "num"):
        return np.array([[np.polyval(sampled.num, z) / np.polyval(sampled.den, z)]])
    return sampled.C @ np.linalg.inv(z * np.eye(len(sampled.A)) - sampled.A) @ sampled.B + sampled.D


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: mf.c2d(H, 0.15, "foh"),
            r"delay of 0\.2 s is 1\.33333 samples of 0\.15 s.*\"zoh\", .* as 0\.2, or",
        ),
        (lambda: mf.c2d(G, 0.1, "zho"), "method='zho' .* did you mean 'zoh'"),
        (lambda: mf.c2d(G, -1), "dt=-1; give the sampling interval"),
        (lambda: mf.c2d("G", 1), "give a linear system .* not 'str'"),
        (lambda: mf.d2c(control.tf([1], [1, 0.5], 0.1)), "pole -0.5 is none of a held system"),
        (lambda: mf.d2c(G), "give a sampled system with its dt, not 'LTI'"),
    ],
)
def test_what_cannot_be_sampled_is_refused(make, words):
    with pytest.raises(mf.SpecError, match=words):
        make()


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (H, r"$$G(s) = \frac{s + 2}{s + 1} e^{-0.2 s}$$"),
        (mf.tf([1e-7], [1, 2e8]), r"$$G(s) = \frac{1 \cdot 10^{-7}}{s + 2 \cdot 10^{8}}$$"),
        (TWO, r"& \frac{2}{s^{2} + 2 s + 5} \\"),
        (G.to_ss(), r"\dot x = \begin{bmatrix} 0 & 1 \\ -8 & -3 \end{bmatrix} x"),
    ],
    ids=["delay", "powers of ten", "matrix", "state space"],
)
def test_notebooks_typeset_systems(system, words):
    assert words in system._repr_latex_()
