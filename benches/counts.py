"""Instructions a replicate of a study, held to a baseline: what a clock on a busy machine cannot tell.

`make counts` calls it. The program counted.rs runs twice under valgrind's callgrind, with so many
replicates and with twice as many; the difference is what replicates cost, without the start of the
program. It passes, with the reason, where there is nothing to count with.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
BASELINE = HERE / "counts.toml"
REPLICATES = 4096
TOLERANCE = 0.02


class NothingToCountWith(Exception):
    """Why instructions cannot be counted here."""


def build() -> Path:
    subprocess.run(["cargo", "build", "--release", "--quiet", "--example", "counted"], cwd=ROOT, check=True)
    metadata = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version=1"], cwd=ROOT, check=True, stdout=subprocess.PIPE
    )
    return Path(json.loads(metadata.stdout)["target_directory"]) / "release" / "examples" / "counted"


def count(program: Path, replicates: int) -> int:
    """Instructions of one run."""
    with tempfile.TemporaryDirectory() as scratch:
        done = subprocess.run(
            ["valgrind", "--tool=callgrind", f"--callgrind-out-file={scratch}/out", program, str(replicates)],
            capture_output=True,
            text=True,
        )
    if done.returncode == 2:
        raise NothingToCountWith(done.stderr.strip().splitlines()[-1])
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or collected is None:
        sys.exit(f"counts: callgrind failed\n{done.stderr}")
    return int(collected[1])


def judge(now: int, rustc: str, baseline: dict[str, Any]) -> tuple[str, bool]:
    """What to say of a count, and whether it is the baseline's."""
    was = baseline["instructions"]
    change = now / was - 1
    said = [f"counts: {now} instructions a replicate, {change:+.1%} of the baseline's {was}"]
    held = abs(change) <= TOLERANCE
    if not held:
        said.append(f"More than {TOLERANCE:.0%} of a change, either way, is to be explained.")
        if rustc != baseline["rustc"]:
            said.append(f"The compiler is {rustc}, the baseline was counted with {baseline['rustc']}.")
        said.append("Mend it, or make it the baseline with `make counts UPDATE=1` and say why in the commit.")
    return "\n".join(said), held


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="make the count of today the baseline")
    update = parser.parse_args().update
    try:
        if shutil.which("valgrind") is None:
            raise NothingToCountWith("there is no valgrind (apt-get install valgrind)")
        program = build()
        few, many = count(program, REPLICATES), count(program, 2 * REPLICATES)
    except NothingToCountWith as reason:
        print(f"counts: not held to the baseline: {reason}")
        return 0
    now = round((many - few) / REPLICATES)
    compiler = subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True)
    rustc = compiler.stdout.split()[1]
    if update:
        BASELINE.write_text(
            "# Instructions a replicate, noise included, on AVX2; written by `make counts UPDATE=1`.\n"
            f'instructions = {now}\nrustc = "{rustc}"\n'
        )
        print(f"counts: {now} instructions a replicate are the baseline now")
        return 0
    text, held = judge(now, rustc, tomllib.loads(BASELINE.read_text()))
    print(text)
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
