"""Terms of an Equation are the equation: compared as functions of time that SymPy differentiates itself."""

import re
import subprocess
import sys
import time

import modfun as mf
import numpy as np
import pytest

sympy = pytest.importorskip("sympy")

from equation_identities import D, identity, sums, t, vanishes  # noqa: E402
from places import ROOT  # noqa: E402

NAMES = {"h": mf.Free(0.1, min=0, max=1)}


CASES = {
    "duffing": (
        "y'' + d*y' + a*y + b*y**3 = u",
        {},
        lambda f, p: D(f.y, t, 2) + p.d * D(f.y, t) + p.a * f.y + p.b * f.y**3 - f.u,
    ),
    "van der pol": (
        "y'' - mu*(1 - y**2)*y' + y = u",
        {},
        lambda f, p: D(f.y, t, 2) - p.mu * (1 - f.y**2) * D(f.y, t) + f.y - f.u,
    ),
    "van der pol, primed": (
        "y'' - mu*(y - y**3/3)' + y = u",
        {},
        lambda f, p: D(f.y, t, 2) - p.mu * (1 - f.y**2) * D(f.y, t) + f.y - f.u,
    ),
    "hammerstein": (
        "y'' + a1*y' + a0*y = b*(u + c2*u**2 + c3*u**3)",
        {},
        lambda f, p: (
            D(f.y, t, 2) + p.a1 * D(f.y, t) + p.a0 * f.y - p.b * (f.u + p.c2 * f.u**2 + p.c3 * f.u**3)
        ),
    ),
    "wiener": (
        "(y + g*y**3)'' + a1*(y + g*y**3)' + a0*(y + g*y**3) = b*u",
        {},
        lambda f, p: (
            D(f.y + p.g * f.y**3, t, 2)
            + p.a1 * D(f.y + p.g * f.y**3, t)
            + p.a0 * (f.y + p.g * f.y**3)
            - p.b * f.u
        ),
    ),
    "bilinear": ("y' + a*y + c*y*u = b*u", {}, lambda f, p: D(f.y, t) + p.a * f.y + (p.c * f.y - p.b) * f.u),
    "lotka volterra": (
        ["x' = a*x - b*x*z", "z' = -c*z + d*x*z"],
        {"outputs": ["x", "z"]},
        lambda f, p: (
            D(f.x, t) - p.a * f.x + p.b * f.x * f.z,
            D(f.z, t) + p.c * f.z - p.d * f.x * f.z,
        ),
    ),
    "logistic": ("y' = r*y*(1 - y/K)", {}, lambda f, p: D(f.y, t) - p.r * f.y * (1 - f.y / p.K)),
    "logistic, logarithm": (
        "(log(y))' = r - r*y/K",
        {},
        lambda f, p: D(f.y, t) / f.y - p.r + p.r * f.y / p.K,
    ),
    "pendulum": (
        "q'' + d*q' + k*sin(q) = b*de",
        {"outputs": ["q"], "inputs": ["de"]},
        lambda f, p: D(f.q, t, 2) + p.d * D(f.q, t) + p.k * sympy.sin(f.q) - p.b * f.de,
    ),
    "ship roll": (
        ["p' + d1*p + d2*p*abs(p) + k1*phi + k3*phi**3 = u", "phi' = p"],
        {"outputs": ["phi", "p"]},
        lambda f, p: (
            D(f.p, t) + p.d1 * f.p + p.d2 * f.p * abs(f.p) + p.k1 * f.phi + p.k3 * f.phi**3 - f.u,
            D(f.phi, t) - f.p,
        ),
    ),
    "quadratic drag": (
        "v' = u - k*v*abs(v)",
        {"outputs": ["v"]},
        lambda f, p: D(f.v, t) - f.u + p.k * f.v**2,
    ),
    "parabolic damping": (
        "y'' + c(t)*y' + k*y = b*u",
        {"varying": {"c": ["1", "t", "t**2"]}},
        lambda f, p: D(f.y, t, 2) + (p.c0 + p.c1 * t + p.c2 * t**2) * D(f.y, t) + p.k * f.y - p.b * f.u,
    ),
    "varying, differentiated": (
        "(c(t)*y')' + c(t)'*y = u",
        {"varying": {"c": ["1", "sin(t)"]}},
        lambda f, p: D((p.c0 + p.c1 * sympy.sin(t)) * D(f.y, t), t) + p.c1 * sympy.cos(t) * f.y - f.u,
    ),
    "delay": (
        "y' + a*y + b*y(t-h) = u",
        {"params": NAMES},
        lambda f, p: D(f.y, t) + p.a * f.y + p.b * f.y.subs(t, t - p.h) - f.u,
    ),
    "delayed derivative": (
        "y'' + a*y'(t - 0.5)*y(t - 0.5) = u(t - 0.25)",
        {},
        lambda f, p: (
            D(f.y, t, 2) + p.a * D(f.y.subs(t, t - 0.5) ** 2, t) / 2 - f.u.subs(t, t - sympy.Rational(1, 4))
        ),
    ),
    "mackey glass": (
        "y' = b*y(t-2)/(1 + y(t-2)**10) - a*y",
        {},
        lambda f, p: D(f.y, t) - p.b * f.y.subs(t, t - 2) / (1 + f.y.subs(t, t - 2) ** 10) + p.a * f.y,
    ),
    "fitzhugh nagumo": (
        ["v' = c*(v - v**3/3 + r) + u", "r' = -(v - a + b*r)/c"],
        {"outputs": ["v", "r"]},
        lambda f, p: (
            D(f.v, t) - p.c * (f.v - f.v**3 / 3 + f.r) - f.u,
            D(f.r, t) + (f.v - p.a + p.b * f.r) / p.c,
        ),
    ),
    "product of signals": (
        "y1'' + a*(y1*y2' + y1'*y2) + b*y1*y2 = u",
        {},
        lambda f, p: D(f.y1, t, 2) + p.a * D(f.y1 * f.y2, t) + p.b * f.y1 * f.y2 - f.u,
    ),
    "squares of derivatives": (
        "y*y'' + a*y'**2 + b*y = u",
        {},
        lambda f, p: f.y * D(f.y, t, 2) + p.a * D(f.y, t) ** 2 + p.b * f.y - f.u,
    ),
    "weighted square": (
        "y'' + a*y'**2*y*exp(y) = u",
        {},
        lambda f, p: D(f.y, t, 2) + p.a * D(f.y, t) ** 2 * f.y * sympy.exp(f.y) - f.u,
    ),
    "cube of a derivative": ("y'' + a*y'**3 = u", {}, lambda f, p: D(f.y, t, 2) + p.a * D(f.y, t) ** 3 - f.u),
    "two derivatives": (
        "y1'' + a*y1'*y2' + b*t*y1*y2'*u = u",
        {},
        lambda f, p: D(f.y1, t, 2) + p.a * D(f.y1, t) * D(f.y2, t) + p.b * t * f.y1 * D(f.y2, t) * f.u - f.u,
    ),
    "input times derivative": (
        "y'' + a*y' + c*y'*u = u",
        {},
        lambda f, p: D(f.y, t, 2) + p.a * D(f.y, t) + p.c * D(f.y, t) * f.u - f.u,
    ),
    "functions": (
        "y'' + (a*y*abs(y) + sin(2*y)/y + exp(-y)*y + log(y)*y**2 + sqrt(1 + 3*y) + 1/(2 + y))' = cosh(u)",
        {},
        lambda f, p: (
            D(f.y, t, 2)
            + D(
                p.a * f.y**2
                + sympy.sin(2 * f.y) / f.y
                + sympy.exp(-f.y) * f.y
                + sympy.log(f.y) * f.y**2
                + sympy.sqrt(1 + 3 * f.y)
                + 1 / (2 + f.y),
                t,
            )
            - sympy.cosh(f.u)
        ),
    ),
    "parameters in signals": (
        "(sin(k*y))'' + (y/(K + y))' + y' = a*u",
        {},
        lambda f, p: D(sympy.sin(p.k * f.y), t, 2) + D(f.y / (p.K + f.y), t) + D(f.y, t) - p.a * f.u,
    ),
    "coefficients": (
        "a**2*y' + a*b*y = u + (a - y)**2",
        {"params": {"a": mf.Free(1.0, min=0, max=5), "b": 0.5}},
        lambda f, p: p.a**2 * D(f.y, t) + p.a * f.y / 2 - f.u - (p.a - f.y) ** 2,
    ),
    "phase": (
        "y'' + k*y = a*sin(2*t + phi) + b*y*cos(y - psi)",
        {},
        lambda f, p: (
            D(f.y, t, 2) + p.k * f.y - p.a * sympy.sin(2 * t + p.phi) - p.b * f.y * sympy.cos(f.y - p.psi)
        ),
    ),
    "second derivative of D": ("D(y**2, 2) + D(y) = u", {}, lambda f, p: D(f.y**2, t, 2) + D(f.y, t) - f.u),
}


