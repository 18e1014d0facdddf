"""Which records of a list can tell that a channel of another one is wrong."""

import modfun as mf
import numpy as np
import pytest
from flights import warned

A = [["Yb", 0, -1, 0.16], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0.05, 0]]
B = [[0, "Ydr"], ["Lda", "Ldr"], ["Nda", "Ndr"], [0, 0]]
SIDES = mf.StateSpace(A, B, states=["beta", "p", "r", "phi"], inputs=["da", "dr"])
TRUTH = {
    "Yb": -0.15, "Ydr": 0.03, "Lb": -12.0, "Lp": -3.0, "Lr": 1.2, "Lda": -18.0, "Ldr": 1.5,
    "Nb": 3.2, "Np": -0.15, "Nr": -0.45, "Nda": 0.4, "Ndr": -2.8,
}  # fmt: skip
NOISE = np.radians(0.02)
OPEN = "dr of record 0 and dr of record 2 are of opposite signs, and two records do not tell which is wrong"


def side(seed, *, aileron=0.0, rudder=0.0, jitter=0.0):
    """A manoeuvre of these surfaces, rad, and noise of the measured rudder."""
    rng, t = np.random.default_rng(seed), np.arange(0, 14, 0.01)
    steps = [1.0 * (t > a) - 2.0 * (t > a + 0.8) + (t > a + 1.6) for a in (1.0, 6.5)]
    actuators = mf.ss(-12 * np.eye(2), 12 * np.eye(2), np.eye(2))
    u = actuators.simulate(u=[aileron * steps[1], rudder * steps[0]], dt=0.01, intersample="zoh")
    a, b = ([[TRUTH.get(x, x) for x in row] for row in matrix] for matrix in (A, B))
    start = rng.normal(0, [0.005, 0.01, 0.01, 0.02])
    y = mf.ss(a, b, np.eye(4)).simulate(u=u, dt=0.01, intersample="foh", initial_state=start)
    y, u = y[:, ::2], u[:, ::2]
    y = y + 0.05 * y.std(axis=1, keepdims=True) * rng.standard_normal(y.shape)
    u = u + [[0.01], [0.01]] + jitter * np.array([[0], [1]]) * rng.standard_normal(u.shape)
    names = zip(SIDES.outputs, y, strict=True), zip(SIDES.inputs, u, strict=True)
    return mf.Record(*map(dict, names), dt=0.02, intersample="smooth")


def three(seed, jitter=0.0):
    """Of the rudder, of the aileron, and of both."""
    return [
        side(3 * seed, rudder=0.05, jitter=jitter),
        side(3 * seed + 1, aileron=0.04, jitter=jitter),
        side(3 * seed + 2, rudder=0.05, aileron=0.04, jitter=jitter),
    ]


@pytest.mark.parametrize(("turned", "jitter", "seed"), [(2, 0.0, 0), (0, 0.0, 1), (2, NOISE, 2)])
def test_a_record_whose_rudder_stands_still_does_not_say_whose_sign_is_wrong(turned, jitter, seed):
    """Also where the sensor of the rudder has noise."""
    records = three(seed, jitter)
    records[turned] = records[turned].assign(dr=-records[turned]["dr"])
    text = warned(records, SIDES)[1]
    assert OPEN in text
    assert "(in record 1 dr moves too little to say)" in text
    assert "records[1].assign" not in text


def test_two_records_with_a_moving_rudder_outvote_the_third():
    records = [*three(4), side(20, rudder=0.05)]
    records[2] = records[2].assign(dr=-records[2]["dr"])
    text = warned(records, SIDES)[1]
    assert (
        text
        == "fit: dr of record 2 is of the opposite sign. First try records[2].assign(dr=-records[2]['dr'])."
    )


def test_lists_with_a_rudder_that_stands_still_are_right():
    assert warned(three(5), SIDES)[1] == ""
