"""How the cost of a joint fit grows with outputs and coefficients, into docs/performance.md.

`make bench` calls it. --quick: two rows and one round, for the tests.
"""

import os
import sys
import warnings

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

import modfun as mf
import numpy as np
from cargo_bench import SETS, times
from measure import Contestant, compete, instruction_set, machine
from report import amount
from section import publish, rounds_of

HEADING = "## How joint fits grow"
# Outputs, inputs, poles of each output: outputs × poles × (1 + inputs) coefficients.
ROWS = (
    (1, 1, 2), (2, 1, 2), (2, 2, 2), (3, 2, 2), (2, 2, 4), (3, 3, 3), (4, 2, 4), (4, 4, 4), (5, 4, 5),
    (6, 4, 6), (6, 5, 6),
)  # fmt: skip
SAMPLES, LINES, NSR = 1000, 240, 0.02
TEXT = """
Written by `make bench` from one run; do not edit. `mf.fit` with `ml` of one record of {samples} samples: of
each output a denominator and full numerators of its own, held random inputs, noise of {percent:.0f} % of the
output's rms and unknown covariance, {lines} harmonics that are given. Processor time, minimum of {rounds}
rounds. The share of the peak counts, in every step, a QR of each output's own columns, the products of these
factors with the columns of the other outputs, and the elimination of all unknowns, at {peak:.1f}
multiply-adds a nanosecond, which is what this core reaches in registers with nothing else to do.

{machine}
"""


def system(outputs: int, inputs: int, poles: int) -> mf.LTI:
    """Resonances spread over the band, all of them at every output with other gains."""
    rng = np.random.default_rng(outputs + 10 * inputs + 100 * poles)
    blocks = []
    left = poles
    while left > 0:
        omega = 1.0 + 1.6 * len(blocks)
        blocks.append([[0.0, 1.0], [-(omega**2), -0.3 * omega]] if left > 1 else [[-omega]])
        left -= 2
    size = poles
    a = np.zeros((outputs * size, outputs * size))
    at = 0
    for output in range(outputs):
        for block in blocks:
            one = np.array(block) * (1.0 + 0.1 * output)
            a[at : at + len(one), at : at + len(one)] = one
            at += len(one)
    c = np.kron(np.eye(outputs), np.ones((1, size)))
    return mf.ss(a, rng.standard_normal((outputs * size, inputs)), c, np.zeros((outputs, inputs)))


def record(size: tuple[int, int, int], seed: int, nsr: float) -> mf.Record:
    """Held random inputs, and what a system of so many outputs, inputs and poles makes of them from rest."""
    u = np.repeat(np.random.default_rng(seed).standard_normal((size[1], SAMPLES // 4)), 4, axis=1)
    return mf.simulate(
        system(*size), input=u, duration=0.1 * (SAMPLES - 1), intervals=SAMPLES - 1, intersample="zoh",
        nsr=nsr, seed=seed,
    )  # fmt: skip


def contestant(outputs: int, inputs: int, poles: int) -> tuple[Contestant, int, int]:
    """A fit to time, its unknowns and its steps."""
    rec = record((outputs, inputs, poles), 1, NSR)
    structure = mf.TransferFunction(poles=poles, zeros=poles - 1, denominator="separate")
    options = {"harmonics": LINES, "trend": None}

    def run(count: int) -> None:
        for _ in range(count):
            mf.fit(rec, structure, **options)

    fit = mf.fit(rec, structure, **options)
    if not fit.success:
        raise AssertionError(f"{outputs} outputs, {inputs} inputs, {poles} poles: {fit!r}")
    return Contestant(f"{outputs} × {inputs}, {poles} poles", run, unit=1), len(fit.params), fit.nit


def work(outputs: int, inputs: int, poles: int) -> float:
    """Multiply-adds of a step: unknowns are coefficients and a transient for each pole."""
    rows, own = 2 * LINES + 1, poles * (2 + inputs)
    return rows * (outputs * own) ** 2 + (outputs * own) ** 3 / 3


def main() -> int:
    given = rounds_of(__doc__, "two rows, one round, no peak", seconds=60)
    warnings.simplefilter("ignore", mf.ModfunWarning)
    about = machine()
    peak = np.nan
    if not given.quick:
        peak = 1 / times(["peak"], "multiply-adds")[f"multiply-adds/{SETS[instruction_set()]}"]
    sizes = ROWS[:2] if given.quick else ROWS
    found = {size: contestant(*size) for size in sizes}
    rounds = compete([c for c, _, _ in found.values()], given.rounds, given.seconds)
    text = [
        HEADING,
        TEXT.format(samples=SAMPLES, percent=100 * NSR, lines=LINES, rounds=rounds, peak=peak, machine=about),
        "| outputs | inputs | poles each | coefficients | steps | a fit | of the peak |",
        "|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for size, (c, coefficients, steps) in found.items():
        share = (steps + 1) * work(*size) / peak / c.best
        text.append(
            f"| {' | '.join(map(str, size))} | {coefficients} | {steps} | {amount(c.best)} | {share:.0%} |"
        )
    publish(given.out, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
