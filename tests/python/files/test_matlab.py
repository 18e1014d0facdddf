""".mat files: arrays, structs, an exported iddata with all it says, and what cannot be read."""

from pathlib import Path

import modfun as mf
import numpy as np
import pytest
from modfun import DataError, Record, SpecError, columns, read
from scipy.io import savemat

pytest.importorskip("h5py")
from mat_writer import write_object, write_v73

N = 100
T = 0.02 * np.arange(N + 1)
Y = np.array([np.sin(3 * T), np.cos(2 * T)])
U = np.array([np.cos(T), T**2])


def cells(*values):
    """A cell array 1 x n for SciPy."""
    made = np.empty((1, len(values)), dtype=object)
    made[0] = values
    return made


def write(path, variables, version):
    """Write with either version; lists are cells."""
    if version == 7.3:
        write_v73(path, variables)
    else:
        savemat(path, {name: _for_scipy(value) for name, value in variables.items()}, oned_as="column")
    return path


def _for_scipy(value):
    if isinstance(value, dict):
        return {name: _for_scipy(one) for name, one in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        made = np.empty((1, len(value)), dtype=[(name, object) for name in value[0]])
        for k, one in enumerate(value):
            made[0, k] = tuple(_for_scipy(one[name]) for name in one)
        return made
    return cells(*map(_for_scipy, value)) if isinstance(value, list) else value


def iddata(**changes):
    """What `s = get(z)` makes of an iddata."""
    return {
        "Domain": "Time",
        "Name": "",
        "OutputData": Y.T,
        "y": "Same as OutputData",
        "OutputName": ["q", "alpha"],
        "OutputUnit": ["deg/s", ""],
        "InputData": U.T,
        "u": "Same as InputData",
        "InputName": ["de", "da"],
        "InputUnit": ["deg", "deg"],
        "Period": np.array([np.inf, np.inf]),
        "InterSample": ["zoh", "bl"],
        "Ts": 20.0,
        "Tstart": 40.0,
        "SamplingInstants": np.zeros((N + 1, 0)),
        "TimeUnit": "milliseconds",
        "ExperimentName": "Exp1",
        "Notes": [],
        **changes,
    }


versions = pytest.mark.parametrize("version", [5, 7.3])


@versions
def test_vectors_and_matrices(tmp_path, version):
    path = write(tmp_path / "run.mat", {"t": T, "q": Y[0], "w": Y.T, "v": Y, "g": 9.81, "note": "x"}, version)
    rec = read(path, outputs=["q", "w2"], inputs="v1")
    assert rec == Record(y=Y, u=Y[0], t=T, outputs=["q", "w2"], inputs="v1")
    assert columns(path)["column"].tolist() == ["t", "q", "w1", "w2", "v1", "v2"] or version == 7.3
    assert sorted(columns(path)["column"]) == ["q", "t", "v1", "v2", "w1", "w2"]


@versions
def test_a_cell_array_names_the_channels_of_the_matrix_beside_it(tmp_path, version):
    names = ["t", "q (deg/s)", "de"]
    path = write(tmp_path / "run.mat", {"data": np.array([T, Y[0], U[0]]).T, "names": names}, version)
    assert columns(path)["column"].tolist() == names
    rec = read(path, outputs={"q": "q (deg/s)"}, inputs="de")
    assert (rec["q"] == Y[0]).all()
    assert (rec["de"] == U[0]).all()
    few = write(tmp_path / "few.mat", {"data": np.array([T, Y[0], U[0]]).T, "names": names[:2]}, version)
    assert columns(few)["column"].tolist() == ["data1", "data2", "data3"]


@versions
def test_structs_of_arrays(tmp_path, version):
    fields = {"t": T, "q": Y[0], "deep": {"r": Y[1]}}
    alone = write(tmp_path / "a.mat", {"data": fields}, version)
    rec = read(alone, outputs=["q", "deep.r"])
    assert np.array_equal(rec.y, Y)
    two = write(tmp_path / "b.mat", {"data": fields, "other": {"t": T, "q": Y[1]}}, version)
    assert np.array_equal(read(two, outputs="other.q", time="data.t").y[0], Y[1])
    assert np.array_equal(read(two, outputs="q", part="other").y[0], Y[1])
    with pytest.raises(SpecError, match="no part 'dta', or several; did you mean 'data'"):
        read(two, outputs="q", part="dta")


@versions
def test_an_iddata_says_everything_itself(tmp_path, version):
    expected = Record(
        y=Y,
        u=U,
        dt=0.02,
        t0=0.04,
        outputs=["q", "alpha"],
        inputs=["de", "da"],
        units={"q": "deg/s", "de": "deg", "da": "deg"},
        intersample=["zoh", "smooth"],
    )
    path = write(tmp_path / "run.mat", {"s": iddata()}, version)
    assert read(path) == expected
    assert read(write(tmp_path / "flat.mat", iddata(), version)) == expected  # save -struct
    part = read(path, outputs={"pitch": "q"}, inputs="da")
    assert (part.outputs, part.inputs, part.intersample) == (("pitch",), ("da",), ("smooth",))
    assert part.units == {"pitch": "deg/s", "da": "deg"}
    assert read(path, outputs="q", inputs=[]).inputs == ()
    assert read(path, dt=0.5, intersample="foh", units={"q": "rad/s"}).dt == 0.5
    table = columns(path)
    assert table.title == "run.mat: 101 rows, dt = 0.02 s"
    assert table["note"].tolist() == ["output", "output", "input, zoh", "input, smooth"]
    assert table["unit"].tolist() == ["deg/s", "", "deg", "deg"]


@versions
def test_an_iddata_with_little_in_it(tmp_path, version):
    bare = {"y": Y[0], "u": np.zeros((0, 0)), "Ts": 0.02}
    assert read(write(tmp_path / "a.mat", {"z": bare}, version)) == Record(y=Y[0], dt=0.02)
    one = iddata(OutputName="q", OutputData=Y[0], OutputUnit="", InputData=U[0], InputName="de",
                 InputUnit="", InterSample="foh", TimeUnit="seconds", Ts=0.02, Tstart=[])  # fmt: skip
    rec = read(write(tmp_path / "b.mat", {"z": one}, version))
    assert rec == Record(y=Y[0], u=U[0], dt=0.02, outputs="q", inputs="de", intersample="foh")


@versions
def test_a_workspace_of_times_signals_and_a_step(tmp_path, version):
    """`t` was no column there, whoever named it."""
    path = write(tmp_path / "a.mat", {"t": T, "y": Y[0], "u": U[0], "Ts": 0.02}, version)
    assert read(path) == read(path, outputs="y", inputs="u", time="t") == Record(y=Y[0], u=U[0], dt=0.02)
    assert columns(path).rows[0]["column"] == "t"


@versions
def test_an_iddata_with_times_of_its_own(tmp_path, version):
    times = 1000 * T**1.5
    rec = read(write(tmp_path / "a.mat", {"z": iddata(Ts=np.zeros((0, 0)), SamplingInstants=times)}, version))
    assert rec.dt is None
    np.testing.assert_allclose(rec.t, T**1.5, rtol=1e-14)


@versions
def test_missing_samples_of_an_iddata(tmp_path, version):
    gap = np.where(np.arange(N + 1) == 7, np.nan, Y[:1])
    path = write(tmp_path / "a.mat", {"z": iddata(OutputData=np.vstack([gap, Y[1:]]).T)}, version)
    with pytest.raises(DataError, match=r"'q' has 1 missing .*\(row 7\).* missing='mask'"):
        read(path)
    assert np.flatnonzero(~read(path, missing="mask").mask[0]).tolist() == [7]


@versions
def test_experiments_are_parts(tmp_path, version):
    several = iddata(
        OutputData=[Y.T, 2 * Y.T[:50]],
        InputData=[U.T, U.T[:50]],
        InterSample=["zoh", "zoh", "foh", "bl"],
        Ts=[0.02, 0.04],
        Tstart=[[], 1.0],
        TimeUnit="seconds",
        ExperimentName=["low", "high"],
    )
    path = write(tmp_path / "a.mat", {"z": several}, version)
    with pytest.raises(SpecError, match=r"2 records; choose one with part=: z\.low, z\.high"):
        read(path)
    low, high = (read(path, part=part) for part in ("low", "z.high"))
    assert np.array_equal(high.y, 2 * Y[:, :50])
    assert (low.dt, high.dt, low.t0, high.t0) == (0.02, 0.04, 0.0, 1.0)
    assert (low.intersample, high.intersample) == (("zoh", "zoh"), ("foh", "smooth"))
    with pytest.raises(SpecError, match=r"no part 'lo'.*z\.low, z\.high"):
        columns(path, part="lo")


@versions
def test_several_structs_are_parts(tmp_path, version):
    path = write(tmp_path / "a.mat", {"z1": iddata(), "z2": iddata(Ts=10.0), "x": T}, version)
    with pytest.raises(SpecError, match="2 records; choose one with part=: z1, z2"):
        read(path)
    assert read(path, part="z2").dt == 0.01
    rows = write(tmp_path / "b.mat", {"z": [iddata(), iddata(Ts=5.0)]}, version)
    assert read(rows, part="z(2)").dt == 0.005


def test_the_fit_of_an_exported_iddata(tmp_path):
    rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256)
    fields = {"OutputData": rec.y.T, "InputData": rec.u.T, "Ts": rec.dt, "InterSample": "bl"}
    path = write(tmp_path / "a.mat", {"z": fields}, 5)
    model = mf.TransferFunction(poles=2, zeros=0)
    assert mf.fit(read(path), model).params.tolist() == mf.fit(rec, model).params.tolist()


