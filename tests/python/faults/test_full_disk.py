"""A disk that is full: said with what to do, nothing lost, and it goes on when there is room."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path

import modfun as mf
import numpy as np
import pytest
from modfun.commands.main import main
from modfun.study import shards
from study_cases import same, small_parts, study

FULL = r"cannot be written \((No space left on device|File too large)\); .*make room"


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of a megabyte."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True)
    except OSError as error:
        pytest.skip(f"no small disk can be mounted: {error}")
    if done.returncode:
        pytest.skip(f"no small disk can be mounted: {done.stderr.strip()}")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.fixture(scope="module")
def fit() -> mf.Fit:
    plant = mf.tf([5], [1, 3, 8])
    rec = mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.2)
    return mf.fit(rec, mf.TransferFunction(poles=2, zeros=0), harmonics=6)


def fill(disk: Path, left: int = 0) -> None:
    """Take all room but so many KiB."""
    with open(disk / "ballast", "wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            size = file.tell()
    os.truncate(disk / "ballast", size // 4096 * 4096 - 1024 * left)


@pytest.mark.parametrize("keep", ["summary", "samples"])
def test_a_study_on_a_full_disk(disk: Path, monkeypatch: pytest.MonkeyPatch, keep: str) -> None:
    small_parts(monkeypatch)
    made = study(replicates=20 * 512)
    undisturbed = made.run(keep=keep, progress=False)
    fill(disk, left=500)
    with pytest.raises(mf.ModfunError, match=FULL + " .* run again to go on"):
        made.run(directory=disk / "s", keep=keep, progress=False)
    kept = shards.status(disk / "s")
    assert kept.damaged == ()
    assert 0 < kept.done < 20 * 512
    assert not list(disk.rglob("*.writing"))
    subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
    assert same(made.run(directory=disk / "s", keep=keep, progress=False), undisturbed)
    assert isinstance(mf.load(disk / "s"), mf.Results)


SIGNAL = mf.signals.doublet(width=1.0, dt=0.01)
WRITERS: dict[str, Callable[[mf.Fit, Path], object]] = {
    "fit.json": lambda fit, place: fit.save(place),
    "rec.csv": lambda fit, place: fit.records[0].to_csv(place),  # type: ignore[index]
    "signal.csv": lambda fit, place: SIGNAL.to_csv(place),
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_was_there_stays(disk: Path, fit: mf.Fit, name: str) -> None:
    WRITERS[name](fit, disk / name)
    before = (disk / name).read_bytes()
    fill(disk)
    with pytest.raises(mf.ModfunError, match=FULL):
        WRITERS[name](fit, disk / name)
    assert (disk / name).read_bytes() == before
    assert sorted(path.name for path in disk.iterdir()) == sorted(["ballast", name])
    (disk / "ballast").unlink()
    WRITERS[name](fit, disk / name)
    assert (disk / name).read_bytes() == before


def test_the_command_says_so(disk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = 0.05 * np.arange(101)
    rows = "\n".join(f"{a!r},{b!r},{c!r}" for a, b, c in zip(t, np.sin(t), np.cos(t), strict=True))
    (disk / "rec.csv").write_text("t,y,u\n" + rows.replace("np.float64(", "").replace(")", "") + "\n")
    fill(disk)
    command = ["fit", str(disk / "rec.csv"), "--output", "y", "--input", "u", "--poles", "1"]
    assert main([*command, "--json", str(disk / "out.json")]) == 1
    err = capsys.readouterr().err
    assert "modfun: --json: " in err
    assert "make room" in err
    assert "Traceback" not in err


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process")
def test_a_limit_on_the_size_of_files(tmp_path: Path, fit: mf.Fit) -> None:
    """As a full disk, without the rights to mount one."""
    fit.save(tmp_path / "fit.json")
    code = """
        import resource, signal, sys
        import modfun as mf
        fit = mf.load("fit.json")
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
        try:
            fit.save("fit.json")
        except mf.ModfunError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], cwd=tmp_path, capture_output=True, text=True
    )
    assert "save: 'fit.json' cannot be written (File too large); make room" in done.stdout, done.stderr
    assert mf.load(tmp_path / "fit.json").params.tolist() == fit.params.tolist()
    assert [path.name for path in tmp_path.iterdir()] == ["fit.json"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_device_that_is_full(fit: mf.Fit) -> None:
    with pytest.raises(
        mf.ModfunError, match=r"save: '/dev/full' cannot be written \(No space left on device"
    ):
        fit.save("/dev/full")
