"""What may import what: the table of docs/architecture.md, held by reading every import of the package.

Imports inside functions and under `TYPE_CHECKING` count like all others.
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest
from places import ROOT, TESTS

PACKAGE = ROOT / "python/modfun"

# A room may import rooms above it in this list, never one of its own line or below.
LEVELS: tuple[tuple[str, ...], ...] = (
    ("errors", "_core"),
    ("base",),
    ("language", "files"),
    ("pages", "signals"),
    ("records", "systems"),
    ("models",),
    ("equations", "reduction"),
    ("results",),
    ("fitting", "tones"),
    ("responses", "streams", "timelag"),
    ("experiments",),
    ("inference", "rivals"),
    ("study",),
    ("plot",),
    ("commands",),
    ("modfun", "__main__"),
)
LEVEL = {room: k for k, rooms in enumerate(LEVELS) for room in rooms}

LONGEST = 500


def name_of(path: Path) -> str:
    """Module of a file, without `modfun.`; the package itself is `modfun`."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    parts = parts[:-1] if parts[-1] == "__init__" else parts
    return ".".join(parts) or "modfun"


@cache
def modules() -> dict[str, Path]:
    """Every module and its file."""
    found = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}
    assert len(found) > 100
    return found


def room(module: str) -> str:
    """The room a module stands in."""
    return module.split(".")[0]


def imported(module: str, is_package: bool, tree: ast.AST) -> set[str]:
    """Modules of the package that a file imports, wherever in it."""
    found = set()
    known = {*modules(), "_core"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
            found |= {n.removeprefix("modfun.") for n in names if n.split(".")[0] == "modfun"}
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level:
            above = [] if module == "modfun" else module.split(".")
            above = above[: len(above) + is_package - node.level] if above else []
            base = [*above, *(node.module or "").split(".")] if node.module else above
        elif node.module and node.module.split(".")[0] == "modfun":
            base = node.module.split(".")[1:]
        else:
            continue
        for alias in node.names:
            full = ".".join([*base, alias.name])
            found.add(full if full in known else ".".join(base) or "modfun")
    return found - {module}


@cache
def arrows() -> dict[str, frozenset[str]]:
    """What each module imports."""
    return {
        name: frozenset(imported(name, path.name == "__init__.py", ast.parse(path.read_text())))
        for name, path in modules().items()
    }


def circles(graph: dict[str, frozenset[str]]) -> list[frozenset[str]]:
    """Strongly connected parts of more than one file (Tarjan)."""
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[frozenset[str]] = []

    def visit(name: str) -> None:
        number[name] = low[name] = len(number)
        stack.append(name)
        for other in graph.get(name, frozenset()):
            if other not in number:
                visit(other)
            if other in stack:
                low[name] = min(low[name], low[other])
        if low[name] == number[name]:
            k = stack.index(name)
            if len(stack) - k > 1:
                found.append(frozenset(stack[k:]))
            del stack[k:]

    for name in graph:
        if name not in number:
            visit(name)
    return found


def test_every_room_has_its_place_and_every_place_its_room() -> None:
    rooms = {room(name) for name in modules()} | {"_core"}
    assert rooms == set(LEVEL), rooms ^ set(LEVEL)


def test_the_page_shows_the_same_table() -> None:
    text = (PACKAGE.parents[1] / "docs/architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| (`[^|]+`) \| [^|]+ \| ([^|]+) \|$", text, re.MULTILINE)
    shown = {(int(level), name) for level, cell, _ in rows for name in re.findall(r"`(\w+)`", cell)}
    assert shown == {(k, name) for name, k in LEVEL.items() if name not in ("modfun", "__main__")}
    for _, cell, files in rows:
        here = re.findall(r"`(\w+)`", cell)[0]
        if (PACKAGE / here).is_dir():
            there = {path.stem for path in (PACKAGE / here).glob("*.py")} - {"__init__"}
            missing = there - set(re.findall(r"`(\w+)`", files))
            assert not missing, f"{here}: {sorted(missing)} not on the page"


def test_every_test_stands_in_a_room() -> None:
    other = {".", "contract", "core", "golden", "oracle", "faults", "data", "docs", "benches", "packaging"}
    folders = {path.parent.relative_to(TESTS).as_posix() for path in TESTS.rglob("test_*.py")}
    rooms = {room for room in LEVEL if (PACKAGE / room).is_dir()}
    assert folders - other <= rooms
    assert other <= folders
    assert rooms - folders == {"plot"}  # which gathers names that have their tests elsewhere


def test_imports_run_down() -> None:
    upwards = [
        f"{name} imports {other}, which stands above it or beside it"
        for name, others in arrows().items()
        for other in sorted(others)
        if room(name) != room(other) and LEVEL[room(name)] <= LEVEL[room(other)]
    ]
    assert not upwards, "\n".join(upwards)


def test_no_circles_between_files() -> None:
    found = circles(arrows())
    assert not found, "\n".join(f"{len(c)} files import each other: {sorted(c)}" for c in found)


def test_files_are_short_enough_to_be_read() -> None:
    core = sorted((ROOT / "rust").rglob("*.rs"))
    assert len(core) > 100
    files = {**modules(), **{path.relative_to(ROOT).as_posix(): path for path in core}}
    lines = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in files.items()}
    long = {name: count for name, count in lines.items() if count > LONGEST}
    assert not long, long


@pytest.mark.parametrize(
    ("module", "is_package", "code", "want"),
    [
        ("records.record", False, "from ..errors import DataError", {"errors"}),
        ("records.record", False, "def f():\n    from . import check", {"records.check"}),
        ("records", True, "from .record import Record", {"records.record"}),
        ("records", True, "from ..errors import DataError", {"errors"}),
        ("modfun", True, "from . import plot, signals", {"plot", "signals"}),
        ("modfun", True, "from ._core import __version__", {"_core"}),
        ("base.axes", False, "if TYPE_CHECKING:\n    from ..results.fit import Fit", {"results.fit"}),
        ("study.run", False, "import modfun.plot\nfrom modfun.errors import SpecError", {"plot", "errors"}),
        ("commands.app", False, "from .. import __version__", {"modfun"}),
        ("commands.app", False, "import numpy as np\nfrom os import path", set()),
    ],
)
def test_the_reader_above_sees_every_import(module: str, is_package: bool, code: str, want: set[str]) -> None:
    assert imported(module, is_package, ast.parse(code)) == want


def test_the_search_above_finds_circles() -> None:
    graph = {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset("b"), "d": frozenset("a")}
    assert circles(graph) == [frozenset("bc")]


def test_no_two_test_files_have_one_name():
    """pytest imports a test file by its bare name: of two of one name it collects one."""
    names = [path.name for path in TESTS.rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))
