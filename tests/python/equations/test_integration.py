"""The core's integrators and propagators against SciPy: stiff and delayed equations, uneven samples."""

import re

import modfun as mf
import numpy as np
import pytest
from modfun import _core
from modfun.signals.sources import evaluate
from oracle import integration as oracle
from places import ROOT
from scipy.integrate import DOP853, LSODA, cumulative_trapezoid
from scipy.interpolate import CubicSpline

TABLEAU = ROOT / "rust/core/integrate/tableau.rs"


def model(text, params=(), **words):
    return mf.Equation(text, **words).model(dict(params))


def test_the_coefficients_are_those_of_scipy():
    """Numbers of the constants in the source, row by row, where SciPy has them."""
    text = TABLEAU.read_text("utf-8")
    found = {
        name: [float(x) for x in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", body)]
        for name, body in re.findall(r"pub const (\w+): [^=]+= (\[.*?\]);", text, re.DOTALL)
    }
    a = np.vstack([np.hstack([DOP853.A, np.zeros((12, 4))]), np.zeros((1, 16)), DOP853.A_EXTRA])
    a[12, :12] = DOP853.B
    assert found["A"] == a[np.tril_indices(16, -1)].tolist()
    assert found["C"] == [*DOP853.C, 1.0, *DOP853.C_EXTRA]
    assert (found["FIFTH"], found["THIRD"]) == (DOP853.E5.tolist(), DOP853.E3.tolist())
    assert found["DENSE"] == DOP853.D.ravel().tolist()


def test_a_very_stiff_oscillator_is_as_accurate_as_lsoda():
    """Van der Pol, μ = 1,000, over a period and a half, beside Radau at 1e-11."""
    mu, t = 1000.0, np.linspace(0.0, 2400.0, 301)

    def slopes(_, x):
        return [x[1], mu * (1 - x[0] ** 2) * x[1] - x[0]]

    exact = oracle.stiff(slopes, [2.0, 0.0], t)[0]
    y = model("y'' - mu*(1 - y**2)*y' + y = 0", {"mu": mu}).simulate(t=t, initial_state=[2.0, 0.0])
    theirs, done = np.empty(t.size), 0
    solver = LSODA(slopes, 0.0, [2.0, 0.0], t[-1], rtol=1e-9, atol=1e-12)
    while done < t.size:
        if solver.t < t[done]:
            solver.step()
        while done < t.size and t[done] <= solver.t:
            theirs[done] = solver.dense_output()(t[done])[0] if t[done] else 2.0
            done += 1
    ours = np.abs(y - exact).max()
    assert ours < 1e-6
    assert ours < 2 * np.abs(theirs - exact).max()


def test_a_stiff_equation_keeps_up_with_an_input():
    """y' = −10⁵ (y − u) + u': y is u but for what dies out in microseconds."""
    t = np.arange(0.0, 30.1, 0.1)
    y = model("y' + k*(y - u) = u'", {"k": 1e5}).simulate(u="sin(t)", t=t, initial_state=[0.3])
    assert np.abs(y - np.sin(t))[1:].max() < 1e-8


@pytest.mark.parametrize("kind", ["zoh", "foh", "smooth"])
def test_a_delayed_equation_follows_the_method_of_steps(kind):
    t, u = np.arange(121) * 0.1, np.sin(0.7 * np.arange(121) ** 1.1)
    spline = CubicSpline(t, u)

    def drive(s, middle):
        k = int(np.clip(np.searchsorted(t, middle) - 1, 0, t.size - 2))
        return {"zoh": u[k], "foh": np.interp(s, t, u), "smooth": spline(s)}[kind]

    def slopes(s, x, past, middle):
        return np.array([x[1], drive(s, middle) - 0.5 * x[1] - 2 * x[0] - 0.7 * past[0] - 0.2 * x[0] ** 3])

    x0 = [0.5, -0.1]
    exact = oracle.delayed(slopes, x0, 0.37, t, breaks=t)[0]
    equation = model("y'' + a*y' + b*y + c*y(t - 0.37) + d*y**3 = u", dict(a=0.5, b=2.0, c=0.7, d=0.2))
    y = equation.simulate(u=u, t=t, initial_state=x0, intersample=kind)
    assert np.abs(y - exact).max() < 1e-8
    assert np.array_equal(y, equation.simulate(u=u, t=t, initial_state=x0, intersample=kind))


def test_starts_with_parameters_of_their_own_look_back_at_their_own_past():
    equation = model("y' + a*y(t - 0.5) = u", {"a": 1.0})
    t = np.arange(61) * 0.05
    both, _ = equation.family(["cos(t)"], t, np.array([[1.0, 2.0]]), "smooth", params=np.array([[1.0, 0.3]]))
    for k, (x0, a) in enumerate([(1.0, 1.0), (2.0, 0.3)]):
        alone = model("y' + a*y(t - 0.5) = u", {"a": a}).simulate(u="cos(t)", t=t, initial_state=[x0])
        assert np.abs(both[0, k] - alone).max() < 1e-8


@pytest.mark.parametrize(
    ("u", "heights"),
    [
        ("step(t - 1.0303) - 2*step(t - 2.5)", 3.0),
        ("sign(sin(7*t))", 24.0),
        ("abs(sin(3*t))", 0.1),
        ("where(t < 2.03, t, 4 - t**2)", 2.16),
        ("floor(5*t)", 26.0),
    ],
)
def test_inputs_that_jump_and_bend_anywhere_are_met(u, heights):
    """∫u by the trapezoidal rule on a grid so fine that half a step times the jumps is its error."""
    t = np.arange(0.0, 5.2, 0.25)
    fine = np.linspace(0.0, t[-1], 2_000_001)
    total = cumulative_trapezoid(evaluate(u, fine), fine, initial=0.0)
    y = model("y' = u").simulate(u=u, t=t)
    assert np.abs(y - np.interp(t, fine, total)).max() < 1.3e-6 * heights


def test_a_function_that_jumps_without_end_is_refused():
    noise = np.random.default_rng(0)
    with pytest.raises(mf.DataError, match="still jumps or bends"):
        model("y' + y = u").simulate(u=lambda t: noise.normal(size=t.shape), dt=0.1, intervals=50)


@pytest.mark.parametrize("poles", [[-1 + 2j, -1 - 2j], [-0.1 + 3j, -0.1 - 3j, -40.0, 0.0]], ids=len)
def test_uneven_samples_are_propagated_exactly(poles):
    rng = np.random.default_rng(4)
    n, t = len(poles), np.cumsum(rng.lognormal(-3, 1.5, 300))
    a = np.zeros((n, n))
    a[:-1, 1:], a[-1] = np.eye(n - 1), -np.poly(poles).real[:0:-1]
    b, c, d = rng.normal(size=(n, 2)), rng.normal(size=(2, n)), rng.normal(size=(2, 2))
    x0, u, held = rng.normal(size=n), rng.normal(size=(2, t.size)), [True, False]
    y = _core.simulate_uneven(a, b, c, d, x0, u, held, t)
    exact = oracle.uneven(a, b, c, d, x0, u, np.array(held), t)
    assert np.abs(y - exact).max() < 1e-11 * np.abs(exact).max()
