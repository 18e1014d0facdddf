"""Output error of dry friction: the cure that checks print, and kinks of the response."""

import warnings

import modfun as mf
import numpy as np
import pytest

TRUTH = {"b": 2.0, "c": 5.0, "a": 30.0}
MOTOR = mf.Equation("w' + b*w + c*sign(w) = a*u", outputs=["w"], inputs=["u"])


def motor(u, seed, start):
    rec = mf.simulate(
        MOTOR.model(TRUTH),
        input=u,
        duration=0.01 * (u.size - 1),
        intervals=u.size - 1,
        intersample="zoh",
        nsr=0.03,
        seed=seed,
        initial_state=[start],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.ModfunWarning)  # of what noise does to signs
        return mf.fit(rec, MOTOR), rec


def errors(found):
    return np.array([(found.params[name] - value) / found.bse[name] for name, value in TRUTH.items()])


@pytest.mark.parametrize("start", [0.5, 3.0])
def test_the_printed_cure_of_dry_friction_runs(start):
    fit, rec = motor(np.repeat(np.tile([-1.0, 1.0], 8), 60)[:900], 0, start)
    words = next(text for text in fit.check() if "output_error" in text)
    cure = words[words.index("mf.rivals") : words.rindex(".")]
    found = eval(cure, {"mf": mf, "fit": fit, "rec": rec, "dict": dict, "zip": zip})
    assert found.pieces == 1
    assert np.abs(errors(found)).max() < 3


def test_estimates_on_a_kink_of_the_response_settle():
    # The likeliest initial speed is zero, where the motor turns at once: steps down either side end beyond.
    u = np.repeat(np.random.default_rng(18).uniform(-1, 1, 25), 60)
    fit, rec = motor(u, 18, 0.0)
    found = mf.rivals.output_error(MOTOR, start=dict(zip(fit.param_names, fit.params, strict=True))).solve(
        rec
    )
    assert found.pieces == 1
    assert abs(found.initial_states[0][0]) < 1e-4
    assert np.abs(errors(found)).max() < 3