@pytest.mark.parametrize("name", CASES)
def test_terms_are_the_equation(name):
    text, words, residuals = CASES[name]
    identity(mf.Equation(text, **words), residuals)


def test_denominators_with_parameters_are_cleared():
    m = mf.Equation("y' = -V*y/(K + y)")
    identity(m, lambda f, p: D(f.y, t) + p.V * f.y / (p.K + f.y), lambda f, p: p.K + f.y)
    assert list(m.terms()["signal"]) == ["y", "y**2", "y"]
    assert "multiplied by its denominators" in str(m.explain())


def test_a_multiplier_makes_predator_and_prey_exact():
    m = mf.Equation("y*y'' - y'**2 + c*y*y' - d*y**2*y' - a*c*y**2 + a*d*y**3 = 0")
    identity(
        m,
        lambda f, p: (
            f.y * D(f.y, t, 2)
            - D(f.y, t) ** 2
            + p.c * f.y * D(f.y, t)
            - p.d * f.y**2 * D(f.y, t)
            - p.a * p.c * f.y**2
            + p.a * p.d * f.y**3
        ),
        lambda f, p: f.y**-2,
    )
    table = m.terms()
    assert list(table["signal"]) == ["log(y)", "log(y)", "y", "y", "1"]
    assert list(table["operator"]) == ["p^2", "p", "p", "1", "1"]
    assert list(table["coefficient"]) == ["1", "c", "-d", "a*d", "-a*c"]
    assert "Multiplied by y**(-2)" in str(m.explain())


