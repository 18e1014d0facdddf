"""Reading: files, frames and dictionaries; what is refused, where it is and what to do about it."""

import gzip
from datetime import datetime, timedelta

import modfun as mf
import numpy as np
import pandas as pd
import pytest
from modfun import DataError, Record, SpecError, columns, read
from places import measured

N = 100
T = 0.02 * np.arange(N + 1)
Q, DE = np.sin(3 * T), np.cos(T)
ARRAYS = {"t": T, "q": Q, "de": DE}


def text(header="t,q,de", mark=",", rows=None, before=""):
    rows = zip(T, Q, DE, strict=True) if rows is None else rows
    return before + "\n".join([header, *(mark.join(map(str, row)) for row in rows)]) + "\n"


@pytest.fixture
def file(tmp_path):
    def write(content, name="run.csv", encoding="utf-8"):
        path = tmp_path / name
        path.write_bytes(content.encode(encoding))
        return path

    return write


def expected(**changes):
    return Record(**{"y": Q, "u": DE, "t": T, "outputs": "q", "inputs": "de", **changes})


# What is read ------------------------------------------------------------------------------------


@pytest.mark.parametrize("mark", [",", ";", "\t", ", "])
def test_csv_with_any_delimiter(file, mark):
    path = file(text(mark.join(["t", "q", "de"]), mark))
    assert read(path, time="t", outputs=["q"], inputs=["de"]) == expected()
    assert read(str(path), outputs="q", inputs="de") == expected()  # the time is found by its name


def test_comments_empty_lines_units_row_and_byte_order_mark(file):
    content = "\ufeff# logger 7\n% x\n\n" + text("t,q,de\n s,deg/s,[deg]") + "# the end\n\n"
    units = {"q": "deg/s", "de": "deg"}
    assert read(file(content), outputs="q", inputs="de") == expected(units=units)
    windows = content.replace("\n", "\r\n")
    assert read(file(windows), outputs="q", inputs="de") == expected(units=units)


def test_units_row_with_blanks_in_it_and_descriptions(file):
    """A dash is no unit, a sentence neither; milliseconds are what they say."""
    rec = read(file(text("t,q,de\nms,-,elevator at the left hinge")), outputs="q", inputs="de")
    assert rec.units == {}
    np.testing.assert_allclose(rec.t, 1e-3 * np.array(T, float))


def test_times_of_day_are_seconds(file):
    """14:05:36.00, and the same with the day of the year, as telemetry writes it."""
    clock = [f"14:{5 + k // 60:02d}:{k % 60:02d}.50" for k in range(70)]
    for before, start in (("", 50700.5), ("325:", 325 * 86400 + 50700.5)):
        rows = "".join(f"{before}{one},{k}\n" for k, one in enumerate(clock))
        rec = read(file("TIME,q\n" + rows), time="TIME", outputs="q")
        assert (rec.t0, rec.dt, rec.intervals) == (start, 1.0, 69)


def test_columns_between_blanks(file):
    rows = "".join(f"  {0.1 * k:.1f}   {k}  {-k}\n" for k in range(20))
    rec = read(file("  t    q   de\n" + rows), outputs="q", inputs="de")
    np.testing.assert_array_equal(rec.y[0], np.arange(20.0))
    np.testing.assert_array_equal(rec.u[0], -np.arange(20.0))


def test_quoted_header_with_commas_and_old_encoding(file):
    content = text('"TIME [s]","Q, body [°/s]","DE [°]"')
    rec = read(file(content, encoding="latin-1"), outputs={"q": "Q, body [°/s]"}, inputs={"de": "DE [°]"})
    assert rec == expected(units={"q": "°/s", "de": "°"})


def test_quoted_numbers(file):
    rows = [(f'"{t}"', q, de) for t, q, de in zip(T, Q, DE, strict=True)]
    assert read(file(text(rows=rows)), outputs="q", inputs="de") == expected()


def test_no_header_names_columns_by_number(file):
    path = file(text().split("\n", 1)[1])
    assert read(path, time="column1", outputs={"q": "column2"}, inputs={"de": "column3"}) == expected()


@pytest.mark.parametrize("mark", ["#", "%", "# "])
def test_a_comment_above_the_numbers_names_the_columns(file, mark):
    body = text().split("\n", 1)[1]
    assert read(file(f"{mark}t,q,de\n{body}"), outputs="q", inputs="de") == expected()
    blanks = file(f"{mark}t q de\n" + body.replace(",", " "))
    assert read(blanks, outputs="q", inputs="de") == expected()
    with pytest.raises(SpecError, match="column1, column2, column3"):
        read(file(f"{mark}flight,12\n{body}"), outputs="q", inputs="de")


