"""What fits say where a rudder moved and is not in the model, or not in the record."""

import modfun as mf
import numpy as np
import pytest
from flights import SHORT, warned
from flights import flown as short_period
from modfun.results.neighbours import absurd

YAW = np.array([[-0.22, 0.07, -0.998, 0.14], [-8.5, -5.6, 1.8, 0], [3.3, -0.55, -1.0, 0], [0, 1, 0.07, 0]])
MOVED = np.array([[0, 0.05], [-16.0, 1.9], [-0.6, -5.4], [0, 0]])
A = [["Yb", 0.07, -0.998, 0.14], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0.07, 0]]
B = [[0], ["Lda"], ["Nda"], [0]]
STATES = ["beta", "p", "r", "phi"]
PLAIN = mf.StateSpace(A, B, states=STATES, inputs=["da"])
WHOLE = mf.StateSpace(
    A, [[0, "Ydr"], ["Lda", "Ldr"], ["Nda", "Ndr"], [0, 0]], states=STATES, inputs=["da", "dr"]
)


def flown(seed, inputs=("da", "dr"), outputs=STATES):
    """16 s at 50 Hz: a 2-1-1 of the rudder, then a doublet of the ailerons, both behind actuators."""
    t, rng = np.arange(0, 16.001, 0.01), np.random.default_rng(seed)
    rudder = 0.07 * ((t > 1) - 2.0 * (t > 2.2) + 2.0 * (t > 2.8) - (t > 3.4))
    aileron = 0.05 * ((t > 6) - 2.0 * (t > 6.7) + (t > 7.4))
    actuator = mf.tf([1], [0.0036, 0.12, 1])
    u = np.vstack([
        np.ravel(actuator.simulate(u=own, dt=0.01, intersample="zoh")) for own in (aileron, rudder)
    ])  # fmt: skip
    y = mf.ss(YAW, MOVED, np.eye(4), np.zeros((4, 2))).simulate(u=u, dt=0.01, intersample="foh")
    y = y[:, ::2] + np.array([[0.0026], [0.007], [0.005], [0.0017]]) * rng.standard_normal((4, 801))
    rows, moves = dict(zip(STATES, y, strict=True)), dict(zip(("da", "dr"), u[:, ::2], strict=True))
    return mf.Record(
        {name: rows[name] for name in outputs},
        {name: moves[name] for name in inputs},
        dt=0.02,
        intersample="smooth",
    )


def swung(seed):
    """20 s of a lighter aircraft at 5 % noise: a 3-2-1-1 of the rudder, then doublets of the ailerons."""
    t, rng = np.arange(0, 20.001, 0.01), np.random.default_rng(seed)
    rudder = 0.052 * ((t > 1) - 2.0 * (t > 3.7) + 2.0 * (t > 5.5) - 2.0 * (t > 6.4) + (t > 7.3))
    aileron = 0.035 * ((t > 9.5) - 2.0 * (t > 10.3) + (t > 11.1) - (t > 12.5) + 2.0 * (t > 13) - (t > 13.5))
    hand = mf.tf([1], [0.0064, 0.16, 1])
    u = np.vstack([np.ravel(hand.simulate(u=own, dt=0.01, intersample="zoh")) for own in (aileron, rudder)])
    a = np.array([[-0.15, 0, -1, 0.163], [-12, -3, 1.2, 0], [3.2, -0.15, -0.45, 0], [0, 1, 0.05, 0]])
    b = np.array([[0, 0.03], [-18, 1.5], [0.4, -2.8], [0, 0]])
    y = mf.ss(a, b, np.eye(4), np.zeros((4, 2))).simulate(u=u, dt=0.01, intersample="foh")[:, ::2]
    y = y + 0.05 * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)
    return mf.Record(dict(zip(STATES, y, strict=True)), {"da": u[0, ::2]}, dt=0.02, intersample="smooth")


def test_a_rudder_in_the_record_is_named_where_a_fit_without_it_has_no_estimate():
    """It ended as "the samples cannot tell the parameters apart: hold one"."""
    fit, text = warned(flown(1), PLAIN)
    assert fit.status == "rank"
    assert "Input 'dr' is in the record and not in the model" in text
    assert text.removeprefix("fit: ") in fit.check()


def test_a_rudder_that_nobody_recorded_is_named_where_a_fit_without_it_has_no_estimate():
    fit, text = warned(flown(1, inputs=("da",)), PLAIN)
    assert fit.status == "rank"
    assert "an input that is not in the record seems to act, such as a rudder" in text
    assert "equations 2, 3" in text


def test_a_rudder_that_nobody_recorded_is_no_missing_term():
    """Without phi there is an estimate, and a term in phi was the first cure."""
    pair = [flown(seed, inputs=("da",), outputs=STATES[:3]) for seed in (1, 2)]
    fit, text = warned(pair, PLAIN.without("phi"))
    assert "an input that is not in the record seems to act, such as a rudder" in text
    assert next(iter(fit.check())) == text.removeprefix("fit: ")


@pytest.mark.parametrize("noise", ["output", "process"])
def test_a_rudder_that_nobody_recorded_is_no_turbulence(noise):
    """Of ten such records seven were said to be driven by turbulence, and with that noise none was named."""
    light = PLAIN._like(A=[["Yb", 0, -1, 0.163], A[1], A[2], [0, 1, 0.05, 0]])
    text = warned(swung(0), light, noise=noise)[1]
    assert "rest most of the time, as no turbulence does" in text
    assert "an input that is not in the record seems to act, such as a rudder" in text


def test_a_term_beyond_all_that_an_equation_holds_is_no_cure():
    """One in beta was, with the coefficient -3e141."""
    fit = mf.fit(flown(1), WHOLE)
    assert absurd(fit, ("term", "phi", "beta"), -3e9)
    assert not absurd(fit, ("term", "p", "dr"), 1e3)
    assert not absurd(fit, ("term", "1", "beta''"), -5.0)
    assert not absurd(fit, ("late", "da"), 1e9)


@pytest.mark.parametrize("scales", [{}, {"beta": 1.1}, {"p": -1.0}])
def test_a_recorded_rudder_is_not_said_to_be_missing(scales):
    for seed in (1, 2):
        rec = flown(seed)
        fit, text = warned(rec.assign(**{name: size * rec[name] for name, size in scales.items()}), WHOLE)
        assert bool(text) == bool(scales)
        assert not any("not in the record" in one for one in fit.check())


@pytest.mark.parametrize("seed", [0, 7])
def test_a_large_drift_of_both_outputs_is_no_rudder(seed):
    """The search runs off beside it, or ends without an estimate: a fit with a drift says why."""
    rec = short_period(seed)
    drift = rec.y.std(axis=1, keepdims=True) * np.linspace(0, 1, rec.t.size)
    fit, text = warned([rec.assign(**dict(zip(rec.outputs, rec.y + drift, strict=True)))], SHORT)
    assert not fit.success
    assert "rudder" not in text
    assert 'First try trend="linear"' in text
    assert ("With a drift of the outputs it settles" in text) == (fit.status == "rank")
