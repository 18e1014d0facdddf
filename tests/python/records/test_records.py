"""Records: what they hold, how they are cut, what they refuse and what they say."""

import copy
import pickle
import subprocess
import sys

import modfun as mf
import numpy as np
import pytest
from modfun import Batch, DataError, ModfunWarning, Record, SpecError
from two_signals import N, T, signals

Y, U = signals()


@pytest.fixture
def rec():
    y, u = signals()
    event = ((T > 2.99) & (T < 5.01)).astype(int)
    return Record(y=y, u=u, dt=0.02, outputs="q", inputs=["de"], units={"q": "rad/s"}, keep={"event": event})


# What it holds -----------------------------------------------------------------------------------


def test_shapes_and_attributes(rec):
    assert rec.y.shape == rec.u.shape == (1, N + 1)
    assert rec.intervals == N
    assert rec.duration == pytest.approx(10.0, abs=1e-12)
    assert (rec.dt, rec.t0) == (0.02, 0.0)
    assert (rec.outputs, rec.inputs, rec.kept) == (("q",), ("de",), ("event",))
    assert rec.channels == ("q", "de", "event")
    assert rec.intersample == ("smooth",)
    assert rec.units == {"q": "rad/s"}
    assert np.array_equal(rec["q"], rec.y[0])
    assert np.array_equal(rec["de"], rec.u[0])
    assert "q" in rec
    assert "x" not in rec


def test_default_names():
    y, u = signals()
    one = Record(y=y, u=u, dt=0.1)
    assert (one.outputs, one.inputs) == (("y",), ("u",))
    two = Record(y=[y, y], u=[u, u, u], dt=0.1)
    assert (two.outputs, two.inputs) == (("y1", "y2"), ("u1", "u2", "u3"))


def test_no_input_is_free_motion():
    rec = Record(y=signals()[0], dt=0.1)
    assert rec.u.shape == (0, N + 1)
    assert rec.inputs == rec.intersample == ()


def test_arrays_are_frozen_contiguous_and_independent_of_the_callers():
    y, u = signals()
    mine = np.array(y)
    record = Record(y=mine, u=u, dt=0.02)
    mine[0] = 99.0
    assert record.y[0, 0] == y[0]
    assert mine.flags.writeable
    record = record.assign(z=y).window(1.0, 5.0)
    for values in (record.y, record.u, record.t, record["y"], record["z"]):
        assert not values.flags.writeable
        assert values.flags.c_contiguous
        assert values.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        record.y[0, 0] = 1.0
    with pytest.raises(AttributeError, match="cannot be changed"):
        record.dt = 1.0
    with pytest.raises(AttributeError, match="cannot be changed"):
        del record.dt
    record.units["y"] = "m"
    assert record.units == {}


def test_assigned_channels_are_copies():
    y, _ = signals()
    mine = np.array(y)
    record = Record(y=y, dt=0.02).assign(z=mine)
    mine[0] = 99.0
    assert record["z"][0] == y[0]


def test_axis_zero_is_time_first():
    y = np.column_stack(signals())
    rec = Record(y=y, dt=0.1, axis=0)
    assert np.array_equal(rec.y, y.T)
    assert rec.y.flags.c_contiguous


def test_integers_and_booleans_become_floats():
    rec = Record(y=np.arange(10), u=np.arange(10) > 4, dt=1)
    assert rec.y.dtype == rec.u.dtype == np.float64
    assert isinstance(rec.dt, float)
    assert rec.u.sum() == 5


def test_clock_dt_fs_and_even_times_agree():
    y, _ = signals()
    by_t = Record(y=y, t=T)
    assert Record(y=y, dt=0.02) == Record(y=y, fs=50.0)
    assert by_t.dt == pytest.approx(0.02, rel=1e-12)
    assert Record(y=y, dt=0.02, t0=3.0).t[0] == 3.0


@pytest.mark.parametrize("start", [0.0, 1.7e9])
def test_times_even_but_for_rounding_are_even(start):
    assert Record(y=signals()[0], t=start + T).dt == pytest.approx(0.02, rel=1e-7)


def test_times_even_to_1e_6_of_a_step_and_not_to_1e_5():
    jitter = 0.02 * np.random.default_rng(1).uniform(-1, 1, N + 1)
    assert Record(y=signals()[0], t=T + 5e-7 * jitter).dt is not None
    uneven = Record(y=signals()[0], t=T + 1e-5 * jitter)
    assert uneven.dt is None
    assert uneven.duration == uneven.t[-1] - uneven.t[0]