@pytest.mark.parametrize("word", ["UTC", "IRIG time", "Zeit [s]"])
def test_clocks_by_other_names_are_times(file, word):
    assert read(file(text(f'"{word}",q,de')), outputs="q", inputs="de") == expected()


def test_new_names_units_from_brackets_and_from_the_mapping(file):
    path = file(text("TIME [s],Q (deg/s),DELE (deg)"))
    rec = read(
        path, time="TIME [s]", outputs={"q": "Q (deg/s)"}, inputs={"de": "DELE (deg)"}, units={"q": "rad/s"}
    )
    assert rec.units == {"q": "rad/s", "de": "deg"}
    assert rec.outputs == ("q",)
    kept_name = read(path, outputs="Q (deg/s)")
    assert kept_name.units == {"Q (deg/s)": "deg/s"}


@pytest.mark.parametrize(
    ("name", "factor"), [("TIME [ms]", 1e3), ("t_ms", 1e3), ("Time (us)", 1e6), ("time", 1)]
)
def test_times_become_seconds(file, name, factor):
    rows = zip(T * factor, Q, DE, strict=True)
    rec = read(file(text(f"{name},q,de", rows=rows)), outputs="q")
    assert rec.dt == pytest.approx(0.02, rel=1e-12)


def test_dt_instead_of_times_and_kept_columns(file):
    rec = read(file(text("k,q,de")), outputs="q", dt=0.02, keep={"event": "de"})
    assert rec.dt == 0.02
    assert rec.inputs == ()
    assert np.array_equal(rec["event"], DE)


def test_dt_beside_times_that_have_another_step_is_refused(file):
    path = file(text("t,q,de"))
    assert read(path, outputs="q", dt=0.02).dt == 0.02
    with pytest.raises(SpecError, match=r"dt=0.01, but the times 't' of .* steps of 0.02 s; give time='t'"):
        read(path, outputs="q", dt=0.01)
    assert read(path, outputs="q", dt=0.01, keep="t").dt == 0.01


def test_text_and_gaps_in_columns_that_are_not_used_do_no_harm(file):
    rows = [(t, q, "" if k == 3 else "ok") for k, (t, q) in enumerate(zip(T, Q, strict=True))]
    assert read(file(text(rows=rows)), outputs="q") == expected(u=None, inputs=None)


def test_intersample_is_passed_on():
    assert read(ARRAYS, outputs="q", inputs="de", intersample="zoh").intersample == ("zoh",)


def test_dictionary_and_npz(tmp_path):
    assert read(ARRAYS, outputs="q", inputs="de") == expected()
    np.savez(tmp_path / "run.npz", **ARRAYS, dt=np.array(0.02))
    assert read(tmp_path / "run.npz", outputs="q", inputs="de") == expected()
    two = read({"t": T, "y": np.array([Q, DE])}, outputs=["y1", "y2"])
    assert np.array_equal(two.y, [Q, DE])


def test_pandas_frames_also_with_times_in_the_index():
    frame = pd.DataFrame(ARRAYS)
    assert read(frame, time="t", outputs=["q"], inputs=["de"]) == expected()
    assert read(frame.set_index("t"), outputs="q", inputs="de") == expected()
    rec = expected(keep={"event": Q})
    assert read(rec.to_pandas(), outputs="q", inputs="de", keep="event") == rec
    unnamed = frame.set_index("t").rename_axis(None)
    assert read(unnamed, outputs="q", inputs="de") == expected()
    assert read(unnamed.assign(time=frame["t"].to_numpy()), outputs="q", inputs="de") == expected()
    with pytest.raises(SpecError, match="no column is named t or time"):
        read(frame.drop(columns="t"), outputs="q", inputs="de")  # row numbers are no times


def test_pandas_dates_and_nullable_columns():
    frame = pd.DataFrame({"time": pd.to_datetime("2024-05-01") + pd.to_timedelta(T, unit="s"), "q": Q})
    frame["n"] = pd.array(np.arange(N + 1), dtype="Int64")
    rec = read(frame, outputs=["q", "n"])
    assert rec.dt == pytest.approx(0.02, rel=1e-9)
    assert rec.y[1, -1] == N
    frame["n"] = frame["n"].mask(frame["n"] == 7)
    with pytest.raises(DataError, match=r"'n' has 1 missing .*\(row 7\)"):
        read(frame, outputs="n")


