"""Bounds beside rivals and functions are those of what these know; what they return is taken by name."""

import modfun as mf
import numpy as np
import pytest
from scipy.signal import lsim

MODEL = mf.TransferFunction(poles=2, zeros=0)
TRUE = np.array([1.2, 4.0, 2.0])
T = np.arange(101) * 0.04
U = (T >= 0.5) * 1.0


def response(theta, start=(0.0, 0.0)):
    a1, a2, b0 = theta
    return lsim(([[0, 1], [-a2, -a1]], [[0], [b0]], [[1, 0]], [[0]]), U, T, X0=start, interp=False)[1]


def bound(*more):
    """Rms of the bounds in % at 5 % noise, from differences of the response, beside columns unknown, too."""
    y = response(TRUE)
    steps = 1e-5 * np.eye(3)
    rows = [(response(TRUE + step) - response(TRUE - step)) / 2e-5 for step in steps]
    information = np.linalg.inv((columns := np.array([*rows, *more])) @ columns.T)
    sigma = 0.05 * np.sqrt(np.mean(y**2))
    return np.sqrt(np.mean((100 * sigma * np.sqrt(np.diag(information))[:3] / TRUE) ** 2))


def study(**estimators):
    return mf.MonteCarlo(
        system=mf.tf([2], [1, 1.2, 4]),
        input=U,
        intersample="zoh",
        duration=4.0,
        intervals=100,
        nsr=0.05,
        replicates=4,
        seed=1,
        estimators=estimators,
    ).run(progress=False)


def from_rest(rec, rng):
    return {"a1": 1.2, "a2": 4.0, "b0": 2.0}


def with_offset(rec, rng):
    return {"a1": 1.2, "a2": 4.0, "b0": 2.0}


from_rest.initial_state = "zero"
with_offset.trend = "constant"


def test_bounds_are_those_of_what_an_estimator_knows():
    rival = mf.rivals.output_error
    res = study(
        free=rival(MODEL),
        rest=rival(MODEL, initial_state="zero"),
        both=rival(MODEL, trend="constant"),
        offset=rival(MODEL, initial_state="zero", trend="constant"),
        from_rest=from_rest,
        with_offset=with_offset,
    )
    start = [response(TRUE, state) - response(TRUE) for state in np.eye(2)]
    one = [np.ones(T.size)]
    expected = [bound(*start), bound(), bound(*start, *one), bound(*one), bound(), bound(*start, *one)]
    assert res.relative()["crlb"] == pytest.approx(expected, rel=1e-3)
    assert not res.notes


def test_a_function_that_does_not_say_what_it_knows_is_said_so():
    res = study(mine=lambda rec, rng: [1.2, 4.0, 2.0])
    assert any('f.initial_state = "zero"' in note and "'mine'" in note for note in res.notes)


def test_a_series_is_read_by_its_labels():
    pandas = pytest.importorskip("pandas")
    res = study(mine=lambda rec, rng: pandas.Series({"b0": 2.0, "a1": 1.2, "a2": 4.0}))
    assert np.abs(res.bias).max() < 1e-12
    res = study(mine=lambda rec, rng: pandas.Series([1.2, 4.0, 2.0]))
    assert np.abs(res.bias).max() < 1e-12


def test_named_parameters_of_another_fit_are_read_by_name():
    res = study(mine=lambda rec, rng: mf.fit(rec, MODEL, harmonics=12).params)
    assert np.abs(res.bias).max() < 1.0
    assert res.status["ok"].sum() == 4


def test_other_names_of_standard_errors_are_refused():
    with pytest.raises(mf.SpecError, match=r"returned a1_err; standard errors.*have the name a1_se"):
        study(mine=lambda rec, rng: {"a1": 1.2, "a2": 4.0, "b0": 2.0, "a1_err": 0.1})


@pytest.mark.parametrize("se", [np.nan, -0.1])
def test_what_is_no_standard_error_is_told(se):
    res = study(mine=lambda rec, rng: {"a1": 1.2, "a2": 4.0, "b0": 2.0, "a1_se": se})
    assert f"returned a1_se = {se}, no standard error" in str(res.messages.to_dict())
    assert res.status["ok"].sum() == 4
