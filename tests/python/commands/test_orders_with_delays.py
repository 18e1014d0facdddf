"""Orders compared from the shell with a delay that is estimated."""

import json

import modfun as mf
import numpy as np
import pytest
from modfun.commands.main import main


def test_a_delay_is_estimated_with_each_order(tmp_path, capsys):
    rec = mf.simulate(
        mf.tf([2], [1, 1, 3], delay=0.5), input="sin(t**2/10)", duration=20.0, intervals=400, nsr=0.05, seed=1
    )
    rows = np.column_stack([rec.t, rec["u"], rec["y"]])
    np.savetxt(tmp_path / "run.csv", rows, delimiter=",", header="t,u,y", comments="")
    words = ["order", str(tmp_path / "run.csv"), "--time", "t", "--output", "y", "--input", "u"]
    assert main([*words, "--poles", "1:2", "--delay", "0:1.5", "--json", "-"]) == 0
    best = json.loads(capsys.readouterr().out)["best"]
    assert best["params"] == pytest.approx([1.0, 3.0, 2.0, 0.5], rel=0.01)  # the delay is the last
    assert main([*words, "--delay", "0:"]) == 2
    assert "a delay to be estimated needs its most, such as 0:0.5" in capsys.readouterr().err
