"""Work of looks that nobody asked for: counted, not timed, so that it ends at the same place everywhere."""

from __future__ import annotations

from contextvars import ContextVar, Token
from types import TracebackType
from typing import ClassVar

__all__ = ["Effort", "Spent", "spend"]


class Spent(BaseException):
    """That the work which a look was given is done; no error, so nothing that handles errors catches it."""


class Effort:
    """A context within which work is counted, and `Spent` raised beyond `most`.

    Inside another one it has no more than that one has left, and counts there, too.

    Parameters
    ----------
    most : float
        About seconds of one core of 2020, at most.
    """

    _now: ClassVar[ContextVar[Effort | None]] = ContextVar("effort", default=None)

    def __init__(self, most: float) -> None:
        self.most = self.left = most
        self._outer: Effort | None = None
        self._token: Token[Effort | None] | None = None

    def __enter__(self) -> Effort:
        self._outer = Effort._now.get()
        if self._outer is not None:
            self.most = self.left = min(self.most, self._outer.left)
        self._token = Effort._now.set(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._token is not None:
            Effort._now.reset(self._token)
        if self._outer is not None:
            self._outer.left -= self.most - self.left

    @staticmethod
    def limited() -> bool:
        """Whether work is counted."""
        return Effort._now.get() is not None


def spend(work: float) -> None:
    """Count work; raise `Spent` where it is more than there is left."""
    effort = Effort._now.get()
    if effort is None:
        return
    effort.left -= work
    if effort.left < 0:
        raise Spent
