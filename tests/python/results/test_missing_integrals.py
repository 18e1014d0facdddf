"""What fits say of a lateral motion without its bank angle, and of records where nothing is missing."""

import modfun as mf
import numpy as np
import pytest
from flights import coloured, warned
from scipy.signal import butter, sosfilt

V, G, DT = 60.0, 9.80665, 0.02
FULL = np.array([[-0.18, 0.07, -1, G / V], [-9.5, -4.2, 1.6, 0], [4.6, -0.35, -0.75, 0], [0, 1, 0.07, 0]])
SURFACES = np.array([[0, 0.04], [-18.0, 1.2], [-0.6, -4.0], [0, 0]])
LEVEL = mf.StateSpace(
    [["Yb", 0, -1], ["Lb", "Lp", "Lr"], ["Nb", "Np", "Nr"]], [[0, "Ydr"], ["Lda", "Ldr"], ["Nda", "Ndr"]],
    states=["beta", "p", "r"], inputs=["da", "dr"],
)  # fmt: skip


def lateral(seed, *, gravity=True, pole=0.0, filtered=0):
    """Rudder and aileron move one after the other; noise has a pole, or all channels are filtered."""
    rng, t = np.random.default_rng(seed), np.arange(0, 20, DT)
    steps = np.vstack([
        2.5 * ((t > 9) - 2.0 * (t > 10.5) + 2.0 * (t > 11.5) - 2.0 * (t > 12) + (t > 12.5)),
        4.0 * ((t > 2) - 2.0 * (t > 2.7) + (t > 3.4)),
    ])  # fmt: skip
    u = np.vstack([np.ravel(mf.tf([150], [1, 25, 150]).simulate(u=own, dt=DT)) for own in steps])
    a = FULL.copy()
    if not gravity:
        a[0, 1] = a[0, 3] = 0
    plant = mf.ss(a, SURFACES, np.eye(4)[:3], np.zeros((3, 2)))
    y = plant.simulate(u=u, dt=DT, intersample="smooth", initial_state=rng.normal(0, 0.5, 4))
    y = y + np.array([[0.12], [0.2], [0.1]]) * [coloured(own, pole) for own in rng.standard_normal(y.shape)]
    rows = np.deg2rad(np.vstack([y, u]))
    if filtered:
        sos = butter(filtered, 8, fs=1 / DT, output="sos")
        rows = sosfilt(sos, np.hstack([np.repeat(rows[:, :1], 200, 1), rows]))[:, 200:]
    channels = dict(zip(("beta", "p", "r", "da", "dr"), rows, strict=True))
    outputs = {name: channels[name] for name in LEVEL.outputs}
    return mf.Record(outputs, {name: channels[name] for name in LEVEL.inputs}, dt=DT, intersample="smooth")


@pytest.mark.parametrize("seed", range(4))
def test_a_bank_angle_that_the_model_lacks_is_named(seed):
    """Noise that drives the equations was, or nothing at all where slow sensors could be as well."""
    text = warned(lateral(seed), LEVEL)[1]
    assert (
        "First try a state more that is the integral of p, x' = p, with a term in x in the equation" in text
    )
    found = float(text.split("coefficient ")[1].split(")")[0])
    assert abs(found - G / V) < 0.06


@pytest.mark.parametrize(
    "kind", [{}, {"filtered": 2}, {"filtered": 4}, {"pole": 0.9}, {"pole": 0.98}, {"pole": 0.995}], ids=str
)
def test_filters_and_coloured_sensors_are_no_missing_state(kind):
    for seed in range(3):
        assert "integral" not in warned(lateral(100 + seed, gravity=False, **kind), LEVEL)[1]