# What is refused ---------------------------------------------------------------------------------

BAD = {
    "frequency": (iddata(Domain="Frequency"), "frequency domain; export the record in time"),
    "no output": (iddata(OutputData=np.zeros((0, 0))), "has no output: OutputData is empty"),
    "no times": (iddata(Ts=np.zeros((0, 0))), "neither Ts nor SamplingInstants"),
    "unit": (iddata(TimeUnit="fortnights"), "unit of time 'fortnights' is unknown"),
    "no text": (iddata(TimeUnit=np.ones(3)), "TimeUnit holds no text, such as 'seconds'"),
    "names": (iddata(InputName=["q", "de"]), "names stand for two channels each"),
    "text": (iddata(OutputData="none"), r"OutputData holds no matrix \(time, channel\)"),
}


@versions
@pytest.mark.parametrize("case", BAD)
def test_refused_iddata(tmp_path, case, version):
    fields, words = BAD[case]
    with pytest.raises(DataError, match=words):
        read(write(tmp_path / "a.mat", {"z": fields}, version))


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("iddata", r"there: s = get\(z\); save run.mat s"),
        ("timetable", "table2struct"),
        ("tf", "as arrays or"),
    ],
)
def test_objects_of_classes_are_told_the_way_out(tmp_path, kind, words):
    write_object(tmp_path / "a.mat", "z", kind)
    with pytest.raises(DataError, match=f"'z' is an object of MATLAB's class {kind}.*{words}"):
        read(tmp_path / "a.mat", outputs="y")