@pytest.mark.parametrize(("rate", "decimals"), [(60, 3), (1024, 6), (30, 4)])
def test_times_written_with_few_decimals_are_even(rate, decimals):
    rec = Record(y=Y, t=np.round(np.arange(N + 1) / rate, decimals))
    assert rec.dt == pytest.approx(1 / rate, rel=1e-4)
    assert Record(y=Y, t=np.round(np.arange(N + 1) / 60, 2)).dt is None  # too coarse to tell


def test_times_as_dates_are_seconds_from_the_first():
    dates = np.datetime64("2020-01-01") + np.arange(N + 1) * np.timedelta64(20, "ms")
    rec = Record(y=signals()[0], t=dates)
    assert rec.t0 == 0.0
    assert rec.dt == pytest.approx(0.02, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "words"),
    [("zoh", ("zoh", "zoh")), (["foh", "smooth"], ("foh", "smooth")), ({"u2": "zoh"}, ("smooth", "zoh"))],
)
def test_intersample_one_for_all_one_each_or_by_name(given, words):
    y, u = signals()
    assert Record(y=y, u=[u, y], dt=0.1, intersample=given).intersample == words


def test_equality_pickle_and_copy(rec):
    for other in (pickle.loads(pickle.dumps(rec)), copy.deepcopy(rec)):
        assert other == rec
        assert not other.y.flags.writeable
        assert not other["event"].flags.writeable
    y, u = signals()
    assert rec != Record(y=y, u=u, dt=0.02, outputs="q", inputs="de")
    assert rec != rec.assign(event=np.zeros(N + 1))
    assert rec != rec.assign(q=y + 1e-9)
    assert rec != 3
    with pytest.raises(TypeError, match="unhashable"):
        hash(rec)
    with pytest.raises(TypeError, match=r"rec\.channels"):
        list(rec)


def test_repr_and_html(rec):
    text = repr(rec)
    for words in ("Record of 10 s: 501 samples, dt = 0.02 s", "rad/s", "input, smooth", "kept"):
        assert words in text
    assert "<table>" in rec._repr_html_()
    assert "from t = 2 s" in repr(rec.window(2.0, 4.0))
    assert "uneven steps" in repr(Record(y=signals()[0], t=T**1.1))


def test_to_pandas(rec):
    frame = rec.to_pandas()
    assert list(frame.columns) == ["q", "de", "event"]
    assert frame.index.name == "t"
    assert np.array_equal(frame["q"].to_numpy(), rec["q"])


# Parts and changes -------------------------------------------------------------------------------


def test_to_csv_is_read_to_the_last_bit(rec, tmp_path):
    ok = np.ones(len(rec.t), dtype=bool)
    ok[3:5] = False
    gappy = rec.weigh(mask=ok)
    gappy.to_csv(tmp_path / "run.csv")
    read = mf.read(
        tmp_path / "run.csv", time="t", outputs=rec.outputs, inputs=rec.inputs, missing="mask",
        intersample=rec.intersample,
    )  # fmt: skip
    assert (read.mask == gappy.mask).all()
    assert (read.y[:, ok] == rec.y[:, ok]).all()
    assert (read.u == rec.u).all()
    assert (read.t == rec.t).all()


def test_window_includes_both_ends_and_keeps_the_clock(rec):
    part = rec.window(2.0, 6.0)
    assert part.intervals == 200
    assert part.t[[0, -1]] == pytest.approx([2.0, 6.0])
    assert part.dt == rec.dt
    assert np.array_equal(part["q"], rec["q"][100:301])
    assert np.array_equal(part["event"], rec["event"][100:301])
    assert rec.window(-1.0, 99.0) == rec


@pytest.mark.parametrize("k", range(1, 29))
def test_window_edges_typed_as_decimals_hit_their_samples(k):
    rec = Record(y=signals()[0], dt=0.1)
    assert rec.window(round(0.1 * k, 1), round(0.1 * (k + 20), 1)).intervals == 20


def test_even_part_of_an_uneven_record_is_even():
    t = T.copy()
    t[300:] += 2.0
    rec = Record(y=signals()[0], t=t)
    assert rec.dt is None
    assert rec.window(0.0, 4.0).dt == pytest.approx(0.02)


