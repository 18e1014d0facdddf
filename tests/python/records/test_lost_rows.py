"""Rows that a logger lost: times on a grid but for a few make an even record with a mask."""

import pickle
import warnings

import modfun as mf
import numpy as np
import pytest
from modfun import Record, read

N, DT = 512, 20 / 512
T = DT * np.arange(N + 1)
PLANT = mf.tf([5], [1, 3, 8])
MODEL = mf.TransferFunction(poles=2, zeros=0)
STAIRS = np.repeat(np.random.default_rng(5).standard_normal(N // 8 + 1), 8)[: N + 1]


def complete(u=None, intersample="smooth"):
    """A noisy record without gaps."""
    u = np.sin(T**2 / 5) if u is None else u
    y = PLANT.simulate(u=u, dt=DT, intersample=intersample).ravel()
    return y + 0.05 * y.std() * np.random.default_rng(1).standard_normal(N + 1), u


def kept(*gaps):
    """True but in gaps (first row, rows)."""
    there = np.ones(N + 1, bool)
    for first, rows in gaps:
        there[first : first + rows] = False
    return there


SINGLE = kept(*((row, 1) for row in (20, 77, 78, 140, 205, 301, 302, 303, 411, 480)))


@pytest.mark.parametrize("there", [SINGLE, kept((200, 10)), kept((200, 45), (400, 20))])
@pytest.mark.parametrize("decimals", [16, 4, 3])
def test_lost_rows_are_masked(there, decimals):
    y, u = complete()
    t = (100 + T).round(decimals)
    rec = Record(y=y[there], u=u[there], t=t[there], intersample="smooth", keep={"on": 1.0 * (T > 5)[there]})
    assert rec.intervals == N
    assert rec.dt == pytest.approx(DT, rel=1e-4)
    assert np.array_equal(rec.mask[0], there)
    assert np.array_equal(rec.y[0, there], y[there])
    assert np.array_equal(rec.u[0, there], u[there])
    assert np.abs(rec.u[0] - u).max() < (2e-3 if there is SINGLE else 2)
    assert set(np.unique(rec["on"])) == {0.0, 1.0}
    lost = int((~there).sum())
    assert f"{lost} of them missing" in repr(rec)
    assert f"{lost} rows of {N + 1} are missing" in str(rec.check())
    assert "masked, " not in str(rec.check())  # said once
    again = pickle.loads(pickle.dumps(rec))
    assert again == rec
    assert f"{lost} of them missing" in repr(again)
    assert "missing" not in repr(rec.window(100 + 0.0, 100 + 0.7))


def test_ten_rows_in_a_row_do_not_ruin_a_fit():
    """Of an uneven record the estimates were 4 to 8 standard errors off."""
    there = kept((200, 10))
    y, u = complete()
    fit = mf.fit(Record(y=y[there], u=u[there], t=T[there]), MODEL)
    best = mf.fit(Record(y=y, u=u, dt=DT), MODEL)
    assert np.max(np.abs(fit.params - best.params) / best.bse) < 1.0
    # The chirp passes the mode in the gap, so that a little is lost for good.
    assert np.max(np.diag(fit.cov_nonrobust) / np.diag(best.cov_nonrobust)) < 1.5


def test_held_inputs_hold_through_a_gap_and_sigma_follows():
    y, u = complete(STAIRS, "zoh")
    there = kept((101, 3), (243, 1))
    sigma = 1 + T
    rec = Record(y=[y[there]] * 2, u=u[there], t=T[there], sigma=sigma[there])
    assert rec.intersample == ("zoh",)
    assert np.array_equal(
        rec.u[0], np.where(there, u, u[np.maximum.accumulate(np.where(there, np.arange(N + 1), 0))])
    )
    assert np.allclose(rec.sigma, sigma)
    own = Record(y=y[there], t=T[there], mask=(T > 1)[there])
    assert np.array_equal(own.mask[0], there & (T > 1))


def test_files_and_frames(tmp_path):
    pandas = pytest.importorskip("pandas")
    y, u = complete()
    frame = pandas.DataFrame({"t": T.round(5), "y": y, "u": u})[SINGLE]
    frame.to_csv(tmp_path / "run.csv", index=False)
    for source in (frame, tmp_path / "run.csv"):
        rec = read(source, outputs="y", inputs="u", intersample="smooth")
        assert np.array_equal(rec.mask[0], SINGLE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mf.fit(rec, MODEL)
    back = rec.to_pandas()
    assert np.array_equal(read(back).mask, rec.mask)
    assert read(back.dropna()).intervals == N  # once more without the rows


@pytest.mark.parametrize(
    "there",
    [
        kept((200, 60)),
        kept(*((row, 1) for row in range(3, 500, 4))),
        kept(*((row, 3) for row in range(3, 500, 5))),
    ],
)
def test_more_is_an_uneven_record(there):
    y, u = complete()
    rec = Record(y=y[there], u=u[there], t=T[there])
    assert rec.dt is None
    assert rec.t.size == there.sum()
    assert "missing" not in repr(rec)


def test_clocks_that_jitter_stay_uneven():
    y, u = complete()
    t = T + 1e-3 * DT * np.random.default_rng(0).standard_normal(N + 1)
    assert Record(y=y[SINGLE], u=u[SINGLE], t=t[SINGLE]).dt is None
    assert Record(y=y, u=u, t=np.cumsum(np.random.default_rng(0).integers(1, 3, N + 1))).dt is None


def test_no_usual_step_is_no_grid() -> None:
    """The median step of five even and five longer ones is near none of them: NumPy warned of no numbers."""
    t = np.array([0, 0.5, 1, 2, 3, 4, 6, 8, 12, 16, 24.0])
    assert mf.Record(y=np.exp(-t), t=t).dt is None
