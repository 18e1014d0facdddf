"""Files cut short, huge, in other letters or of other kinds: a message with the file, and nothing is run."""

from __future__ import annotations

import io
import json
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import h5py
import modfun as mf
import numpy as np
import pandas as pd
import pytest
from modfun.study import toml_file
from scipy.io import savemat

T = 0.02 * np.arange(101)
COLUMNS = {"t": T, "y": np.sin(T)}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


class Harmful:
    """What a pickle would run if it were loaded."""

    def __reduce__(self) -> Any:
        return os.mkdir, ("harmed",)


def hdf5(name: str, **given: Any) -> None:
    with h5py.File(name, "w", userblock_size=512) as file:
        for key, value in given.items():
            file[key] = value


def npz_header(count: int) -> bytes:
    head = io.BytesIO()
    words = {"descr": "<f8", "fortran_order": False, "shape": (count,)}
    np.lib.format.write_array_header_1_0(head, words)
    return head.getvalue()


def claims(name: str, count: int) -> None:
    """An array of so many numbers by its header, of a thousand in truth."""
    with zipfile.ZipFile(name, "w") as file:
        file.writestr("y.npy", npz_header(count) + bytes(8000))


def csv(content: bytes | str) -> Path:
    path = Path("run.csv")
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# File by name, what it holds, and what is said.
FILES: dict[str, tuple[bytes, str]] = {
    "bytes.csv": (bytes(range(256)) * 50, r"bytes.csv, line \d+: .* correct the line"),
    "zeros.csv": (bytes(5000), "zeros.csv has column names .{60,90} but no rows of numbers"),
    "line.csv": (b"x" * 10**6, "line.csv has column names .{60,90} but no rows of numbers"),
    "text.csv": (b"t,y\n" + b"0,high\n" * 20, "text.csv, line 2: column 'y' holds 'high' where a number is"),
    "cut.csv": (b"t,y\n0,1\n1,2\n2", "cut.csv, line 4: 1 fields where the header has 2"),
    "huge.csv": (b"t,y\n0," + b"9" * 10**5 + b"\n1,2\n", r"huge.csv: column 'y' has 1 .* infinite .*line 2"),
    "pickle.csv": (pickle.dumps(Harmful()), r"pickle.csv"),
    "pickle.npz": (pickle.dumps(Harmful()), r"pickle.npz cannot be read as .npz"),
    "text.npz": (b"t,y\n0,1\n", "text.npz cannot be read as .npz .* write it again, or give a .csv"),
    "text.mat": (b"t,y\n0,1\n" * 99, "text.mat cannot be read as .mat .* save it again in MATLAB"),
    "empty.mat": (b"", "empty.mat cannot be read as .mat .* cut short"),
    "noise.mat": (bytes(range(256)) * 20, "noise.mat cannot be read as .mat"),
    "text.parquet": (b"t,y\n0,1\n", "text.parquet cannot be read as .parquet"),
    "noise.parquet": (b"PAR1" + bytes(range(256)) + b"PAR1", "noise.parquet cannot be read as .parquet"),
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_other_kinds(name: str) -> None:
    content, said = FILES[name]
    Path(name).write_bytes(content)
    with pytest.raises(mf.ModfunError, match=said) as caught:
        mf.read(name, outputs="y")
    assert len(str(caught.value)) < 600
    assert not Path("harmed").exists()


WRITERS: dict[str, Any] = {
    "run.mat": lambda name: savemat(name, COLUMNS),
    "run73.mat": lambda name: hdf5(name, **COLUMNS),
    "run.parquet": lambda name: pd.DataFrame(COLUMNS).to_parquet(name),
    "run.npz": lambda name: np.savez(name, **COLUMNS),
}


@pytest.mark.parametrize("name", WRITERS)
def test_files_cut_short(name: str) -> None:
    WRITERS[name](name)
    whole = Path(name).read_bytes()
    assert mf.read(name, outputs="y", time="t").intervals == 100
    for share in (0.1, 0.5, 0.9):
        Path(name).write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(mf.ModfunError, match=name):
            mf.read(name, outputs="y", time="t")


def test_arrays_that_claim_to_be_huge() -> None:
    """What a header says is not taken from the memory."""
    claims("claims.npz", 10**12)
    with h5py.File("claims.mat", "w", userblock_size=512) as file:
        file.create_dataset("y", shape=(10**12,), dtype="f8", chunks=(10**6,))
    with pytest.raises(mf.DataError, match=r"claims.npz cannot be read"):
        mf.read("claims.npz", outputs="y", dt=0.1)
    with pytest.raises(mf.DataError, match=r"claims.mat: /y unpacks to 7450.6 GiB and .* are free"):
        mf.read("claims.mat", outputs="y", dt=0.1)


def test_an_archive_that_unpacks_to_more_than_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    np.savez_compressed("bomb.npz", y=np.zeros(10**6))
    assert Path("bomb.npz").stat().st_size < 20000
    monkeypatch.setattr("modfun.base.writing.memory", lambda: 10**6)
    with pytest.raises(mf.DataError, match=r"bomb.npz unpacks to 0.0 GiB and 0.0 GiB of memory are free"):
        mf.read("bomb.npz", outputs="y", dt=0.1)


def test_objects_of_an_archive_are_not_run() -> None:
    np.savez("objects.npz", y=np.array([Harmful()] * 9, dtype=object))
    with pytest.raises(mf.DataError, match=r"objects.npz .*allow_pickle=False"):
        mf.read("objects.npz", outputs="y", dt=0.1)
    assert not Path("harmed").exists()


def test_links_and_loops_of_hdf5() -> None:
    hdf5("outside.mat", y=h5py.ExternalLink("/etc/passwd", "/x"))
    with h5py.File("loop.mat", "w", userblock_size=512) as file:
        file.create_group("g")["g"] = h5py.SoftLink("/g")
    for name in ("outside.mat", "loop.mat"):
        with pytest.raises(mf.DataError, match=f"{name} cannot be read as .mat"):
            mf.read(name, outputs="y", dt=0.1)


@pytest.mark.parametrize("code", ["utf-16", "utf-8-sig", "latin-1"])
def test_letters_of_other_codes_are_read(code: str) -> None:
    """Spreadsheets write "Unicode text" as UTF-16."""
    text = "t [s]\ty [°]\n" + "".join(f"{0.1 * k:.1f}\t{k}\n" for k in range(20))
    rec = mf.read(csv(text.encode(code)), outputs={"y": "y [°]"})
    assert rec.y[0].tolist() == list(range(20))
    assert rec.units["y"] == "°"


# Saved fits --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def saved() -> dict[str, Any]:
    plant = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2)
    told: dict[str, Any] = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), harmonics=6).to_dict()
    return json.loads(json.dumps(told))  # type: ignore[no-any-return]