def test_split_every_shares_the_sample_between(rec):
    parts = rec.split(every=3.0)
    assert [p.intervals for p in parts] == [150, 150, 150]
    assert parts[0].t[-1] == parts[1].t[0]
    assert len(rec.split(every=5.0)) == 2
    assert rec.split(every=10.0) == [rec]


def test_split_on_event(rec):
    (part,) = rec.split(on="event")
    assert part["event"].min() == 1.0
    assert part.t[[0, -1]] == pytest.approx([3.0, 5.0])
    several = rec.assign(event=(np.sin(4 * T) > 0) * 5.0)
    parts = several.split(on="event")
    assert len(parts) == 7
    assert sum(len(p.t) for p in parts) == int((several["event"] > 0).sum())


def test_split_on_numbers_keeps_each_of_them(rec):
    run = 1.0 + (T > 3.0) + (T > 6.0)
    parts = rec.assign(event=run).split(on="event")
    assert [p["event"][0] for p in parts] == [1.0, 2.0, 3.0]
    assert sum(len(p.t) for p in parts) == N + 1
    assert len(rec.assign(event=run[::-1].copy()).split(on="event")) == 3
    assert len(rec.assign(event=101.0 + (T > 3.0)).split(on="event")) == 2
    (on,) = rec.assign(event=2.0 + 3.0 * (T > 3.0)).split(on="event")  # 2 and 5 V are a mark
    assert on["event"].min() == 5.0


def test_split_at_gaps(rec):
    left = (rec.t < 3.0) | (rec.t > 5.0)
    cut = Record(y=rec.y[:, left], u=rec.u[:, left], t=rec.t[left], outputs="q", inputs="de")
    parts = cut.split(gap=0.5)
    assert [p.dt for p in parts] == pytest.approx([rec.dt, rec.dt])
    assert sum(len(p.t) for p in parts) == int(left.sum())
    assert len(cut.split(gap=3.0)) == 1
    with pytest.raises(DataError, match=r"longest of \d+ pieces has 1 samples, .* usual step is 0.02 s"):
        cut.split(gap=1e-4)
    with pytest.raises(SpecError, match="positive number of seconds"):
        cut.split(gap=0.0)
    model = mf.TransferFunction(poles=1, zeros=0)
    with pytest.raises(
        DataError, match=r"no samples between t = 2\.98 and 5\.02, .*mf\.fit\(rec\.split\(gap=1\)"
    ):
        mf.fit(cut, model)
    with pytest.raises(DataError, match="record 1: the record has no samples"):
        mf.fit([rec, cut], model)


def test_split_on_warns_of_pieces_too_short(rec):
    event = np.zeros(N + 1)
    event[10:13] = event[100:200] = 1
    with pytest.warns(ModfunWarning, match=r"1 of 2 pieces have fewer than 8 samples .* t = 0\.2 s"):
        parts = rec.assign(event=event).split(on="event")
    assert len(parts) == 1


def test_select_takes_any_channel(rec):
    assert rec.select() == rec
    both = rec.select(outputs=["q", "event"])
    assert (both.outputs, both.kept) == (("q", "event"), ())
    assert both.y.shape == (2, N + 1)
    assert rec.select(inputs=[]).u.shape == (0, N + 1)
    swapped = rec.select(outputs="de", inputs="q")
    assert np.array_equal(swapped.y[0], rec["de"])
    assert swapped.units == {"q": "rad/s"}


def test_select_keeps_the_form_of_the_inputs():
    y, u = signals()
    rec = Record(y=y, u=[u, 2 * u], dt=0.1, intersample=["zoh", "foh"])
    assert rec.select(inputs=["u2"]).intersample == ("foh",)
    assert rec.select(inputs=["u2", "u1"]).intersample == ("foh", "zoh")


def test_assign_replaces_or_adds(rec):
    new = rec.assign(q=lambda r: 2 * r["q"], de=np.zeros(N + 1), speed=lambda r: r["q"] ** 2)
    assert np.array_equal(new["q"], 2 * rec["q"])
    assert new["de"].max() == 0.0
    assert np.array_equal(new["speed"], rec["q"] ** 2)  # functions see the record as it was
    assert new.kept == ("event", "speed")
    assert new.units == {}
    assert rec["de"].max() == 1.0


