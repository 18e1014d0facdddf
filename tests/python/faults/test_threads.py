"""Threads that call modfun together, and processes forked after it was used: the bits of a call alone."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import modfun as mf
import numpy as np
import pytest
from places import TESTS
from study_cases import FIGURES, small_parts, study

TF2 = mf.TransferFunction(poles=2, zeros=0)


def record(k: int) -> mf.Record:
    plant = mf.tf([5 + k], [1, 3, 8 + k])
    return mf.simulate(plant, input="sin(t**2/5)", duration=10.0, intervals=128 + k, nsr=0.2, seed=k)


def single(k: int) -> list[Any]:
    found = mf.fit(record(k), TF2, harmonics=5 + k % 3)
    return [found.params, found.bse]


def many(k: int) -> list[Any]:
    found = mf.fit_many([record(k)] * 30, TF2, harmonics=6)
    return [found.params, found.bse]


def monte_carlo(k: int) -> list[Any]:
    found = study(seed=k, replicates=1100).run(progress=False, threads=1 + k % 3)
    return [getattr(found, name) for name in FIGURES]


def resampled(k: int) -> list[Any]:
    found = mf.bootstrap(mf.fit(record(k), TF2, harmonics=8), replicates=200, seed=k)
    return [found.sd]


def streamed(k: int) -> list[Any]:
    rec = record(k)
    stream = mf.Stream(mf.Estimator(TF2, harmonics=6), dt=rec.dt, window=8.0)
    stream.push(rec.y, rec.u)
    return [stream.fit().params]


@pytest.mark.parametrize("call", [single, many, monte_carlo, resampled, streamed])
def test_eight_threads_on_eight_problems(call: Callable[[int], list[Any]], monkeypatch: Any) -> None:
    small_parts(monkeypatch)
    alone = [call(k) for k in range(8)]
    together = threading.Barrier(8)

    def turn(k: int) -> list[list[Any]]:
        together.wait(timeout=60)
        return [call(k) for _ in range(3)]

    with ThreadPoolExecutor(8) as pool:
        for wanted, turns in zip(alone, pool.map(turn, range(8)), strict=True):
            for found in turns:
                for a, b in zip(found, wanted, strict=True):
                    np.testing.assert_array_equal(a, b)


def test_others_run_while_the_core_computes() -> None:
    """A thread counts on; it would not if the interpreter were held until the study's end."""
    ticks, done = 0, threading.Event()

    def run() -> None:
        study(replicates=100 * 512).run(progress=False, threads=1)
        done.set()

    worker = threading.Thread(target=run)
    worker.start()
    while not done.wait(0.001):
        ticks += 1
    worker.join()
    assert ticks > 20


FORKED = """
    import os, signal, sys, threading, warnings
    import modfun as mf, numpy as np, modfun.study.work
    from study_cases import same, study
    warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 warns where there are threads
    modfun.study.work.PART = 1.0
    before = study().run(threads=3, progress=False)
    stop = threading.Event()
    def busy():
        while not stop.is_set():
            study().run(threads=2, progress=False)
    other = threading.Thread(target=busy)
    other.start()
    for _ in range(8):
        child = os.fork()
        if child == 0:
            signal.alarm(60)
            os._exit(0 if same(study().run(threads=2, progress=False), before) else 1)
        assert os.waitpid(child, 0)[1] == 0
    stop.set()
    other.join()
    print("done")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_forks_while_another_thread_computes() -> None:
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(FORKED)],
        cwd=TESTS,
        capture_output=True,
        text=True,
        timeout=400,
    )
    assert done.stdout == "done\n", done.stderr
