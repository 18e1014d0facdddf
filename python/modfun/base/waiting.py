"""Says that a long call is at work, though nobody knows how long it will take."""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
from typing import ClassVar

from .progress import LINE_EVERY, SILENT, Progress

__all__ = ["Waiting"]

TICK = 0.25  # seconds between looks at the call
IDLE = 20  # looks without one, after which the watch ends


class Waiting:
    """A context in which standard error says what is done: on a terminal after two seconds.

    Elsewhere it is a line every ten seconds. One thread watches all, as one for each would take as long as
    a short fit. Nothing is said inside another one, beside a bar, in other threads and in worker processes.

    Parameters
    ----------
    what : str
        What is being done; may be set anew while it goes on.
    """

    _lock: ClassVar[threading.Lock] = threading.Lock()
    _now: ClassVar[Waiting | None] = None
    _watch: ClassVar[threading.Thread | None] = None

    def __init__(self, what: str) -> None:
        self.what, self._start, self._said, self._shown = what, 0.0, 0.0, 0

    def __enter__(self) -> Waiting:
        outer = Waiting._now is not None or Progress.open > 0
        if outer or threading.get_ident() != threading.main_thread().ident:
            return self
        self._start, Waiting._now = time.monotonic(), self
        if Waiting._watch is None or not Waiting._watch.is_alive():
            Waiting._watch = threading.Thread(target=_watch, name="modfun-waiting", daemon=True)
            Waiting._watch.start()
        return self

    def __exit__(self, *reason: object) -> None:
        if Waiting._now is self:
            with Waiting._lock:  # so that nothing is written after this
                Waiting._now = None
                if self._shown:
                    sys.stderr.write("\r" + " " * self._shown + "\r")
                    sys.stderr.flush()

    def _look(self) -> None:
        """Write how long it has taken, where it is time to."""
        if multiprocessing.parent_process() is not None:
            return
        seconds = time.monotonic() - self._start
        text = f"{self.what}, {seconds:.0f} s"
        if sys.stderr.isatty():
            if seconds < SILENT:
                return
            sys.stderr.write("\r" + text)
            self._shown = len(text)
        elif seconds - self._said >= LINE_EVERY:
            self._said = seconds
            sys.stderr.write(f"{text} so far\n")
        sys.stderr.flush()


def _watch() -> None:
    idle = 0
    while idle < IDLE:
        time.sleep(TICK)
        with Waiting._lock:
            call = Waiting._now
            idle = 0 if call else idle + 1
            if call:
                call._look()