def test_any_frame_with_columns():
    class Frame:
        columns = ("t", "q", "de")

        def __getitem__(self, name):
            return ARRAYS[name].tolist()

    assert read(Frame(), outputs="q", inputs="de") == expected()


def test_many_rows_are_read_exactly(file):
    values = np.random.default_rng(0).standard_normal((20000, 2))
    t = np.arange(20000)
    content = "t,a,b\n" + "".join(f"{k},{a!r},{b!r}\n" for k, (a, b) in zip(t, values.tolist(), strict=True))
    rec = read(file(content), outputs=["b", "a"])
    assert np.array_equal(rec.y, values.T[::-1])


# Samples left out or trusted less ------------------------------------------------------------------


def test_missing_values_of_outputs_may_be_masked(file):
    path = file(text(rows=HOLE))
    rec = read(path, outputs="q", inputs="de", missing="mask")
    assert np.flatnonzero(~rec.mask[0]).tolist() == [3, 7]
    assert rec == expected(mask=~np.isin(np.arange(N + 1), [3, 7]))
    assert read(path, outputs="de", missing="mask").mask is None
    with pytest.raises(DataError, match=r"'q' has 2 missing .* with missing='mask'"):
        read(path, outputs="q")
    with pytest.raises(DataError, match=r"'q' has 2 missing .*missing='hold'"):
        read(path, outputs="de", inputs="q", missing="mask")
    with pytest.raises(SpecError, match="missing='maks' is unknown; did you mean 'mask'"):
        read(path, outputs="q", missing="maks")


def test_masks_written_as_words(file):
    rows = [(t, q, str(t < 1)) for t, q in zip(T, Q, strict=True)]
    assert np.array_equal(read(file(text("t,q,ok", rows=rows)), outputs="q", mask="ok").mask[0], T < 1)
    frame = pd.DataFrame({"t": T, "q": Q, "ok": pd.array(T < 1, dtype="boolean").astype(object)})
    assert np.array_equal(read(frame, outputs="q", mask="ok").mask[0], T < 1)


def test_columns_of_masks_and_sigmas():
    ok = np.abs(T - 1) > 0.1
    source = {**ARRAYS, "ok": ok, "s": 1 + T, "r": Q + 2}
    rec = read(source, outputs=["q", "r"], inputs="de", mask="ok", sigma={"r": "s"})
    assert np.array_equal(rec.mask, [ok, ok])
    assert np.array_equal(rec.sigma, [np.ones(N + 1), 1 + T])
    gap = {**source, "r": np.where(T > 1.9, np.nan, Q)}
    both = read(gap, outputs=["q", "r"], mask={"r": "ok"}, missing="mask")
    assert both.mask[0].all()
    assert np.array_equal(both.mask[1], ok & (T <= 1.9))
    with pytest.raises(SpecError, match="mask names 'x', which is not an output; there are: q"):
        read(source, outputs="q", mask={"x": "ok"})
    with pytest.raises(SpecError, match="no column 'okay'; did you mean 'ok'"):
        read(source, outputs="q", mask="okay")
    with pytest.raises(DataError, match=r"mask holds 1\.02 where True"):
        read(source, outputs="q", mask="s")


# Columns -----------------------------------------------------------------------------------------


def test_columns_of_a_file(file):
    rows = [(t, "" if k in (3, 4) else q, 5.0, "on") for k, (t, q) in enumerate(zip(T, Q, strict=True))]
    table = columns(file(text("TIME [s],Q (deg/s),flap,mode", rows=rows)))
    assert table.title == "run.csv: 101 rows"
    assert table["column"].tolist() == ["TIME [s]", "Q (deg/s)", "flap", "mode"]
    assert table["unit"].tolist() == ["s", "deg/s", "", ""]
    assert table["missing"].tolist() == [0, 2, 0, None]
    assert table["note"].tolist() == ["time, even, dt = 0.02 s", "", "constant", "text"]
    assert table["min"][1] == pytest.approx(Q.min())
    assert table["max"][0] == 2.0
    assert "Q (deg/s)" in str(table)


def test_columns_say_how_even_the_time_is():
    gap = np.where(T > 1.0, T + 1.0, T)
    assert columns({"t": gap})["note"][0] == "time, 1 gap, usual step 0.02 s"
    assert columns({"t": T**1.1})["note"][0].startswith("time, uneven, steps")
    assert "does not increase" in columns({"t": -T})["note"][0]
    assert columns({"x": np.full(9, np.nan)})["note"][0] == "empty"
    assert columns(pd.DataFrame(ARRAYS))["column"].tolist() == ["t", "q", "de"]


