"""How many fits a wrong model costs: regressions choose the changes that are worth one."""

import warnings

import modfun as mf
import numpy as np
import pytest
from flights import warned
from modfun.fitting import single
from modfun.results.worth import worth

A = [["Yb", 0.03, -0.99, "9.81/60"], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0.03, 0]]
B = [[0, "Yd"], ["La", "Ld"], ["Na", "Nd"], [0, 0]]
NAMES = ["beta", "p", "r", "phi"]


def flown(**scales):
    """A lateral motion under two doublets, 2 % noise, channels times `scales`."""
    a = [[-0.25, 0.03, -0.99, 9.81 / 60], [-12, -3, 0.9, 0], [5, -0.2, -0.6, 0], [0, 1, 0.03, 0]]
    plant = mf.ss(a, [[0, 0.05], [-8, 2], [-0.4, -3], [0, 0]], np.eye(4), np.zeros((4, 2)))
    t = 0.02 * np.arange(600)
    u = 0.1 * np.array([(1.0 * (t > s) - 2 * (t > s + 0.6) + (t > s + 1.2)) for s in (1, 5)])
    y = plant.simulate(u=u, dt=0.02, intersample="zoh")
    y = y + 0.02 * y.std(axis=1, keepdims=True) * np.random.default_rng(0).standard_normal(y.shape)
    rec = mf.Record(y=y, u=u, dt=0.02, outputs=NAMES, inputs=["da", "dr"], intersample="zoh")
    return rec.assign(**{name: size * rec[name] for name, size in scales.items()})


def lacking(name=""):
    """The model without a derivative."""
    a, b = ([[0 if entry == name else entry for entry in row] for row in matrix] for matrix in (A, B))
    return mf.StateSpace(a, b, states=NAMES, inputs=["da", "dr"])


@pytest.fixture
def fits(monkeypatch):
    """Every solution of equations, also those that take kinks out."""
    made = []

    def counted(*given, **words):
        made.append(given)
        return plain(*given, **words)

    plain = single.fit_equation
    monkeypatch.setattr(single, "fit_equation", counted)
    return made


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Nb", "a term in beta in the equation of r'"),
        ("Np", "a term in p in the equation of r'"),
        ("Lp", "a term in p in the equation of p'"),
        ("Ld", "a term in dr in the equation of p'"),
        ("Yd", "a term in dr in the equation of beta'"),
    ],
)
def test_a_missing_derivative_is_named_after_few_fits(fits, name, words):
    """Where every neighbour was fitted, a model without one of eleven derivatives took some forty fits."""
    text = warned(flown(), lacking(name))[1]
    assert f"First try {words}" in text
    assert len(fits) <= 16
    assert warned(flown(), lacking())[1] == ""


def test_the_regression_tells_what_a_fit_of_the_term_would_gain():
    """BIC falls by what one step of Gauss-Newton says, to a tenth."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)
        wrong = mf.fit(flown(), lacking("Np"))
    right = mf.fit(flown(), lacking(), band=wrong.band)
    told = worth(wrong)
    assert max(told, key=told.get) == ("term", "r", "p")
    assert told["term", "r", "p"] == pytest.approx(wrong.bic - right.bic, rel=0.1)
    assert told["late", "beta"] < 10
    assert told["drift",] < 10


def test_answers_that_several_looks_ask_for_are_found_once(fits):
    """`check` asks for the cures that the warning had, and makes no further fits for them."""
    fit, _ = warned(flown(), lacking("Ld"))
    first = len(fits)
    assert worth(fit) is worth(fit)
    fit.check()
    assert len(fits) - first <= 12


def test_a_sideslip_of_the_other_sign_is_told_by_one_fit_more(fits):
    """The fit itself does not settle; no search from smooth inputs follows, since no input acts at once."""
    fit, text = warned(flown(beta=-1.0), lacking())
    assert not fit.success
    assert "beta=-rec['beta']" in text
    assert len(fits) <= 4


def test_equations_of_several_outputs_name_the_signal_and_not_its_twin(fits):
    """p' holds beta, so that a term in it explains as much; powers are not tried where a linear term does."""
    model = mf.Equation(
        [
            "beta' = Yb*beta + 0.03*p - 0.99*r + 0.1635*phi + Yd*dr + c1",
            "p' = Lb*beta + Lp*p + Lr*r + La*da + Ld*dr + c2",
            "r' = Np*p + Nr*r + Na*da + Nd*dr + c3",
            "phi' = p + 0.03*r + c4",
        ],
        outputs=NAMES,
        inputs=["da", "dr"],
    )
    text = warned(flown(), model)[1]
    assert "First try a term in beta in equation 3 (coefficient 5)" in text
    assert len(fits) <= 20
