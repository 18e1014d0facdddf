"""Studies in directories: resumed, shared, merged, loaded, and every damage found."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import textwrap
from contextlib import suppress
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
import pytest
from modfun.study import shards
from modfun.study.work import Work
from places import TESTS
from study_cases import made_parts, mine, quick_study, same, small_parts, study, wait_for


@pytest.fixture(autouse=True)
def parts_of_one_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    small_parts(monkeypatch)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, mf.Results]:
    """A finished directory (to be copied, not changed) and its results."""
    with pytest.MonkeyPatch.context() as patch:
        small_parts(patch)
        place = tmp_path_factory.mktemp("finished") / "study"
        return place, study().run(directory=place, keep="samples", progress=False)


@pytest.fixture
def copy(made: tuple[Path, mf.Results], tmp_path: Path) -> Path:
    return Path(shutil.copytree(made[0], tmp_path / "copy"))


def part(place: Path, number: int) -> Path:
    return place / "parts" / f"{number:08d}.part"


# Kept and gone on with ---------------------------------------------------------------------------


def test_with_and_without_a_directory(made: tuple[Path, mf.Results]) -> None:
    place, found = made
    assert same(found, study().run(keep="samples", progress=False))
    assert sorted(f.name for f in place.iterdir()) == sorted(
        ["study.json", "truth.npz", "manifest.json", "parts", "runs.jsonl", "samples.npy"]
    )
    assert len(list((place / "parts").iterdir())) == 6


def test_loaded_results_are_those_of_the_run(made: tuple[Path, mf.Results]) -> None:
    place, found = made
    again = mf.load(place)
    assert isinstance(again, mf.Results)
    assert same(again, found)
    assert again.axes == found.axes
    np.testing.assert_array_equal(again.crlb, found.crlb)
    assert repr(again) == repr(found)
    cell = {"system": "two", "nsr": 0.4}
    (rec, fits), (rec2, fits2) = (r.replicate(2000, **cell) for r in (found, again))
    np.testing.assert_array_equal(rec.y, rec2.y)
    np.testing.assert_array_equal(fits["ml"].params, fits2["ml"].params)
    assert isinstance(again.samples, np.memmap)
    plain = np.load(place / "samples.npy", mmap_mode="r")
    assert plain.shape == (found.replicates, 2, 2, 2, 3)
    np.testing.assert_array_equal(again.samples[1, 0, 1], plain[:, 1, 0, 1])
    np.testing.assert_allclose(again.samples[0, 1, 1, 2000], fits["ml"].params, rtol=1e-10)


def test_more_replicates_later(tmp_path: Path) -> None:
    first = study().run(directory=tmp_path, replicates=700, progress=False)
    assert first.replicates == 700
    times = {k: part(tmp_path, k).stat().st_mtime_ns for k in range(2)}
    more = study().run(directory=tmp_path, progress=False)
    assert same(more, study().run(progress=False))
    assert part(tmp_path, 0).stat().st_mtime_ns == times[0]  # whole: kept
    assert part(tmp_path, 1).stat().st_mtime_ns != times[1]  # was cut short: made again
    with pytest.warns(mf.ModfunWarning, match=r"replicates=10, but directory=.* of this study"):
        fewer = study().run(directory=tmp_path, replicates=10, progress=False)
    assert same(fewer, more)  # a directory never shrinks
    kept = study().run(directory=tmp_path, keep="samples", progress=False)
    assert same(kept, study().run(keep="samples", progress=False))


SCRIPT = """
    import signal, sys
    import modfun as mf, modfun.study.work
    from study_cases import quick_study
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    modfun.study.work.PART = 1.0
    print("ready", flush=True)
    quick_study({replicates}).run(directory=sys.argv[1], progress=False, threads={threads}{more})
    print("done", flush=True)