# What is refused: content, options, class, and the words of the message ----------------------------

HOLE = [(t, "" if k in (3, 7) else q, d) for k, (t, q, d) in enumerate(zip(T, Q, DE, strict=True))]
WORD = [(t, "open" if k == 5 else q, d) for k, (t, q, d) in enumerate(zip(T, Q, DE, strict=True))]
ROWS = list(zip(T, Q, DE, strict=True))
MIXED = [(0.0, 0.5, 0.0), (0.1, "0,5", 0.0)]
COMMA = [(t, str(q).replace(".", ","), d) for t, q, d in zip(T, Q, DE, strict=True)]
LONG = [(t, q, d, 1) if k == 4 else (t, q, d) for k, (t, q, d) in enumerate(zip(T, Q, DE, strict=True))]
SHORT = [(t, q) if k == 4 else (t, q, d) for k, (t, q, d) in enumerate(zip(T, Q, DE, strict=True))]
BACK = [(t if k != 9 else 0.0, q, d) for k, (t, q, d) in enumerate(zip(T, Q, DE, strict=True))]

FILES = {
    "empty": ("", {}, DataError, "holds no data; it needs a line of column names"),
    "comments only": ("# a\n\n# b\n", {}, DataError, "holds no data"),
    "header only": ("t,q,de\n", {}, DataError, r"column names \(t, q, de\) but no rows"),
    "wrong column": (text(), {"outputs": "Q"}, SpecError, "no column 'Q'; did you mean 'q'.*are: t, q, de"),
    "wrong time": (text(), {"time": "TIME"}, SpecError, "no column 'TIME'; .*there are: t, q, de"),
    "wrong keep": (text(), {"keep": "event"}, SpecError, "no column 'event'"),
    "wrong old name": (text(), {"outputs": {"q": "qq"}}, SpecError, "no column 'qq'; did you mean 'q'"),
    "column twice": (text("t,q,q"), {"inputs": None}, SpecError, "2 columns named 'q'; .*'q#1', 'q#2'"),
    "output twice": (text(), {"outputs": ["q", "q"]}, SpecError, "outputs names a column twice"),
    "in and out": (text(), {"inputs": "q"}, SpecError, "'q' names more than one"),
    "missing": (text(rows=HOLE), {}, DataError, r"'q' has 2 missing .*\(line 5, line 9\); fill or cut"),
    "text": (text(rows=WORD), {}, DataError, "line 7: column 'q' holds 'open' .*put # before"),
    "text, comments": (text(rows=WORD, before="#\n\n"), {}, DataError, "line 9: column 'q' holds 'open'"),
    "decimal comma": (
        text("t;q;de", ";", MIXED),
        {},
        DataError,
        "line 2: column 'q' holds '0.5', whose point is no thousands mark, while .*'0,5' in line 3",
    ),
    "quoted comma": (
        text(rows=[(0.0, '"0,5"', 0.0)]),
        {},
        DataError,
        "line 2: column 'q' holds '0,5' .*decimal commas are read where another mark",
    ),
    "no names": (
        text("t,q"),
        {},
        DataError,
        "line 1: the header has 2 fields where all rows have 3; put # before line 1 if it is a title",
    ),
    "titles and no names": (
        text("Unit 7\nof, today"),
        {},
        DataError,
        "line 1: the header has 1 field where all rows have 3; put # before lines 1 to 2 if they are a title",
    ),
    "row too long": (text(rows=LONG), {}, DataError, "line 6: 4 fields where the header has 3; correct"),
    "row too short": (text(rows=SHORT), {}, DataError, "line 6: 2 fields where the header has 3"),
    "time falls": (text(rows=BACK), {}, DataError, "time does not increase at index 9"),
    "no time": (
        text("x,q,de"),
        {},
        SpecError,
        "no column is named t or time; name it .* or give dt=. .*x, q, de",
    ),
    "two times": (text("t,q,time"), {"inputs": None}, SpecError, r"may be the time \(t, time\); say which"),
    "time and dt": (text(), {"time": "t", "dt": 0.1}, SpecError, "not both"),
    "bad dt": (text(), {"dt": -1}, SpecError, "dt=-1 must be a positive"),
    "unit of old name": (text(), {"units": {"de (deg)": "deg"}}, SpecError, "units names 'de .deg.'"),
    "bad hold": (text(), {"intersample": "zho"}, SpecError, "did you mean 'zoh'"),
    "no outputs": (text(), {"outputs": []}, DataError, "y is empty"),
    "too few rows": (text(rows=[(0, 1, 2), (1, 2, 3)]), {}, DataError, "2 samples are too few"),
}


