"""One thread of BLAS in all processes of the tests; a kind for every test, of `markers` in pyproject.toml."""

import os
from types import ModuleType

import pytest

# Read once, when NumPy is loaded. BLAS gains nothing on matrices as small as ours, and the threads of several
# workers of pytest-xdist wait for one another: more than three times the time on two cores.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

KINDS = ("unit", "oracle", "statistics", "process", "docs")
# Files of one kind; a mark on a test comes first, and what is not named here is `oracle` where its file
# imports the twins of that folder, else `unit`.
FILES = {
    "process": (
        "test_binary", "test_cluster", "test_full_disk", "test_imports", "test_interrupts", "test_killed",
        "test_shared", "test_threads", "test_study_cluster", "test_study_engines", "test_study_examples",
    ),
    "docs": (
        "test_bench_field", "test_bench_nonlinear", "test_bench_rivals", "test_bench_sinusoids",
        "test_bench_stream", "test_browser", "test_counts", "test_design", "test_docs", "test_docstrings",
        "test_flight", "test_gallery", "test_growth", "test_initial_state_bench", "test_migration",
        "test_reproduction", "test_validation_page",
    ),
}  # fmt: skip
KIND = {name: kind for kind, names in FILES.items() for name in names}


def kind_of(module: ModuleType) -> str:
    """Of the tests of a file that say nothing themselves."""
    name = module.__name__.rpartition(".")[2]
    if name in KIND or name.startswith("test_records_"):  # pages of docs/records
        return KIND.get(name, "docs")
    sources = (getattr(value, "__module__", None) or value.__name__ for value in vars(module).values()
               if hasattr(value, "__name__"))  # fmt: skip
    return "oracle" if any(source.startswith("oracle.") for source in sources) else "unit"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Every test has one kind."""
    kinds = {module: kind_of(module) for module in {item.getparent(pytest.Module).obj for item in items}}
    for item in items:
        if not any(mark.name in KINDS for mark in item.iter_markers()):
            item.add_marker(kinds[item.getparent(pytest.Module).obj])
