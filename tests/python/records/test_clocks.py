"""Clocks of files: units by any name, seconds since 1970, jitter and uneven rows, and cures that work."""

import modfun as mf
import numpy as np
import pytest

LAGGED = mf.TransferFunction(poles=1, zeros=0, delay=mf.Free(min=0, max=1))
ROLES = {"outputs": ["y"], "inputs": ["u"]}


def file(path, times, name="Timestamp"):
    """A lag of 1 s behind a delay of 0.3 s, moved by a chirp."""
    at, fine = (times - times[0]) / (1000 if times[1] - times[0] > 50 else 1), 0.01 * np.arange(4100)
    y = np.ravel(
        mf.tf([1], [1, 1], delay=0.3).simulate(u=np.sin(fine**2 / 20), dt=0.01, intersample="smooth")
    )
    y = np.interp(at, fine, y) + 0.01 * np.random.default_rng(3).standard_normal(at.size)
    rows = np.column_stack([times, np.sin(at**2 / 20), y])
    np.savetxt(path, rows, delimiter=",", header=f"{name},u,y", comments="", fmt=["%.3f", "%.6f", "%.6f"])
    return path


@pytest.mark.parametrize("word", ["t", "Timestamp", "timestamp"])
def test_the_unit_of_the_times_is_taken_by_any_name(tmp_path, word):
    """`t` was no channel, and the times stayed a thousand times too long."""
    path = file(tmp_path / "run.csv", 100.0 * np.arange(400))
    rec = mf.read(path, **ROLES, units={word: "ms"})
    assert (rec.t[0], rec.dt) == (0.0, 0.1)
    assert mf.read(path, **ROLES, units={word: "ms"}, dt=0.1).dt == 0.1


def test_a_unit_of_no_column_is_still_refused(tmp_path):
    path = file(tmp_path / "run.csv", 0.1 * np.arange(400))
    with pytest.raises(mf.SpecError, match="units names 'alpha', which is not a channel"):
        mf.read(path, **ROLES, units={"alpha": "deg"})


def test_seconds_since_1970_are_counted_from_the_first(tmp_path):
    """Doubles of 1.7e9 are 2e-7 apart, and so is 40 s from first to last."""
    rec = mf.read(file(tmp_path / "run.csv", 1.7e9 + 0.1 * np.arange(400)), **ROLES)
    assert rec.t[0] == 0
    assert rec.dt == pytest.approx(0.1, rel=1e-8)
    rec = mf.read(file(tmp_path / "run.csv", 1.7e12 + 100 * np.arange(400)), **ROLES, units={"t": "ms"})
    assert rec.t[0] == 0
    assert rec.dt == pytest.approx(0.1, rel=1e-9)
    jump = rec["y"] + 5.0 * (np.arange(400) == 100)
    with pytest.warns(mf.ModfunWarning, match="The sample of y at t = 10 s is far"):
        mf.fit(rec.assign(y=jump), mf.TransferFunction(poles=1, zeros=0))


def test_a_clock_that_jitters_is_read_with_the_step_that_messages_name(tmp_path):
    jitter = 0.002 * np.random.default_rng(1).standard_normal(400)
    path = file(tmp_path / "run.csv", 1.7e9 + 0.1 * np.arange(400) + jitter)
    rec = mf.read(path, **ROLES)
    with pytest.raises(mf.DataError, match=r"give dt=0.1\d* instead of the times") as refused:
        mf.fit(rec, LAGGED)
    step = float(str(refused.value).split("give dt=")[1].split(" ")[0])
    assert mf.fit(mf.read(path, **ROLES, dt=step), LAGGED)["delay"] == pytest.approx(0.3, abs=0.03)