@pytest.mark.parametrize("case", FILES)
def test_refused_files(file, case):
    content, options, error, words = FILES[case]
    with pytest.raises(error, match=words):
        read(file(content), **{"outputs": "q", "inputs": "de", **options})


TITLES = {
    "one": ("Unit 7, run 3\nt,q,de", ",", ROWS),
    "without marks": ("Unit 7\nt;q;de", ";", COMMA),
    "two": ("Trend export;Unit 7\nMade on;05.03.2024 10:00\n\nt;q;de\ns;deg;", ";", COMMA),
    "padded": ("Trend export;;\nUnit 7;;\nt;q;de", ";", COMMA),
}


@pytest.mark.parametrize("case", TITLES)
def test_lines_of_a_title_above_the_names_are_skipped(file, case):
    """One was refused with advice, two with advice about the line of the names."""
    head, mark, rows = TITLES[case]
    named = read(
        file(text(head.splitlines()[-2 if case == "two" else -1], mark, rows)), outputs="q", inputs="de"
    )
    rec = read(file(text(head, mark, rows)), outputs="q", inputs="de")
    assert np.array_equal(rec.y, named.y)
    assert np.array_equal(rec.t, named.t)
    assert rec.units == ({"q": "deg"} if case == "two" else {})


def test_a_line_of_separators_below_a_title_is_skipped(file):
    """Of a sheet every line has all its separators; this one was refused in words about the times."""
    rec = read(file(text("run 3,,\n,,\nt,q,de", ",", ROWS)), outputs="q", inputs="de")
    assert rec.outputs == ("q",)
    assert rec.t.size == len(ROWS)


def test_a_channel_named_t_is_no_time(file):
    """T, a temperature that rose, was the time in silence beside a column of dates with another name."""
    rows = "".join(f"2026-03-01 10:00:{k:02d};{20 + k * k / 9:.2f};1\n" for k in range(40))
    rec = read(file("Zeitstempel;T;P\n" + rows), outputs="T", inputs="P")
    assert rec.dt == pytest.approx(1.0)
    assert rec["T"][-1] == pytest.approx(189.0)


def test_a_temperature_with_its_unit_is_no_time(file):
    """It was noted as a time in an unknown unit, and both columns might be the time."""
    path = file(text("t [s],T [C],q", ",", ROWS))
    assert columns(path)["note"].tolist()[1:] == ["", ""]
    assert read(path, outputs="q").dt == pytest.approx(0.02)
    alone = columns(file(text("T [C],p,q", ",", ROWS)))  # where nothing else may be the time
    assert "unknown unit" in alone["note"][0]


@pytest.mark.parametrize("head", [",q\ns,deg", "t,q\ns,deg"])
def test_a_line_of_units_is_no_header(file, head):
    table = columns(file(text(head, ",", [row[:2] for row in ROWS])))
    assert table["column"].tolist()[1] == "q"


SOURCES = {
    "list": ([1, 2], SpecError, "int is not a source; give a path"),
    "lengths": ({**ARRAYS, "q": Q[1:]}, DataError, "differ in length .*q 100"),
    "complex": ({**ARRAYS, "q": Q + 1j}, DataError, "'q' is complex; .*two columns"),
    "time first": ({"t": T, "q": np.zeros((50, 2))}, DataError, r"\(channel, time\), transposed"),
    "nothing": ({}, DataError, "no 1-D or 2-D array"),
    "nan": ({**ARRAYS, "q": np.where(T > 1.99, np.nan, Q)}, DataError, r"'q' has 1 missing .*\(row 100\)"),
    "many nan": ({**ARRAYS, "q": Q * np.nan}, DataError, r"101 missing .*row 4, \.\.\.\)"),
    "words": ({**ARRAYS, "q": ["x"] * 101}, DataError, "row 0: column 'q' holds .*'x'.* number is needed"),
    "frame": (pd.DataFrame(ARRAYS).rename(columns={"q": "p"}), SpecError, "the frame has no column 'q'"),
}


@pytest.mark.parametrize("case", SOURCES)
def test_refused_sources(case):
    source, error, words = SOURCES[case]
    with pytest.raises(error, match=words):
        read(source, outputs="q", inputs="de", time="t")


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_cut_short_anywhere(tmp_path, save):
    path = tmp_path / "a.npz"
    save(path, **ARRAYS)
    whole = path.read_bytes()
    for share in (0.0, 0.01, 0.3, 0.9, 0.999):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(DataError, match=r"a\.npz cannot be read as \.npz .*cut short .*write it again"):
            read(path, outputs="q")


