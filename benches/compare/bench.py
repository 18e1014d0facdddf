"""modfun against its rivals, in one run: checks, times, writes docs/benchmarks.md. `make bench` calls it.

--quick: one round, without what must be compiled first (numba, JAX, dsmc); for the tests.
"""

import argparse
import os
import sys
from pathlib import Path

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "docs" / "benchmarks.md"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one round, nothing compiled")
    parser.add_argument("--no-jax", action="store_true", help="without JAX, which compiles for a minute")
    parser.add_argument("--rounds", type=int, default=40, help="most rounds")
    parser.add_argument("--seconds", type=float, default=120.0, help="most seconds of rounds")
    parser.add_argument("--out", type=Path, default=PAGE, help="the page written (default: %(default)s)")
    given = parser.parse_args()

    import contestants
    import report
    from checks import same_distribution, same_estimates
    from measure import Contestant, compete, machine
    from rivals.output_error import OutputError

    said = machine()
    found, absent = contestants.rivals(compiled=not given.quick, jax=not given.no_jax)
    samples, coefficients = {}, {}
    for name, rival in found.items():
        worst = same_estimates(rival)
        same_distribution(rival.samples)
        same_distribution(rival.coefficients)
        print(f"{name}: estimates as modfun's to {worst:.0e}", file=sys.stderr)
        samples[name] = Contestant(name, rival.samples)
        coefficients[name] = Contestant(name, rival.coefficients)
    samples["output error"] = Contestant("SciPy output error", OutputError().samples, unit=16)
    dsmc = None
    if given.quick:
        absent["dsmc"] = "left out by --quick"
    else:
        dsmc = contestants.dsmc(absent)
    if dsmc is not None:
        samples["dsmc"] = Contestant("dsmc's SRIVC (Rust), noise given", dsmc.turn, unit=1)
    timed = {
        **contestants.modfun_runs(), **contestants.fits(), **contestants.long_records(),
        "noise": contestants.noise_alone(),
    }  # fmt: skip
    every = [*timed.values(), *samples.values(), *coefficients.values()]
    rounds = compete(every, 1 if given.quick else given.rounds, given.seconds)
    if dsmc is not None:
        dsmc.close()
    memory = contestants.long_record_memory()
    text = report.page(said, rounds, timed, samples, coefficients, absent, memory)
    given.out.write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
