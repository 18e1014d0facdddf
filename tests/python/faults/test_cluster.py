"""A dask cluster whose scheduler is killed: said, and what was finished is kept for the next run."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import modfun as mf
import pytest
from modfun.study import shards
from places import TESTS
from study_cases import quick_study, same, small_parts

pytest.importorskip("distributed")

# Scheduler and workers are processes of their own; the scheduler is killed when three parts are there.
LOST = """
    import os, pathlib, subprocess, sys, threading, time
    import dask, distributed
    import modfun as mf, modfun.study.work
    from study_cases import quick_study, wait_for

    modfun.study.work.PART = 1.0
    dask.config.set({"distributed.comm.timeouts.connect": "2s"})
    place = pathlib.Path(sys.argv[1])
    told = str(place / "scheduler.json")

    def start(name, *options):
        return subprocess.Popen([sys.executable, "-m", f"distributed.cli.dask_{name}", *options,
                                 "--scheduler-file", told], stderr=subprocess.DEVNULL)

    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
    workers = []
    try:
        while not os.path.exists(told):
            time.sleep(0.05)
        workers = [start("worker", "--nthreads", "1", "--no-dashboard", "--no-nanny") for _ in range(2)]
        client = distributed.Client(scheduler_file=told)
        client.wait_for_workers(2, timeout=60)

        def kill():
            wait_for(place / "s", 3)
            scheduler.kill()

        threading.Thread(target=kill).start()
        quick_study(400 * 512).run(executor=client.get_executor(), directory=place / "s", progress=False)
    except mf.ModfunError as error:
        print(error, flush=True)
    finally:
        for process in (scheduler, *workers):
            process.kill()
            process.wait()
        os._exit(0)  # the client would wait for its scheduler
"""


def test_the_scheduler_is_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small_parts(monkeypatch)
    tests = str(TESTS)
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(LOST), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": tests},
        cwd=tests,
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert "did not give its part back" in done.stdout, done.stderr
    assert "finished before are kept if directory= was given: run again to go on" in done.stdout
    kept = shards.status(tmp_path / "s")
    assert kept.damaged == ()
    assert 3 * 512 <= kept.done < 400 * 512
    made = quick_study(kept.done + 512)  # the same study, of fewer replicates
    store = tmp_path / "s" / "parts"
    before = {path.name: path.stat().st_mtime_ns for path in store.glob("*.part")}
    made.run(directory=tmp_path / "s", shard=(0, 50), progress=False)
    assert {name: (store / name).stat().st_mtime_ns for name in before} == before
    found = quick_study(400 * 512).run(directory=tmp_path / "s", progress=False)
    assert same(found, quick_study(400 * 512).run(progress=False))
    assert isinstance(mf.load(tmp_path / "s"), mf.Results)
