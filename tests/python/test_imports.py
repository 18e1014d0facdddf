"""`import modfun` is cheap and silent: NumPy and little else, no threads, files, handlers or words."""

import ast
import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import modfun
import pytest

# What is loaded within the functions that need it.
HEAVY = {
    "argparse", "asyncio", "control", "csv", "doctest", "jinja2", "logging", "matplotlib", "multiprocessing",
    "pandas", "polars", "pytest", "rich", "scipy", "socket", "sqlite3", "statistics", "sympy", "tkinter",
    "typer", "unittest", "xarray",
}  # fmt: skip

LOOK = """
import json, os, signal, sys, threading, time, warnings
import numpy
handlers = [signal.getsignal(s) for s in signal.valid_signals()]
state = numpy.geterr(), dict(os.environ), os.getcwd(), list(sys.path), sys.excepthook
hooks = list(warnings.filters), numpy.get_printoptions()
folder = set(os.listdir("."))
files = set(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else set()
tasks = set(os.listdir("/proc/self/task")) if os.path.isdir("/proc/self/task") else set()
random = numpy.random.get_state()[1].tolist()
before, began = set(sys.modules), time.process_time()
import modfun
seconds = time.process_time() - began
print(json.dumps({
    "seconds": seconds,
    "modules": sorted(set(sys.modules) - before),
    "threads": threading.active_count(),
    "tasks": not tasks or set(os.listdir("/proc/self/task")) == tasks,
    "files": not files or set(os.listdir("/proc/self/fd")) == files,
    "folder": set(os.listdir(".")) == folder,
    "handlers": handlers == [signal.getsignal(s) for s in signal.valid_signals()],
    "state": state == (numpy.geterr(), dict(os.environ), os.getcwd(), list(sys.path), sys.excepthook),
    "hooks": hooks == (list(warnings.filters), numpy.get_printoptions()),
    "random": random == numpy.random.get_state()[1].tolist(),
}))
"""


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What one import does to a fresh interpreter, warnings being errors."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", LOOK],
        cwd=tmp_path_factory.mktemp("empty"),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout)


def test_import_loads_nothing_heavy(seen):
    loaded = {name.split(".")[0] for name in seen["modules"]}
    assert loaded & HEAVY == set(), f"loaded at import: {sorted(loaded & HEAVY)}"


def test_import_loads_little_besides_numpy(seen):
    own = [name for name in seen["modules"] if name.split(".")[0] == "modfun"]
    other = [name for name in seen["modules"] if name not in own]
    assert own == ["modfun", "modfun._core", "modfun.errors"]
    assert len(other) < 5, other


def test_import_takes_no_time_worth_mention(seen):
    """Some tenths of a second of the processor beside NumPy; the bound holds on busy machines too."""
    assert seen["seconds"] < 2.0


@pytest.mark.parametrize("what", ["tasks", "files", "folder", "handlers", "state", "hooks", "random"])
def test_import_leaves_the_process_as_it_was(seen, what):
    assert seen[what], f"import modfun changed the process: {what}"


def test_import_starts_no_thread(seen):
    assert seen["threads"] == 1


def test_all_that_shows_is_public():
    assert dir(modfun) == modfun.__all__
    for name in modfun.__all__:
        assert getattr(modfun, name) is not None, name


def test_names_load_from_where_type_checkers_see_them():
    """The imports under TYPE_CHECKING and the places that names load from are the same."""
    tree = ast.parse(Path(modfun.__file__).read_text())
    under = next(
        node for node in tree.body if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    )
    typed = {
        alias.name: f".{node.module or alias.name}"
        for node in under.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert typed == modfun._PLACES | {name: f".{name}" for name in modfun._MODULES}
    for name, place in typed.items():
        loaded = import_module(place, "modfun")
        assert getattr(modfun, name) is (loaded if place == f".{name}" else getattr(loaded, name))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'modfun' has no attribute 'fitt'"):
        modfun.fitt  # noqa: B018
    told = subprocess.run(
        [sys.executable, "-c", "import modfun; modfun.TransferFuncton"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Did you mean: 'TransferFunction'?" in told.stderr
