"""`make counts`: a count beside the baseline fails with the cure, and nothing to count with is no failure."""

import os
import runpy
import subprocess
import sys
import tomllib

import pytest
from places import ROOT

SCRIPT = ROOT / "benches" / "counts.py"
BASELINE = tomllib.loads(SCRIPT.with_name("counts.toml").read_text())


@pytest.mark.process
def test_without_valgrind_it_says_so_and_passes(tmp_path):
    alone = {**os.environ, "PATH": str(tmp_path)}
    done = subprocess.run([sys.executable, SCRIPT], env=alone, capture_output=True, text=True)
    assert done.returncode == 0
    assert "there is no valgrind" in done.stdout


@pytest.mark.parametrize(("factor", "held"), [(1.0, True), (1.015, True), (1.025, False), (0.97, False)])
@pytest.mark.parametrize("name", BASELINE["instructions"])
def test_only_counts_near_the_baseline_hold(name, factor, held):
    judge = runpy.run_path(str(SCRIPT))["judge"]
    was = BASELINE["instructions"]
    now = {**was, name: round(factor * was[name])}
    text, verdict = judge(now, dict.fromkeys(was, "a fit"), "another", BASELINE)
    assert verdict is held
    assert all(other in text for other in was)
    assert (" *" in text) is not held
    assert ("make counts UPDATE=1" in text) is not held
    assert ("The compiler is another" in text) is not held


def test_a_program_without_a_baseline_does_not_hold():
    judge = runpy.run_path(str(SCRIPT))["judge"]
    now = {**BASELINE["instructions"], "juggling": 1}
    text, verdict = judge(now, dict.fromkeys(now, "a fit"), BASELINE["rustc"], BASELINE)
    assert not verdict
    assert "juggling is new" in text
