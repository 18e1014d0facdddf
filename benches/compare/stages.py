"""Where a replicate's time goes, beside what the processor could do, into docs/performance.md.

`make bench` calls it; the times are those of `cargo bench`, which it runs.
"""

import os
import sys

import contestants
import setting as s
from cargo_bench import SETS, times
from measure import compete, instruction_set, machine
from section import arguments, publish

HEADING = "## Where a replicate's time goes"
TEXT = """
Written by `make bench` from one run; do not edit. The report's eq. (24) as in docs/benchmarks.md: 257
normals, coefficients on {lines} lines, start and {steps} reweightings of {sums} weighted sums and a 5 × 5
system each. Times are minima of `cargo bench`, of one replicate out of eight that travel together. "At the
peak" is the time of the multiplications and multiply-adds that a stage cannot do without, at the rate that
this core reaches in registers with nothing else to do ({peak:.1f} a nanosecond).

{machine}
"""


def main() -> int:
    given = arguments(__doc__).parse_args()
    said = machine()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    benches = ["rng", "spectrum", "estimate", "peak"]
    ns = times(benches, "normals 257|trapezoid.*256x8|awls, 5 steps|estimate/.*wls$|multiply-adds")
    isa = SETS[instruction_set()]
    peak = 1 / ns[f"multiply-adds/{isa}"]
    lines, sums, unknowns = s.LINES, 15, 5
    step = lines * (sums + 4) + unknowns * (unknowns + 1) * (unknowns + 2) // 6 + unknowns**2
    start = ns[f"estimate/{isa} wls"]
    study = contestants.modfun_runs()["samples"]
    compete([study], 20, 10.0)
    parts = [
        # 27 a pair: 7 of the logarithm, 1 of the angle, 16 of sine and cosine, 3 to scale.
        ("normals", ns[f"normals 257/{isa}"], 27 * 129),
        ("their coefficients", ns[f"sums of eight records/{isa} trapezoid/256x8"], 65 * (2 * lines - 1)),
        ("products, `wls`", start, sums * lines * 2),
        (f"{s.STEPS} reweightings", ns[f"estimate/{isa} awls, 5 steps"] - start, s.STEPS * step),
    ]
    told = sum(time for _, time, _ in parts)
    rest = study.best - told
    text = [HEADING, TEXT.format(lines=lines, steps=s.STEPS, sums=sums, peak=peak, machine=said)]
    text += ["| stage | ns | share | at the peak, ns |", "|---|---:|---:|---:|"]
    for name, time, work in parts:
        text.append(f"| {name} | {time:.0f} | {time / study.best:.0%} | {work / peak:.0f} |")
    text.append(f"| noise added, errors counted, the call | {rest:.0f} | {rest / study.best:.0%} | |")
    text.append(f"| a replicate of a study | {study.best:.0f} | 100% | |")
    publish(given.out, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
