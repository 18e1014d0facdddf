"""What a process of an executor does: a part at a time; Ctrl-C gives up the part, never cuts an answer."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import NamedTuple

from ..base.interrupts import raises
from .tally import Tally
from .work import Part, Work, compute

__all__ = ["GIVEN_UP", "new_run", "stop", "task"]

Answer = tuple[Part, Tally]

GIVEN_UP = "given up"  # instead of an answer, where Ctrl-C came

# Frames in which a pool waits for a task or hands over an answer. Of an answer that is cut in half the pool
# would wait for the rest for ever.
PLUMBING = ("multiprocessing.", "concurrent.futures.")


class Run(NamedTuple):
    """A run of a study, the same in all of its tasks and in no other."""

    process: int
    token: bytes


_last: Run | None = None  # what this process works for
_left: Run | None = None  # what it was interrupted in
_stopped: set[Run] = set()


def task(work: Work, run: Run) -> Callable[[Part], Answer | str]:
    """The function of a part that is given to an executor: it returns the part and its sums."""
    return partial(_task, work, run)


def new_run() -> Run:
    """A run of this process."""
    return Run(os.getpid(), os.urandom(8))


def stop(run: Run) -> None:
    """Have the threads of this process give up their parts of a run."""
    _stopped.add(run)


def _task(work: Work, run: Run, part: Part) -> Answer | str:
    if not _of_a_pool(run):

        def hear(done: int, total: int) -> None:
            if run in _stopped:
                raise KeyboardInterrupt

        return part, compute(work, part, progress=hear)
    global _last
    _last = run
    if raises():
        signal.signal(signal.SIGINT, _heard)
    try:
        return GIVEN_UP if _left == run else (part, compute(work, part))
    except KeyboardInterrupt:
        return GIVEN_UP


def _of_a_pool(run: Run) -> bool:
    """Whether this is the main thread of a process that multiprocessing started for others' tasks."""
    return (
        multiprocessing.parent_process() is not None
        and os.getpid() != run.process
        and threading.current_thread() is threading.main_thread()
    )


def _heard(number: int, frame: FrameType | None) -> None:
    """Ctrl-C: as ever, but for the pool's own frames; tasks of the run that wait are not begun."""
    global _left
    _left = _last
    if frame is None or not frame.f_globals.get("__name__", "").startswith(PLUMBING):
        raise KeyboardInterrupt
