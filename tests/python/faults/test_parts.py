"""What stands where a part should be, and is none: made again, or refused with what to do; never counted."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import modfun as mf
import numpy as np
import pytest
from modfun.study import shards
from modfun.study.files import packed, unpacked
from study_cases import same, small_parts, study

GIVEN = {"replicates": 3 * 512, "estimators": ["ls"], "harmonics": 6}


@pytest.fixture(autouse=True)
def parts_of_one_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    small_parts(monkeypatch)


@pytest.fixture
def place(tmp_path: Path) -> Path:
    study(**GIVEN).run(directory=tmp_path / "s", progress=False)
    return tmp_path / "s"


def part(place: Path, number: int = 1) -> Path:
    return place / "parts" / f"{number:08d}.part"


def empty(path: Path) -> None:
    path.write_bytes(b"")


def zeros(path: Path) -> None:
    """What some file systems show of a file whose blocks were lost in a power cut."""
    path.write_bytes(bytes(path.stat().st_size))


def noise(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 400)


def other_version(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b"modfun part 2", b"modfun part 3", 1))


def twice(path: Path) -> None:
    path.write_bytes(2 * path.read_bytes())


def of_other_replicates(path: Path) -> None:
    """The title of a part that is longer than any."""
    path.write_bytes(path.read_bytes().replace(b" 512 ", b" 513 ", 1))


def of_another_study(path: Path) -> None:
    study(**GIVEN, seed=9).run(directory=path.parents[2] / "other", progress=False)
    shutil.copy(part(path.parents[2] / "other"), path)


def link_to_nothing(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


def link_to_another(path: Path) -> None:
    path.unlink()
    path.symlink_to(part(path.parents[1], 0))


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def unreadable(path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may read everything")
    path.chmod(0)


@pytest.mark.parametrize(
    "harm",
    [
        empty, zeros, noise, other_version, twice, of_other_replicates, of_another_study, link_to_nothing,
        link_to_another, pipe, unreadable,
    ],
)  # fmt: skip
def test_it_is_seen_and_made_again(place: Path, harm: Callable[[Path], None]) -> None:
    before = mf.load(place)
    assert isinstance(before, mf.Results)
    harm(part(place))
    found = shards.status(place)
    assert (found.missing, found.done) == (1, 2 * 512)
    with pytest.raises(mf.DataError, match=r"1 of 3 parts .* run the study again with this directory="):
        mf.load(place)
    assert same(study(**GIVEN).run(directory=place, progress=False), before)
    assert shards.status(place).missing == 0


def test_a_folder_stays_and_is_named(place: Path) -> None:
    part(place).unlink()
    part(place).mkdir()
    with pytest.raises(mf.ModfunError, match=r"00000001.part' cannot be written \(Is a directory\); parts .* "
                       "are kept: move it away, and run again"):  # fmt: skip
        study(**GIVEN).run(directory=place, progress=False)
    part(place).rmdir()
    study(**GIVEN).run(directory=place, progress=False)
    assert shards.status(place).missing == 0


def test_a_link_to_a_sound_part_serves(place: Path, tmp_path: Path) -> None:
    part(place).rename(tmp_path / "elsewhere")
    part(place).symlink_to(tmp_path / "elsewhere")
    assert shards.status(place).missing == 0


def test_a_manifest_of_a_later_schema_is_refused(place: Path) -> None:
    from modfun.study.directory import _sum

    manifest = place / "manifest.json"
    told = json.loads(manifest.read_text()) | {"schema": 7, "modfun": "9.9"}
    manifest.write_text(json.dumps(told | {"sum": _sum(told)}))
    for call in (lambda: mf.load(place), lambda: study(**GIVEN).run(directory=place, progress=False)):
        with pytest.raises(mf.DataError, match=r"has schema 7 \(modfun 9.9\), this version reads 1; install"):
            call()


def test_a_note_that_was_cut_short_is_passed_over(place: Path) -> None:
    with open(place / "runs.jsonl", "ab") as file:
        file.write(b'{"begun": "20')
    study(**GIVEN).run(directory=place, progress=False)
    assert same(study(**GIVEN).run(directory=place, progress=False), study(**GIVEN).run(progress=False))
    assert shards.status(place).complete


def test_arrays_of_any_name_come_back_and_objects_are_refused() -> None:
    given = {"file": np.arange(3.0), "allow_pickle": np.eye(2, dtype=np.int64), "0": np.array(7)}
    found = unpacked(packed(given))
    assert list(found) == list(given)  # and no other
    for name, array in given.items():
        np.testing.assert_array_equal(found[name], array, strict=True)
    with pytest.raises(ValueError, match="Object arrays cannot be saved"):
        packed({"y": np.array([object()])})
