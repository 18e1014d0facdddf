"""Pauses of loggers in records at uneven times: those that lines bridge are fitted, others are to be cut."""

import modfun as mf
import numpy as np
import pytest
from modfun import DataError, Record
from modfun.records.uneven_rows import refuse_gap
from modfun.results.linear_lines import equation_lines

pytestmark = pytest.mark.filterwarnings("ignore::modfun.ModfunWarning")


PLANT = mf.StateSpace([["Za", 1], ["Ma", "Mq"]], [["Zd"], ["Md"]], states=["w", "q"], inputs=["de"])
STATES = {"Za": -1.1, "Ma": -6.0, "Mq": -1.8, "Zd": -0.1, "Md": -9.0}


def paused(seed, *pauses, slow=1.0):
    """Motion at jittering times without those in the pauses."""
    rng = np.random.default_rng(seed)
    t = 0.01 * np.arange(4001)
    w, p = rng.uniform(0.3, 5, 6) / slow, rng.uniform(0, 6, 6)
    u = np.sin(np.outer(t, w) + p).sum(axis=1)
    model = PLANT._like(A=[["Za", 1 / slow], ["Ma", "Mq"]])
    y = model.model({name: value / slow for name, value in STATES.items()}).simulate(u=u, dt=0.01)
    rows = np.unique(np.clip(np.arange(0, 4001, 4) + rng.integers(-1, 2, 1001), 0, 4000))
    rows = rows[[not any(a < x < b for a, b in pauses) for x in t[rows]]]
    y = y[:, rows] + 0.02 * y.std() * rng.normal(size=(2, rows.size))
    rec = Record(y=y, u=u[rows], t=t[rows], outputs=["w", "q"], inputs=["de"], intersample="smooth")
    return rec


@pytest.mark.parametrize("model", [PLANT, mf.TransferFunction(poles=2, zeros=1)])
def test_pauses_in_which_outputs_move_are_refused(model):
    """Each is below a tenth of the record; fits ended in 75 s, by a crash, or told of poles too many."""
    rec = paused(0, (10, 12), (20, 23), (28, 30))
    with pytest.raises(
        DataError, match=r"between t = 9\.9\d and 12\.0\d and in 2 other pauses, .*split\(gap=1\)"
    ):
        mf.fit(rec, model)
    with pytest.raises(DataError, match=r"record 1: .* between t = 9\.9\d and 11(\.0\d)?, too long"):
        mf.fit([paused(0), paused(0, (10, 11))], model)
    assert len(rec.split(gap=1)) == 4


def test_pauses_over_which_outputs_hardly_move_are_taken():
    """State spaces fitted to these are within 2.3 standard errors of the truth."""
    for seed in range(3):
        rec = paused(seed, (10, 10.7), slow=4.0)
        steps = np.diff(rec.t)
        assert steps.max() > 15 * steps.mean()
        refuse_gap("fit", rec)


def test_an_output_that_stands_still_does_not_move_in_a_pause():
    """Rounding of its mean was more than its spread."""
    t = np.r_[np.arange(0, 10, 0.04), np.arange(12, 40, 0.041)]
    refuse_gap("fit", Record(y=np.full(t.size, 0.1), t=t))


def test_steps_at_random_times_are_no_pauses():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        t = np.cumsum(rng.exponential(0.3, 1500))
        refuse_gap("fit", Record(y=np.sin(3 * t), u=np.cos(3 * t), t=t))


def test_equations_at_uneven_times_have_no_residual_lines():
    fit = mf.fit(paused(0), PLANT)
    assert equation_lines(fit) is None


def lost(seed, *gaps, quiet=False):
    """The plant at even times without the rows of the gaps; `quiet`: the input rests from 20 s on."""
    t = 0.02 * np.arange(2001)
    u = np.sin((0.5 + 0.06 * t) * t) * ((t < 20) if quiet else 1.0)
    y = PLANT.model(STATES).simulate(u=u, dt=0.02)
    y = y + 0.02 * y.std(axis=1, keepdims=True) * np.random.default_rng(seed).normal(size=y.shape)
    rows = ~np.any([(a < t) & (t < b) for a, b in gaps], axis=0)
    return Record(y=y[:, rows], u=u[rows], t=t[rows], outputs=["w", "q"], inputs=["de"], intersample="smooth")


def test_rows_lost_while_an_input_moves_are_refused():
    """Of a spline through 2 s of a sweep that were lost, estimates were 5 standard errors off."""
    rec = lost(0, (10, 12), (30, 32))
    assert rec.dt == pytest.approx(0.02)
    with pytest.raises(
        DataError, match=r"between t = 10 and 12, where the input 'de' moves.*split\(gap=0\.99\)"
    ):
        mf.fit(rec, PLANT)
    assert [piece.mask for piece in rec.split(gap=0.99)] == [None] * 3
    assert "rec.split(gap=0.99)" in str(rec.check())
    fit = mf.fit(rec.split(gap=0.99), PLANT)
    # 5 parameters in one record: beyond 3.9 in one of 2,000 records.
    assert np.max(np.abs(fit.params - list(STATES.values())) / fit.bse) < 3.9


@pytest.mark.parametrize("seed", range(3))
def test_rows_lost_at_rest_are_bridged(seed):
    fit = mf.fit(lost(seed, (25, 27), (34, 36), quiet=True), PLANT)
    assert fit.success
    assert np.max(np.abs(fit.params - list(STATES.values())) / fit.bse) < 3.9


def test_a_spline_over_lost_rows_stays_near_the_samples():
    """Slopes of noise at both ends of 5 s led it four times the range of an elevator away."""
    t = 0.02 * np.arange(3001)
    u = np.where(t < 20, np.sin(t), 0.0) + 1e-3 * np.random.default_rng(0).normal(size=t.size)
    rows = ~((t > 25) & (t < 30))
    rec = Record(y=np.sin(t)[rows], u=u[rows], t=t[rows], intersample="smooth")
    assert np.max(np.abs(rec["u"][(t > 25) & (t < 30)])) < 5e-3