"""


def start(place: Path, replicates: int, threads: int = 1, more: str = "") -> subprocess.Popen[str]:
    code = textwrap.dedent(SCRIPT.format(replicates=replicates, threads=threads, more=more))
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(place)],
        cwd=TESTS,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_killed_at_any_moment_and_resumed(tmp_path: Path) -> None:
    replicates = 40 * 512 + 7
    for parts in (0, 1, 5, 17):
        process = start(tmp_path / "s", replicates, more=", keep='samples'")
        wait_for(tmp_path / "s", parts)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=10)
    assert made_parts(tmp_path / "s") < 41
    made = quick_study(replicates)
    found = made.run(directory=tmp_path / "s", keep="samples", progress=False)
    assert same(found, made.run(keep="samples", progress=False))


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("executor", ["", ", executor=__import__('concurrent.futures').futures."
                                          "ProcessPoolExecutor(2, __import__('multiprocessing')"
                                          ".get_context('fork'))"])  # fmt: skip
def test_ctrl_c_stops_at_once_and_leaves_what_is_made(tmp_path: Path, executor: str) -> None:
    replicates = 400 * 512
    process = start(tmp_path, replicates, more=executor)
    wait_for(tmp_path, 3)
    os.killpg(process.pid, signal.SIGINT)  # all processes of a terminal get it
    try:
        _, err = process.communicate(timeout=20)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert "KeyboardInterrupt" in err
    assert process.returncode != 0
    left = shards.status(tmp_path)
    assert 3 * 512 <= left.done < replicates
    assert not [f for f in tmp_path.rglob(".*")]
    made = quick_study(replicates)
    assert same(made.run(directory=tmp_path, progress=False), made.run(progress=False))


@pytest.mark.process
def test_two_processes_share_a_directory(tmp_path: Path) -> None:
    replicates = 30 * 512
    both = [start(tmp_path / "s", replicates, more=", keep='samples'") for _ in range(2)]
    for process in both:
        out, err = process.communicate(timeout=60)
        assert out == "done\n", err
    made = quick_study(replicates)
    assert same(mf.load(tmp_path / "s"), made.run(keep="samples", progress=False))


# Shards ------------------------------------------------------------------------------------------


def test_shards_in_one_directory(
    made: tuple[Path, mf.Results], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert study().run(directory=tmp_path, shard=(1, 3), keep="samples") is None
    assert "shard 1 of 3 is done; 4 parts of others are missing" in capfd.readouterr().err
    assert shards.status(tmp_path) == shards.Status(6, 4, 2660, 1024)
    with pytest.raises(mf.DataError, match="4 of 6 parts"):
        mf.load(tmp_path)
    assert study().run(directory=tmp_path, shard=(2, 3), keep="samples", progress=False) is None
    found = study().run(directory=tmp_path, shard=(0, 3), keep="samples", progress=False)
    assert found is not None
    assert same(found, made[1])


def test_directories_of_shards_merged(made: tuple[Path, mf.Results], tmp_path: Path) -> None:
    places = [tmp_path / str(k) for k in range(3)]
    for k, place in enumerate(places):
        study().run(directory=place, shard=(k, 3), keep="samples", progress=False)
    assert shards.merge(tmp_path / "some", places[:2]).missing == 2
    assert shards.merge(tmp_path / "all", places) == shards.Status(6, 0, 2660, 2660)
    assert same(mf.load(tmp_path / "all"), made[1])
    shards.merge(tmp_path / "some", places[2:])
    assert same(mf.load(tmp_path / "some"), made[1])
    other = study(seed=4, replicates=10)
    other.run(directory=tmp_path / "other", progress=False)
    with pytest.raises(mf.SpecError, match="different studies"):
        shards.merge(tmp_path / "new", [places[0], tmp_path / "other"])
    with pytest.raises(mf.SpecError, match="no directories"):
        shards.merge(tmp_path / "new", [])
    with pytest.raises(mf.SpecError, match="no directory of a study"):
        shards.merge(tmp_path / "new", [tmp_path])


# Damage ------------------------------------------------------------------------------------------


def flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def heals(place: Path, made: tuple[Path, mf.Results], missing: int) -> None:
    """The damage is found, refused by load, and made good by running again."""
    assert shards.status(place).missing == missing
    with pytest.raises(mf.DataError, match=f"{missing} of 6 parts"):
        mf.load(place)
    assert same(study().run(directory=place, keep="samples", progress=False), made[1])
    assert shards.status(place).missing == 0


def test_a_byte_changed_anywhere_in_a_part_is_found(made: tuple[Path, mf.Results], copy: Path) -> None:
    size = part(copy, 0).stat().st_size
    for at in [*range(0, 200), *range(200, size, max(1, size // 50)), size - 1]:
        flip(part(copy, 0), at)
        assert shards.status(copy).missing == 1, at
        flip(part(copy, 0), at)
    assert shards.status(copy).missing == 0
    for number in range(6):
        flip(part(copy, number), 5000)
    heals(copy, made, 6)


def test_parts_cut_short_missing_and_empty(made: tuple[Path, mf.Results], copy: Path) -> None:
    for number, size in enumerate((0, 3, 100, 5000)):
        os.truncate(part(copy, number), size)
    part(copy, 5).unlink()
    heals(copy, made, 5)


def test_parts_of_other_places_and_studies(made: tuple[Path, mf.Results], copy: Path, tmp_path: Path) -> None:
    shutil.copy(part(copy, 0), part(copy, 1))
    study(seed=4).run(directory=tmp_path / "other", progress=False)
    shutil.copy(part(tmp_path / "other", 2), part(copy, 2))
    shutil.copy(part(copy, 5), part(copy, 3))
    heals(copy, made, 3)


def test_estimates_that_were_changed_are_made_again(made: tuple[Path, mf.Results], copy: Path) -> None:
    flip(copy / "samples.npy", 128 + 8 * 24 * 600)
    with pytest.raises(mf.DataError, match=r"samples.npy' is missing or damaged at replicates 512 to 1023"):
        mf.load(copy)
    assert same(study().run(directory=copy, keep="samples", progress=False), made[1])
    os.truncate(copy / "samples.npy", 5000)
    with pytest.raises(mf.DataError, match=r"samples.npy' is missing or damaged at replicates 0 to 511"):
        mf.load(copy)
    assert same(study().run(directory=copy, keep="samples", progress=False), made[1])


def test_a_damaged_manifest_is_refused_and_can_be_made_again(
    made: tuple[Path, mf.Results], copy: Path
) -> None:
    manifest = copy / "manifest.json"
    size = manifest.stat().st_size
    for at in range(3, size - 3, 7):
        sound = manifest.read_bytes()
        flip(manifest, at)
        if json.loads(sound) != _json(manifest):  # not mere white space
            with pytest.raises((mf.DataError, mf.SpecError)):
                study().run(directory=copy, progress=False)
            with pytest.raises(mf.DataError, match="damaged"):
                mf.load(copy)
        manifest.write_bytes(sound)
    manifest.unlink()
    times = [part(copy, k).stat().st_mtime_ns for k in range(6)]
    assert same(study().run(directory=copy, keep="samples", progress=False), made[1])
    assert times == [part(copy, k).stat().st_mtime_ns for k in range(6)]


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_bytes())
    except ValueError:
        return None


@pytest.mark.parametrize("name", ["study.json", "truth.npz"])
def test_a_damaged_description_is_refused_by_load_and_written_again(
    made: tuple[Path, mf.Results], copy: Path, name: str
) -> None:
    flip(copy / name, 300)
    with pytest.raises(mf.DataError, match="damaged or missing"):
        mf.load(copy)
    study().run(directory=copy, progress=False)
    assert same(mf.load(copy), made[1])


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "options", "reason"),
    [
        ({"seed": 4}, {}, "seed 3 there, 4 here"),
        ({"nsr": [0.1, 0.3]}, {}, "other signals, noise levels"),
        ({"estimators": ["ls", "awls"]}, {}, "estimators or functions"),
        ({}, {"draw": "samples"}, "draw 'coefficients' there"),
        ({}, {"coverage": False}, "coverage True there"),
    ],
)
def test_another_study_is_refused(
    copy: Path, changes: dict[str, Any], options: dict[str, Any], reason: str
) -> None:
    with pytest.raises(mf.SpecError, match=reason):
        study(**changes).run(directory=copy, progress=False, **options)


def test_other_places_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(mf.SpecError, match=r"thesis\.tex, which no study wrote"):
        study().run(directory=tmp_path, progress=False)
    with pytest.raises(mf.SpecError, match="is a file"):
        study().run(directory=tmp_path / "thesis.tex", progress=False)
    with pytest.raises(mf.SpecError, match="no directory of a study"):
        mf.load(tmp_path)
    with pytest.raises(mf.SpecError, match="'x' is a lambda, which a reader of directory="):
        study(estimators={"x": lambda rec, rng: []}).run(directory=tmp_path / "d", progress=False)
    assert sorted(f.name for f in tmp_path.iterdir()) == ["thesis.tex"]


def test_a_disk_that_takes_nothing_more(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    part(copy, 3).unlink()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(mf.ModfunError, match=r"manifest.json' cannot be written \(No space left"):
            study().run(directory=copy, progress=False)
    assert shards.status(copy).missing == 1
    assert not [f for f in copy.rglob(".*")]


def test_another_version_of_the_package_is_said(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modfun.study.directory.__version__", "9.9")
    with pytest.warns(mf.ModfunWarning, match=r"begun with modfun .*, this is 9.9"):
        study().run(directory=copy, progress=False)


# Functions ---------------------------------------------------------------------------------------


def test_functions_are_kept_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    structure = mf.TransferFunction(poles=1, zeros=0)
    own = {"mine": mine, "oe": mf.rivals.output_error(structure), "ml": "ml"}
    made = study(system=mf.tf([1], [1, 1]), estimators=own, replicates=70, nsr=0.1)
    found = made.run(directory=tmp_path, progress=False)
    again = mf.load(tmp_path)
    assert same(found, again)
    assert found.messages == again.messages
    fits, fits2 = (r.replicate(3)[1] for r in (found, again))
    assert fits["oe"] == fits2["oe"]
    np.testing.assert_array_equal(fits["mine"].params, fits2["mine"].params)
    monkeypatch.delattr("study_cases.mine")
    lost = mf.load(tmp_path)
    assert same(found, lost)
    answer = lost.replicate(3)[1]["mine"]
    assert isinstance(answer, mf.DataError)
    assert "study_cases:mine" in str(answer)


# The hash ----------------------------------------------------------------------------------------


def key(draw: str = "samples", coverage: bool = True, samples: bool = False, **changes: Any) -> str:
    return Work(study(**changes).plan, draw, coverage, samples).key


def changed(rec: mf.Record, rng: np.random.Generator) -> list[float]:
    return [1.0, 2.0]


def test_the_hash_changes_with_what_changes_numbers_and_with_nothing_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tf, tf2 = mf.tf([5], [1, 3, 8]), mf.TransferFunction(poles=2, zeros=0)
    base = {"system": tf, "nsr": 0.1}
    own = {"e": mf.Estimator(tf2, method="ml", harmonics=6)}
    t = np.linspace(0, 10, 65)
    equal = [
        key(**base),
        key(**base, replicates=7),
        key(**base, samples=True),
        key(**(base | {"system": {"name": tf}, "nsr": [0.1]})),
        key(**base, input={"chirp": "sin(t**2/5)"}),
    ]
    assert len(set(equal)) == 1
    different = [
        key(**base, seed=4),
        key(**base, draw="coefficients"),
        key(**base, coverage=False),
        key(**(base | {"nsr": 0.1 + 1e-15})),
        key(**(base | {"system": mf.tf([5], [1, 3, 8 + 1e-13])})),
        key(**base, input=np.sin(t**2 / 5) + 1e-14),
        key(**base, duration=10.001),
        key(**base, initial_state="zero"),
        key(**base, initial_state=[1.0, 0.0]),
        key(**base, estimators=["ls"]),
        key(**base, estimators=["ml", "ls"]),
        key(**base, estimators=own),
        *(
            key(**base, estimators={"e": mf.Estimator(tf2, method="ml", harmonics=6, **{name: value})})
            for name, value in {
                "trend": None, "tol": 1e-8, "maxiter": 49, "rule": "trapezoid", "extended": False,
                "cov_type": "nonrobust", "noise": "equation",
            }.items()
        ),
        key(**base, estimators={"e": mine}),
        key(**base, estimators={"e": changed}),
        key(**base, estimators={"e": mf.rivals.output_error(tf2)}),
        key(**base, estimators={"e": mf.rivals.output_error(tf2, maxiter=3)}),
    ]  # fmt: skip
    assert key(**base, estimators={"other name": own["e"]}) == key(**base, estimators=own)
    monkeypatch.setattr("modfun.study.work.CHUNK", 1024)
    different.append(key(**base))
    monkeypatch.undo()
    small_parts(monkeypatch)
    monkeypatch.setattr("modfun.study.work.STREAM_VERSION", 99)
    different.append(key(**base))
    assert len({equal[0], *different}) == 1 + len(different)
