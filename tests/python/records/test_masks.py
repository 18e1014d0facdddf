"""Masked samples and samples with a sigma of their own: how a record keeps, cuts, shows and refuses them."""

import pickle

import modfun as mf
import numpy as np
import pytest
from modfun import DataError, ModfunWarning, Record, SpecError

N = 200
T = 0.05 * np.arange(N + 1)
Y = np.array([np.sin(2 * T), np.cos(T) + 0.3 * T])
U = np.cos(3 * T)
OK = np.ones((2, N + 1), dtype=bool)
OK[0, 40:50] = OK[1, 0:3] = OK[1, 120] = False
SIGMA = np.array([1.0 + T, np.full(N + 1, 2.0)])


def spoiled():
    return np.where(OK, Y, np.nan)


@pytest.fixture
def rec():
    return Record(y=spoiled(), u=U, dt=0.05, outputs=["q", "a"], inputs="de", mask=OK, sigma=SIGMA)


# What it holds -----------------------------------------------------------------------------------


def test_masked_samples_lie_on_lines_between_good_ones(rec):
    assert rec.mask.dtype == bool
    assert np.array_equal(rec.mask, OK)
    assert np.array_equal(rec.y[OK], Y[OK])
    q, a = rec.y
    np.testing.assert_allclose(q[40:50], np.interp(T[40:50], T[[39, 50]], Y[0, [39, 50]]), rtol=1e-14)
    assert np.array_equal(a[:3], np.repeat(Y[1, 3], 3))
    assert a[120] == pytest.approx(0.5 * (Y[1, 119] + Y[1, 121]), rel=1e-14)


def test_lines_follow_uneven_times():
    t = np.where(T[41] > T, T, T + 3.0)
    rec = Record(y=10 * t, t=t, mask=np.abs(np.arange(N + 1) - 41) > 3)
    np.testing.assert_allclose(rec["y"], 10 * t, rtol=1e-13)


def test_what_a_masked_sample_held_does_not_matter():
    wild = np.where(OK, Y, 1e9)
    assert Record(y=wild, dt=0.05, mask=OK) == Record(y=spoiled(), dt=0.05, mask=OK)


def test_one_row_serves_all_outputs_and_time_may_come_first():
    ok = np.abs(T - 3) > 0.2
    both = Record(y=Y, dt=0.05, mask=ok, sigma=1 + T)
    assert np.array_equal(both.mask, [ok, ok])
    assert np.array_equal(both.sigma[0], both.sigma[1])
    columns = Record(y=Y.T, dt=0.05, mask=np.array([ok, ok]).T, sigma=SIGMA.T, axis=0)
    assert np.array_equal(columns.mask, both.mask)
    assert Record(y=Y.T, dt=0.05, mask=ok.astype(int), axis=0).mask.shape == (2, N + 1)


def test_a_mask_of_nothing_is_none():
    assert Record(y=Y, dt=0.05, mask=np.ones(N + 1)) == Record(y=Y, dt=0.05)
    assert Record(y=Y, dt=0.05).mask is None
    assert Record(y=Y, dt=0.05).sigma is None


def test_sigma_of_masked_samples_may_be_anything():
    sigma = np.where(OK, SIGMA, np.nan)
    rec = Record(y=Y, dt=0.05, mask=OK, sigma=sigma)
    assert np.array_equal(rec.sigma[OK], SIGMA[OK])
    np.testing.assert_allclose(rec.sigma, SIGMA, rtol=0.15)


def test_frozen_equal_pickled(rec):
    for values in (rec.mask, rec.sigma):
        assert not values.flags.writeable
        assert values.flags.c_contiguous
    assert pickle.loads(pickle.dumps(rec)) == rec
    assert rec != Record(y=rec.y, u=U, dt=0.05, outputs=["q", "a"], inputs="de", sigma=SIGMA)
    assert rec != rec.weigh(sigma=SIGMA**2)
    mine = OK.copy()
    other = Record(y=Y, dt=0.05, mask=mine)
    mine[:] = True
    assert not other.mask.all()


# Parts and changes -------------------------------------------------------------------------------


def test_parts_keep_their_share(rec):
    part = rec.window(2.0, 4.0)
    assert np.array_equal(part.mask, OK[:, 40:81])
    assert np.array_equal(part.sigma, SIGMA[:, 40:81])
    assert np.array_equal(part.y, rec.y[:, 40:81])
    assert rec.window(7.0, 9.0).mask is None
    assert [piece.mask is None for piece in rec.split(every=2.5)] == [False, True, False, True]


def test_pieces_with_too_few_good_samples_are_left_out():
    ok = (T < 4) | (T > 7)
    rec = Record(y=Y, dt=0.05, mask=ok)
    with pytest.warns(ModfunWarning, match="of 3 of 10 pieces the mask leaves fewer than 8"):
        assert len(rec.split(every=1.0)) == 7
    with pytest.raises(DataError, match=r"window\(5, 6\): the mask leaves 0 samples of output 'y1'"):
        rec.window(5.0, 6.0)
    with pytest.raises(DataError, match=r"split\(on='event'\): the mask leaves 0"):
        rec.assign(event=(T > 5) & (T < 6)).split(on="event")


def test_select_keeps_masks_by_name(rec):
    swapped = rec.select(outputs=["a", "q"])
    assert np.array_equal(swapped.mask, OK[::-1])
    assert np.array_equal(swapped.sigma, SIGMA[::-1])
    new = rec.assign(event=U).select(outputs=["event"])
    assert new.mask is None
    assert np.array_equal(new.sigma, np.ones((1, N + 1)))
    with pytest.raises(DataError, match="'q' has 10 masked samples, and an input must be known"):
        rec.select(outputs="a", inputs="q")


