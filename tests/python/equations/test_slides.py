"""Integrations slide along switches where states stay on them: dry friction, relays, comparisons."""

import warnings

import modfun as mf
import numpy as np
import pytest

T = np.arange(0, 5.0, 0.01)


@pytest.mark.parametrize("size", [1e-3, 1.0, 300.0])
@pytest.mark.parametrize("friction", ["sign(v)", "(2*step(v) - 1)", "where(v < 0, -1, 1)"])
def test_dry_friction_stops_a_block_and_holds_it(friction, size):
    # Exact: v = v0 - (fc - u) t until it stands, and stands while |u| is below fc.
    model = mf.Equation(f"v' = -fc*{friction} + u", outputs=["v"], inputs=["u"]).model({"fc": size})
    v = model.simulate(u=np.full(T.size, 0.5 * size), t=T, initial_state=[size])
    np.testing.assert_allclose(v, np.maximum(size - 0.5 * size * T, 0.0), atol=2e-6 * size)


def test_a_relay_holds_a_level():
    # Heated by 3 below 20, cooled by 1 always: it stays there, at a rate between both sides.
    model = mf.Equation("T' = -1 + where(T < c, 3, 0) + u", outputs=["T"], inputs=["u"]).model({"c": 20.0})
    temperature = model.simulate(u=np.zeros(T.size), t=T, initial_state=[16.0])
    np.testing.assert_allclose(temperature, np.minimum(16 + 2 * T, 20.0), atol=1e-4)


def test_one_state_from_several_starts_with_parameters_of_their_own():
    model = mf.Equation("v' = -fc*sign(v) + u", outputs=["v"], inputs=["u"]).model({"fc": 1.0})
    starts, friction = np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 2.0, 1.5]])
    y, _ = model.family([np.zeros(T.size)], T, starts, "zoh", params=friction)
    np.testing.assert_allclose(y[0], np.maximum(starts.T - friction.T * T, 0.0), atol=1e-5)


def test_a_fit_with_dry_friction_that_sticks_predicts_in_a_moment():
    equation = mf.Equation(["x' = v", "v' = -k*x - fc*sign(v) + u"], outputs=["x", "v"], inputs=["u"])
    t = np.arange(0, 20.0, 0.02)
    u = 2.0 * np.sin(1.5 * t) + np.sin(3.1 * t)
    rec = mf.simulate(
        equation.model({"k": 4.0, "fc": 0.8}),
        input=u,
        duration=t[-1],
        intervals=t.size - 1,
        nsr=0.01,
        seed=1,
        initial_state=[0.5, 0.0],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)  # of what noise does to signs
        fit = mf.fit(rec, equation)
    assert fit.params == pytest.approx([4.0, 0.8], rel=0.05)
    assert np.min(np.asarray(fit.score(rec)["fit_percent"])) > 95


def test_what_jumps_in_inputs_and_in_time_stays_exact():
    model = mf.Equation("y' = sign(u) + step(t - 1.005)", outputs=["y"], inputs=["u"])
    assert not model.model({}).form.slides
    assert mf.Equation("y' = -sign(y) + u").model({}).form.slides
