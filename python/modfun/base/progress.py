"""Progress of long work on standard error: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any, ClassVar

from ..errors import SpecError

__all__ = ["Progress", "clock"]

SILENT = 2.0  # seconds: what is done by then needs no bar
LINE_EVERY = 10.0  # seconds between the lines of a run that nobody watches


def clock(seconds: float) -> str:
    """A time as hours:minutes:seconds."""
    whole = int(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


class Progress:
    """Call it with (done, total); use it as a context manager so that the bar is closed.

    Parameters
    ----------
    asked : {"auto", True, False}
        False: nothing. "auto" and True: nothing during the first two seconds (then a bar of the package
        rich on a terminal where it is installed, otherwise plain lines); True shows them at once.
    what : str
        What is being done, the first words shown.
    unit : str
        What is counted; with it the rate and the time left are shown.
    """

    open: ClassVar[int] = 0  # of them, inside one another

    def __init__(self, asked: str | bool, what: str, unit: str = "") -> None:
        if not isinstance(asked, bool) and asked != "auto":
            raise SpecError(f'{what}: progress={asked!r} must be "auto", True or False')
        self.on = asked is not False
        self._patience = 0.0 if asked is True else SILENT
        self._what, self._unit = what, unit
        self._start = time.monotonic()
        self._first: int | None = None
        self._last = -float("inf")
        self._bar: Any = None
        self._task: Any = None
        self._plain = not sys.stderr.isatty()

    def __enter__(self) -> Progress:
        Progress.open += 1
        return self

    def __exit__(self, *reason: object) -> None:
        Progress.open -= 1
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, done: int, total: int) -> None:
        """Show how far it is; what the first call says was done before the clock began."""
        now = time.monotonic()
        if self._first is None:
            self._first, self._start = done, now
        if not self.on or now - self._start < self._patience:
            return
        speed = self._speed(done, total, now - self._start)
        if self._bar is None and not self._plain:
            self._open(total)
        if self._bar is not None:
            self._bar.update(self._task, completed=done, total=total, speed=speed)
        elif now - self._last >= LINE_EVERY:
            self._last = now
            percent = 100 * done / max(total, 1)
            self.say(f"{done} of {total} ({percent:.0f} %){speed}")

    def say(self, text: str) -> None:
        """Print a line, unless nothing is to be shown."""
        if self.on:
            print(f"{self._what}: {text}", file=sys.stderr, flush=True)

    def _speed(self, done: int, total: int, seconds: float) -> str:
        """Rate and time left, once they can be told."""
        made = done - (self._first or 0)
        if not self._unit or made <= 0 or seconds <= 0:
            return ""
        left = clock(seconds * max(total - done, 0) / made)
        return f", {made / seconds:.3g} {self._unit}/s, {left} left"

    def _open(self, total: int) -> None:
        try:
            from rich import progress as rich
            from rich.console import Console
        except ImportError:
            self._plain = True
            return
        self._bar = rich.Progress(
            rich.TextColumn("{task.description}"),
            rich.BarColumn(),
            rich.TextColumn("{task.percentage:.0f} %{task.fields[speed]}"),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task(self._what, total=total, speed="")
        self._bar.start()