# Spectrum ----------------------------------------------------------------------------------------


def test_spectrum_gives_amplitudes_of_sinusoids():
    w = 2 * np.pi / 10.0
    y = 5.0 + 2.0 * np.sin(20 * w * T + 0.3) + 0.5 * np.cos(60 * w * T)
    spec = Record(y=y, dt=0.02).spectrum()
    assert spec.omega[19] == pytest.approx(20 * w)
    assert spec["y"][19] == pytest.approx(2.0, rel=1e-9)
    assert spec["y"][59] == pytest.approx(0.5, rel=1e-9)
    assert spec["y"][100:].max() < 1e-9
    assert len(spec.omega) == N // 2
    assert not spec.amplitude.flags.writeable
    with pytest.raises(SpecError, match="there are: y"):
        spec["q"]


def test_spectrum_of_an_uneven_record():
    t = np.concatenate(([0.0], np.sort(np.random.default_rng(3).uniform(0, 10, 999)), [10.0]))
    spec = Record(y=2.0 * np.sin(2 * np.pi * 2.0 * t), t=t).spectrum()
    assert spec["y"][19] == pytest.approx(2.0, rel=0.02)
    assert spec.omega[19] == pytest.approx(4 * np.pi)


# Noise level -------------------------------------------------------------------------------------


def test_noise_level_finds_the_noise_of_each_channel():
    noise = np.random.default_rng(4).standard_normal((2, 2001))
    t = 0.01 * np.arange(2001)
    y = np.array([3 * np.sin(t), 5 + t]) + np.array([[0.3], [0.02]]) * noise
    table = Record(y=y, u=np.cos(2 * t), dt=0.01, units={"y1": "deg"}).noise_level()
    assert table["channel"].tolist() == ["y1", "y2", "u"]
    assert table["unit"].tolist() == ["deg", "", ""]
    assert table["noise_sd"][:2] == pytest.approx([0.3, 0.02], rel=0.1)
    assert table["noise_sd"][2] < 1e-3
    assert table["rms"] == pytest.approx([*y.std(axis=1), np.cos(2 * t).std()])
    assert table["percent"] == pytest.approx(100 * table["noise_sd"] / table["rms"])


# Plots -------------------------------------------------------------------------------------------


@pytest.fixture
def pyplot():
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def test_plot_draws_each_channel(rec, pyplot):
    before = dict(pyplot.rcParams)
    axes = rec.plot()
    assert dict(pyplot.rcParams) == before
    assert [ax.get_ylabel() for ax in axes] == ["q (rad/s)", "de"]
    assert axes[-1].get_xlabel() == "time (s)"
    for ax, name in zip(axes, ["q", "de"], strict=True):
        (line,) = ax.lines
        assert np.array_equal(line.get_xdata(), rec.t)
        assert np.array_equal(line.get_ydata(), rec[name])
        assert line.get_drawstyle() == "default"


def test_plot_on_given_axes(rec, pyplot):
    _, ax = pyplot.subplots()
    assert rec.plot(ax=ax) is ax
    assert [line.get_label() for line in ax.lines] == ["q", "de"]
    assert ax.get_legend() is not None
    _, two = pyplot.subplots(2)
    assert list(mf.plot.record(rec, ax=two)) == list(two)
    with pytest.raises(SpecError, match="ax has 3 Axes where 2 are needed"):
        rec.plot(ax=pyplot.subplots(3)[1])


def test_plot_of_one_channel_is_one_axes_and_held_inputs_are_steps(pyplot):
    assert Record(y=Y, dt=0.1).plot().lines
    axes = Record(y=Y, u=U, dt=0.1, intersample="zoh").plot()
    assert axes[1].lines[0].get_drawstyle() == "steps-post"


def test_plot_of_a_spectrum_in_rad_s_and_hertz(rec, pyplot):
    spec = rec.spectrum()
    axes = spec.plot()
    assert np.array_equal(axes[0].lines[0].get_xdata(), spec.omega)
    assert np.array_equal(axes[1].lines[0].get_ydata(), spec["de"])
    assert axes[0].get_xscale() == axes[0].get_yscale() == "log"
    axes = mf.plot.spectrum(spec, hz=True)
    assert axes[0].lines[0].get_xdata()[0] == pytest.approx(0.1)
    assert axes[-1].get_xlabel() == "frequency (Hz)"
    Record(y=np.zeros(20), dt=1.0).spectrum().plot()


