"""Numerical trust: each section of docs/validation.md made again. `make validate` calls it.

python benches/validate/validate.py                  # all
python benches/validate/validate.py --only orders    # that section alone; the others stay as they are
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
import time
import warnings
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "validation.md"
SECTIONS = {
    "report": "the_report",
    "benchmarks": "published",
    "coverage": "covering",
    "oracles": "twins",
    "orders": "orders",
    "bits": "bits",
}
TESTS = ("tests/python", "tests/python/reduction", "tests/python/responses", "tests/python/results")
for folder in ("benches", "benches/compare", "examples", "examples/records", *TESTS):
    sys.path.append(str(ROOT / folder))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=list(SECTIONS), action="append", help="a section; may be repeated")
    parser.add_argument(
        "--scale", type=float, default=1.0, help="times the replicates (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, default=PAGE, help="the page written (default: %(default)s)")
    given = parser.parse_args()

    import modfun as mf
    import page
    from measure import machine
    from section import write

    warnings.simplefilter("ignore", mf.ModfunWarning)  # what they say is counted, or the point of a row
    page.begin(given.out)
    unexplained = 0
    for name, module in SECTIONS.items():
        if given.only and name not in given.only:
            continue
        start = time.perf_counter()
        made = importlib.import_module(module).section(given.scale)
        made.command, made.machine = f"make validate ONLY={name}", machine()
        made.seconds = time.perf_counter() - start
        write(given.out, made.heading, made.text())
        page.summarise(given.out)
        unexplained += made.unexplained
        print(f"{name}: {made.count} checks, {made.off} off, {made.seconds:.0f} s", file=sys.stderr)
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main())
