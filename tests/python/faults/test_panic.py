"""A defect or an interrupt inside the compiled core: always an exception, never a hang."""

import os
import signal
import threading
import time

import pytest
from modfun import _core
from modfun.errors import InternalError, SpecError


@pytest.mark.parametrize("threads", [0, 1, 2, 5])
def test_a_panicking_worker_gives_internal_error(threads):
    started = time.monotonic()
    with pytest.raises(InternalError, match="chunk 3 of 1000: asked to panic"):
        _core._panic_for_tests(threads)
    assert time.monotonic() - started < 10


def test_the_core_works_after_a_panic():
    with pytest.raises(InternalError):
        _core._panic_for_tests(2)
    assert _core.normals(1, "noise_y", 0, 0, 0, 3).shape == (3,)


@pytest.fixture
def heard():
    """SIGINT raises, also where a shell's background job ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
def test_ctrl_c_stops_the_workers():
    started = time.monotonic()
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        _core._wait_for_tests(2)
    timer.join()
    # The workers would go on for half a minute.
    assert time.monotonic() - started < 10


def test_what_progress_raises_comes_through():
    seen = []

    def progress(done, total):
        seen.append((done, total, threading.current_thread()))
        if len(seen) == 2:
            raise ZeroDivisionError("the bar broke")

    with pytest.raises(ZeroDivisionError, match="the bar broke"):
        _core._wait_for_tests(2, progress)
    assert seen == [(0, 1000, threading.current_thread())] * 2


def test_the_interpreter_is_free_meanwhile():
    ticks = []

    def tick():
        while len(ticks) < 20:
            ticks.append(time.monotonic())
            time.sleep(0.001)

    def progress(done, total):
        if len(ticks) >= 20:
            raise StopIteration

    other = threading.Thread(target=tick)
    other.start()
    with pytest.raises(StopIteration):
        _core._wait_for_tests(1, progress)
    other.join()


def test_thread_count(monkeypatch):
    monkeypatch.delenv("MODFUN_NUM_THREADS", raising=False)
    assert _core.thread_count(3) == 3
    assert 1 <= _core.thread_count() <= (os.cpu_count() or 1)
    monkeypatch.setenv("MODFUN_NUM_THREADS", "7")
    assert _core.thread_count() == 7
    monkeypatch.setenv("MODFUN_NUM_THREADS", "many")
    with pytest.raises(SpecError, match="many"):
        _core.thread_count()
    with pytest.raises(SpecError, match="at least 1"):
        _core.thread_count(0)
