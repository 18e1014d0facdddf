"""Parameters that ran off: recognised by a limit that fits as well, and named once."""

import warnings

import modfun as mf
import numpy as np
import pytest
import sympy
from modfun.equations.symbolic.limits import bends, limits
from scipy.integrate import solve_ivp

T = np.linspace(0.0, 20.0, 513)


def record(rate, seed=0, nsr=0.02, start=0.2):
    """Moved by a chirp, with white noise."""
    u = np.sin(T**2 / 10)
    y = solve_ivp(lambda t, x: rate(t, x) + np.sin(t**2 / 10), (0, 20), [start], t_eval=T, rtol=1e-8).y[0]
    noise = np.random.default_rng(seed).standard_normal(T.size)
    return mf.Record(y=y + nsr * y.std() * noise, u=u, dt=T[1])


def fitted(rec, text, **words):
    """The fit and its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit = mf.fit(rec, mf.Equation(text, **words))
    return fit, [str(one.message) for one in caught]


@pytest.mark.parametrize(
    ("text", "slope", "ratio", "name"),
    [
        ("y' + a*y/(K + y) = u", 2.3, "a/K", "K"),
        ("y' + c*tanh(k*y) = u", 2.0, "c*k", "k"),
        ("y' + c*sin(k*y) = u", 1.5, "c*k", "k"),
        ("y' + c*exp(-k*y) = u + d", 1.5, "c*k", "k"),
    ],
)
def test_linear_records_determine_a_ratio(text, slope, ratio, name):
    """The limit is the truth: its one parameter within five standard errors (6e-7 a case)."""
    fit, said = fitted(record(lambda t, x: -slope * x), text)
    assert len(said) == 1, said
    assert said[0].startswith(f"fit: {name} ")
    assert f"the record only determines {ratio} = " in said[0]
    value, error = said[0].split(f"{ratio} = ")[1].split(",")[0].split(" ± ")
    assert abs(abs(float(value)) - slope) < 5 * float(error)
    assert "First fit the limit, mf.Equation(" in said[0]
    found = [doubt for doubt in fit.check() if "First fit the limit" in doubt]
    assert len(found) == 1
    assert not any("maxiter" in doubt for doubt in fit.check())


def test_limit_in_the_message_can_be_fitted():
    rec = record(lambda t, x: -2.3 * x)
    _, said = fitted(rec, "y' + a*y/(K + y) = u")
    text = said[0].split("mf.Equation('")[-1].split('mf.Equation("')[-1].split(" = 0")[0] + " = 0"
    limit, more = fitted(rec, text)
    assert limit["q"] == pytest.approx(2.3, abs=5 * limit.bse["q"])
    assert more == []


def test_what_has_died_at_once_is_left_out():
    rec = record(lambda t, x: -1.5 * x + np.exp(-40 * t))
    _, said = fitted(rec, "y' + b*y = u + c*exp(-k*t)")
    assert len(said) == 1, said
    assert "k grows beyond all bounds" in said[0]
    assert "b*y + y'" in said[0] or "y' - u + b*y" in said[0]


def test_other_amplitudes_are_no_false_alarm():
    """Records that show the curve: nothing is said of ten, at some four hundred standard errors."""
    for seed in range(10):
        fit, said = fitted(record(lambda t, x: -2 * x / (1 + x), seed, start=1.0), "y' + a*y/(K + y) = u")
        assert said == []
        assert not any("First fit the limit" in doubt for doubt in fit.check())


def test_small_linear_coefficients_are_no_runaways():
    """A coefficient that is 0 has a large relative error, and is right so."""
    fit, said = fitted(record(lambda t, x: -1.5 * x), "y' + a*y + c*y**3 = u")
    assert fit.bse["c"] > 0.4 * abs(fit["c"])
    assert said == []


@pytest.mark.parametrize(
    ("text", "name", "sign", "expected"),
    [
        ("y' + a*y/(K + y) = u", "K", 1, "y' + q*y - u"),
        ("y' + c*tanh(k*y) = u", "k", 1, "y' + c*sign(y) - u"),
        ("y' + c*tanh(y/w) = u", "w", -1, "y' - c*sign(y) - u"),
        ("y' + c*atan(k*y) = u", "k", 1, "y' + c*pi*sign(y)/2 - u"),
        ("y' + c*exp(-k*t) = u", "k", 1, "y' - u"),
        ("y' + c*(1 - cos(k*y)) = u", "k", 1, "y' + q*y**2/2 - u"),
    ],
)
def test_limits_of_equations(text, name, sign, expected):
    compiled = mf.Equation(text).compiled()
    assert bends(compiled, name)
    names = {s.name: sympy.Symbol(s.name) for expr in compiled.source for s in expr.free_symbols}
    names |= {"q": sympy.Symbol("q"), "sign": sympy.sign, "pi": sympy.pi}

    def plain(one):
        return sympy.sympify(one.replace("y'", "dy"), locals=names | {"dy": sympy.Symbol("dy")})

    found = [plain(one.texts[0].removesuffix(" = 0")) for one in limits(compiled, name, sign)]
    assert any(sympy.simplify(one - plain(expected)) == 0 for one in found), found
