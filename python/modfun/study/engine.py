"""Who computes the parts of a study: threads of this process, an executor, or a map-like function."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import nullcontext
from queue import Empty, SimpleQueue
from typing import Any, Protocol

from ..base.interrupts import Held
from ..errors import ModfunError, SpecError
from .tally import Tally
from .work import Part, Work, compute
from .worker import GIVEN_UP, new_run, stop, task

__all__ = ["Engine", "Store", "engine", "tallies"]

Answer = tuple[Part, Tally]

BYTES = 2**28  # of estimates that may be on their way at once
UNKNOWN = 64  # tasks in flight where an executor does not tell how many workers it has
SLICE = 0.1  # seconds between two looks for Ctrl-C

POOLS = ("concurrent.futures.process", "concurrent.futures.thread", "distributed.")
FUTURE = ("add_done_callback", "result", "cancel")  # what is called of one
SUBMITS = (
    "give an executor whose submit(function, part) returns a future with the result of function(part), as "
    "those of concurrent.futures"
)
MAPS = (
    "a map-like function is called as f(function, parts) and returns an iterable with function(part) of each "
    "part, as map does"
)


class Engine(Protocol):
    """Computes parts; answers come in any order."""

    window: int

    def begin(self, part: Part) -> None:
        """Take on a part."""

    def answer(self) -> Answer:
        """Wait for any of the parts begun."""

    def stop(self) -> None:
        """Give up what was begun."""


class Store(Protocol):
    """Keeps parts."""

    def holds(self, part: Part) -> bool:
        """Whether this very part is there, undamaged."""

    def load(self, part: Part) -> Tally:
        """A part that is there."""

    def save(self, part: Part, tally: Tally) -> None:
        """Keep a part."""


class Threads:
    """One part after another, each on all threads of this process."""

    window = 1

    def __init__(self, work: Work, threads: int, progress: Callable[[float], None]) -> None:
        self._work, self._threads, self._progress = work, threads, progress
        self._part: Part | None = None

    def begin(self, part: Part) -> None:
        self._part = part

    def answer(self) -> Answer:
        part, self._part = self._part, None
        assert part is not None

        def within(done: int, total: int) -> None:
            self._progress(part.first + part.replicates * done / max(total, 1))

        return part, compute(self._work, part, self._threads, within)

    def stop(self) -> None:
        self._part = None


class Submitted:
    """Each part a task of one thread, given to an executor."""

    def __init__(self, work: Work, executor: Any) -> None:
        workers = getattr(executor, "_max_workers", None)
        self.window = _window(work, 2 * workers if isinstance(workers, int) else UNKNOWN)
        self._run = new_run()
        self._task = task(work, self._run)
        self._executor = executor
        # Who computes in submit itself can be interrupted there.
        self._quick = any(kind.__module__.startswith(POOLS) for kind in type(executor).__mro__)
        self._done: SimpleQueue[Any] = SimpleQueue()
        self._futures: dict[Any, Part] = {}
        self._again: set[int] = set()
        self._taken = False
        self._broken = False

    def begin(self, part: Part) -> None:
        try:
            with Held() if self._quick else nullcontext():
                future = self._executor.submit(self._task, part)
        except ModfunError:
            raise
        except RuntimeError as error:
            self._broken = isinstance(error, BrokenExecutor)
            raise _died(error) from error
        except Exception as error:
            if self._taken:  # it was sound, and is gone
                raise _died(error) from error
            raise SpecError(
                f"run: submit of executor= failed with {type(error).__name__}: {error}; {SUBMITS}"
            ) from error
        if not all(callable(getattr(future, name, None)) for name in FUTURE):
            raise SpecError(f"run: submit of executor= returned {_said(future)}, no future; {SUBMITS}")
        self._taken = True
        self._futures[future] = part
        with Held():
            future.add_done_callback(self._done.put)

    def answer(self) -> Answer:
        while True:
            try:
                future = self._done.get(timeout=SLICE)
            except Empty:
                continue
            part = self._futures.pop(future)
            try:
                with Held():
                    found = future.result()
            except ModfunError:
                raise
            except Exception as error:
                # A worker that dies while its answer is fetched costs the answer: ask once more.
                if part.number in self._again:
                    raise _died(error) from error
                self._again.add(part.number)
                self.begin(part)
                continue
            return _answer(found, "a future of executor= held", SUBMITS)

    def stop(self) -> None:
        with Held():
            if not self._broken:  # a broken pool ends its futures itself, and fails at a cancelled one
                for future in self._futures:
                    future.cancel()
            stop(self._run)


class Mapped:
    """Each part a task of one thread, given to a function f(function, iterable) -> iterable."""

    def __init__(self, work: Work, call: Callable[..., Iterable[Answer]]) -> None:
        self.window = _window(work, UNKNOWN)
        self._task = task(work, new_run())
        self._call = call
        self._batch: list[Part] = []
        self._answers: Iterator[Any] = iter(())

    def begin(self, part: Part) -> None:
        self._batch.append(part)

    def answer(self) -> Answer:
        try:
            if self._batch:
                batch, self._batch = self._batch, []
                found = self._call(self._task, batch)
                if not isinstance(found, Iterable):
                    raise SpecError(f"run: executor= returned {_said(found)}; {MAPS}")
                self._answers = iter(found)
            answer = next(self._answers)
        except ModfunError:
            raise
        except StopIteration:
            raise SpecError(
                f"run: executor= returned fewer results than it was given parts; {MAPS}"
            ) from None
        except Exception as error:
            raise SpecError(f"run: executor= failed with {type(error).__name__}: {error}; {MAPS}") from error
        return _answer(answer, "executor= returned a result that is", MAPS)

    def stop(self) -> None:
        self._batch = []


def engine(work: Work, executor: Any, threads: int, progress: Callable[[float], None]) -> Engine:
    """The engine for `executor=`; None: threads of this process."""
    if executor is None:
        return Threads(work, threads, progress)
    _ = work.key  # made once here, not in every process
    if isinstance(executor, type) and hasattr(executor, "submit"):
        raise SpecError(
            f"run: executor is the class {executor.__name__}; give an instance of it, as "
            f"{executor.__name__}()"
        )
    if hasattr(executor, "submit"):
        return Submitted(work, executor)
    if callable(executor):
        return Mapped(work, executor)
    raise SpecError(
        f"run: executor is a {type(executor).__name__}; give an executor (with submit, as those of "
        "concurrent.futures), or a map-like function f(function, iterable)"
    )


def tallies(
    wanted: Iterable[Part], workers: Engine | None, store: Store | None
) -> Generator[Answer, None, None]:
    """Every wanted part in order: from the store if it is there, else computed and stored.

    Parts are begun as far ahead as the engine's window; what is computed out of order waits.
    """
    left = iter(wanted)
    ahead: deque[Part] = deque()
    begun: set[int] = set()
    ready: dict[int, Tally] = {}
    try:
        while True:
            while len(ahead) < (workers.window if workers is not None else 1):
                part = next(left, None)
                if part is None:
                    break
                ahead.append(part)
                if workers is not None and not (store is not None and store.holds(part)):
                    workers.begin(part)
                    begun.add(part.number)
            if not ahead:
                return
            head = ahead.popleft()
            while workers is not None and head.number in begun:
                part, tally = workers.answer()
                begun.discard(part.number)
                if store is not None:
                    store.save(part, tally)
                ready[part.number] = tally
            if head.number in ready:
                yield head, ready.pop(head.number)
            else:
                assert store is not None
                yield head, store.load(head)
    finally:
        if workers is not None:
            workers.stop()


def _answer(found: Any, what: str, cure: str) -> Answer:
    """What a task gave back, refused where an executor made something else of it."""
    if isinstance(found, str) and found == GIVEN_UP:
        raise KeyboardInterrupt
    if isinstance(found, tuple) and list(map(type, found)) == [Part, Tally]:
        part, tally = found
        return part, tally
    raise SpecError(f"run: {what} {_said(found)}, not what function(part) returned; {cure}")


def _said(value: Any) -> str:
    return "None" if value is None else f"a {type(value).__name__}"


def _window(work: Work, wanted: int) -> int:
    """Tasks in flight, fewer where their estimates would fill the memory."""
    if not work.samples:
        return wanted
    size = 8 * work.part
    for length in work.plan.shape:
        size *= length
    return max(2, min(wanted, BYTES // size))


def _died(error: BaseException) -> ModfunError:
    return ModfunError(
        f"run: a worker of executor= did not give its part back ({type(error).__name__}: {error}); parts "
        "finished before are kept if directory= was given: run again to go on with a new executor"
    )
