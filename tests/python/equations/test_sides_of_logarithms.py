"""Logarithms of what is negative in a record, as of epidemics known by all cases, and of parameters."""

import modfun as mf
import numpy as np
import pytest
from scipy.integrate import solve_ivp

SUSCEPTIBLE = ["C' = b*(1000 - C)*I/1000", "I' = b*(1000 - C)*I/1000 - g*I"]
TRUE = {"b": 0.5, "g": 0.2}


def _cases(seed, b=0.5, nsr=0.005):
    t = np.linspace(0, 60, 241)

    def rates(_, x):
        new = b * (1000 - x[0]) * x[1] / 1000
        return [new, new - 0.2 * x[1]]

    cases = solve_ivp(rates, (0, 60), [5.0, 5.0], t_eval=t, rtol=1e-9, atol=1e-9).y[0]
    noise = nsr * cases.std() * np.random.default_rng(seed).standard_normal(t.size)
    return mf.Record(y={"C": cases + noise}, t=t)


def _model(texts=SUSCEPTIBLE, **params):
    return mf.Equation(texts, outputs=["C"], hidden=["I"], params=params or None)


@pytest.mark.parametrize("seed", range(10))
def test_infected_are_eliminated_by_the_susceptible_that_are_left(seed):
    fit = mf.fit(_cases(seed), _model())
    for name, value in TRUE.items():
        assert abs(fit[name] - value) < 4 * fit.bse[fit.param_names.index(name)]


def test_the_start_of_a_parameter_inside_says_the_side():
    texts = [text.replace("1000", "N") for text in SUSCEPTIBLE]
    fit = mf.fit(_cases(1), _model(texts, N=mf.Free(1200.0)))
    assert abs(fit["N"] - 1000) < 4 * fit.bse[fit.param_names.index("N")] < 100


def test_records_of_one_problem_have_their_own_sides():
    """y' = a y (1 - y/2) is integrated by log(y) and log(y - 2), from either side of 2."""
    t = np.linspace(0, 5, 101)
    noise = 1e-4 * np.random.default_rng(0).standard_normal((2, t.size))
    recs = [
        mf.Record(y={"y": 2 / (1 + (2 / y0 - 1) * np.exp(-0.8 * t)) + e}, t=t)
        for y0, e in zip((0.2, 4.0), noise, strict=True)
    ]
    model = mf.Equation("y'/(y - 2) = -a*y/2", outputs="y")
    assert abs(mf.fit(recs, model)["a"] - 0.8) < 0.01


def test_noise_across_the_singularity_has_no_logarithm_and_a_window_is_named():
    rec = _cases(0, b=1.0, nsr=0.01)
    with pytest.warns(mf.ModfunWarning, match="log\\(1000 - C\\) has no value at 1 of 241 samples"):
        fit = mf.fit(rec, _model(), noise="equation")  # which no response can follow
    assert "cut the record to where 1000 - C stays above" in fit.message
    fit = mf.fit(rec, _model())
    assert np.all(np.abs(fit.params - [1.0, 0.2]) < 4 * fit.bse)


def test_a_logarithm_of_the_user_is_no_logarithm_of_negative_samples():
    rec = _cases(0)
    with pytest.warns(mf.ModfunWarning, match="log\\(-1000 \\+ C\\) has no value at 241 of 241"):
        mf.fit(rec, mf.Equation("C' = a*log(C - 1000)", outputs="C"))


@pytest.mark.parametrize("start", [1.0, 1.3])
@pytest.mark.parametrize("text", ["V*u**n/(K**n + u**n)", "V*u**n*K**(-n)/(1 + (u/K)**n)"])
def test_a_parameter_with_a_start_may_be_raised_to_another(text, start):
    """The derivative of K**n has a logarithm of K alone, which is a number once its start is put in."""
    t = np.linspace(0, 60, 241)
    u = 1.5 + 1.4 * np.sin(0.3 * t) * np.cos(0.11 * t)
    true = {"V": 2.0, "n": 2.5, "K": 1.2, "d": 0.5}
    into = 2 * u**2.5 / (1.2**2.5 + u**2.5)
    x = solve_ivp(lambda s, x: np.interp(s, t, into) - 0.5 * x, (0, 60), [0.2], t_eval=t, rtol=1e-8).y[0]
    x += 0.02 * x.std() * np.random.default_rng(0).standard_normal(t.size)
    model = mf.Equation(f"x' = {text} - d*x", outputs=["x"], inputs=["u"], params={"K": mf.Free(start)})
    fit = mf.fit(mf.Record(y={"x": x}, u={"u": u}, t=t), model)
    for name, value in true.items():
        assert abs(fit[name] - value) < 4 * fit.bse[fit.param_names.index(name)]
