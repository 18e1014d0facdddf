"""modfun beside its rivals in one run: accuracy, failures and time a fit, into docs/rivals.md. `make rivals`.

Cells already there in the file given by --keep are not computed again. --quick: few records, nothing to be
installed or compiled, 20 records for the benchmark of the field; for the tests.
"""

import argparse
import json
import os
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from time import process_time

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

import field_benchmark
import numpy as np
import problems
from competitors import COMPETITORS, EQ24, RAO_GARNIER, silence

PAGE = Path(__file__).resolve().parents[2] / "docs" / "rivals.md"
LEVELS = (0.0, 0.05, 0.2, 0.6)
TIMED = 8  # records gone through in turn when a fit is timed
SLOW = 2e8  # ns: not timed apart from the cells


def problem_named(name):
    """By name, for other processes."""
    return problems.report() if name == EQ24 else problems.rao_garnier()


def attempt(estimate, rec, size):
    """θ, or NaN where the rival raises."""
    try:
        return np.asarray(estimate(rec), dtype=float)
    except Exception:
        return np.full(size, np.nan)


def cell(index, name, nsr, state, scale):
    """Figures of a competitor on a cell, in %; errors are rms over the parameters, one a record."""
    warnings.simplefilter("ignore")
    who, problem = COMPETITORS[index], problem_named(name)
    records = [problem.record(k, nsr, state, who.states) for k in range(who.count(problem, scale))]
    with silence():
        estimate = who.make(problem)
        start = process_time()
        if hasattr(estimate, "many"):
            theta = estimate.many(records)
        else:
            theta = np.array([attempt(estimate, rec, problem.truth.size) for rec in records])
        spent = process_time() - start
    failed = problem.failed(theta)
    off = 100 * (theta / problem.truth - 1)
    good = off[~failed]
    return {
        "failed": int(failed.sum()),
        "bias": rms(good.mean(axis=0)) if len(good) > 1 else None,
        "sd": rms(good.std(axis=0, ddof=1)) if len(good) > 1 else None,
        "ns": round(1e9 * spent / len(records)),
        "errors": [None if bad else rms(each) for bad, each in zip(failed, off, strict=True)],
    }


def rms(values):
    """Root mean square, six digits."""
    return float(f"{np.sqrt(np.mean(values**2)):.6g}")


def cells(present, kept, scale, workers, save):
    """All cells that are not kept yet."""
    names = [EQ24] + ([RAO_GARNIER] if problems.DEFINITION.exists() else [])
    wanted = [
        (i, name, nsr, state)
        for name in names for state in problems.STATES for nsr in LEVELS
        for i, who in enumerate(COMPETITORS) if who in present
    ]  # fmt: skip
    keys = {job: "|".join([COMPETITORS[job[0]].name, *map(str, job[1:])]) for job in wanted}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(cell, *job, scale): keys[job] for job in wanted if keys[job] not in kept}
        for done in as_completed(running):
            kept[running[done]] = done.result()
            print(running[done], file=sys.stderr, flush=True)
            save()
    return {key: kept[key] for key in keys.values()}


def times(present, results, quick):
    """{problem: {competitor: ns a fit}}: minima over rounds, in turn on one core; of the slow the mean."""
    from measure import Contestant, compete

    found = {}
    for name in [EQ24] + ([] if quick or not problems.DEFINITION.exists() else [RAO_GARNIER]):
        problem, fast, found[name] = problem_named(name), [], {}
        for who in present:
            found[name][who.name] = results[f"{who.name}|{name}|0.2|zero"]["ns"]
            if found[name][who.name] < SLOW:
                records = [problem.record(k, 0.2, "zero", who.states) for k in range(TIMED)]
                with silence():
                    fast.append(Contestant(who.name, turn(who, problem, records), unit=1))
        with silence():
            found[name]["rounds"] = compete(fast, 1 if quick else 10, 1.0 if quick else 60.0)
        found[name] |= {c.name: c.best for c in fast}
    return found


def turn(who, problem, records):
    """What goes through the records so many times."""
    estimate = who.make(problem)
    if hasattr(estimate, "process"):
        return estimate.process(records).turn

    def run(count):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for k in range(count):
                attempt(estimate, records[k % TIMED], problem.truth.size)

    return run


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few records, nothing to be installed")
    parser.add_argument("--scale", type=float, default=1.0, help="times the usual number of records")
    parser.add_argument("--field", type=int, default=10_000, help="records of the benchmark of the field")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--keep", type=Path, help="JSON file of the cells computed so far")
    parser.add_argument("--out", type=Path, default=PAGE, help="the page written (default: %(default)s)")
    given = parser.parse_args()
    import rivals_page
    from measure import machine

    kept = json.loads(given.keep.read_text()) if given.keep and given.keep.exists() else {}

    def save():
        if given.keep:
            given.keep.write_text(json.dumps(kept, indent=0))

    said = machine()
    absent = {who.name: who.missing() for who in COMPETITORS}
    if given.quick:
        absent = {who.name: absent[who.name] if who.quick else "left out by --quick" for who in COMPETITORS}
    present = [who for who in COMPETITORS if absent[who.name] is None]
    for name, why in absent.items():
        if why:
            print(f"{name}: not in this run ({why})", file=sys.stderr)
    if "dsmc" in {who.package for who in present}:
        from rivals.srivc_dsmc import build

        build()  # once, before processes ask for it
    scale, field = (0.02, 20) if given.quick else (given.scale, given.field)
    benchmark = field_benchmark.run(field, given.workers, kept, save, quick=given.quick)
    results = cells(present, kept, scale, given.workers, save)
    if "times" not in kept:
        kept["times"] = times(present, results, given.quick)
        save()
    absent = {name: why for name, why in absent.items() if why}
    given.out.write_text(rivals_page.page(said, benchmark, results, kept["times"], absent))
    return 0


if __name__ == "__main__":
    sys.exit(main())
