"""A term that equations have already, perhaps in other words, is proposed by no check."""

import modfun as mf
import numpy as np
import pytest
from modfun.results.contained import contained
from modfun.results.cures import of_written
from scipy.integrate import solve_ivp

VAN_DER_POL = mf.Equation(["x' = a*v", "v' = b*x + c*v + d*x**2*v"], outputs=["x", "v"])


def oscillator(noise, seed):
    t = np.linspace(0, 20, 1001)
    ode = {"t_eval": t, "rtol": 1e-10, "atol": 1e-12, "method": "DOP853"}
    path = solve_ivp(lambda _, x: [x[1], 1.5 * (1 - x[0] ** 2) * x[1] - x[0]], (0, 20), [2, 0], **ode).y
    size = noise * path.std(axis=1, keepdims=True)
    return mf.Record(
        y=path + size * np.random.default_rng(seed).standard_normal(path.shape), t=t, outputs=["x", "v"]
    )


@pytest.fixture(scope="module")
def fit():
    return mf.fit(oscillator(0.03, 17), VAN_DER_POL)


def test_a_product_by_another_name_is_not_proposed(fit):
    """93.1 times x**2*x', which is x**2*v by the first equation, lowered BIC by 38."""
    assert of_written(fit) is None


@pytest.mark.parametrize("term", ["x", "v", "x'", "v'", "x''", "x**2*x'"])
def test_what_other_equations_say_counts(fit, term):
    assert contained(fit, 1, term)


@pytest.mark.parametrize("term", ["x**2", "x*v", "x**3", "v**2*v'", "sin(x)", "v''"])
def test_other_terms_may_be_missing(fit, term):
    assert not contained(fit, 1, term)


def test_numbers_hold_no_place_for_a_term():
    """x' = v with the coefficient 1 may lack a part of v."""
    rec = oscillator(0.001, 1)
    model = mf.Equation(["x' = v", "v' = b*x + c*v + d*x**2*v"], outputs=["x", "v"])
    fit = mf.fit(rec, model)
    assert not contained(fit, 0, "v")
    assert contained(fit, 1, "x'")


def test_inputs_and_second_derivatives_are_read():
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.05, seed=1
    )
    fit = mf.fit(rec, mf.Equation("y'' + d*y' + a*y = b*u"))
    assert all(contained(fit, 0, term) for term in ("u", "y", "y'", "y''"))
    assert not any(contained(fit, 0, term) for term in ("u'", "y'''", "y**3", "u*y"))
