"""Times the programs of benches/programs.rs as they are and as a commit has them, in turn.

`make bench-compare BASE=commit` calls it.
"""

import argparse
import shutil
import subprocess
import sys

from cargo_bench import ROOT, programs

TREE = ROOT / "target" / "base"


def check_out(commit: str) -> None:
    """A worktree of the commit, with a target folder of its own that later comparisons use again."""
    if (TREE / ".git").exists():
        subprocess.run(["git", "checkout", "--quiet", "--detach", commit], cwd=TREE, check=True)
    else:
        shutil.rmtree(TREE, ignore_errors=True)
        subprocess.run(["git", "worktree", "prune"], cwd=ROOT, check=True)
        subprocess.run(["git", "worktree", "add", "--detach", TREE, commit], cwd=ROOT, check=True)


def table(base: list[dict[str, float]], now: list[dict[str, float]]) -> str:
    """Minima over the rounds of what both have, and their ratio."""
    rows = ["| program | base, µs | now, µs | now / base |", "|---|---:|---:|---:|"]
    for name in now[0]:
        if name in base[0]:
            was, is_now = (min(each[name] for each in rounds) / 1e3 for rounds in (base, now))
            rows.append(f"| {name} | {was:.4g} | {is_now:.4g} | {is_now / was:.3f} |")
    only = sorted(base[0].keys() ^ now[0].keys())
    return "\n".join(rows) + (f"\n\nOnly one of the two has: {', '.join(only)}." if only else "")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("base", help="the commit to compare with")
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    check_out(given.base)
    base, now = [], []
    for _ in range(given.rounds):
        base.append(programs(TREE))
        now.append(programs())
    print(table(base, now))
    return 0


if __name__ == "__main__":
    sys.exit(main())