CHANGES: dict[str, dict[str, Any]] = {
    "no numbers": {"params": None},
    "too few": {"params": [1.0]},
    "words": {"params": ["a", "b", "c"]},
    "covariance": {"cov_hc3": [[1.0]]},
    "halves that differ": {"residuals": [{"re": [1], "im": [1, 2]}]},
    "status": {"status": "fine"},
    "outputs": {"outputs": 5},
    "poles": {"structure": {"poles": 10**9, "zeros": 0, "delay": 0, "denominator": "common", "params": {}}},
}


@pytest.mark.parametrize("case", CHANGES)
def test_a_saved_fit_that_was_changed(saved: dict[str, Any], case: str) -> None:
    Path("fit.json").write_text(json.dumps(saved | CHANGES[case]))
    with pytest.raises(mf.DataError, match=r"load: 'fit.json': the file is damaged .*; fit and save again"):
        mf.load("fit.json")


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"\x80\x04", b"[" * 10**5, b'{"a": ' + b"1" * 5000 + b"}", b"\xff\xfe{\0}\0", b"nul"],
)
def test_what_is_no_json(content: bytes) -> None:
    Path("fit.json").write_bytes(content)
    with pytest.raises(mf.DataError, match=r"load: 'fit.json' is not JSON .*; it should be what fit.save"):
        mf.load("fit.json")


# Study files -------------------------------------------------------------------------------------

PLAIN = """
input = "sin(t)"
duration = 10.0
intervals = 64
nsr = 0.1
estimators = ["ls"]
harmonics = 6
system = { num = [5], den = [1, 3, 8] }
"""
WRONG = {
    "key": (
        PLAIN.replace("harmonics", "harmonic"),
        r"study.toml, line 7: there is no key 'harmonic'; did",
    ),
    "table": (
        PLAIN + "[grids]\na = 1\n",
        r"study.toml, line 9: there is no key 'grids'; did you mean",
    ),
    "key twice": (PLAIN + "nsr = 0.2\n", r"study.toml: this is not TOML: .*\(at line 9"),
    "nothing": ("", r"study.toml: system=, input=, duration=, intervals= are missing"),
    "no input": (PLAIN.replace('input = "sin(t)"', ""), "study.toml: input= is missing; give it"),
    "nan": (PLAIN.replace("0.1", "nan"), "study.toml: nsr holds nan"),
    "no end": (PLAIN.replace("10.0", "inf"), "study.toml: .*duration=inf must be"),
    "huge": (
        PLAIN.replace("64", "10000000000000"),
        "study.toml: .*intervals=10000000000000 must be a whole number from 1 to",
    ),
    "deep": ("a = " + "[" * 20000, "study.toml: this is not TOML: .*recursion"),
    "code": (PLAIN.replace("sin(t)", "__import__('os').mkdir('harmed')"), "is not part of the language"),
    "NUL": ("a = \0", "study.toml: this is not TOML"),
}


@pytest.mark.parametrize("case", WRONG)
def test_study_files(case: str) -> None:
    content, said = WRONG[case]
    Path("study.toml").write_text(content)
    with pytest.raises(mf.SpecError, match=said):
        toml_file.load("study.toml")
    assert not Path("harmed").exists()


def test_a_study_file_that_is_a_folder() -> None:
    Path("study.toml").mkdir()
    with pytest.raises(mf.SpecError, match=r"study file 'study.toml' cannot be read \(Is a directory\)"):
        toml_file.load("study.toml")