MULTIPLIED = {
    "exponential": (
        "y'' + y'**2 + b*y = u",
        lambda f, p: D(f.y, t, 2) + D(f.y, t) ** 2 + p.b * f.y - f.u,
        lambda f, p: sympy.exp(f.y),
    ),
    "without parameters": (
        "y''/(1 + y**2) + b*y' = u",
        lambda f, p: D(f.y, t, 2) / (1 + f.y**2) + p.b * D(f.y, t) - f.u,
        lambda f, p: 1 + f.y**2,
    ),
    "parameters in the multiplier": (
        "(K + y)*y'' + 2*y'**2 + b*(K + y)*y' + y = (K + y)*u",
        lambda f, p: (p.K + f.y) * (D(f.y, t, 2) + p.b * D(f.y, t) - f.u) + 2 * D(f.y, t) ** 2 + f.y,
        lambda f, p: p.K + f.y,
    ),
    "two signals": (
        "y1*y2' - y2*y1' + a*y1*y2 = u",
        lambda f, p: f.y1 * D(f.y2, t) - f.y2 * D(f.y1, t) + p.a * f.y1 * f.y2 - f.u,
        lambda f, p: f.y2**-2,
    ),
    "a parameter in another signal": (
        "y*y'' - y'**2 + sin(k*y) = 0",
        lambda f, p: f.y * D(f.y, t, 2) - D(f.y, t) ** 2 + sympy.sin(p.k * f.y),
        lambda f, p: f.y**-2,
    ),
}


@pytest.mark.parametrize("name", MULTIPLIED)
def test_multipliers(name):
    text, residuals, times = MULTIPLIED[name]
    m = mf.Equation(text)
    identity(m, residuals, times)
    assert all(term.factor is None for term in m.compiled().terms)
    assert "Multiplied by" in str(m.explain())


def test_factors_of_products_have_no_parameters():
    m = mf.Equation("y'' + y'*u/(K + y) = u")
    identity(m, lambda f, p: D(f.y, t, 2) + D(f.y, t) * f.u / (p.K + f.y) - f.u, lambda f, p: p.K + f.y)
    factors = {str(term.factor) for term in m.compiled().terms if term.factor is not None}
    assert factors == {"y", "u"}
    with pytest.raises(mf.SpecError, match="hold k at a number"):
        mf.Equation("y'' + sin(k*u)*y' = u").compiled()


