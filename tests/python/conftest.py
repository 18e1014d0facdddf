"""One thread of BLAS; a kind for every test, of `markers` in pyproject.toml; tests that fork run apart."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

# Read once, when NumPy is loaded. BLAS gains nothing on matrices as small as ours, and the threads of several
# workers of pytest-xdist wait for one another: more than three times the time on two cores.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

KINDS = ("unit", "oracle", "statistics", "process", "docs")
FOLDERS = ("benches", "data", "docs")  # whose tests are of the kind docs
# Files of another kind than their folder's; a mark on a test comes first, and what neither names is `oracle`
# where its file imports the twins of that folder, else `unit`.
PROCESS = {
    "test_binary", "test_cluster", "test_full_disk", "test_imports", "test_interrupts", "test_killed",
    "test_shared", "test_threads", "test_study_cluster", "test_study_engines", "test_study_examples",
}  # fmt: skip
DOCS = {"test_browser", "test_docstrings", "test_reproduction"}


@pytest.fixture(autouse=True)
def figures_are_closed() -> Iterator[None]:
    """Matplotlib warns where twenty are open, and a warning fails a test that has opened one."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


@pytest.fixture(autouse=True)
def failures_of_looks_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A look that fails loses no fit of a user, but its test."""
    if check := sys.modules.get("modfun.results.check"):
        monkeypatch.setattr(check, "FAILURES", ())


def kind_of(module: ModuleType) -> str:
    """Of the tests of a file that say nothing themselves."""
    name = module.__name__.rpartition(".")[2]
    if name in PROCESS:
        return "process"
    if name in DOCS or Path(module.__file__ or "").parent.name in FOLDERS:
        return "docs"
    sources = (getattr(value, "__module__", None) or value.__name__ for value in vars(module).values()
               if hasattr(value, "__name__"))  # fmt: skip
    return "oracle" if any(source.startswith("oracle.") for source in sources) else "unit"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Every test has one kind."""
    kinds = {module: kind_of(module) for module in {item.getparent(pytest.Module).obj for item in items}}
    for item in items:
        if not any(mark.name in KINDS for mark in item.iter_markers()):
            item.add_marker(kinds[item.getparent(pytest.Module).obj])


# A fork of a process that has threads may wait for ever for a lock that one of these held, and the process of
# all tests has threads: of pytest-xdist, of dask, of pools.
ALONE = "MODFUN_TESTS_ALONE"
LONGEST = 300  # s


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Runs what is marked `forks` in a process of its own."""
    if pyfuncitem.get_closest_marker("forks") is None or ALONE in os.environ:
        return None
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
    done = subprocess.run(
        [*words, f"{pyfuncitem.path}::{pyfuncitem.name}"],
        cwd=pyfuncitem.config.rootpath,
        env={**os.environ, ALONE: "1"},
        capture_output=True,
        text=True,
        timeout=LONGEST,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout, done.stdout
    return True
