"""Exports of process historians: bad quality, values stored by exception, coarse clocks, names twice."""

import modfun as mf
import numpy as np
import pytest
from modfun import DataError, SpecError

N = 120
Y = np.sin(np.arange(N) / 9)


@pytest.fixture
def export(tmp_path):
    """A function that writes columns with decimal commas."""

    def write(header, *columns):
        path = tmp_path / "export.csv"
        rows = [";".join(str(x).replace(".", ",") for x in row) for row in zip(*columns, strict=True)]
        path.write_text("\n".join([header, *rows]))
        return path

    return write


def with_words(*words):
    values = [f"{y:.4f}" for y in Y]
    values[30 : 30 + len(words)] = words
    return values


def test_words_of_bad_quality_are_masked(export):
    path = export("t;y", range(N), with_words("Bad", "Bad Input", "#NV", "I/O Timeout", "No Data"))
    rec = mf.read(path, outputs="y", missing="mask")
    assert np.flatnonzero(~rec.mask[0]).tolist() == [30, 31, 32, 33, 34]


@pytest.mark.parametrize("frame", [False, True])
def test_other_words_are_named_by_the_user(export, frame):
    values = with_words("St\u00f6rung")
    source = {"t": np.arange(N), "y": np.array(values)} if frame else export("t;y", range(N), values)
    with pytest.raises(DataError, match="missing_values='St\u00f6rung'"):
        mf.read(source, outputs="y", missing="mask")
    rec = mf.read(source, outputs="y", missing="mask", missing_values=["st\u00f6rung", "other"])
    assert np.flatnonzero(~rec.mask[0]).tolist() == [30]


def test_an_input_that_is_stored_when_it_changes_is_held_if_asked(export):
    u = np.repeat([0.0, 1.0, 0.5, 2.0], N // 4)
    stored = ["" if k and u[k] == u[k - 1] else u[k] for k in range(N)]
    path = export("t;u;y", range(N), stored, with_words("", ""))
    for missing in ("refuse", "mask"):
        with pytest.raises(DataError, match=r"'u' has 116 missing .*missing='hold' if an empty cell"):
            mf.read(path, outputs="y", inputs="u", missing=missing)
    rec = mf.read(path, outputs="y", inputs="u", missing="hold")
    assert np.array_equal(rec["u"], u)
    assert np.flatnonzero(~rec.mask[0]).tolist() == [30, 31]
    assert rec.intersample == ("zoh",)


def test_nothing_is_held_before_the_first_value(export):
    path = export("t;u;y", range(N), ["", "", *[1.5] * (N - 2)], Y)
    with pytest.raises(DataError, match=r"'u' has 2 missing .*\(line 2, line 3\); there is no value before"):
        mf.read(path, outputs="y", inputs="u", missing="hold")


@pytest.mark.parametrize(("per", "cut"), [(30, 0), (30, 7), (2, 1)])
def test_a_clock_too_coarse_for_its_samples_is_told_the_step(export, per, cut):
    minutes = 60 * ((np.arange(N) + cut) // per)
    path, step = export("t;y", minutes, Y), 60 / per
    with pytest.raises(DataError, match=rf"in {per} samples in a row.*too coarse .*give dt={step:g} instead"):
        mf.Record(y=Y, t=minutes) if cut == 0 else mf.read(path, outputs="y", time="t")
    assert f"{per} rows each have the same: give dt={step:g}" in mf.columns(path)["note"][0]
    assert mf.read(path, outputs="y", dt=step).dt == step
    with pytest.raises(SpecError, match=rf"stand still for {per} rows each, of {step:g} s; give dt={step:g}"):
        mf.read(path, outputs="y", dt=1.5 * step)


@pytest.mark.parametrize("k", [1, 60])
def test_one_repeated_time_is_no_coarse_clock(k):
    t = np.arange(N, dtype=float)
    t[k] = t[k - 1]
    with pytest.raises(DataError, match=f"at index {k}: .*drop repeated ones"):
        mf.Record(y=Y, t=t)


def test_columns_of_one_name_are_numbered(export):
    path = export("t;T (K);T (K)", range(N), Y, 2 * Y)
    table = mf.columns(path)
    assert table["column"].tolist() == ["t", "T (K)#1", "T (K)#2"]
    assert table["unit"].tolist()[1:] == ["K", "K"]
    rec = mf.read(path, time="t", outputs={"T": "T (K)#2"})
    assert rec["T"] == pytest.approx(2 * Y)
    assert rec.units == {"T": "K"}
    with pytest.raises(SpecError, match=r"2 columns named 'T \(K\)'; give one by its number"):
        mf.read(path, time="t", outputs="T (K)")
