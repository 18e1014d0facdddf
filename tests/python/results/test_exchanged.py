"""Parameters that may be exchanged: the fit says so and how to choose, unless the user has chosen."""

import re

import modfun as mf
import numpy as np
import pytest

LAGS = ["x1' = (k*u - x1)/T1", "x2' = (x1 - x2)/T2"]
SAME = "the equations are the same"


def _record(seed, **lags):
    model = mf.Equation(LAGS, outputs=["x1", "x2"]).model({"k": 2.0, "T1": 0.5, "T2": 2.0} | lags)
    both = mf.simulate(model, input="sin(t**2/20) + 0.5", duration=30.0, intervals=512, nsr=0.05, seed=seed)
    return mf.Record(y={"x2": both["x2"]}, u={"u": both["u"]}, dt=both.dt)


def _lags(**params):
    return mf.Equation(LAGS, outputs=["x2"], hidden=["x1"], params=params or None)


@pytest.mark.parametrize("seed", range(6))
def test_lags_in_a_row_may_be_exchanged_and_each_of_the_bounds_named_chooses(seed):
    rec = _record(seed)
    with pytest.warns(mf.ModfunWarning, match=SAME) as caught:
        fit = mf.fit(rec, _lags())
    text = str(caught[0].message)
    assert text.startswith(f"fit: With T1 = {fit['T2']:.4g}, T2 = {fit['T1']:.4g} {SAME}")
    assert text.endswith("takes those; or measure x1.")
    name = re.search(r"\{'(\w+)'", text)[1]
    bounds = [eval(one, {"mf": mf}) for one in re.findall(r"mf\.Free\([^)]*\)", text)]
    for given, own in zip(bounds, ("T1", "T2"), strict=True):
        chosen = mf.fit(rec, _lags(**{name: given}))  # without a warning
        assert chosen["T1"] == pytest.approx(fit[own], rel=1e-4)


@pytest.mark.parametrize(
    "given",
    [
        {"T1": mf.Free(0.4)},
        {"T1": mf.Free(max=1.0)},
        {"T2": mf.Free(2.0, sd=0.5)},
        {"T1": 0.5},
    ],
)
def test_a_start_bound_prior_or_number_of_the_user_chooses(given):
    for seed in range(3):
        assert mf.fit(_record(seed), _lags(**given))["T2"] == pytest.approx(2.0, rel=0.2)


def test_a_start_of_another_parameter_has_not_chosen():
    with pytest.warns(mf.ModfunWarning, match=SAME):
        mf.fit(_record(0), _lags(k=mf.Free(2.0)))


def test_measuring_the_other_signal_chooses():
    model = mf.Equation(LAGS, outputs=["x1", "x2"])
    rec = mf.simulate(
        model.model({"k": 2.0, "T1": 0.5, "T2": 2.0}),
        input="sin(t**2/20) + 0.5", duration=30.0, intervals=512, nsr=0.05, seed=0,
    )  # fmt: skip
    assert np.all(np.abs(mf.fit(rec, model).params - [2.0, 0.5, 2.0]) < 0.2)
