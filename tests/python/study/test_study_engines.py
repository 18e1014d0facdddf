"""Studies give the same bits for any engine and instruction set; the stopping rule; what is refused."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import textwrap
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import modfun as mf
import numpy as np
import pytest
from places import TESTS
from study_cases import backwards, dies, dies_once, mine, part_size, same, small_parts, study

SPAWN, FORK = (multiprocessing.get_context(kind) for kind in ("spawn", "fork"))


@pytest.fixture(autouse=True)
def parts_of_one_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    small_parts(monkeypatch)
    # A spawned process reads the size of parts from the work it is given.


@pytest.fixture(scope="module")
def reference() -> mf.Results:
    with pytest.MonkeyPatch.context() as patch:
        small_parts(patch)
        return study().run(threads=1, keep="samples", progress=False)


def test_a_part_is_a_whole_number_of_chunks_by_sizes_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    assert part_size(study()) == part_size(study(replicates=1, seed=9)) == 512
    monkeypatch.undo()
    light, heavy = part_size(study(nsr=0.1)), part_size(study(intervals=4096, nsr=[0.1, 0.2, 0.3]))
    assert light > 8 * heavy >= 8 * 512
    assert light % 512 == 0
    assert part_size(study(estimators={"mine": mine})) == 64


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_threads(reference: mf.Results, threads: int) -> None:
    assert same(study().run(threads=threads, keep="samples", progress=False), reference)


@pytest.mark.forks
@pytest.mark.parametrize("context", [SPAWN, FORK], ids=["spawn", "fork"])
def test_processes(reference: mf.Results, context: Any) -> None:
    with ProcessPoolExecutor(2, mp_context=context) as pool:
        found = study().run(executor=pool, keep="samples", progress=False)
    assert same(found, reference)
    assert found.seconds["ml"] > 0


class Forgetful(ThreadPoolExecutor):
    """Loses the answer to every task the first time, as a cluster does when a worker dies after it."""

    def __init__(self, losses: int) -> None:
        super().__init__(2)
        self.losses, self.asked = losses, {}

    def submit(self, call: Any, part: Any) -> Any:
        self.asked[part.number] = self.asked.get(part.number, 0) + 1
        if self.asked[part.number] <= self.losses:
            lost: Future[Any] = Future()
            lost.set_exception(ValueError("not enough values to unpack"))
            return lost
        return super().submit(call, part)


def test_an_answer_that_is_lost_is_asked_for_once_more(reference: mf.Results) -> None:
    with Forgetful(1) as pool:
        found = study().run(executor=pool, keep="samples", progress=False)
        assert set(pool.asked.values()) == {2}
    assert same(found, reference)
    with Forgetful(2) as pool, pytest.raises(mf.ModfunError, match="did not give its part back"):
        study().run(executor=pool, progress=False)


@pytest.mark.parametrize("executor", [map, backwards])
def test_functions_as_map(reference: mf.Results, executor: Any) -> None:
    assert same(study().run(executor=executor, keep="samples", progress=False), reference)


@pytest.mark.forks
def test_a_map_of_a_pool(reference: mf.Results) -> None:
    with FORK.Pool(2) as pool:
        assert same(study().run(executor=pool.imap_unordered, keep="samples", progress=False), reference)


def test_functions_of_the_user_anywhere() -> None:
    made = study(system=mf.tf([1], [1, 1]), estimators={"ml": "ml", "mine": mine}, replicates=150, nsr=0.2)
    here = made.run(progress=False, keep="samples")
    assert 0 < here.status["raised"][1] < 30
    assert here.messages["count"].sum() == here.status["raised"][1]
    with ProcessPoolExecutor(2, mp_context=SPAWN) as pool, ThreadPoolExecutor(2) as threads:
        for executor in (pool, threads):
            there = made.run(executor=executor, progress=False, keep="samples")
            assert same(here, there)
            assert here.messages == there.messages
    local = study(system=mf.tf([1], [1, 1]), estimators={"x": lambda rec, rng: [1.0, 1.0]}, replicates=10)
    with ThreadPoolExecutor(1) as threads:
        assert local.run(executor=threads, progress=False).failures.sum() == 0
    with pytest.raises(mf.SpecError, match=r"'x' is a lambda, which the processes of executor="):
        local.run(executor=backwards, progress=False)


def test_texts_are_capped_and_all_counted() -> None:
    def never(rec: mf.Record, rng: np.random.Generator) -> list[float]:
        raise ValueError(f"{rng.random()}" + "no" * 5000)

    with pytest.warns(
        mf.ModfunWarning, match="failed in every replicate; the first said: ValueError: 0.*nono"
    ):
        res = study(estimators={"never": never}, replicates=60, nsr=0.1).run(progress=False)
    assert res.status["raised"].sum() == 120
    assert len(res.messages) == 100
    assert max(map(len, res.messages["text"])) <= 2000


@pytest.fixture(scope="module")
def best() -> bytes:
    done = _figures("")
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("isa", ["plain", "avx2", "avx512", "neon"])
def test_instruction_sets(best: bytes, isa: str) -> None:
    done = _figures(isa)
    refusal = f"MODFUN_ISA={isa}: this processor has no "
    if refusal in done.stderr.decode():
        assert done.returncode != 0
        pytest.skip(refusal + "such instructions")
    assert done.returncode == 0, done.stderr
    assert len(best) > 1000
    assert done.stdout == best


def test_an_instruction_set_that_does_not_exist_is_refused() -> None:
    refusal = 'SpecError: MODFUN_ISA="avx3" is not one of "avx512", "avx2", "neon", "plain"'
    assert refusal in _figures("avx3").stderr.decode()


def _figures(isa: str) -> subprocess.CompletedProcess[bytes]:
    """A study of all methods, held to an instruction set."""
    code = """
        import numpy as np, sys
        from study_cases import *
        res = study(replicates=700, estimators=["ls", "wls", "awls", "ml"]).run(progress=False)
        for name in FIGURES:
            sys.stdout.buffer.write(np.ascontiguousarray(getattr(res, name)).tobytes())
    """
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env={**os.environ, "MODFUN_ISA": isa},
        cwd=TESTS,
        capture_output=True,
    )


@pytest.mark.forks
def test_fork_after_use(reference: mf.Results) -> None:
    assert study().run(threads=2, progress=False).replicates == reference.replicates
    with FORK.Pool(1) as pool:
        answer = pool.apply_async(_bias, ())
        np.testing.assert_array_equal(answer.get(timeout=30), reference.bias)


def _bias() -> Any:
    return study().run(threads=2, progress=False).bias


# The stopping rule -------------------------------------------------------------------------------


@pytest.mark.forks
def test_until_stops_at_the_same_part_for_all(tmp_path: Path) -> None:
    made = study(nsr=0.4, system=mf.tf([5], [1, 3, 8]), replicates=50)
    one = made.run(until={"bias": 0.02, "coverage": 0.02}, progress=False)
    assert one.replicates % 512 == 0
    assert one.replicates > 512
    assert max(one.bias_mcse.max() / 0.02, one.coverage_mcse.max() / 0.02) <= 1
    before = made.run(replicates=one.replicates - 512, progress=False)
    assert max(before.bias_mcse.max() / 0.02, before.coverage_mcse.max() / 0.02) > 1
    with ProcessPoolExecutor(2, mp_context=FORK) as pool:
        assert same(one, made.run(until={"bias": 0.02, "coverage": 0.02}, executor=pool, progress=False))
    kept = made.run(until={"bias": 0.02, "coverage": 0.02}, directory=tmp_path / "s", progress=False)
    assert same(one, kept)
    assert same(one, mf.load(tmp_path / "s"))


def test_until_that_is_never_met_says_so() -> None:
    made = study(replicates=600)
    with pytest.warns(mf.ModfunWarning, match="not reached after 700 replicates"):
        made.run(until={"sd": 1e-9}, replicates=700, progress=False)
    for until in ({}, {"mean": 1.0}, {"bias": 0.0}, ["bias"], {"bias": "x"}):
        with pytest.raises(mf.SpecError, match="until="):
            made.run(until=until, progress=False)  # type: ignore[arg-type]
    with pytest.raises(mf.SpecError, match="no coverage"):
        made.run(until={"coverage": 0.1}, coverage=False, progress=False)
    with pytest.raises(mf.SpecError, match="directory="):
        made.run(until={"bias": 0.1}, keep="samples", progress=False)


# What goes wrong ---------------------------------------------------------------------------------


@pytest.mark.forks
@pytest.mark.parametrize("context", [SPAWN, FORK], ids=["spawn", "fork"])
def test_a_worker_that_dies(context: Any) -> None:
    made = study(estimators={"dies": dies}, replicates=200)
    with (
        ProcessPoolExecutor(2, mp_context=context) as pool,
        pytest.raises(mf.ModfunError, match=r"BrokenProcessPool.*are kept if directory= was given"),
    ):
        made.run(executor=pool, progress=False)


class Breaking(Executor):
    """Its workers die at once; as in a pool of processes, it is the pool that ends what was begun."""

    def __init__(self) -> None:
        self._max_workers, self.begun = 2, list[Future[Any]]()

    def submit(self, call: Any, *parts: Any) -> Any:
        if len(self.begun) == 4:
            raise BrokenExecutor("a worker died")
        self.begun.append(Future())
        if len(self.begun) == 4:
            self.begun[0].set_exception(BrokenExecutor("a worker died"))
        return self.begun[-1]


def test_what_a_broken_pool_ends_itself_is_not_cancelled() -> None:
    pool = Breaking()
    with pytest.raises(mf.ModfunError, match="BrokenExecutor: a worker died"):
        study(replicates=5000).run(executor=pool, progress=False)
    assert [future.cancelled() for future in pool.begun] == 4 * [False]


@pytest.mark.forks
def test_a_run_goes_on_after_a_worker_died(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    made = study(system=mf.tf([1], [1, 1]), estimators={"x": dies_once}, replicates=300, nsr=0.1)
    with (
        ProcessPoolExecutor(2, mp_context=FORK) as pool,
        pytest.raises(mf.ModfunError, match="BrokenProcessPool"),
    ):
        made.run(executor=pool, directory="s", progress=False)
    with ProcessPoolExecutor(2, mp_context=FORK) as pool:
        found = made.run(executor=pool, directory="s", progress=False)
    assert same(found, made.run(progress=False))


class Counting(Executor):
    """Runs at once, and counts what is on its way."""

    def __init__(self) -> None:
        self.waiting: list[Any] = []
        self.most = 0

    def submit(self, function: Any, /, *given: Any, **words: Any) -> Any:
        future: Future[Any] = Future()
        self.waiting.append((future, function, given))
        self.most = max(self.most, len(self.waiting))
        if len(self.waiting) == 64:  # the window of an executor that does not tell its size
            for one, call, values in self.waiting[::-1]:
                one.set_result(call(*values))
            self.waiting = []
        return future


def test_tasks_in_flight_are_bounded_and_may_come_in_any_order() -> None:
    made = study(replicates=3 * 64 * 512, nsr=0.1, system=mf.tf([1], [1, 1]), estimators=["ls"], harmonics=6)
    executor = Counting()
    found = made.run(executor=executor, progress=False)
    assert executor.most == 64
    assert same(found, made.run(progress=False))


def _done(value: Any) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_result(value)
    return future


@pytest.mark.parametrize(
    ("options", "cure"),
    [
        ({"executor": 3}, "with submit"),
        ({"executor": ThreadPoolExecutor}, r"the class ThreadPoolExecutor; .* as ThreadPoolExecutor\(\)"),
        ({"executor": lambda f, items: []}, "fewer results .* an iterable with function"),
        ({"executor": lambda f, items: None}, "executor= returned None; .* an iterable with function"),
        ({"executor": lambda f, items: [1] * len(items)}, "is a int, not .* an iterable with function"),
        ({"executor": lambda f, items: [None] * len(items)}, "is None, not .* an iterable with function"),
        ({"executor": lambda f, items: {k: f(k) for k in items}}, "is a Part, not .* an iterable with"),
        ({"executor": lambda f: f}, r"failed with TypeError: .*called as f\(function, parts\)"),
        (
            {"executor": SimpleNamespace(submit=lambda f, part: 3)},
            "returned a int, no future; .*returns a future",
        ),
        (
            {"executor": SimpleNamespace(submit=lambda f: 3)},
            "submit .* failed with TypeError.*returns a future",
        ),
        (
            {"executor": SimpleNamespace(submit=lambda f, part: _done(3))},
            "held a int, not .*returns a future",
        ),
        ({"shard": (0, 2)}, "give directory="),
        ({"shard": (2, 2), "directory": "x"}, "0 <= k < n"),
        ({"shard": 3, "directory": "x"}, "0 <= k < n"),
        ({"shard": (0.0, 2), "directory": "x"}, r"shard=\(0.0, 2\) must be \(k, n\), whole numbers"),
        ({"shard": (True, 2), "directory": "x"}, r"shard=\(True, 2\) must be \(k, n\), whole numbers"),
        ({"shard": (0, 2), "directory": "x", "until": {"bias": 1.0}}, "until="),
        ({"directory": 5}, "directory=5 cannot name a directory .* give a path as a text"),
        ({"directory": ["a"]}, r"directory=\['a'\] cannot name a directory"),
        ({"directory": b"a"}, "directory=b'a' cannot name a directory"),
        ({"directory": "é" * 300}, r"directory='é+\.\.\. cannot name a directory \(File name too long\)"),
        ({"directory": "a\0b"}, "cannot name a directory .*embedded null"),
        ({"directory": Path(__file__) / "a"}, "cannot name a directory .Not a directory"),
        ({"replicates": 0}, "whole number from 1"),
        ({"replicates": 10**9, "keep": "samples"}, "GiB of memory are free; give directory="),
    ],
)
def test_bad_runs(options: dict[str, Any], cure: str) -> None:
    with pytest.raises(mf.SpecError, match=cure):
        study().run(progress=False, **options)


@pytest.mark.parametrize("late", [False, True])
def test_what_a_map_raises_is_the_cause(late: bool) -> None:
    def fails(function: Any, items: Any) -> Any:
        if late:
            return (function(item) if item.number == 0 else {}["x"] for item in items)
        raise KeyError("x")

    with pytest.raises(mf.SpecError, match="executor= failed with KeyError: 'x'") as caught:
        study().run(executor=fails, progress=False)
    assert isinstance(caught.value.__cause__, KeyError)


def test_memory_that_is_refused_points_to_a_directory(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*given: Any) -> Any:
        raise MemoryError

    made = study()
    monkeypatch.setattr("modfun.study.run.memory", lambda: None)
    monkeypatch.setattr("modfun.study.run.np.full", none)
    with pytest.raises(mf.SpecError, match=r"2660 replicates needs 0.0 GiB, .* give directory="):
        made.run(keep="samples", progress=False)


# Memory ------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform != "linux", reason="kilobytes of ru_maxrss")
@pytest.mark.parametrize("kept", ["", "directory='s', keep='samples'"])
def test_memory_does_not_grow_with_replicates(kept: str, tmp_path: Path) -> None:
    """The estimates of the longer study are 96 MB, which no peak shows."""
    code = f"""
        import resource, modfun.study.work
        from study_cases import study
        modfun.study.work.LARGEST = 2**20
        for replicates in (10**5, 10**6):
            study(estimators=["ls"], harmonics=6).run(replicates=replicates, progress=False, {kept})
            print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    """
    out = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env={**os.environ, "PYTHONPATH": str(TESTS)},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    short, long = map(float, out.split())
    assert long - short < 24, out
