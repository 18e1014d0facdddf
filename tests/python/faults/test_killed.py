"""Studies that are killed (kill -9) at any moment go on where they were, to the same bits."""

from __future__ import annotations

import os
import random
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import modfun as mf
import pytest
from modfun.study import shards
from places import TESTS
from study_cases import quick_study, same, small_parts

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked, to be quick")

REPLICATES = 40 * 512 + 7
KEPT: dict[str, Any] = {"keep": "samples", "progress": False}

# Forks a process that runs the study for each line it reads: "after" and the seconds after which it is
# killed, or "at" and the step of writing before which it kills itself. Says what became of it.
FORKS = """
    import builtins, os, signal, sys, time
    import modfun as mf, modfun.study.directory, modfun.study.run, modfun.study.work
    from study_cases import quick_study
    modfun.study.work.PART = 1.0
    quick_study(1).run(progress=False, threads=1)  # so that no child has to load what runs need
    pwrite = os.pwrite

    def counted(call, steps):
        def step(*given, **words):
            if next(steps) == 0:
                if call is pwrite:  # half of it was written
                    file, data, at = given
                    pwrite(file, bytes(data)[: len(data) // 2], at)
                os.kill(os.getpid(), signal.SIGKILL)
            return call(*given, **words)
        return step

    for line in sys.stdin:
        way, number, replicates, place = line.split()
        child = os.fork()
        if child == 0:
            if way == "at":
                steps = iter(range(int(number), -10**6, -1))
                for name in ("open", "fsync", "replace", "close", "pwrite"):
                    setattr(os, name, counted(getattr(os, name), steps))
                builtins.open = counted(builtins.open, steps)
            quick_study(int(replicates)).run(directory=place, keep="samples", progress=False, threads=1)
            os._exit(0)
        if way == "after":
            time.sleep(float(number))
            os.kill(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        print("killed" if os.WIFSIGNALED(status) else os.WEXITSTATUS(status), flush=True)
"""


class Forks:
    """A process that forks studies and has them killed."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(FORKS)],
            cwd=TESTS,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def killed(self, way: str, number: float, replicates: int, place: Path) -> bool:
        """Run a study; False if it came to its end before."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        print(way, number, replicates, place, file=self.process.stdin, flush=True)
        end = self.process.stdout.readline().strip()
        assert end in ("killed", "0")
        return end == "killed"


@pytest.fixture
def forks(monkeypatch: pytest.MonkeyPatch) -> Iterator[Forks]:
    small_parts(monkeypatch)
    made = Forks()
    yield made
    made.process.communicate(timeout=30)


def test_fifty_moments_of_a_run(forks: Forks, tmp_path: Path) -> None:
    """Studies are killed and gone on with until they end; a new one begins until fifty were killed."""
    undisturbed = quick_study(REPLICATES).run(**KEPT)
    assert not forks.killed("never", 0, 1, tmp_path / "warm")
    start = time.monotonic()
    assert not forks.killed("never", 0, REPLICATES, tmp_path / "whole")
    span = time.monotonic() - start
    rng, kills, place, seen = random.Random(0), 0, tmp_path / "0", set()
    while kills < 50 or place.exists() or (len(seen) <= 5 and kills < 300):  # busy machines kill early
        start = time.monotonic()
        if forks.killed("after", rng.uniform(0, span), REPLICATES, place):
            kills += 1
            span *= 1.05  # or a machine that has become slower would never come to an end
            if (place / "manifest.json").exists():
                left = shards.status(place)
                assert left.damaged == ()
                assert left.done == sum(size(number) for number in there(place))
                seen.add(left.done)
            continue
        span = max(0.7 * span, time.monotonic() - start)
        found = mf.load(place)
        assert isinstance(found, mf.Results)
        assert same(found, undisturbed)
        place = tmp_path / str(kills)
    assert len(seen) > 5


def there(place: Path) -> list[int]:
    """Numbers of the parts whose files are there."""
    return [int(path.stem) for path in (place / "parts").glob("*.part")]


def size(number: int) -> int:
    """Replicates of a part."""
    return min(512, REPLICATES - 512 * number)


def test_every_step_of_writing(forks: Forks, tmp_path: Path) -> None:
    """The process kills itself before each open, write, flush, rename and close."""
    undisturbed = quick_study(600).run(**KEPT)
    step, killed = 0, True
    while killed:
        place = tmp_path / str(step)
        killed = forks.killed("at", step, 600, place)
        assert same(quick_study(600).run(directory=place, **KEPT), undisturbed), step
        assert shards.status(place).damaged == ()
        step += 1
    assert step > 40


def test_what_killed_processes_left_is_removed_when_it_is_old(forks: Forks, tmp_path: Path) -> None:
    step = 0
    while not (left := list(tmp_path.rglob("*.writing"))):
        assert forks.killed("at", step, 600, tmp_path / "s")
        step += 1
    quick_study(600).run(directory=tmp_path / "s", **KEPT)
    assert left[0].exists()  # another process may be at it
    os.utime(left[0], (0, 0))
    quick_study(600).run(directory=tmp_path / "s", **KEPT)
    assert not left[0].exists()
