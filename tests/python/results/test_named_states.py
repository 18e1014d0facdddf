"""Initial states that are given by the names of the states."""

import modfun as mf
import numpy as np
import pytest

PENDULUM = mf.Equation("th'' + d*th' + w2*sin(th) = b*u")
START = {"th'": -0.4, "th": 0.3}  # not in the order of the states


@pytest.fixture(scope="module")
def fit():
    model = PENDULUM.model({"d": 0.5, "w2": 9.0, "b": 2.0})
    rec = mf.simulate(model, input="sin(2*t)", duration=10.0, intervals=400, nsr=0.05, seed=1)
    return mf.fit(rec, PENDULUM)


def test_of_equations_in_simulations_and_predictions(fit):
    rec = fit.records[0]
    named = fit.predict(rec, initial_state=START).y
    np.testing.assert_array_equal(named, fit.predict(rec, initial_state=[0.3, -0.4]).y)
    assert abs(named[0, 0] - 0.3) < 1e-12
    args = {"input": "sin(2*t)", "duration": 2.0, "intervals": 100}
    both = [mf.simulate(fit.model, initial_state=s, **args).y for s in (START, [0.3, -0.4])]
    np.testing.assert_array_equal(*both)
    u = np.sin(np.arange(50) / 25)
    both = [fit.model.simulate(u=u, dt=0.02, initial_state=s) for s in (START, [0.3, -0.4])]
    np.testing.assert_array_equal(*both)


def test_of_transfer_functions():
    rec = mf.simulate(mf.tf([4], [1, 1, 4]), input="sin(t**2/5)", duration=10, intervals=256, nsr=0.1, seed=2)
    fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
    named = fit.predict(rec, initial_state={"y'": 1.0, "y": 0.5}).y
    np.testing.assert_array_equal(named, fit.predict(rec, initial_state=[0.5, 1.0]).y)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"th": 0.3}, "initial_state has no value of th'; give one of each"),
        ({"th": 0.3, "dth": 1.0}, "initial_state names 'dth'; "),
    ],
)
def test_names_that_do_not_fit_are_said(fit, given, said):
    with pytest.raises(mf.SpecError, match=said):
        fit.predict(fit.records[0], initial_state=given)
    with pytest.raises(mf.SpecError, match=said):
        fit.model.simulate(u=np.zeros(20), dt=0.1, initial_state=given)