def test_saturation_in_a_compartment_of_two():
    """Eliminated to (K + x)² x'' + …; a multiplier with the parameter K in it spares products."""
    texts = ["x' = p1*(z - x) - V*x/(K + x) + u", "z' = p2*(x - z)"]
    m = mf.Equation(texts, outputs=["x"])
    vanishes(
        m,
        "xz",
        lambda x, u, p: (
            {"x": p.p1 * (x.z - x.x) - p.V * x.x / (p.K + x.x) + u.u, "z": p.p2 * (x.x - x.z)},
            {"x": x.x},
        ),
    )
    assert all(term.factor is None for term in m.compiled().terms)


def test_rosenfeld_and_groebner_say_the_same():
    pytest.importorskip("DifferentialAlgebra")
    from modfun.equations.equation import equations_of
    from modfun.equations.symbolic.elimination import eliminate
    from modfun.equations.symbolic.rosenfeld import rosenfeld

    for name in ("prey only", "fitzhugh nagumo, v only", "four compartments"):
        text, words, _, _ = HIDDEN[name]
        system = equations_of(mf.Equation(text, **words))
        (theirs,) = rosenfeld(system.equations, system.hidden, system.outputs, system.moving)
        (ours,), _ = eliminate(system.equations, system.hidden, system.moving)
        assert sympy.cancel(theirs / ours).is_number


def test_exact_equations_are_left_alone():
    """No multiplier and no product where every term is a derivative as it stands."""
    for name in ("duffing", "van der pol", "logistic", "lotka volterra", "mackey glass"):
        text, words, _ = CASES[name]
        compiled = mf.Equation(text, **words).compiled()
        assert compiled.steps == ()
        assert all(term.factor is None for term in compiled.terms)


def test_parameters_leave_signals_where_they_can():
    text, words, _ = CASES["phase"]
    signals = {str(term.signal) for term in mf.Equation(text, **words).compiled().terms}
    assert signals == {"y", "sin(2*t)", "cos(2*t)", "y*cos(y)", "y*sin(y)"}


def test_products_stand_only_where_nothing_is_exact():
    compiled = mf.Equation("y'' + a*y' + c*y'*u = u").compiled()
    assert [(str(x.factor), x.order) for x in compiled.terms if x.factor is not None] == [("u", 1)]


def test_callables_and_samples_as_coefficients():
    instants = np.linspace(0, 2, 101)
    m = mf.Equation("y'' + c(t)*y' = u", varying={"c": ["1", np.sin, np.sin(instants)]})
    compiled = m.compiled()
    assert compiled.parameters == ("c0", "c1", "c2")
    names = sorted(s.name for s in compiled.known)
    assert names == ["c1(t)", "c1(t)'", "c2(t)", "c2(t)'"]
    for symbol, function in compiled.known.items():
        wanted = np.cos(instants) if "'" in symbol.name else np.sin(instants)
        np.testing.assert_allclose(function(instants), wanted, atol=1e-7)
    assert [name for name, _ in compiled.varying["c"]] == ["c0", "c1", "c2"]
    with pytest.raises(mf.DataError, match="101 samples, and the record has 3 instants"):
        compiled.known[sympy.Symbol("c2(t)", real=True)](np.zeros(3))


def test_a_scale_of_its_own_is_given_where_every_term_has_parameters():
    m = mf.Equation("a*y' + b*y + c*u = 0")
    assert "Divided by a," in str(m.explain())
    identity(m, lambda f, p: p.a * D(f.y, t) + p.b * f.y + p.c * f.u, lambda f, p: 1 / p.a)


