"""Fits of equations with nothing free, and of logarithms of what the noise makes negative."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options

REC = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.05)


@pytest.mark.parametrize(
    "model",
    [
        mf.Equation("y'' + 3*y' + 8*y = 5*u"),
        mf.Equation("y'' + a*y' + b*y = c*u", params={"a": 3, "b": 8, "c": 5}),
        mf.StateSpace([[0, 1], [-8, -3]], [0, 5], [1, 0], outputs=["y"]),
    ],
)
def test_nothing_free_is_a_fit_that_can_be_checked(model):
    """A raw ValueError before."""
    fit = mf.fit(REC, model)
    assert fit.params.size == 0
    assert fit.chi2 < 2 * fit.df_resid
    assert not [text for text in fit.check() if "missing" in text]


@pytest.mark.parametrize(
    "model",
    [
        mf.Equation("y'' + a*y' + b*y = c*u", params={"a": 2, "b": 6, "c": 4}),
        mf.StateSpace(
            [[0, 1], ["-b", "-a"]], [0, "c"], [1, 0], outputs=["y"], params={"a": 2, "b": 6, "c": 4}
        ),
    ],
)
def test_start_values_given_as_numbers_are_named(model):
    """Four wrong causes were advised: a missing term, a lag of a sensor, load, an offset."""
    with pytest.warns(mf.ModfunWarning, match="Nothing was estimated: params= fixes every") as said:
        fit = mf.fit(REC, model)
    found = list(fit.check())
    assert len(found) == 1
    assert str(said[0].message) == f"fit: {found[0]}"
    assert '"a": mf.Free(2)' in found[0]


def test_a_logarithm_is_cut_where_noise_begins():
    """An epidemic of which I alone is measured: cut where I stayed above 0, 9 of 40 fits ran away."""
    from scipy.integrate import solve_ivp

    t, b, g = np.linspace(0, 100, 201), 0.6, 0.15

    def grow(_, x):
        return [-b * x[0] * x[1], b * x[0] * x[1] - g * x[1]]

    truth = solve_ivp(grow, (0, 100), [0.95, 0.05], t_eval=t, rtol=1e-9, atol=1e-12).y[1]
    model = mf.Equation(["S' = -b*S*I", "I' = b*S*I - g*I"], outputs=["I"], hidden=["S"])
    for seed in range(4):
        noise = 0.02 * truth.std() * np.random.default_rng(seed).standard_normal(t.size)
        rec = mf.Record(y=truth + noise, dt=0.5, outputs="I")
        assert mf.fit(rec, model)["g"] == pytest.approx(g, rel=0.02)  # by its response
        message = fit_quietly((rec,), model, Options()).message
        assert "5 times its noise" in message
        start, stop = re.findall(r"window\(([\d.]+), ([\d.]+)\)", message)[0]
        cut = rec.window(float(start), float(stop))
        assert truth[round(float(stop) / 0.5)] > 3 * 0.02 * truth.std()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = mf.fit(cut, model)
        assert fit.status == "ok"
        assert abs(fit["g"] - g) < 4 * fit.bse[fit.param_names.index("g")]
