"""The scripts for clusters run, and all find what threads find."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import modfun as mf
import pytest
from places import ROOT

EXAMPLES = ROOT / "examples"


@cache
def threads() -> str:
    """What the study of the scripts prints without a cluster."""
    words: dict[str, object] = {}
    exec((EXAMPLES / "study_slurm.py").read_text(encoding="utf-8"), words | {"__name__": "slurm"}, words)
    study = words["STUDY"]
    assert isinstance(study, dict)
    return f"{mf.MonteCarlo(**study).run(progress=False)}\n"


def printed(command: list[str], place: Path, **environment: str) -> str:
    done = subprocess.run(
        command,
        cwd=place,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(find_spec("distributed") is None, reason="needs distributed")
def test_dask(tmp_path: Path) -> None:
    found = printed([sys.executable, "-W", "error", str(EXAMPLES / "study_dask.py")], tmp_path)
    assert found == threads()


@pytest.mark.skipif(
    find_spec("mpi4py") is None or shutil.which("mpiexec") is None, reason="needs mpi4py and mpiexec"
)
def test_mpi(tmp_path: Path) -> None:
    script = str(EXAMPLES / "study_mpi.py")
    found = printed(["mpiexec", "-n", "3", sys.executable, "-m", "mpi4py.futures", script], tmp_path)
    assert found == threads()


@pytest.mark.skipif(shutil.which("sh") is None, reason="needs a shell")
def test_slurm(tmp_path: Path) -> None:
    """The script's own lines, with what SLURM sets for each job of the array."""
    (tmp_path / "examples").symlink_to(EXAMPLES)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = (EXAMPLES / "study_slurm.sh").read_text(encoding="utf-8")
    array = re.search(r"^#SBATCH --array=0-(\d+)$", script, re.MULTILINE)
    assert array is not None
    count = int(array[1]) + 1
    for k in range(count):
        number = {"SLURM_ARRAY_TASK_ID": str(k), "SLURM_ARRAY_TASK_COUNT": str(count)}
        assert printed(["sh", "examples/study_slurm.sh"], tmp_path, PATH=path, **number) == ""
    last = re.search(r'--wrap="([^"]+)"', script)
    assert last is not None
    assert printed(["sh", "-c", last[1]], tmp_path, PATH=path) == threads()