def test_uneven_rows_are_resampled_as_the_message_says(tmp_path):
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(400, 300, replace=False))
    rec = mf.read(file(tmp_path / "run.csv", 1.7e9 + 0.1 * kept + rng.uniform(-0.04, 0.04, 300)), **ROLES)
    assert any("Fits take such times as they are, but no delays." in text for text in rec.check())
    with pytest.raises(mf.DataError, match=r"steps are uneven; make it even, rec\.resample\(") as refused:
        mf.fit(rec, LAGGED)
    even = rec.resample(float(str(refused.value).split("resample(")[1].split(")")[0]))
    assert even.dt == pytest.approx(0.01335, rel=0.03)
    assert mf.fit(even, LAGGED)["delay"] == pytest.approx(0.3, abs=0.03)


UNITS = {
    "t [mins]": 60, "t[hr]": 3600, "Zeit [Std]": 3600, "Zeit (Minuten)": 60, "Time [minutes]": 60,
    "Time (hours)": 3600, "Zeit/min": 60, "elapsed_minutes": 60, "Zeit [Sek.]": 1, "t (msec)": 1e-3,
    "Zeit in Stunden": 3600, "Time, s": 1, "Minutes": 60, "t [weeks]": 604800, "Time (UTC)": 1,
    "time tag": 1, "t_d": 1, "t_std": 1,
}  # fmt: skip


@pytest.mark.parametrize("name", UNITS)
def test_units_of_time_in_other_spellings(name):
    """They were taken as seconds in silence."""
    t = 0.5 * np.arange(40)
    assert mf.read({name: t, "y": np.sin(t)}, time=name, outputs="y").dt == pytest.approx(0.5 * UNITS[name])


def test_columns_tell_the_step_in_seconds():
    t = 0.5 * np.arange(40)
    assert mf.columns({"Zeit/min": t, "y": t})["note"][0] == "time, even, dt = 30 s"


def test_an_unknown_unit_of_time_is_refused():
    t = 0.5 * np.arange(40)
    source = {"t (foo)": t, "y": np.sin(t)}
    with pytest.raises(mf.SpecError, match=r"'t \(foo\)' are in 'foo'.*units=\{'t \(foo\)': 's'\}"):
        mf.read(source, outputs="y")
    note = mf.columns(source)["note"][0]
    assert note == "time, in an unknown unit; give units={'t (foo)': 's'} or the like"
    assert mf.read(source, outputs="y", units={"t": "s"}).dt == 0.5
    assert mf.read(source, outputs="y", dt=0.1).dt == 0.1


@pytest.mark.parametrize("kind", ["csv", "frame", "text", "parquet"])
def test_dates_are_in_seconds_whatever_stands_in_brackets(tmp_path, kind):
    """Neither their unit nor the size of their steps is in doubt."""
    pandas = pytest.importorskip("pandas")
    at = pandas.date_range("2026-03-01 08:00", periods=40, freq="2s")
    frame = pandas.DataFrame({"Time (local)": at, "y": np.sin(np.arange(40.0))})
    source = frame.astype({"Time (local)": str}) if kind == "text" else frame
    if kind == "csv":
        frame.to_csv(source := tmp_path / "run.csv", index=False)
    if kind == "parquet":
        pytest.importorskip("pyarrow")
        frame.to_parquet(source := tmp_path / "run.parquet")
    rec = mf.read(source, outputs="y")
    assert rec.dt == 2
    assert not any("milliseconds" in sentence for sentence in rec.check())
    assert not any("milliseconds" in sentence for sentence in rec.window(0, 60).check())


def stamped(start, form, freq="1s", rows=30):
    at = pytest.importorskip("pandas").date_range(start, periods=rows, freq=freq)
    return {"t": list(at.strftime(form)), "y": np.sin(np.arange(float(rows)))}


@pytest.mark.parametrize("start", ["2024-03-05 11:59:50", "2024-03-15 23:59:50", "2024-05-03 23:59:50"])
@pytest.mark.parametrize(
    "form",
    [
        "%m/%d/%Y %I:%M:%S %p",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%d/%m/%Y %H:%M:%S",
        "%m/%d/%Y %H:%M:%S",
        "%d.%m.%y %H:%M:%S",
    ],
)
def test_dates_with_the_month_or_the_day_first(start, form):
    """They were refused as text; the order is that in which times increase and the record is short."""
    rec = mf.read(stamped(start, form), outputs="y")
    assert (rec.t[0], rec.dt, rec.intervals) == (0, 1, 29)