def test_bode_draws_decibels_and_degrees(pyplot):
    omega = np.array([1.0, 10.0, 100.0])
    system = mf.FrequencyResponse(omega=omega, response=1 / (1 + 1j * omega))
    magnitude, phase = mf.plot.bode(system, hz=True)
    assert magnitude.lines[0].get_ydata() == pytest.approx(-10 * np.log10(1 + omega**2))
    assert phase.lines[0].get_ydata() == pytest.approx(-np.degrees(np.arctan(omega)))
    assert phase.lines[0].get_xdata() == pytest.approx(omega / (2 * np.pi))


# Batches -----------------------------------------------------------------------------------------


def test_batch_shapes_and_replicates():
    rng = np.random.default_rng(0)
    y, u = rng.standard_normal((5, 1, 33)), rng.standard_normal(33)
    batch = Batch(y=y, u=u, dt=0.1, inputs="de", intersample="zoh")
    assert (batch.y.shape, batch.u.shape) == ((5, 1, 33), (1, 1, 33))
    assert len(batch) == 5
    assert batch[3] == Record(y=y[3], u=u, dt=0.1, inputs="de", intersample="zoh")
    assert "shared" in repr(batch)
    assert not batch.y.flags.writeable
    assert y.flags.writeable
    assert np.shares_memory(batch.y, y)
    again = pickle.loads(pickle.dumps(batch))
    assert np.array_equal(again.y, batch.y)
    assert again.intersample == ("zoh",)
    with pytest.raises(AttributeError, match="cannot be changed"):
        batch.dt = 1.0


def test_batch_with_an_input_a_replicate_and_without():
    rng = np.random.default_rng(0)
    own = Batch(y=rng.standard_normal((5, 33)), u=rng.standard_normal((5, 2, 33)), dt=0.1)
    assert own.inputs == ("u1", "u2")
    assert np.array_equal(own[4].u, own.u[4])
    assert Batch(y=own.y, dt=0.1).u.shape == (1, 0, 33)


def test_batch_lets_a_bad_replicate_pass():
    y = np.zeros((3, 1, 16))
    y[1] = np.nan
    assert np.isnan(Batch(y=y, dt=1.0).y[1]).all()


# What is refused: call, class, and the cure that the message names ---------------------------------