def test_refused_paths(tmp_path, file):
    file(text(), "flight7.csv")
    with pytest.raises(DataError, match=r"no file .*flight.csv'; did you mean 'flight7.csv'\?"):
        read(tmp_path / "flight.csv", outputs="q")
    with pytest.raises(DataError, match="check the path"):
        read(tmp_path / "none" / "a.csv", outputs="q")
    with pytest.raises(DataError, match="not a regular file"):
        columns(tmp_path)
    with pytest.raises(SpecError, match=r"kind \.xls are not read; convert it to \.csv"):
        read(file("x", "a.xls"), outputs="q")
    with pytest.raises(DataError, match=r"cannot be read as \.npz"):
        read(file("x", "a.npz"), outputs="q")


# Records of the world ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "outputs", "inputs", "dt", "samples"),
    [
        ("twinotter_lon_018/twinotter_lon_018.csv", "q_dps", "el_deg", 0.02, 401),
        ("tu144_lon_4d/tu144_f20_4d.csv", "q_dps", "lonstk_in", 0.03125, 641),
        ("f18harv_lon_153b/f18harv_153b.csv", ["q_dps", "alpha_deg"], "stab_deg", 0.02, 701),
        ("sst_pitch_tf_delay/sst_pitch.csv", "ytrue_q_dps", "u_stick_cm", 0.03125, 5241),
        ("daisy_hairdryer/hairdryer.csv", "y_temp", "u_heating", 0.08, 1000),
        ("daisy_flexible_structure_2x2/flex_0_4096.csv", ["y1", "y2"], ["u1", "u2"], 1 / 1024, 4096),
    ],
)
def test_real_records_are_even_and_sound(path, outputs, inputs, dt, samples):
    rec = mf.read(measured(path), outputs=outputs, inputs=inputs)
    assert rec.dt == pytest.approx(dt, rel=1e-6)
    assert len(rec.t) == samples
    assert not any("outlying" in sentence or "clipped" in sentence for sentence in rec.check())


def clocks(form):
    """Fifty instants of 0.02 s across midnight, written by a function of a datetime."""
    first = datetime(2026, 3, 1, 23, 59, 59, 500000)
    return [form(first + timedelta(seconds=0.02 * k)) for k in range(50)]


@pytest.mark.parametrize(
    "form",
    [
        lambda at: at.isoformat(timespec="milliseconds"),
        lambda at: at.isoformat(" ", timespec="milliseconds") + "Z",
        lambda at: at.isoformat(timespec="microseconds") + "+02:00",
        lambda at: at.time().isoformat(timespec="milliseconds"),
        lambda at: at.time().isoformat(timespec="milliseconds").replace(".", ","),
        lambda at: f"{at.day}.{at.month}.{at.year} {at.time().isoformat(timespec='milliseconds')}",
        lambda at: f"{at:%d.%m.%Y %H:%M:%S},{at.microsecond // 1000:03d}",
    ],
    ids=[
        "iso",
        "iso with blank",
        "iso with zone",
        "clock",
        "clock with comma",
        "day first",
        "day first, comma",
    ],
)
def test_dates_and_times_over_midnight_become_even_seconds(file, form):
    path = file(text("time;q", ";", zip(clocks(form), (f"{k},5" for k in range(50)), strict=True)))
    rec = mf.read(path, outputs="q")
    assert rec.dt == pytest.approx(0.02, rel=1e-9)
    assert rec.duration == pytest.approx(0.98, rel=1e-9)
    assert mf.columns(path)["unit"].tolist() == ["s", ""]


def test_dates_with_the_day_first_need_no_seconds(file):
    rows = [(f"{1 + k // 24}.3.2026 {k % 24}:05", k) for k in range(30)]
    rec = mf.read(file(text("time,q", rows=rows)), outputs="q")
    assert (rec.dt, rec.t[-1]) == (3600, 29 * 3600)


