"""benches/stream.py and examples/follow_change.py print what docs/stream.md says."""

import importlib
import re

import numpy as np
import pytest
from places import ROOT


@pytest.fixture
def bench(monkeypatch):
    for folder in ("benches", "examples"):
        monkeypatch.syspath_prepend(str(ROOT / folder))
    return importlib.import_module("stream")


def test_the_change_is_followed_as_the_page_says(bench, capsys):
    bench.jump(None)
    printed = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| window")]
    page = (ROOT / "docs" / "stream.md").read_text(encoding="utf-8")
    assert len(printed) == 2
    for line in printed:
        assert line in page
    values = [float(cell) for cell in re.findall(r"\d\.\d{3}", printed[0])]
    assert abs(values[0] - 2.5) < 0.05  # two standard errors
    assert abs(values[2] - 1.8) < 0.05
    assert abs(values[3] - 1.8) < 0.05


def test_the_figure_is_drawn(bench, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    bench.jump(tmp_path)
    assert (tmp_path / "stream_jump.png").stat().st_size > 10_000


def test_speed_prints_a_row_a_band(bench, capsys, monkeypatch):
    record = bench.record
    monkeypatch.setattr(bench, "record", lambda count: record(2101))
    bench.speed()
    rows = [line for line in capsys.readouterr().out.splitlines() if re.match(r"\| \d", line)]
    assert [line.split("|")[1].strip() for line in rows] == ["8", "15", "30", "60"]
    assert np.all([float(cell) > 0 for line in rows for cell in line.split("|")[2:4]])
