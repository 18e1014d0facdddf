"""Long calls say that they are at work, and short ones nothing."""

from __future__ import annotations

import sys
import threading
import time

import modfun as mf
import pytest
from modfun.base import waiting
from modfun.base.progress import Progress
from modfun.base.waiting import Waiting


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waiting, "SILENT", 0.05)
    monkeypatch.setattr(waiting, "LINE_EVERY", 0.1)
    monkeypatch.setattr(waiting, "TICK", 0.02)


def seen(capsys: pytest.CaptureFixture[str], seconds: float = 0.5) -> str:
    time.sleep(seconds)
    return capsys.readouterr().err


def test_lines_tell_what_is_done_where_nobody_watches(capsys: pytest.CaptureFixture[str]) -> None:
    with Waiting("fit: estimating"), Waiting("check"):
        text = seen(capsys)
    assert text.startswith("fit: estimating, 0 s so far\n")
    assert text.count("so far") >= 2
    assert "check" not in text
    assert seen(capsys) == ""


def test_a_line_on_a_terminal_is_taken_away_again(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as terminal:
        terminal.setattr(sys.stderr, "isatty", lambda: True)
        with Waiting("check"):
            time.sleep(0.5)
        text = capsys.readouterr().err
    assert text.startswith("\rcheck, 0 s")
    assert text.endswith("\r          \r")


def test_nothing_is_said_beside_a_bar_and_in_threads(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress(False, "bootstrap"), Waiting("fit"):
        assert seen(capsys) == ""

    def fitted() -> None:
        with Waiting("fit"):
            time.sleep(0.3)

    thread = threading.Thread(target=fitted)
    thread.start()
    thread.join()
    assert capsys.readouterr().err == ""


def test_a_fit_that_fails_leaves_no_watch(capsys: pytest.CaptureFixture[str]) -> None:
    rec = mf.Record(y=[0.0, 1.0, 0.0, 1.0] * 3, u=[1.0, 0.0, 1.0, 1.0] * 3, dt=0.1)
    with pytest.raises(mf.DataError, match="unknowns"):
        mf.fit(rec, mf.TransferFunction(poles=6, zeros=5))
    assert seen(capsys) == ""
