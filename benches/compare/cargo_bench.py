"""Minima of `cargo bench`, read from what criterion keeps."""

import json
import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SETS = {"avx512": "Avx512", "avx2": "Avx2", "neon": "Neon"}  # of instructions, as the benches name them


def times(benches: list[str], pattern: str, *options: str, root: Path = ROOT) -> dict[str, float]:
    """Minima in ns an element, by the names of the benches that match, of the sources under `root`."""
    asked = ["cargo", "metadata", "--no-deps", "--format-version=1"]
    # Worktrees must not share a target folder: cargo knows their crates by the same names.
    alone = {name: value for name, value in os.environ.items() if name != "CARGO_TARGET_DIR"}
    told = subprocess.run(asked, cwd=root, check=True, capture_output=True, env=alone)
    described = json.loads(told.stdout)
    target = described["target_directory"]
    for old in list(Path(target, "criterion").glob("**/new")):  # of benches that are no more, perhaps
        shutil.rmtree(old)
    build = ["cargo", "bench", "--quiet", *(f"--bench={name}" for name in benches)]
    subprocess.run(
        [*build, "--", pattern, *options],
        cwd=root,
        check=True,
        stdout=subprocess.DEVNULL,
        env=alone,
    )
    found = {}
    for path in Path(target, "criterion").glob("**/new/benchmark.json"):
        told = json.loads(path.read_text())
        elements = (told["throughput"] or {}).get("Elements", 1)
        sample = json.loads(path.with_name("sample.json").read_text())
        each = (time / count for time, count in zip(sample["times"], sample["iters"], strict=True))
        found[told["full_id"]] = min(each) / elements
    return found


def programs(root: Path = ROOT) -> dict[str, float]:
    """Minima in ns a piece of the programs of benches/programs.rs, by their names; three seconds each."""
    found = times(["fits"], "^fits/", "--warm-up-time=1", "--measurement-time=2", root=root)
    return {name.split("/")[1]: found[name] for name in sorted(found) if name.startswith("fits/")}