@pytest.mark.parametrize(
    ("texts", "values"),
    [
        (["999", "1.040", "1.234.567", "-1.200", "n/a"], [999, 1040, 1234567, -1200, np.nan]),
        (["1.233,50", "12,5", "45", "---", "1e3"], [1233.5, 12.5, 45, np.nan, 1000]),
        (["0.512", "1.200", "10.000", "2.5", "7"], [0.512, 1.2, 10, 2.5, 7]),  # no thousands, since 0.512
    ],
    ids=["thousands", "thousands and decimals", "decimal points"],
)
def test_thousands_marks_of_a_file_of_decimal_commas(file, texts, values):
    rows = [(k, one, "45,0") for k, one in enumerate(texts)]
    table = mf.records.reading.open_columns(file(text("t;q;de", ";", rows)))
    np.testing.assert_equal(table.load(["q"])["q"], values)
    np.testing.assert_equal(table.load(["de"])["de"], 45.0)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (
            ["1.5", "2"],
            r"line 2: column 'q' holds '1.5', whose point is no .*'de'.*\('45,0' in line 2\); write",
        ),
        (["1.200", "1.50"], r"line 3: column 'q' holds '1.50', whose point is no thousands mark"),
        (["900", "1.200", "2500"], r"line 3: column 'q' holds '1.200' and, in line 4, '2500' without"),
    ],
)
def test_points_that_may_be_decimal_or_not_are_refused(file, texts, message):
    rows = [(k, one, "45,0") for k, one in enumerate(texts)]
    with pytest.raises(DataError, match=message):
        mf.read(file(text("t;q;de", ";", rows)), outputs="q")


def test_points_are_decimal_where_no_number_has_a_comma(file):
    rows = [(k, "1.200", "a,b" if k else "1,2") for k in range(10)]  # the last column is text
    assert (mf.read(file(text("t;q;note", ";", rows)), outputs="q").y == 1.2).all()


@pytest.mark.parametrize("gap", ["#NV", "#N/A", "Bad", "---", "n/a", "Bad Input", "I/O Timeout", "No Data"])
def test_marks_of_gaps_are_masked(file, gap):
    rows = [(gap if k == 3 else q, t) for k, (t, q) in enumerate(zip(T, Q, strict=True))]
    rec = mf.read(file(text("q,t", rows=rows)), outputs="q", missing="mask")
    assert np.flatnonzero(~rec.mask[0]).tolist() == [3]
    assert len(rec.t) == N + 1


def test_the_separator_line_of_excel(file):
    wanted = mf.read(file(text()), outputs="q")
    assert mf.read(file(text("t;q;de", ";", COMMA, before="sep=;\n")), outputs="q") == wanted


def test_a_thirteenth_month_is_no_date(file):
    with pytest.raises(DataError, match="line 2: column 'time' holds '2026-13-01T00:00' where a number"):
        mf.read(file(text("time,q", rows=[("2026-13-01T00:00", 1.0)])), outputs="q")


def test_decimal_commas_are_read_beside_other_marks(file):
    wanted = mf.read(file(text()), outputs="q")
    assert mf.read(file(text("t;q;de", ";", COMMA)), outputs="q") == wanted
    rows = [(str(t).replace(".", ","), str(q).replace(".", ",")) for t, q in zip(T, Q, strict=True)]
    bare = file("\n".join(";".join(row) for row in rows), name="bare.csv")
    assert np.array_equal(mf.read(bare, outputs="column2", time="column1").y, wanted.y)


def test_milliseconds_are_doubted_until_the_unit_is_said(file):
    path = file(text("t,q", rows=[(20 * k, 0.1 * k) for k in range(20)]))
    assert mf.columns(path)["note"][0] == "time, even, dt = 20 s; or in ms?"
    with pytest.warns(mf.ModfunWarning, match=r"'t' has no unit and steps of 20, .*units=\{'t': 'ms'\}"):
        assert mf.read(path, outputs="q").dt == 20
    assert mf.read(path, outputs="q", units={"t": "ms"}).dt == pytest.approx(0.02)
    assert mf.read(path, outputs="q", units={"t": "s", "q": "deg"}).units == {"q": "deg"}
    with pytest.raises(SpecError, match="units gives 'mile' for the times 't'; did you mean 'min'"):
        mf.read(path, outputs="q", units={"t": "mile"})


@pytest.mark.parametrize("decimals", [15, 9])
@pytest.mark.parametrize("seconds", [0.5, 1, 60, 300])
def test_serial_dates_are_doubted_until_the_unit_is_said(file, seconds, decimals):
    rows = [(f"{46082 + seconds * k / 86400:.{decimals}f}".replace(".", ","), k) for k in range(200)]
    path = file(text("Zeit;q", ";", rows))
    assert mf.columns(path)["note"][0].endswith("; or in d?")
    cure = r"if they are days, as the dates of spreadsheets, give units=\{'Zeit': 'd'\}, else"
    with pytest.warns(mf.ModfunWarning, match=cure):
        mf.read(path, outputs="q")
    rec = mf.read(path, outputs="q", units={"Zeit": "d"})
    assert (rec.t[0], rec.dt) == (0.0, pytest.approx(seconds, rel=1e-4 / min(seconds, 1)))


