"""Several processes on one directory at once: no lock to be left behind, nothing lost, the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import modfun as mf
import pytest
from modfun.study import shards
from places import TESTS
from study_cases import quick_study, same, small_parts

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked, to be quick")

# Starts three processes on each directory at once; of some rounds one is killed on the way.
TOGETHER = """
    import os, random, signal, sys, time
    import modfun as mf, modfun.study.directory, modfun.study.run, modfun.study.work
    from study_cases import quick_study
    modfun.study.work.PART = 1.0
    quick_study(1).run(progress=False, threads=1)  # so that no child has to load what runs need
    rng = random.Random(1)
    for k in range(12):
        children = []
        for replicates in (700, 1400, 2600):
            child = os.fork()
            if child == 0:
                quick_study(replicates).run(
                    directory=f"{sys.argv[1]}/{k}", keep="samples", progress=False, threads=1)
                os._exit(0)
            children.append(child)
        if k % 2:
            time.sleep(rng.uniform(0, 0.01))
            os.kill(children[0], signal.SIGKILL)
        print(*(os.waitpid(child, 0)[1] for child in children), flush=True)
"""


def test_three_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They want different numbers of replicates; the directory keeps the largest."""
    small_parts(monkeypatch)
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(TOGETHER), str(tmp_path)],
        cwd=TESTS,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    ends = [line.split() for line in done.stdout.splitlines()]
    assert len(ends) == 12
    assert all(end[1:] == ["0", "0"] for end in ends), done.stderr
    assert any(end[0] == "9" for end in ends), "none was killed on its way"
    alone = quick_study(2600).run(keep="samples", progress=False)
    for k in range(12):
        assert shards.status(tmp_path / str(k)).complete
        found = mf.load(tmp_path / str(k))
        assert isinstance(found, mf.Results)
        assert same(found, alone)
