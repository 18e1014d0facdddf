"""Records as pandas, polars and xarray objects and as .parquet, there and back; such objects of others."""

import sys

import numpy as np
import pandas as pd
import pytest
from modfun import DataError, Record, SpecError, columns, read

pl = pytest.importorskip("polars")
xr = pytest.importorskip("xarray")
pytest.importorskip("pyarrow")

N = 100
T = 0.05 * np.arange(N + 1)
Y = np.array([np.sin(3 * T), np.cos(2 * T)])
U = np.array([np.cos(T), T**2])
OK = np.ones((2, N + 1), dtype=bool)
OK[0, 40:50] = OK[1, 0:3] = False
ROLES = {"outputs": ["q", "a"], "inputs": ["de", "da"]}
MORE = {
    "units": {"q": "deg/s", "de": "deg", "event": "V"},
    "intersample": ["zoh", "smooth"],
    "keep": {"event": T},
}

RECORDS = {
    "plain": Record(y=Y[0], u=U[0], dt=0.05),
    "free motion": Record(y=Y, dt=0.05, t0=3.0),
    "all of it": Record(y=Y, u=U, dt=0.05, **ROLES, **MORE, mask=OK, sigma=1 + Y**2),
    "uneven": Record(y=Y, u=U, t=T**1.1, **ROLES, **MORE),
    "a window": Record(y=Y, u=U, dt=0.05, **ROLES, **MORE, sigma=1 + T).window(1.0, 3.0),
    "a name taken": Record(y=Y, dt=0.05, outputs=["q", "q_sigma"], sigma=1 + T),
}


@pytest.mark.parametrize("case", RECORDS)
def test_pandas_there_and_back(case, tmp_path):
    rec = RECORDS[case]
    frame = rec.to_pandas()
    assert read(frame) == rec
    assert read(frame.reset_index()) == rec
    frame.to_parquet(tmp_path / "run.parquet")
    assert read(tmp_path / "run.parquet") == rec


@pytest.mark.parametrize("case", RECORDS)
def test_xarray_there_and_back(case, tmp_path):
    rec = RECORDS[case]
    data = rec.to_xarray()
    assert read(data) == rec
    data.to_netcdf(tmp_path / "run.nc", engine="scipy")
    with xr.open_dataset(tmp_path / "run.nc", engine="scipy") as opened:
        assert read(opened) == rec
    with pytest.raises(SpecError, match=r"give xarray\.open_dataset\('run\.nc'\)"):
        read(tmp_path / "run.nc")


def test_polars_there_and_back(tmp_path):
    rec = RECORDS["all of it"]
    frame = pl.from_pandas(rec.to_pandas().reset_index())
    back = read(frame, **ROLES, keep="event", units=rec.units, intersample=rec.intersample,
                sigma={"q": "q_sigma", "a": "a_sigma"}, missing="mask")  # fmt: skip
    np.testing.assert_allclose(back.dt, rec.dt, rtol=1e-12)
    assert np.array_equal(back.mask, rec.mask)
    np.testing.assert_allclose(back.y, rec.y, rtol=1e-12)
    assert np.array_equal(back.sigma[OK], rec.sigma[OK])
    assert np.array_equal(back["event"], rec["event"])
    frame.write_parquet(tmp_path / "run.parquet")
    again = read(tmp_path / "run.parquet", outputs={"q": "q"}, missing="mask")
    assert np.array_equal(again["q"], back["q"])


def test_a_frame_that_was_changed_tells_only_what_is_still_so():
    rec = RECORDS["all of it"]
    frame = rec.to_pandas()
    assert read(frame.drop(columns=["a", "event", "q_sigma"])).channels == ("q", "de", "da")
    assert read(frame.iloc[::2]).dt == pytest.approx(0.1, rel=1e-12)
    renamed = read(frame, outputs={"pitch": "q"}, inputs="de")
    assert (renamed.outputs, renamed.units) == (("pitch",), {"pitch": "deg/s", "de": "deg", "event": "V"})
    assert np.array_equal(renamed.mask[0], OK[0])
    assert read(frame, outputs="q", keep=[], intersample="foh").intersample == ("foh", "foh")
    odd = pd.DataFrame({"t": T, "q": Y[0]})
    odd.attrs["modfun"] = "mine"
    assert read(odd, outputs="q").outputs == ("q",)


def test_what_a_data_set_looks_like():
    data = RECORDS["all of it"].to_xarray()
    assert data.q.dims == ("t",)
    assert data.t.attrs == {"units": "s"}
    assert data.q.attrs == {"role": "output", "units": "deg/s", "masked": 10}
    assert data.de.attrs == {"role": "input", "units": "deg", "intersample": "zoh"}
    assert data.q_sigma.attrs == {"role": "sigma", "of": "q"}
    assert int(data.q.isnull().sum()) == 10
    with pytest.raises(SpecError, match="a channel is named 't'"):
        Record(y=T, dt=0.05, outputs="t").to_xarray()


# Objects that others made ------------------------------------------------------------------------