BAD = np.where(np.arange(N + 1) >= 17, np.nan, Y)
REFUSED = {
    "no clock": (lambda: Record(y=Y), SpecError, r"exactly one of dt= .* none was given"),
    "two clocks": (lambda: Record(y=Y, dt=1, fs=1), SpecError, r"dt and fs were given"),
    "zero dt": (lambda: Record(y=Y, dt=0), SpecError, "dt=0 must be a positive number of seconds"),
    "negative fs": (lambda: Record(y=Y, fs=-50), SpecError, "fs=-50 must be a positive number of hertz"),
    "zero fs": (lambda: Record(y=Y, fs=0), SpecError, "fs=0.0 must be a positive number of hertz"),
    "nan dt": (lambda: Record(y=Y, dt=np.nan), SpecError, "dt=nan must be a positive"),
    "text dt": (lambda: Record(y=Y, dt="fast"), SpecError, "dt='fast' must be a number"),
    "t0 with t": (lambda: Record(y=Y, t=T, t0=1.0), SpecError, "t0= goes with dt= or fs="),
    "infinite t0": (lambda: Record(y=Y, dt=1, t0=np.inf), SpecError, "t0=inf must be finite"),
    "empty": (lambda: Record(y=[], dt=1), DataError, "y is empty"),
    "no output": (lambda: Record(y=np.empty((0, 20)), dt=1), DataError, "y is empty"),
    "too few": (lambda: Record(y=Y[:7], dt=1), DataError, "7 samples are too few; at least 8"),
    "three axes": (lambda: Record(y=np.zeros((2, 3, 40)), dt=1), DataError, "3 dimensions; .*2-D"),
    "scalar": (lambda: Record(y=3.0, dt=1), DataError, "0 dimensions"),
    "ragged": (lambda: Record(y=[[1.0, 2.0], [1.0]], dt=1), DataError, "ragged"),
    "long axis first": (lambda: Record(y=np.zeros((100, 2)), dt=1), DataError, "100 channels of 2 .*axis=0"),
    "axis=0 too much": (lambda: Record(y=np.zeros((2, 100)), dt=1, axis=0), DataError, "leave axis=0 out"),
    "axis 2": (lambda: Record(y=np.zeros((2, 100)), dt=1, axis=2), SpecError, r"axis=2; .* -1 \(last\) or 0"),
    "complex": (lambda: Record(y=Y + 1j, dt=1), DataError, "complex128 .*real and imaginary part as two"),
    "objects": (lambda: Record(y=[None] * 20, dt=1), DataError, "object .*missing values and text"),
    "texts": (lambda: Record(y=["1.0"] * 20, dt=1), DataError, r"convert the texts .*modfun\.read"),
    "lengths": (lambda: Record(y=Y, u=U[:-1], dt=1), DataError, "y has 501 .* u has 500; .*cut or resample"),
    "nan": (
        lambda: Record(y=[Y, BAD], dt=1),
        DataError,
        "'y2' has 484 .* index 17 .nan.; cut .*fill the gap",
    ),
    "inf in u": (
        lambda: Record(y=Y, u=U * np.inf, dt=1),
        DataError,
        "'u' has 501 values that are not finite",
    ),
    "nan kept": (lambda: Record(y=Y, dt=1, keep={"e": BAD}), DataError, "channel 'e' has 484"),
    "2-D kept": (lambda: Record(y=Y, dt=1, keep={"e": [Y, Y]}), DataError, r"'e' has shape .* must be 1-D"),
    "kept length": (lambda: Record(y=Y, dt=1, keep={"e": Y[1:]}), DataError, "kept channel 'e' has 500"),
    "t length": (lambda: Record(y=Y, t=T[:-1]), DataError, r"t has shape \(500,\).*each of the 501 samples"),
    "t nan": (lambda: Record(y=Y, t=np.where(T > 1.01, np.nan, T)), DataError, "t is nan at index 51; .*cut"),
    "t stops": (lambda: Record(y=Y, t=np.minimum(T, 1.0)), DataError, "not increase at index 51.* give dt="),
    "t falls": (lambda: Record(y=Y, t=-T), DataError, "not increase at index 1: t = -?0, then -0.02; sort"),
    "t text": (lambda: Record(y=Y, t=["a"] * (N + 1)), DataError, "t holds str"),
    "few names": (lambda: Record(y=[Y, U], dt=1, outputs=["q"]), SpecError, r"names 1 .*\(q\), y has 2"),
    "name of no input": (lambda: Record(y=Y, dt=1, inputs="de"), SpecError, r"inputs names 1 .* u has 0"),
    "empty name": (lambda: Record(y=Y, dt=1, outputs=[" "]), SpecError, "not empty"),
    "number as name": (lambda: Record(y=Y, dt=1, outputs=[3]), SpecError, "names are texts"),
    "same name": (lambda: Record(y=Y, u=U, dt=1, outputs="x", inputs="x"), SpecError, "'x' .*must differ"),
    "kept same name": (lambda: Record(y=Y, dt=1, keep={"y": Y}), SpecError, "'y' names more than one"),
    "unit of nothing": (lambda: Record(y=Y, dt=1, units={"Y": "m"}), SpecError, "did you mean 'y'"),
    "hold": (
        lambda: Record(y=Y, u=U, dt=1, intersample="zho"),
        SpecError,
        "did you mean 'zoh'.* smooth, zoh, foh",
    ),
    "hold of none": (
        lambda: Record(y=Y, dt=1, intersample="linear"),
        SpecError,
        "there are: auto, smooth, zoh, foh",
    ),
    "holds": (lambda: Record(y=Y, u=U, dt=1, intersample=["zoh"] * 2), SpecError, "2 words for 1 inputs"),
    "hold of x": (
        lambda: Record(y=Y, u=U, dt=1, intersample={"x": "zoh"}),
        SpecError,
        "not an input; .*are: u",
    ),
    "no channel": (lambda: Record(y=Y, dt=1, outputs="pitch")["ptich"], SpecError, "did you mean 'pitch'"),
    "window off": (lambda: Record(y=Y, dt=0.02).window(20, 30), DataError, "holds 0 samples.*from 0 to 10 s"),
    "window back": (lambda: Record(y=Y, dt=0.02).window(5, 2), DataError, "holds 0 samples"),
    "window short": (lambda: Record(y=Y, dt=0.02).window(1, 1.1), DataError, "holds 6 samples, at least 8"),
    "split by none": (lambda: Record(y=Y, dt=1).split(), SpecError, "one of every= .*and on="),
    "split by both": (lambda: Record(y=Y, dt=1).split(every=1, on="y"), SpecError, "one of every= "),
    "split every -1": (lambda: Record(y=Y, dt=1).split(every=-1), SpecError, "positive number of seconds"),
    "split long": (lambda: Record(y=Y, dt=0.02).split(every=11), DataError, "501 samples in 10 s"),
    "split short": (lambda: Record(y=Y, dt=0.02).split(every=0.1), DataError, "at least 8 samples"),
    "split on x": (lambda: Record(y=Y, dt=1).split(on="ev"), SpecError, "no channel 'ev'; there are: y"),
    "split on 0": (lambda: Record(y=0 * Y, dt=1).split(on="y"), DataError, "0 throughout.*marks the pieces"),
    "split on spike": (
        lambda: Record(y=np.arange(99) == 9, dt=1).split(on="y"),
        DataError,
        "on 1 times, never",
    ),
    "select none": (lambda: Record(y=Y, dt=1).select(outputs=[]), SpecError, "needs an output; there are: y"),
    "select twice": (lambda: Record(y=Y, dt=1).select(inputs="y"), SpecError, "'y' names more than one"),
    "select wrong": (lambda: Record(y=Y, dt=1).select(outputs="Y"), SpecError, "did you mean 'y'"),
    "assign length": (lambda: Record(y=Y, dt=1).assign(z=Y[1:]), DataError, r"shape \(500,\) where \(501,\)"),
    "assign nan": (lambda: Record(y=Y, dt=1).assign(z=BAD), DataError, "channel 'z' has 484"),
    "batch 1-D": (lambda: Batch(y=Y, dt=1), DataError, r"must be \(replicate, channel, time\)"),
    "batch no dt": (lambda: Batch(y=[Y]), SpecError, "give dt="),
    "batch u": (lambda: Batch(y=[Y], u=U[1:], dt=1), DataError, "as many samples as y"),
    "batch u unclear": (lambda: Batch(y=[Y, Y], u=[U, U], dt=1), DataError, r"u\[:, None, :\] .*u\[None\]"),
    "batch u nan": (lambda: Batch(y=[Y], u=BAD, dt=1), DataError, "channel 'u' has 484"),
    "batch short": (lambda: Batch(y=np.zeros((3, 1, 5)), dt=1), DataError, "5 samples are too few"),
    "batch axes": (lambda: Batch(y=np.zeros((3, 50, 8)), dt=1), DataError, r"np\.moveaxis\(y, 1, 2\)"),
    "batch names": (lambda: Batch(y=[Y], u=U, dt=1, inputs="y"), SpecError, "names must differ"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_with_the_cure(case):
    call, error, words = REFUSED[case]
    with pytest.raises(error, match=words):
        call()


# The package -------------------------------------------------------------------------------------


@pytest.mark.process
def test_import_loads_nothing_heavy():
    code = (
        "import sys, modfun; "
        "print([m for m in ('scipy', 'matplotlib', 'pandas', 'csv') if m in sys.modules], "
        "all(hasattr(modfun, name) for name in modfun.__all__))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[] True"


def test_samples_by_name():
    t = np.arange(50) * 0.1
    rec = mf.Record(y={"alpha": np.sin(t), "q": np.cos(t)}, u={"de": t}, dt=0.1)
    assert (rec.outputs, rec.inputs) == (("alpha", "q"), ("de",))
    np.testing.assert_array_equal(rec["q"], np.cos(t))
    with pytest.raises(mf.SpecError, match="y names its channels, as does outputs"):
        mf.Record(y={"alpha": t}, outputs="q", dt=0.1)
    with pytest.raises(mf.DataError, match="y is ragged"):
        mf.Record(y={"alpha": t, "q": t[:-1]}, dt=0.1)
    with pytest.raises(mf.DataError, match="channel 'alpha' holds str"):
        mf.Record(y={"alpha": ["fast"] * 50}, dt=0.1)