@pytest.mark.parametrize("step", [0.0005, 0.001, 0.002, 1 / 256, 0.004, 0.005, 1 / 128, 0.01, 0.02])
def test_seconds_of_the_day_are_no_serial_dates(file, step):
    path = file(text("t,q", rows=[(repr(36000 + step * k), k) for k in range(200)]))
    assert mf.read(path, outputs="q").duration == pytest.approx(199 * step)


def test_times_in_minutes_are_even_in_their_own_decimals(file):
    path = file(text("t [min],q", rows=[(f"{k / 60:.3f}", k) for k in range(200)]))
    assert mf.read(path, outputs="q").dt == pytest.approx(1, rel=1e-3)


def test_packed_text_is_read_and_damage_is_said(tmp_path):
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(text().encode()))
    assert np.array_equal(read(path, outputs="q").y[0], Q)
    path.write_bytes(gzip.compress(text().encode())[:-20] + bytes(4))
    with pytest.raises(DataError, match=r"run\.csv\.gz cannot be unpacked .*damaged or cut short"):
        read(path, outputs="q")


@pytest.mark.parametrize("alone", [False, True], ids=["pyarrow", "polars"])
def test_feather_is_read(tmp_path, alone, monkeypatch):
    path = tmp_path / "run.feather"
    pd.DataFrame(ARRAYS).to_feather(path)
    if alone:
        monkeypatch.setattr("modfun.records.opening.find_spec", lambda name: None if name == "pyarrow" else 1)
    assert np.array_equal(read(path, outputs="q", inputs="de").u[0], DE)
    path.write_bytes(b"nothing")
    with pytest.raises(DataError, match=r"run\.feather cannot be read as \.feather"):
        read(path, outputs="q")


def test_sheets_are_read_as_text_files_are(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    path, book = tmp_path / "run.xlsx", openpyxl.Workbook()
    for row in [["time", "q", "de"], ["", "deg/s", "deg"], *zip(clocks(lambda at: at), Q, DE, strict=False)]:
        book.active.append(list(row))
    book.save(path)
    rec = read(path, outputs="q", inputs="de")
    assert (rec.dt, rec.units) == (pytest.approx(0.02), {"q": "deg/s", "de": "deg"})
    np.testing.assert_allclose(rec.y[0], Q[:50], rtol=1e-14)
    book.create_sheet("second").append(["t", "q"])
    book.save(path)
    with pytest.raises(SpecError, match=r"holds 2 sheets; choose one with part=: Sheet, second"):
        read(path, outputs="q")
    assert read(path, outputs="q", part="Sheet").intervals == 49
    with pytest.raises(SpecError, match="has no sheet 'secnd'; did you mean 'second'"):
        read(path, outputs="q", part="secnd")
    path.write_bytes(b"nothing")
    with pytest.raises(DataError, match=r"run\.xlsx cannot be read as \.xlsx"):
        read(path, outputs="q")


def test_texts_of_sheets_are_told_from_their_numbers(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    path, book = tmp_path / "run.xlsx", openpyxl.Workbook()
    book.active.append(["time", "q", "de", "p"])
    for k in range(10):
        book.active.append([f"01.03.2026 10:00:{k:02d}", 1.234, "1.234" if k else "900", "45,5"])
    book.save(path)
    rec = read(path, outputs=["q", "de", "p"])
    assert (rec.dt, rec["q"].tolist(), rec["de"].tolist()) == (1.0, [1.234] * 10, [900.0] + [1234.0] * 9)
    assert rec["p"].tolist() == [45.5] * 10


def test_a_list_of_sources_gives_a_list_of_records(file):
    paths = [file(text(), name=f"run{k}.csv") for k in range(2)]
    records = read([*paths, ARRAYS], outputs="q", inputs="de")
    assert [rec.y.tolist() for rec in records] == [[Q.tolist()]] * 3
    with pytest.raises(SpecError, match="list of sources is empty"):
        read([], outputs="q")


def test_units_go_to_a_file_and_back(tmp_path):
    rec = Record(y=Q, u=DE, dt=0.02, outputs="q", inputs="de", units={"q": "deg/s", "de": "1"})
    rec.to_csv(tmp_path / "run.csv")
    assert (tmp_path / "run.csv").read_text().splitlines()[:2] == ["t,q,de", "s,deg/s,"]
    again = read(tmp_path / "run.csv", outputs="q", inputs="de")
    assert (again.units, again.y.tolist(), again.dt) == ({"q": "deg/s"}, rec.y.tolist(), rec.dt)
