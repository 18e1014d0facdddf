"""Signs that equations without their hidden signals leave open are those with which they can be simulated."""

from dataclasses import replace

import modfun as mf
import numpy as np
import pytest
from modfun.equations.symbolic.twins import flips
from modfun.fitting.signs import signed
from modfun.fitting.single import fit_quietly
from modfun.models.options import Options
from scipy.integrate import solve_ivp

TANKS = ["x1' = k*u - a*sqrt(x1)", "x2' = a*sqrt(x1) - b*sqrt(x2)"]
TRUTH = {"k": 0.5, "a": 0.6, "b": 0.7}


def _levels(seed, texts=TANKS, truth=TRUTH):
    both = mf.Equation(texts, outputs=["x1", "x2"]).model(truth)
    u = "3 + sin(0.25*t) + sin(0.43*t + 1)"
    seen = mf.simulate(both, input=u, duration=100.0, intervals=128, initial_state=[3.0, 2.0])
    noise = 0.001 * np.random.default_rng(seed).normal(size=seen.t.size)
    return mf.Record(y={"x2": seen["x2"] + noise}, u={"u": seen["u"]}, dt=seen.dt)


def _tanks(texts=TANKS, **params):
    return mf.Equation(texts, outputs=["x2"], hidden=["x1"], params=params or None)


def _fitted(rec, model):
    return fit_quietly((rec,), model, Options.checked("fit"))  # without looks at what products amplify


def test_the_root_of_a_hidden_level_has_the_sign_with_which_the_tanks_can_be_simulated():
    fit = _fitted(_levels(0), _tanks())
    for name, value in TRUTH.items():
        assert abs(fit[name] - value) < 0.05 * value
    turned = signed(replace(fit, params=fit.params * [1.0, -1.0, 1.0]))
    np.testing.assert_array_equal(turned.params, fit.params)


def test_the_sign_turns_the_covariances_along():
    fit = _fitted(_levels(1), _tanks())
    signs = np.array([1.0, -1.0, 1.0])
    other = replace(fit, params=fit.params * signs, cov_nonrobust=fit.cov_nonrobust * np.outer(signs, signs))
    np.testing.assert_array_equal(signed(other).cov_nonrobust, fit.cov_nonrobust)


def test_a_factor_that_is_negative_stays_so():
    texts = ["x1' = k*u + a*sqrt(x1)", "x2' = -a*sqrt(x1) - b*sqrt(x2)"]
    fit = _fitted(_levels(2, texts, TRUTH | {"a": -0.6}), _tanks(texts))
    assert abs(fit["a"] + 0.6) < 0.03


def test_bounds_and_starts_of_a_user_decide_first():
    assert _fitted(_levels(3), _tanks(a=mf.Free(max=0.0)))["a"] < 0.0


def test_many_records_have_the_same_sign():
    found = mf.fit_many([_levels(seed) for seed in range(2)], _tanks())
    np.testing.assert_allclose(found.params[:, 1], 0.6, rtol=0.05)


@pytest.mark.parametrize(("text", "count"), [(TANKS, 1), (["x1' = u - k*x1", "x2' = a*x1 - b*x2"], 0)])
def test_signs_are_open_where_all_coefficients_are_even(text, count):
    compiled = _tanks(text).compiled(("x2",), ("u",))
    assert len(flips(compiled, np.array([0.5, 0.6, 0.7]))) == count


@pytest.mark.parametrize("start", [None, 0.0])
def test_the_offset_of_an_angle_is_within_half_a_turn(start):
    """It was 6.323 of 0.04, and a warning listed 25.17, -3.102 and 9.465; from a start once k was -28."""
    t = np.arange(0, 10, 0.02)
    th = solve_ivp(
        lambda _, x: [x[1], -0.2 * x[1] - 28 * np.sin(x[0])], (0, 10), [0.8, 0], t_eval=t, rtol=1e-9
    ).y[0]
    params = {} if start is None else {"o": mf.Free(start)}
    model = mf.Equation("th'' + d*th' + k*sin(th - o) = 0", outputs=["th"], params=params)
    for seed in range(3):
        noise = 0.005 * np.random.default_rng(seed).standard_normal(t.size)
        fit = mf.fit(mf.Record(y=th + 0.04 + noise, dt=0.02, outputs="th"), model)
        assert fit["o"] == pytest.approx(0.04, abs=0.005)
        assert fit["k"] == pytest.approx(28, rel=0.01)


def test_the_search_for_other_parameters_is_silent_where_a_logarithm_has_none():
    """Growth by Gompertz's law printed "invalid value encountered in log" at each fit."""
    t = np.linspace(0, 24, 41)
    y = 1.5 * np.exp(np.log(0.05 / 1.5) * np.exp(-0.25 * t))
    y += 0.03 * np.random.default_rng(0).standard_normal(t.size)
    bounded = {"r": mf.Free(0.3, min=0), "K": mf.Free(1, min=0.01)}
    fit = mf.fit(mf.Record(y={"y": y}, t=t), mf.Equation("y' = r*y*log(K/y)", params=bounded))
    assert fit["K"] == pytest.approx(1.5, rel=0.1)
