"""Types are part of the interface, which `make lint` checks; one version stands everywhere."""

import tomllib
from importlib import metadata
from pathlib import Path

import modfun as mf
from modfun import _core
from places import ROOT


def test_the_package_says_that_it_is_typed():
    assert (Path(mf.__file__).parent / "py.typed").exists()


def test_there_is_one_version():
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))
    version = cargo["workspace"]["package"]["version"]
    assert mf.__version__ == version
    assert _core.__version__ == version
    assert metadata.version("modfun") == version
