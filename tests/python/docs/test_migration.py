"""docs/migration.md: every line of its middle columns runs, in the page's order and without a warning."""

import re
import warnings

import modfun as mf
import numpy as np
import pytest
from places import ROOT
from scipy.io import savemat

PAGE = ROOT / "docs" / "migration.md"


def rows():
    """Yield line number and the three cells of every row of every table."""
    for number, line in enumerate(PAGE.read_text(encoding="utf-8").splitlines(), start=1):
        if line.startswith("|") and not line.startswith("|---"):
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if "modfun" not in cells:  # the head of a table
                yield number, cells


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The names and files that the page speaks of."""
    monkeypatch.chdir(tmp_path)
    rec = mf.simulate(
        mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=500, nsr=0.1, seed=3
    )
    fields = {"OutputData": rec.y.T, "OutputName": "q", "InputData": rec.u.T, "InputName": "de", "Ts": 0.02,
              "InterSample": "bl"}  # fmt: skip
    savemat("run.mat", {"s": fields})
    cell = np.empty((1, 2), dtype=object)
    cell[0, :] = [rec.y.T, 2 * rec.y.T]
    inputs = np.empty((1, 2), dtype=object)
    inputs[0, :] = [rec.u.T, 2 * rec.u.T]
    savemat("several.mat", {"s": {**fields, "OutputData": cell, "InputData": inputs}})
    table = np.column_stack([rec.t, rec.y[0], rec.u[0]])
    np.savetxt("run.csv", table, delimiter=",", header="t,Q (deg/s),DELE (deg)", comments="", fmt="%.17g")
    gaps = np.where(np.arange(3) == 1, np.where(np.arange(501)[:, None] % 90 == 7, np.nan, table), table)
    np.savetxt("gaps.csv", gaps, delimiter=",", header="t,q,de", comments="", fmt="%.17g")
    return {"mf": mf, "np": np, "y": rec.y[0], "u": rec.u[0], "t": rec.t}


def test_every_line_runs_in_order(here, capsys):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    pytest.importorskip("control")
    count = 0
    for number, (there, code, remark) in rows():
        if code == "—":
            assert there, f"{PAGE.name}:{number}: what has no counterpart?"
            assert remark, f"{PAGE.name}:{number}: why has it none, or what comes nearest?"
            continue
        (line,) = re.findall(r"^`([^`]+)`$", code)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                exec(compile(line, f"{PAGE.name}:{number}", "exec"), here)
            except Exception as problem:
                raise AssertionError(f"{PAGE.name}:{number}: {line}") from problem
        matplotlib.pyplot.close("all")
        count += 1
    assert count > 60
    # What the lines made is what the page says it is.
    assert here["gappy"].mask.sum() == 501 - 6
    assert here["rec2"].outputs == ("q",)
    assert here["fit"].options.method == "ml"
    assert abs(here["fit"]["a2"] - 8) < 4 * here["fit"].bse[1]


def test_the_rows_have_three_cells():
    for number, cells in rows():
        assert len(cells) == 3, f"{PAGE.name}:{number}"


def test_lines_that_a_test_would_miss_are_none():
    text = PAGE.read_text(encoding="utf-8")
    assert len(re.findall(r"^\|", text, re.MULTILINE)) == sum(1 for _ in rows()) + 2 * text.count(
        "|---|---|---|"
    )
