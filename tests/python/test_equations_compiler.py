"""Terms of an Equation are the equation: compared as functions of time that SymPy differentiates itself."""

import subprocess
import sys
from types import SimpleNamespace

import modfun as mf
import numpy as np
import pytest

sympy = pytest.importorskip("sympy")

from modfun.symbolic.compiled import Delayed, jet, time  # noqa: E402

t = time
D = sympy.diff
NAMES = {"h": mf.Free(0.1, min=0, max=1)}


def smooth(name, rng):
    """A positive function of time with every derivative."""
    a, b, w, v, phase = rng.uniform([0.2, 0.1, 0.7, 2.0, 0.0], [0.5, 0.2, 1.2, 3.0, 3.0])
    return 1.5 + a * sympy.sin(w * t + phase) + b * sympy.cos(v * t)


def identity(model, residuals, times=None, tries=2):
    """Σ g F p^k E against the equation as a function of time, at random instants and parameters.

    `residuals(f, p)` gives the equations as expressions in t, `times(f, p)` the multipliers.
    """
    compiled = model.compiled()
    rng = np.random.default_rng(20)
    for _ in range(tries):
        given = {name: smooth(name, rng) for name in (*compiled.outputs, *compiled.inputs)}
        p = SimpleNamespace(**{name: float(rng.uniform(0.3, 0.9)) for name in compiled.parameters})
        f = SimpleNamespace(**given)
        wanted = residuals(f, p)
        wanted = wanted if isinstance(wanted, tuple) else (wanted,)
        scale = (1,) * len(wanted) if times is None else times(f, p)
        scale = scale if isinstance(scale, tuple) else (scale,)
        made = [sympy.S.Zero] * len(wanted)
        values = {sympy.Symbol(name, real=True): value for name, value in vars(p).items()}

        def at(expr, values=values, given=given):
            expr = expr.replace(Delayed, lambda y, h: given[y.name].subs(t, t - h))
            return expr.subs({jet(name): value for name, value in given.items()}).subs(values)

        for term in compiled.terms:
            factor = 1 if term.factor is None else at(term.factor)
            own = at(term.coefficient) * factor * D(at(term.signal), t, term.order)
            made[term.equation] += own
        for instant in rng.uniform(0, 5, 3):
            for left, right, multiplier in zip(made, wanted, scale, strict=True):
                ours = float(left.subs(t, instant))
                theirs = float((sympy.sympify(right) * multiplier).subs(t, instant))
                assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-9)


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


def test_exact_equations_are_left_alone():
    """No multiplier and no product where every term is a derivative as it stands."""
    for name in ("duffing", "van der pol", "logistic", "lotka volterra", "mackey glass"):
        text, words, _ = CASES[name]
        compiled = mf.Equation(text, **words).compiled()
        assert compiled.steps == ()
        assert all(term.factor is None for term in compiled.terms)


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


def test_sympy_is_loaded_by_the_compiler_only():
    code = (
        "import sys, modfun as mf; m = mf.Equation(\"y' + a*y = u\"); assert 'sympy' not in sys.modules; "
        "m.terms(); assert 'sympy' in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
