"""Orders that are compared by a fit of each candidate: uneven times, missing rows, unknown delays."""

import itertools

import modfun as mf
import numpy as np
import pytest
from scipy.linalg import expm


def held_at(t, seed, level=0.02):
    """A response to a held switching input at given times, in white noise; and the noise level."""
    rng = np.random.default_rng(seed)
    u = rng.choice([-1.0, 1.0], 31)[np.minimum(t.astype(int), 30)]
    a, b = np.array([[0, 1], [-6, -1.5]]), np.array([0, 1.0])
    x, y = np.zeros(2), np.empty(t.size)
    for k, (now, after) in enumerate(itertools.pairwise(np.append(t, t[-1] + 1))):
        y[k], steady = np.array([5, 2]) @ x, np.linalg.solve(a, -b * u[k])
        x = steady + expm(a * (after - now)) @ (x - steady)
    noise = level * np.std(y)
    return y + noise * rng.standard_normal(t.size), u, noise


@pytest.mark.parametrize("declared", [{"intersample": "zoh"}, {}])
def test_true_orders_are_found_at_uneven_times(declared):
    """What sums over the samples have too much was ten times the noise, and four poles followed it."""
    t = np.concatenate([[0], np.sort(np.random.default_rng(1).uniform(0, 30, 299)), [30]])
    y, u, level = held_at(t, 1)
    found = mf.select_order(mf.Record(y=y, u=u, t=t, **declared), poles=[2, 3], zeros=[0, 1])
    assert found.best.structure == mf.TransferFunction(poles=2, zeros=1)
    assert found.best.success
    assert found.table["residual"][1] == pytest.approx(level, rel=0.2)
    assert found.table["cost"].tolist() == [fit.cost for fit in found.fits]


def test_true_orders_are_found_where_rows_are_missing():
    """Such records, whose missing rows are masked, were refused."""
    t = np.linspace(0, 30, 301)
    kept = np.random.default_rng(3).random(301) > 0.1
    kept[[0, -1]] = True
    y, u, level = held_at(t[kept], 2)
    rec = mf.Record(y=y, u=u, t=t[kept], intersample="zoh")
    assert rec.mask is not None
    found = mf.select_order(rec, poles=range(1, 4))
    assert found.best.structure == mf.TransferFunction(poles=2, zeros=1)
    assert found.table["residual"][2] == pytest.approx(level, rel=0.2)


# Unknown delays -----------------------------------------------------------------------------------


LATE = {
    (1, 0): mf.tf([2], [1, 0.5], delay=1.3),
    (2, 0): mf.tf([1.5], [1, 1.2, 1.0], delay=0.95),
    (2, 1): mf.tf([1, 1], [1, 1.2, 1.0], delay=0.95),
}


def late(true, input, seed, level=0.03):
    rng = np.random.default_rng(seed)
    t = np.arange(301) * 0.2
    u = rng.choice([-1.0, 1.0], 31).repeat(10)[:301] if input == "switched" else (t > 10) * 1.0
    y = np.asarray(LATE[true].simulate(u=u, dt=0.2, intersample="zoh")).ravel()
    return mf.Record(y=y + level * np.std(y) * rng.standard_normal(301), u=u, dt=0.2, intersample="zoh")


@pytest.mark.parametrize("true", LATE)
@pytest.mark.parametrize("input", ["step", "switched"])
def test_order_and_delay_are_found_together(true, input):
    found = mf.select_order(late(true, input, 0), poles=range(1, 4), delay=mf.Free(min=0, max=4))
    assert (found.best.structure.poles, found.best.structure.zeros) == true
    at = found.best.param_names.index("delay")
    assert abs(found.best.params[at] - LATE[true].delays[0]) < 4 * found.best.bse[at]


def test_larger_candidates_with_free_delays_leave_no_more_than_smaller_ones():
    """A search for three poles and two zeros ended with twice the residual of two poles."""
    found = mf.select_order(late((2, 0), "switched", 0), poles=range(1, 4), delay=mf.Free(min=0, max=4))
    residual = {(row["poles"], row["zeros"]): row["residual"] for row in found.table.rows}
    for n, z in residual:
        for smaller in ((n - 1, z), (n, z - 1)):
            assert residual[n, z] < 1.05 * residual.get(smaller, np.inf)


def test_each_input_has_its_own_delay_and_some_are_known():
    rng = np.random.default_rng(5)
    u = rng.choice([-1.0, 1.0], (2, 31)).repeat(10, axis=1)[:, :301]
    plant = mf.tf([[2.0], [1.0]], [1, 1.2, 1.0], delay=[0.7, 0.2])
    y = np.asarray(plant.simulate(u=list(u), dt=0.2, intersample="zoh")).ravel()
    rec = mf.Record(y=y + 0.03 * np.std(y) * rng.standard_normal(301), u=u, dt=0.2, intersample="zoh")
    found = mf.select_order(rec, poles=range(1, 4), zeros=0, delay=[mf.Free(min=0, max=2), 0.2])
    assert found.best.order == 2
    assert found.best.params[-1] == pytest.approx(0.7, abs=0.05)


# Starts at rest beside unknown delays ---------------------------------------------------------------


def heated(seed):
    """A heater after a step of its power."""
    t = np.arange(0, 901, 2.0)
    y = 75 + 50 * (1 - np.exp(-np.maximum(t - 75, 0) / 120))
    noise = 0.3 * np.random.default_rng(seed).standard_normal(t.size)
    rec = mf.Record(y=y + noise, u=np.where(t >= 60, 40.0, 20.0), dt=2.0)
    late = mf.Free(min=0, max=60)
    return mf.select_order(rec, poles=[1, 2], zeros=0, delay=late, initial_state="rest", progress=False)


def test_a_candidate_is_stable_where_an_unstable_one_leaves_as_much():
    """An unstable one left least, and its simulation ran away: the level of the high band was 1e118."""
    found = heated(4)
    assert np.all(found.table["stable"])
    assert found.table["cost"][1] < found.table["cost"][0]
    assert found.fits[1].high_band_sigma == pytest.approx(0.3, rel=0.1)
    assert found.criterion == "calibrated_bic"
    assert found.sigma == pytest.approx(0.3, rel=0.1)
    assert np.all((found.table["p_value"] > 0.01) & (found.table["p_value"] < 0.99))
    assert found.best.structure.poles == 1


def test_a_larger_candidate_at_rest_begins_where_a_smaller_one_ends():
    """From afar it leaves 140 times as much as the smaller one; a pole three bands away 2.6 % more."""
    found = heated(17)
    assert found.table["cost"][1] < 1.03 * found.table["cost"][0]
    assert found.fits[1].records[0].t.size == 451  # without its past
