"""Types are part of the interface: annotations, the compiled core's stub, and one version everywhere."""

import subprocess
import sys
import tomllib
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

import modfun as mf
import pytest
from modfun import _core

ROOT = Path(__file__).parents[2]
needs_mypy = pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")


def clean(*command: str) -> None:
    """Runs a module of this interpreter from the project's root; its words are the failure's."""
    done = subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, f"{' '.join(command)} says:\n{done.stdout}{done.stderr}"


@needs_mypy
def test_annotations_are_strict():
    clean("mypy", "--strict")


@needs_mypy
def test_the_stub_is_the_compiled_core():
    clean("mypy.stubtest", "modfun._core")


def test_the_package_says_that_it_is_typed():
    assert (Path(mf.__file__).parent / "py.typed").exists()


def test_there_is_one_version():
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))
    version = cargo["workspace"]["package"]["version"]
    assert mf.__version__ == version
    assert _core.__version__ == version
    assert metadata.version("modfun") == version
