"""Installs a wheel into a new environment, runs tests against it, and takes it away again.

    python packaging/try_wheel.py oldest newest        a part of the tests, minutes
    python packaging/try_wheel.py oldest --whole       all of them

"oldest" has the lowest versions that pyproject.toml allows, of extras and of their own needs where those have
moved on; "newest" is what pip takes. Tests of the repository run; the package is the installed one.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLACE = ROOT / "target" / "wheels-tried"
# Each layer once: import, files, fits, equations, studies, figures, the shell, the first page.
PART = [
    "test_imports.py", "core/test_binary.py", "records/test_reading.py", "study/test_frames.py",
    "records/test_labelled.py", "fitting/test_fit.py", "fitting/test_fit_many.py",
    "models/test_transfer_function.py", "systems/test_interop.py", "equations/test_equations_parser.py",
    "equations/test_nonlinear.py", "study/test_studies.py", "results/test_plots_fit.py",
    "commands/test_cli.py",
]  # fmt: skip
FIRST_PAGE = ["tests/python/docs/test_docs.py", "-k", "README and python_blocks"]
TOOLS = ["pytest>=8.3", "pytest-xdist>=3.6"]
# Needs of the oldest extras that must be as old as these to work with them: pyparsing and click warn of what
# matplotlib 3.8 and typer 0.18 call, and a warning fails a test.
OLD_NEEDS = ["pyparsing<3.3", "click<8.5"]


def lowest() -> list[str]:
    """The lowest versions allowed, as pip is told them."""
    project = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text("utf-8"))["project"]
    needs = project["dependencies"] + project["optional-dependencies"]["all"]
    return [need.replace(">=", "==") for need in needs]


def remains(packages: Path) -> list[str]:
    """What is left of modfun among installed packages."""
    return sorted(path.name for path in packages.glob("*modfun*"))


def attempt(which: str, wheel: Path, whole: bool) -> bool:
    """Whether the wheel works with one set of versions; says so."""
    place = PLACE / which
    shutil.rmtree(place, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "venv", place], check=True)
    python = place / ("Scripts" if os.name == "nt" else "bin") / "python"

    def run(*arguments: str) -> int:
        return subprocess.run([python, *arguments], cwd=ROOT).returncode

    wanted = lowest() + OLD_NEEDS if which == "oldest" else []
    if run("-m", "pip", "install", "--quiet", "--only-binary=:all:", f"{wheel}[all]", *wanted, *TOOLS):
        return False
    where = "import modfun; print(modfun.__file__)"
    told = subprocess.run([python, "-c", where], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    package = Path(told.strip()).parent
    if not package.is_relative_to(place):
        raise SystemExit(f"{package} is not the installed package")
    quiet = ["-m", "pytest", "-q", "-n", "2"]
    if whole:
        failed = run(*quiet)
    else:
        failed = run(*quiet, *(f"tests/python/{name}" for name in PART)) or run(*quiet, *FIRST_PAGE)
    run("-m", "pip", "list", "--format=freeze")
    gone = run("-m", "pip", "uninstall", "--quiet", "--yes", "modfun") == 0 and not remains(package.parent)
    left = "nothing" if gone else ", ".join(remains(package.parent))
    print(f"{wheel.name}, {which}: tests {'failed' if failed else 'passed'}; uninstalling left {left}")
    return not failed and gone


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("which", nargs="+", choices=["oldest", "newest"])
    parser.add_argument("--wheel", type=Path, help="the wheel; without it, the only one in dist/")
    parser.add_argument("--whole", action="store_true", help="every test, not only a part")
    given = parser.parse_args()
    wheels = [given.wheel] if given.wheel else sorted(ROOT.glob("dist/*.whl"))
    if len(wheels) != 1:
        raise SystemExit(f"dist holds {len(wheels)} wheels: give one with --wheel")
    return sum(not attempt(which, wheels[0].resolve(), given.whole) for which in given.which)


if __name__ == "__main__":
    sys.exit(main())
