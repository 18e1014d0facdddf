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
        DataError, match=r"between 9\.9\d and 12\.0\d s and in 2 other pauses, .*split\(gap=1\)"
    ):
        mf.fit(rec, model)
    with pytest.raises(DataError, match=r"record 1: .* between 9\.9\d and 11(\.0\d)? s, too long"):
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