HIDDEN = {
    "prey only": (
        ["x' = a*x - b*x*z", "z' = -c*z + d*x*z"],
        {"outputs": ["x"]},
        "xz",
        lambda x, u, p: ({"x": p.a * x.x - p.b * x.x * x.z, "z": -p.c * x.z + p.d * x.x * x.z}, {"x": x.x}),
    ),
    "fitzhugh nagumo, v only": (
        ["v' = c*(v - v**3/3 + r) + u", "r' = -(v - a + b*r)/c"],
        {"outputs": ["v"]},
        "vr",
        lambda x, u, p: (
            {"v": p.c * (x.v - x.v**3 / 3 + x.r) + u.u, "r": -(x.v - p.a + p.b * x.r) / p.c},
            {"v": x.v},
        ),
    ),
    # After Chin and Lan: the normal force lags behind the angle of attack by one state of the flow.
    "unsteady aerodynamics": (
        [
            "alpha' = q - La*alpha - Lw*w",
            "q' = Ma*alpha + Mq*q + Mw*w + Md*de",
            "w' = -b*w + c*alpha' + c2*alpha**2",
        ],
        {"outputs": ["alpha", "q"], "inputs": ["de"]},
        ["alpha", "q", "w"],
        lambda x, u, p: (
            {
                "alpha": (own := x.q - p.La * x.alpha - p.Lw * x.w),
                "q": p.Ma * x.alpha + p.Mq * x.q + p.Mw * x.w + p.Md * u.de,
                "w": -p.b * x.w + p.c * own + p.c2 * x.alpha**2,
            },
            {"alpha": x.alpha, "q": x.q},
        ),
    ),
    "infected only": (
        ["S' = -b*S*I", "I' = b*S*I - g*I"],
        {"outputs": ["I"]},
        "SI",
        lambda x, u, p: ({"S": -p.b * x.S * x.I, "I": p.b * x.S * x.I - p.g * x.I}, {"I": x.I}),
    ),
    "second tank only": (
        ["h1' = -k1*sqrt(h1) + k2*u", "h2' = k1*sqrt(h1) - k3*sqrt(h2)"],
        {"outputs": ["h2"]},
        ["h1", "h2"],
        lambda x, u, p: (
            {
                "h1": -p.k1 * sympy.sqrt(x.h1) + p.k2 * u.u,
                "h2": p.k1 * sympy.sqrt(x.h1) - p.k3 * sympy.sqrt(x.h2),
            },
            {"h2": x.h2},
        ),
    ),
    "four compartments": (
        ["x1' = -k1*x1 + k2*u", "x2' = k1*x1 - k3*x2", "x3' = k3*x2 - k4*x3", "x4' = k4*x3 - k5*x4"],
        {"outputs": ["x4"]},
        ["x1", "x2", "x3", "x4"],
        lambda x, u, p: (
            {
                "x1": -p.k1 * x.x1 + p.k2 * u.u,
                "x2": p.k1 * x.x1 - p.k3 * x.x2,
                "x3": p.k3 * x.x2 - p.k4 * x.x3,
                "x4": p.k4 * x.x3 - p.k5 * x.x4,
            },
            {"x4": x.x4},
        ),
    ),
    "a state with time in it": (
        ["y' = z*(t - 1) + z'", "z' = -a*z + u"],
        {},
        "yz",
        lambda x, u, p: (
            {"y": x.z * (t - 1) - p.a * x.z + u.u, "z": -p.a * x.z + u.u},
            {"y": x.y},
        ),
    ),
    "lorenz without w": (
        ["x' = s*(z - x)", "z' = x*(r - w) - z", "w' = x*z - b*w"],
        {"outputs": ["x", "z"]},
        "xzw",
        lambda x, u, p: (
            {"x": p.s * (x.z - x.x), "z": x.x * (p.r - x.w) - x.z, "w": x.x * x.z - p.b * x.w},
            {"x": x.x, "z": x.z},
        ),
    ),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_hidden_signals_are_eliminated(name):
    text, words, states, motion = HIDDEN[name]
    m = mf.Equation(text, **words)
    vanishes(m, states, motion)
    assert len(m.compiled().source) == len(text)
    assert "was eliminated" in str(m.explain())


def test_the_prey_alone_has_the_signals_of_theory():
    m = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x"])
    table = m.terms()
    assert set(table["signal"]) == {"log(x)", "x", "1"}
    assert m.compiled().parameters == ("a", "c", "d")
    assert m.compiled().hidden == ("z",)


def test_without_hides_an_output():
    full = mf.Equation(["x' = a*x - b*x*z", "z' = -c*z + d*x*z"], outputs=["x", "z"])
    assert full.without("z") == mf.Equation(full.texts, outputs=["x"], hidden=["z"])
    with pytest.raises(mf.SpecError, match="no output is left"):
        full.without("x", "z")
    with pytest.raises(mf.SpecError, match="'w' is not an output"):
        full.without("w")


def test_delayed_hidden_signals():
    m = mf.Equation(["y' + a*y = z(t - 1)", "z' + b*z = u"])
    compiled = m.compiled()
    rng = np.random.default_rng(3)
    z = sum(float(c) * t**k for k, c in enumerate(rng.uniform(0.5, 1, 6)))
    values = {"a": 0.7, "b": 0.4}
    late = sympy.expand(z.subs(t, t - 1))
    y = sum(sympy.S(-1) ** k * D(late, t, k) / sympy.Float(0.7) ** (k + 1) for k in range(6))
    given = {"y": y, "u": D(z, t) + 0.4 * z}
    (left,) = sums(compiled, given, values)
    assert float(left.subs(t, 0.3)) == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize(
    ("texts", "words", "why"),
    [
        (["y' = sin(z)", "z' = -a*z + u"], {}, "no equation can be solved for z"),
        (["y' = -a*y + u", "z' = y"], {}, "z is not measured and stands in one equation only"),
        (["y' = z", "z' = y(t-1)*z(t-1)"], {}, "z is not measured and stands at several times"),
        (["y' = z**2", "z' = u - z"], {}, "y''"),
    ],
)
def test_elimination_that_fails_says_why(texts, words, why):
    with pytest.raises(mf.SpecError, match=why):
        mf.Equation(texts, **words).compiled()


def test_elimination_gives_up_in_time():
    start = time.monotonic()
    rows = [f"x{k}' = x{k - 1}*x{k + 1} + a{k}*x{k}**3 + x1*x2*x3" for k in range(2, 7)]
    with pytest.raises(mf.SpecError, match=r"not measured.*beyond what is tried"):
        mf.Equation(["x1' = x2*x3 + x6", *rows, "x7' = x1*x6"], outputs=["x1"]).compiled()
    assert time.monotonic() - start < 60


@pytest.mark.parametrize(
    ("text", "term"),
    [
        ("y'' + a*abs(y')*y' = u", "y'*abs(y')"),
        ("y' = sin(y')", "sin(y')"),
        ("y*y''**2 + y = u", "y*y''**2"),
        ("1/y' + y = u", "1/y'"),
    ],
)
def test_terms_outside_the_class_are_named_with_the_cure(text, term):
    with pytest.raises(mf.SpecError, match="measure y'") as caught:
        mf.Equation(text).compiled()
    assert term in str(caught.value)


def test_channels_of_a_record_are_matched_by_name():
    m = mf.Equation("y' + a*y = u")
    assert m.compiled(["y"], ["u", "v"]).inputs == ("u", "v")
    with pytest.raises(mf.SpecError, match=r"outputs=\['q'\]"):
        m.compiled(["q"], ["u"])
    with pytest.raises(mf.SpecError, match=r"rec.select\(outputs=\['y'\]\)"):
        m.compiled(["y", "q"], ["u"])
    with pytest.raises(mf.SpecError, match="has the input 'u'"):
        m.compiled(["y"], [])
    with pytest.raises(mf.SpecError, match="among the inputs of the model"):
        m.compiled(["y", "u"], ["v"])


@pytest.mark.process
def test_sympy_is_loaded_by_the_compiler_only():
    code = (
        "import sys, modfun as mf; m = mf.Equation(\"y' + a*y = u\"); assert 'sympy' not in sys.modules; "
        "m.terms(); assert 'sympy' in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_equal_equations_are_compiled_once():
    text = "y'' + zeta*y' + y + kappa*y**5 = u"
    first = mf.Equation(text).compiled()
    assert mf.Equation(text).compiled(["y"], ["v", "u"]).terms is first.terms


def test_the_page_shows_what_is_printed(capsys):
    """docs/equations.md: each block of text is what the Python before it prints."""
    page = (ROOT / "docs" / "equations.md").read_text("utf-8")
    shown = re.findall(r"```python\n(.*?)```\n\n```text\n(.*?)```", page, re.DOTALL)
    assert len(shown) > 4
    for code, text in shown:
        exec(code, {"__name__": "__main__"})
        assert capsys.readouterr().out == text