def test_thirteen_oclock_pm_is_no_time():
    with pytest.raises(mf.DataError, match=r"'t' holds .*13:00:00 PM.* where a number is needed"):
        mf.read({"t": ["01:00:00 PM", *["13:00:00 PM"] * 20], "y": np.arange(21.0)}, outputs="y")


@pytest.mark.parametrize(
    "forms", [("%d.%m.%Y", "%H:%M:%S,%f"), ("%m/%d/%Y", "%I:%M:%S %p"), ("%Y-%m-%d", "%H:%M:%S")]
)
def test_date_and_time_in_two_columns(tmp_path, forms):
    date, time = (stamped("2024-03-05 23:59:50", form)["t"] for form in forms)
    rows = "".join(f"{a};{b};{k % 7}\n" for k, (a, b) in enumerate(zip(date, time, strict=True)))
    (path := tmp_path / "run.csv").write_text("Date;Time;y\n" + rows)
    rec = mf.read(path, time=["Date", "Time"], outputs="y")
    assert (rec.t[0], rec.dt, rec.intervals) == (0, 1, 29)
    with pytest.raises(mf.SpecError, match="'Time' is no column of dates, 2026-03-01; give date, then time"):
        mf.read(path, time=["Time", "Date"], outputs="y")
    with pytest.raises(
        mf.SpecError, match="give one column, or that of the date and that of the time of day"
    ):
        mf.read(path, time=["Date", "Clock"], outputs="y")


NAMED = {
    "TimeUS": 1e-6,
    "timeus": 1e-6,
    "TimeMS": 1e-3,
    "time_us": 1e-6,
    "timestamp_ns": 1e-9,
    "timestampUS": 1e-6,
}


@pytest.mark.parametrize("name", NAMED)
def test_clocks_of_autopilots_say_their_unit(name):
    """They were taken as seconds, a million times too long, and asked whether they are milliseconds."""
    made = {name: np.rint(5 + 0.01 * np.arange(40) / NAMED[name]), "y": np.sin(np.arange(40.0))}
    rec = mf.read(made, outputs="y")
    assert rec.dt == pytest.approx(0.01)
    assert not any("Steps of" in text for text in rec.check())


@pytest.mark.parametrize(
    ("start", "step", "unit", "word"),
    [
        (5e8, 1e4, "us", "microseconds"),
        (3.0, 2500.0, "us", "microseconds"),
        (0.0, 20.0, "ms", "milliseconds"),
        (1.7e12, 20.0, "ms", "milliseconds"),
        (1.7e18, 1e7, "ns", "nanoseconds"),
    ],
)
def test_steps_without_a_unit_are_offered_the_plausible_one(start, step, unit, word):
    made = {"timestamp": start + step * np.arange(40), "y": np.sin(np.arange(40.0))}
    cure = rf"if they are {word}, give units=\{{'timestamp': '{unit}'\}}, else"
    with pytest.warns(mf.ModfunWarning, match=cure):
        rec = mf.read(made, outputs="y")
    assert any(f"if they are {word}, give dt=" in text for text in rec.check())


@pytest.mark.parametrize(
    ("start", "step"), [(0.0, 60.0), (0.0, 300.0), (1.7e9, 20.0), (1.7e9, 5.0), (7.0, 1.0)]
)
def test_times_that_look_like_seconds_are_seconds(start, step):
    rec = mf.read({"t": start + step * np.arange(40), "y": np.sin(np.arange(40.0))}, outputs="y")
    assert rec.dt == step
    assert not any("Steps of" in text for text in rec.check())
    given = mf.Record(y=np.sin(np.arange(40.0)), dt=step if step != 20 else 2.0)
    assert not any("Steps of" in text for text in given.check())
