"""Where the repository and the measured records are; the records are not part of it."""

import os
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent  # from which other processes import the helpers
ROOT = TESTS.parents[1]
DATA = Path(os.environ.get("MODFUN_DATA") or ROOT.parent / "shared" / "data").resolve()


def measured(name: str = "") -> Path:
    """A file or folder of the records, or a skip that says why."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{path} is not there: set MODFUN_DATA to the folder of the records")
    return path
