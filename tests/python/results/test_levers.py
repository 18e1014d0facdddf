"""Accelerometers away from the centre of gravity are named with their levers, and those in it are not."""

import re

import modfun as mf
import numpy as np
import pytest
from modfun.results.shifts import likeliest_lever
from scipy.signal import StateSpace, lsim

SPEED, GRAVITY, DT = 60.0, 9.81, 0.02
PITCH = np.array([[-2.0, -9.0], [1.0, -1.2]]), np.array([[-12.0], [-0.15]])
LATERAL = (
    np.array([[-0.25, 0, -1, GRAVITY / SPEED], [-12, -6, 2, 0], [4, -0.4, -0.6, 0], [0, 1, 0, 0]]),
    np.array([[0, 0.06], [25, 2], [-0.8, -4.5], [0, 0]]),
)
SHORT = mf.StateSpace(
    A=[["Mq", "Ma"], [1, "Za"]],
    B=[["Md"], ["Zd"]],
    C=[[1, 0], [0, "60*Za"]],
    D=[[0], ["60*Zd"]],
    states=["q", "alpha"],
    inputs=["de"],
    outputs=["q", "az"],
)
SIDE = mf.StateSpace(
    A=[["Yb", 0, -1, GRAVITY / SPEED], ["Lb", "Lp", "Lr", 0], ["Nb", "Np", "Nr", 0], [0, 1, 0, 0]],
    B=[[0, "Yr"], ["La", "Ldr"], ["Na", "Ndr"], [0, 0]],
    C=[[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], ["60*Yb", 0, 0, 0]],
    D=[[0, 0], [0, 0], [0, 0], [0, "60*Yr"]],
    states=["beta", "p", "r", "phi"],
    inputs=["da", "dr"],
    outputs=["p", "r", "phi", "ay"],
)


def steps(size: int, *pieces: tuple[float, float, float]) -> np.ndarray:
    t = np.arange(size) * DT
    return sum((t >= start) * (t < stop) * value for start, stop, value in pieces)


def pitched(ahead: float, seed: int, nsr: float = 0.02) -> mf.Record:
    """A 3-2-1-1 of the elevator; the accelerometer is `ahead` of the centre of gravity, m."""
    a, b = PITCH
    u = steps(600, (1, 2.5, 0.05), (2.5, 3.5, -0.05), (3.5, 4, 0.05), (4, 4.5, -0.05))
    rows = [[1, 0], SPEED * a[1] - [SPEED, 0] - ahead * a[0]], [[0], SPEED * b[1] - ahead * b[0]]
    return sampled(StateSpace(a, b, *map(np.array, rows)), u[:, None], SHORT, seed, nsr)


def rolled(ahead: float, above: float, seed: int) -> mf.Record:
    """Doublets of ailerons and rudder; the accelerometer is ahead of and above the centre of gravity, m."""
    a, b = LATERAL
    da = steps(900, (1, 2, 0.03), (2, 3, -0.03), (9, 10, 0.03), (10, 10.6, -0.03))
    dr = steps(900, (5, 6, 0.05), (6, 7, -0.05), (13, 13.7, 0.05))
    c = np.vstack([np.eye(4)[1:], [SPEED * a[0, 0], 0, 0, 0] + ahead * a[2] - above * a[1]])
    d = np.vstack([np.zeros((3, 2)), SPEED * b[0] + ahead * b[2] - above * b[1]])
    return sampled(StateSpace(a, b, c, d), np.stack([da, dr], axis=1), SIDE, seed, 0.02)


def sampled(system: StateSpace, u: np.ndarray, model: mf.StateSpace, seed: int, nsr: float) -> mf.Record:
    t = np.arange(len(u)) * DT
    y = lsim(system, u, t, interp=False)[1]
    y = y + nsr * y.std(axis=0) * np.random.default_rng(seed).standard_normal(y.shape)
    outputs, inputs = dict(zip(model.outputs, y.T, strict=True)), dict(zip(model.inputs, u.T, strict=True))
    return mf.Record(y=outputs, u=inputs, dt=DT, intersample="zoh")


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("ahead", [0.25, 1.0])
def test_a_lever_is_named_with_its_length(ahead: float, seed: int) -> None:
    """Sought within bounds, for a second lever, some 6 m longer, explains such a record as well."""
    with pytest.warns(mf.ModfunWarning, match="away from the centre of gravity") as told:
        mf.fit(pitched(ahead, seed), SHORT)
    found = re.search(r"\(lever_q = (\S+)\)", str(told[0].message))
    assert found is not None
    assert float(found[1]) == pytest.approx(-ahead, abs=0.2)  # five standard errors


def test_two_levers_of_one_sensor_are_named_together() -> None:
    with pytest.warns(mf.ModfunWarning, match=r"lever_p\*p' \+ lever_r\*r'") as told:
        mf.fit(rolled(0.5, 0.1, 0), SIDE)
    found = re.search(r"lever_p = (\S+), lever_r = (\S+)\)", str(told[0].message))
    assert found is not None
    assert [float(one) for one in found.groups()] == pytest.approx([-0.1, 0.5], abs=0.02)


def test_a_sensor_in_the_centre_of_gravity_is_not_objected_to() -> None:
    """Warnings are errors here; of 20 tests at a p-value of 1e-4 one is false in 1 of 500 runs."""
    lengths = []
    for seed in range(20):
        fit = mf.fit(pitched(0.0, seed), SHORT)
        lever = likeliest_lever(fit, [("az", "q")])
        assert lever is not None
        lengths.append(lever.length / lever.error)
    assert np.mean(np.square(lengths)) == pytest.approx(1.0, abs=1.3)  # four standard errors of chi-square/20