def test_a_data_set_of_ones_own():
    time = ("time", 1000 * T, {"units": "ms"})
    data = xr.Dataset({"q": ("time", Y[0], {"units": "deg/s"}), "g": 9.81}, {"time": time, "e": ("time", T)})
    rec = read(data, outputs="q", inputs="e")
    assert rec == Record(y=Y[0], u=T, t=T, outputs="q", inputs="e", units={"q": "deg/s"})
    assert columns(data)["column"].tolist() == ["time", "e", "q"]
    assert columns(data)["unit"].tolist() == ["ms", "", "deg/s"]
    for dt in (0.05, 50.0, "50 ms", [0.05]):  # an attribute of others, which may mean anything
        assert read(data.assign_attrs(dt=dt), outputs="q", inputs="e").dt == pytest.approx(0.05, rel=1e-12)
    with pytest.raises(SpecError, match="or give dt="):
        read(xr.Dataset({"q": ("t", Y[0])}, attrs={"dt": 50.0}), outputs="q")
    dated = data.assign_coords(time=np.datetime64("2024-01-01") + (1e9 * T).astype("timedelta64[ns]"))
    assert read(dated, outputs="q").dt == pytest.approx(0.05)


@pytest.mark.parametrize("turned", [False, True])
def test_data_arrays(turned):
    labels = {"t": T, "channel": ["q", "a"]}
    array = xr.DataArray(Y, labels, ("channel", "t"), attrs={"units": "deg/s"})
    rec = read(array.T if turned else array, outputs=["a", "q"])
    assert np.array_equal(rec.y, Y[::-1])
    assert rec.units == {"a": "deg/s", "q": "deg/s"}
    numbered = xr.DataArray(Y.T, dims=("t", "channel"), name="v")
    assert np.array_equal(read(numbered, outputs="v2", dt=0.05).y[0], Y[1])
    alone = xr.DataArray(Y[0], {"sample": T}, ("sample",))
    assert read(alone, outputs="y", time="sample").dt == pytest.approx(0.05)
    both = xr.Dataset({"v": array, "w": 2 * array})
    assert np.array_equal(read(both, outputs="w a").y[0], 2 * Y[1])


def test_polars_frames_with_nulls_and_dates():
    first = np.datetime64("2024-01-01")
    frame = pl.DataFrame({"time": first + (1e6 * T).astype("timedelta64[us]"), "q": Y[0], "n": range(N + 1)})
    assert read(frame, outputs=["q", "n"]).dt == pytest.approx(0.05)
    holes = frame.with_columns(n=pl.when(pl.col("n") == 7).then(None).otherwise(pl.col("n")))
    with pytest.raises(DataError, match=r"'n' has 1 missing .*\(row 7\)"):
        read(holes, outputs="n")
    assert np.flatnonzero(~read(holes, outputs="n", missing="mask").mask[0]).tolist() == [7]
    with pytest.raises(SpecError, match="the frame has no column 'Q'; did you mean 'q'"):
        read(frame, outputs="Q")


@pytest.mark.parametrize("by", ["pyarrow", "polars"])
def test_parquet_of_others(tmp_path, monkeypatch, by):
    path = tmp_path / "run.parquet"
    frame = pd.DataFrame({"TIME [ms]": 1000 * T, "Q (deg/s)": Y[0], "note": "x", "n": np.arange(N + 1)})
    frame.to_parquet(path)
    RECORDS["all of it"].to_pandas().to_parquet(tmp_path / "own.parquet")
    if by == "polars":
        monkeypatch.setattr(
            "modfun.records.opening.find_spec", lambda name: None if name == "pyarrow" else name
        )
        monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    rec = read(path, outputs={"q": "Q (deg/s)"}, inputs="n")
    assert rec == Record(y=Y[0], u=np.arange(N + 1), t=T, outputs="q", inputs="n", units={"q": "deg/s"})
    assert columns(path)["note"].tolist() == ["time, even, dt = 0.05 s", "", "text", ""]
    with pytest.raises(SpecError, match=r"run\.parquet has no column 'q'; did you mean 'Q \(deg/s\)'"):
        read(path, outputs="q")
    assert read(tmp_path / "own.parquet") == RECORDS["all of it"]
    whole = path.read_bytes()
    for share in (0.0, 0.1, 0.5, 0.99):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(DataError, match=r"run\.parquet cannot be read as \.parquet .*write it again"):
            read(path, outputs="n")


def test_parquet_damaged_within(tmp_path):
    path = tmp_path / "run.parquet"
    pd.DataFrame({"t": T, "q": Y[0]}).to_parquet(path)
    content = bytearray(path.read_bytes())
    content[4:400] = bytes(396)
    path.write_bytes(content)
    with pytest.raises(DataError, match="it is damaged, cut short or of another kind"):
        read(path, outputs="q")


def test_parquet_without_a_reader(tmp_path, monkeypatch):
    path = tmp_path / "run.parquet"
    pd.DataFrame({"t": T}).to_parquet(path)
    monkeypatch.setattr("modfun.records.opening.find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(
        ImportError, match=r"reading run\.parquet needs pyarrow: pip install 'modfun\[parquet\]'"
    ):
        read(path, outputs="t")


REFUSED = {
    "three dimensions": (
        xr.Dataset({"q": (("run", "x", "t"), np.zeros((2, 2, 9)))}),
        DataError,
        r"isel\(run=0\)",
    ),
    "no time": (
        xr.Dataset({"q": (("run", "x"), Y)}),
        SpecError,
        "dimensions run, x; name the one of the times",
    ),
    "nothing over time": (xr.Dataset({"g": 9.8}, {"t": T}), DataError, "holds no variable over 't'"),
    "no clock": (xr.Dataset({"q": ("t", Y[0])}), SpecError, "no column is named t or time; .* give dt="),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_xarray_objects(case):
    source, error, words = REFUSED[case]
    with pytest.raises(error, match=words):
        read(source, outputs="q")
