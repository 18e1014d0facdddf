"""Instructions of the programs of programs.rs, held to a baseline: what no clock on a busy machine can tell.

`make counts` calls it. Each program runs twice under valgrind's callgrind, with so many pieces of work and
with twice as many; the difference is what the pieces cost, without the start of the program. It passes, with
the reason, where there is nothing to count with.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
BASELINE = HERE / "counts.toml"
TOLERANCE = 0.02
HEAD = """\
# Instructions of a piece of each program's work, written by `make counts UPDATE=1`. On AVX2, the widest set
# that valgrind knows: the same on every processor that has it, whatever else it has.
"""


class NothingToCountWith(Exception):
    """Why instructions cannot be counted here."""


def build() -> Path:
    subprocess.run(["cargo", "build", "--release", "--quiet", "--example", "counted"], cwd=ROOT, check=True)
    metadata = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version=1"], cwd=ROOT, check=True, stdout=subprocess.PIPE
    )
    return Path(json.loads(metadata.stdout)["target_directory"]) / "release" / "examples" / "counted"


def programs(counted: Path) -> dict[str, tuple[int, str]]:
    """How many pieces of each program are counted, and what a piece is."""
    said = subprocess.run([counted], check=True, stdout=subprocess.PIPE, text=True).stdout
    rows = (line.split("\t") for line in said.splitlines())
    return {name: (int(pieces), piece) for name, pieces, piece in rows}


def run(counted: Path, name: str, pieces: int) -> int:
    """Instructions of one run."""
    with tempfile.TemporaryDirectory() as scratch:
        done = subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                f"--callgrind-out-file={scratch}/out",
                counted,
                name,
                str(pieces),
            ],
            capture_output=True,
            text=True,
        )
    if done.returncode == 2:
        raise NothingToCountWith(done.stderr.strip().splitlines()[-1])
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or collected is None:
        sys.exit(f"counts: callgrind failed\n{done.stderr}")
    return int(collected[1])


def count(counted: Path, name: str, pieces: int) -> int:
    """Instructions of a piece."""
    return round((run(counted, name, 2 * pieces) - run(counted, name, pieces)) / pieces)


def judge(
    now: dict[str, int], pieces: dict[str, str], rustc: str, baseline: dict[str, Any]
) -> tuple[str, bool]:
    """What to say of the counts, and whether they are the baseline's."""
    was = baseline["instructions"]
    said, held = [], now.keys() == was.keys()
    for name in sorted(now.keys() ^ was.keys()):
        said.append(f"counts: {name} is {'new' if name in now else 'gone'}")
    for name in now.keys() & was.keys():
        change = now[name] / was[name] - 1
        off = abs(change) > TOLERANCE
        held = held and not off
        said.append(
            f"counts: {name:<13} {now[name]:>13,} instructions {pieces[name]}, "
            f"{change:+.1%} of the baseline's{' *' if off else ''}"
        )
    said.sort()
    if not held:
        said.append(f"More than {TOLERANCE:.0%} of a change, either way, is to be explained.")
        if rustc != baseline["rustc"]:
            said.append(f"The compiler is {rustc}, the baseline was counted with {baseline['rustc']}.")
        said.append("Mend it, or make it the baseline with `make counts UPDATE=1` and say why in the commit.")
    return "\n".join(said), held


def write(now: dict[str, int], rustc: str) -> None:
    """Makes these counts the baseline."""
    rows = "".join(f'"{name}" = {value}\n' for name, value in now.items())
    BASELINE.write_text(f'{HEAD}rustc = "{rustc}"\n\n[instructions]\n{rows}')
    print(f"counts: {len(now)} counts are the baseline now")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="make the counts of today the baseline")
    update = parser.parse_args().update
    try:
        if shutil.which("valgrind") is None:
            raise NothingToCountWith("there is no valgrind (apt-get install valgrind)")
        counted = build()
        all_of = programs(counted)
        with ThreadPoolExecutor(2) as threads:
            counts = threads.map(lambda name: count(counted, name, all_of[name][0]), all_of)
            now = dict(zip(all_of, counts, strict=True))
    except NothingToCountWith as reason:
        print(f"counts: not held to the baseline: {reason}")
        return 0
    compiler = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True)
    rustc = compiler.stdout.split()[1]
    if update:
        write(now, rustc)
        return 0
    pieces = {name: piece for name, (_, piece) in all_of.items()}
    text, held = judge(now, pieces, rustc, tomllib.loads(BASELINE.read_text()))
    print(text)
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
