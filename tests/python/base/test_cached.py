"""Attributes that are computed once: no lock is held while they are."""

from __future__ import annotations

import threading

from modfun.base.cached import cached_property, kept


class Counted:
    def __init__(self) -> None:
        self.calls = 0

    @cached_property
    def value(self) -> int:
        """A number."""
        self.calls += 1
        return self.calls


def test_computed_once_and_deleted() -> None:
    one = Counted()
    assert (one.value, one.value, one.calls) == (1, 1, 1)
    del one.value
    assert (one.value, one.calls) == (2, 2)
    assert Counted.value.__doc__ == "A number."


def test_no_thread_waits_for_another() -> None:
    """Of another instance, as a process forked meanwhile would wait for ever."""
    began, may_end = threading.Event(), threading.Event()

    class Slow:
        def __init__(self, waits: bool) -> None:
            self.waits = waits

        @cached_property
        def value(self) -> bool:
            if self.waits:
                began.set()
                assert may_end.wait(60)
            return self.waits

    slow = Slow(True)
    first = threading.Thread(target=lambda: slow.value)
    first.start()
    assert began.wait(60)
    found: list[bool] = []
    second = threading.Thread(target=lambda: found.append(Slow(False).value))
    second.start()
    second.join(10)
    may_end.set()
    first.join()
    second.join()
    assert found == [False]
    assert slow.value


def test_an_answer_stays_with_the_object() -> None:
    asked = []

    @kept
    def size(of: Counted) -> None:
        asked.append(of)

    one, other = Counted(), Counted()
    assert (size(one), size(one), size(other)) == (None, None, None)
    assert asked == [one, other]
