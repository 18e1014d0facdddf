"""Minima are kept beside earlier ones and drawn; the tables of waits and of joint fits are whole."""

import csv
import subprocess
import sys

import pytest
from places import ROOT

sys.path.append(str(ROOT / "benches" / "compare"))
import commits
import history

COMPARE = ROOT / "benches" / "compare"


def test_each_run_is_added_and_drawn(tmp_path):
    kept, figure = tmp_path / "history.csv", tmp_path / "history.png"
    history.append({"single ml": 1234.5, "tones": 1e7}, kept)
    history.append({"single ml": 1200.0}, kept)
    rows = list(csv.DictReader(kept.read_text().splitlines()))
    assert [row["name"] for row in rows] == ["single ml", "tones", "single ml"]
    assert tuple(rows[0]) == history.FIELDS
    assert all(row["machine"] and row["date"] for row in rows)
    (points,) = history.read(kept)["single ml"].values()
    assert [ns for _, ns in points] == [1234.0, 1200.0]  # four digits
    history.draw(kept, figure)
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_what_is_kept_can_be_read():
    for lines in history.read().values():
        assert all(ns > 0 for points in lines.values() for _, ns in points)


def test_commits_are_compared_by_minima():
    base = [{"frf": 2000.0, "tones": 1.0}, {"frf": 1000.0, "tones": 1.0}]
    now = [{"frf": 500.0}, {"frf": 800.0}]
    text = commits.table(base, now)
    assert "| frf | 1 | 0.5 | 0.500 |" in text
    assert text.endswith("Only one of the two has: tones.")


@pytest.mark.process
@pytest.mark.parametrize(
    ("script", "rows"),
    [
        ("waits.py", ["`fit.predict`", "`mf.fit_many`, 10 records"]),
        ("joint_growth.py", ["2 | 1 | 2"]),
        ("joint_rivals.py", ["| a fit | error"]),
    ],
)
def test_tables_are_written(tmp_path, script, rows):
    page = tmp_path / "performance.md"
    page.write_text("# Performance\n\n## Other\n\nKept.\n")
    subprocess.run(
        [sys.executable, COMPARE / script, "--quick", "--out", page], check=True, capture_output=True
    )
    text = page.read_text()
    assert text.startswith("# Performance\n\n## Other\n\nKept.\n")
    assert all(f"| {row} |" in text for row in rows)