def test_assign_keeps_masks_and_takes_nan_under_them(rec):
    degrees = rec.assign(q=lambda r: np.rad2deg(np.where(OK[0], r["q"], np.nan)))
    np.testing.assert_allclose(degrees["q"], np.rad2deg(rec["q"]), rtol=1e-13)
    assert np.array_equal(degrees.mask, OK)
    with pytest.raises(DataError, match="'q' has 1 values that are not finite"):
        rec.assign(q=np.where(T[70] == T, np.nan, T))


def test_weigh_masks_more_and_unmasks_nothing(rec):
    more = rec.weigh(mask=T < 9)
    assert np.array_equal(more.mask, OK & (T < 9))
    assert np.array_equal(more.sigma, SIGMA)
    assert more["q"][-1] == Y[0, 179]
    assert rec.weigh(mask=np.ones(N + 1)) == rec.weigh() == rec
    np.testing.assert_allclose(rec.weigh(sigma=3 + T).sigma[0], 3 + T, rtol=1e-14)
    with pytest.raises(DataError, match="weigh: the mask leaves 0 samples of output 'q'"):
        rec.weigh(mask=T > 99)


def test_weigh_of_one_output_leaves_the_others(rec):
    one = rec.weigh(mask={"q": T < 9})
    assert np.array_equal(one.mask, OK & np.array([T < 9, T < 99]))
    with pytest.raises(SpecError, match="weigh: 'de' is no output; "):
        rec.weigh(mask={"de": T < 9})
    with pytest.raises(DataError, match=r"what is given for 'q' has shape \(3,\)"):
        rec.weigh(mask={"q": [1, 0, 1]})


# What it says ------------------------------------------------------------------------------------


def test_repr_and_check_count_masked_samples(rec):
    text = repr(rec)
    assert "output, 10 masked" in text
    assert "output, 4 masked" in text
    assert "own sigma" in text
    first, second = (said for said in rec.check() if "masked" in said)
    assert "'q': 10 of 201 samples masked, 10 in a row at most, a gap of 0.55 s from t = 1.95 s" in first
    assert "'a': 4 of 201 samples masked, 3 in a row at most, a gap of 0.15 s from t = 0 s" in second


def test_check_does_not_take_the_filling_for_stale_samples():
    k = np.arange(N + 1)
    held = np.where((k > 80) & (k < 121), Y[0, 80], Y[0])
    held[121] = held[80]
    assert "is frozen: 42 samples" in Record(y=held, dt=0.05).check()
    rec = Record(y=held, dt=0.05, mask=(k <= 80) | (k >= 121))
    assert np.array_equal(rec["y"], held)
    assert "repeat the one before" not in rec.check()
    assert "is frozen" not in rec.check()


def test_frames_show_masked_samples_as_nan(rec):
    frame = rec.to_pandas()
    assert np.array_equal(np.isnan(frame["q"]), ~OK[0])
    assert frame["de"].notna().all()


def test_plot_leaves_masked_samples_out_and_bridges_them(rec):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = rec.plot()
    line, bridge = axes[0].get_lines()
    assert np.array_equal(np.isnan(line.get_ydata()), ~OK[0])
    assert np.array_equal(np.flatnonzero(np.isfinite(bridge.get_ydata())), np.arange(39, 51))
    assert len(axes[2].get_lines()) == 1


def test_a_prediction_is_whole(rec):
    one = rec.select(outputs="q")
    y = mf.tf([5], [1, 3, 8]).simulate(u=U, dt=0.05)
    whole = Record(y=y, u=U, dt=0.05, outputs="q", inputs="de")
    simulated = mf.fit(whole, mf.TransferFunction(poles=2, zeros=0)).predict(one)
    assert simulated.mask is None
    assert simulated.sigma is None


# What is refused ---------------------------------------------------------------------------------

REFUSED = {
    "length": ({"mask": OK[0, 1:]}, DataError, r"mask has shape \(200,\).* one value a sample of y"),
    "rows": ({"mask": np.ones((3, N + 1))}, DataError, r"mask has shape \(3, 201\).*\(2, 201\)"),
    "numbers": ({"mask": 2 * T}, DataError, "mask holds 0.1 where True"),
    "words": ({"mask": ["a"] * (N + 1)}, DataError, "mask holds str"),
    "nothing left": ({"mask": OK & (T > 11)}, DataError, "leaves 0 samples of output 'y1', at least 8"),
    "inverted": ({"mask": ~OK}, DataError, "leaves 4 samples of output 'y2'.* False where it is left out"),
    "nan": ({"y": spoiled()}, DataError, "10 values that are not finite.* mask="),
    "nan elsewhere": ({"y": spoiled(), "mask": OK[0]}, DataError, "'y2' has 4 values that are not finite"),
    "nan in u": ({"u": np.where(OK[0], U, np.nan), "mask": OK}, DataError, "'u' has 10 values"),
    "sigma zero": ({"sigma": T}, DataError, r"2 values that are not positive .* index 0 \(0\.0\)"),
    "sigma nan": ({"sigma": np.where(OK, 1, np.nan), "mask": OK[0]}, DataError, "sigma has 4 values"),
    "sigma length": ({"sigma": 1.0}, DataError, "sigma has 0 dimensions"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    given, error, words = REFUSED[case]
    with pytest.raises(error, match=words):
        Record(**{"y": Y, "u": U, "dt": 0.05, **given})


def test_masked_arrays_of_numpy_are_told_the_way():
    with pytest.raises(DataError, match=r"14 masked samples.*y=y\.data, mask=~y\.mask"):
        Record(y=np.ma.masked_array(Y, mask=~OK), dt=0.05)
    with pytest.raises(SpecError, match="there are"):
        Record(y=Y, dt=0.05, mask=OK)["mask"]
