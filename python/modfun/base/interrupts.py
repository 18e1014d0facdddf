"""Ctrl-C that comes at a bad moment waits for a better one."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

__all__ = ["Held", "raises"]


class Held:
    """A block, of microseconds, that Ctrl-C does not cut: it is heard when the block ends.

    A KeyboardInterrupt between two lines of a lock written in Python, as those of concurrent.futures, leaves
    it locked for ever. A second Ctrl-C is not held.
    """

    def __init__(self) -> None:
        self._before: Any = None
        self._came: tuple[Any, ...] | None = None
        self._process = os.getpid()

    def __enter__(self) -> None:
        before = signal.getsignal(signal.SIGINT)
        if callable(before) and threading.current_thread() is threading.main_thread():
            self._before = before
            signal.signal(signal.SIGINT, self)

    def __exit__(self, *raised: object) -> None:
        if self._before is None:
            return
        signal.signal(signal.SIGINT, self._before)
        if self._came is not None:
            self._before(*self._came)

    def __call__(self, *heard: Any) -> None:
        if self._came is not None or os.getpid() != self._process:  # a process forked in the block keeps this
            raise KeyboardInterrupt
        self._came = heard


def raises() -> bool:
    """Whether Ctrl-C raises KeyboardInterrupt in this process, as nobody has said otherwise."""
    handler = signal.getsignal(signal.SIGINT)
    return handler is signal.default_int_handler or isinstance(handler, Held)