@versions
def test_files_cut_short_anywhere(tmp_path, version):
    whole = write(tmp_path / "a.mat", {"z": iddata()}, version).read_bytes()
    for share in (0.0, 0.01, 0.1, 0.3, 0.6, 0.9, 0.999):
        path = tmp_path / "cut.mat"
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(
            DataError, match=r"cut\.mat (cannot be read as \.mat .*save it again|holds no num)"
        ):
            read(path)


def test_files_of_other_kinds(tmp_path):
    path = tmp_path / "a.mat"
    path.write_text("t,q\n" + "1,2\n" * 200)
    with pytest.raises(DataError, match="of another kind: save it again in MATLAB"):
        read(path, outputs="q")
    with pytest.raises(SpecError, match=r"part='x' is for \.mat files"):
        read({"t": T}, outputs="t", part="x")
    with pytest.raises(SpecError, match="say with outputs= which of the columns they are: t, q"):
        read({"t": T, "q": T})


def test_version_73_without_h5py(tmp_path, monkeypatch):
    path = write(tmp_path / "a.mat", {"q": T}, 7.3)
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(ImportError, match=r"version 7\.3\) needs h5py: pip install 'modfun\[mat\]'"):
        read(path, outputs="q", dt=0.1)


def test_files_that_matlab_wrote():
    folder = Path(__import__("scipy").__file__).parent / "io/matlab/tests/data"
    names = ("testdouble_4.2c_SOL2", "testdouble_7.4_GLNX86", "testhdf5_7.4_GLNX86")
    files = [folder / f"{name}.mat" for name in names]
    if not all(file.is_file() for file in files):
        pytest.skip("SciPy came without its test data")
    for file in files:
        rec = read(file, outputs="testdouble", dt=1.0)
        np.testing.assert_allclose(rec["testdouble"], np.linspace(0, 2 * np.pi, 9), rtol=1e-15)
    with pytest.raises(DataError, match="'testfunc' is an object of MATLAB's class function_handle"):
        read(folder / "testfunc_7.4_GLNX86.mat", outputs="y")
    for name in ("corrupted_zlib_data", "corrupted_zlib_checksum", "malformed1", "bad_miuint32"):
        with pytest.raises(DataError, match=r"cannot be read as \.mat"):
            read(folder / f"{name}.mat", outputs="y")
