"""Studies on a dask cluster of separate processes: the bits of threads, also where a worker is killed."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import modfun as mf
import pytest
from places import TESTS
from study_cases import dies, made_parts, mine, quick_study, same, small_parts, study, wait_for

dask, distributed = map(pytest.importorskip, ("dask", "distributed"))

UNTIL = {"bias": 0.02}


@pytest.fixture(autouse=True)
def parts_of_one_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    small_parts(monkeypatch)


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """Two processes of one thread each; a task is given up when two have died of it."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(_find, str(TESTS))
        yield client


def _find(folder: str) -> None:
    import sys

    sys.path.insert(0, folder)


def test_the_bits_of_threads(client: Any) -> None:
    made = study()
    there = made.run(executor=client.get_executor(), keep="samples", progress=False)
    assert same(there, made.run(threads=2, keep="samples", progress=False))


def test_functions_of_the_user(client: Any) -> None:
    made = study(system=mf.tf([1], [1, 1]), estimators={"ml": "ml", "mine": mine}, replicates=150, nsr=0.2)
    here, there = (made.run(executor=e, progress=False) for e in (None, client.get_executor()))
    assert same(here, there)
    assert here.messages == there.messages


def test_until_stops_where_threads_stop(client: Any) -> None:
    made = study(nsr=0.4, system=mf.tf([5], [1, 3, 8]))
    there = made.run(until=UNTIL, executor=client.get_executor(), progress=False)
    assert there.replicates > 512
    assert same(there, made.run(until=UNTIL, progress=False))


def test_a_worker_killed_in_mid_run(client: Any, tmp_path: Path) -> None:
    made = quick_study(400 * 512)
    workers = sorted(client.run(os.getpid).values())
    done = []

    def kill() -> None:
        wait_for(tmp_path, 3)
        os.kill(workers[0], signal.SIGKILL)
        done.append(made_parts(tmp_path))

    killer = threading.Thread(target=kill)
    killer.start()
    there = made.run(executor=client.get_executor(), directory=tmp_path, keep="samples", progress=False)
    killer.join()
    assert 3 <= done[0] < 400
    client.wait_for_workers(2, timeout=30)
    assert workers[0] not in client.run(os.getpid).values()
    client.run(_find, str(TESTS))
    assert same(there, made.run(threads=2, keep="samples", progress=False))


def test_a_task_that_kills_every_worker_is_given_up(client: Any) -> None:
    made = study(estimators={"dies": dies}, replicates=64, nsr=0.1)
    with pytest.raises(mf.ModfunError, match=r"KilledWorker.*run again to go on"):
        made.run(executor=client.get_executor(), progress=False)
