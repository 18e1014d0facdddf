"""Fits of several outputs beside other packages, into docs/rivals.md.

`make rivals` calls it. --quick: one problem, one round, nobody who has to be installed; for the tests.
"""

import os
import sys
import warnings

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

from time import process_time

import numpy as np
from competitors import silence
from joint_growth import NSR, SAMPLES, record
from measure import machine
from report import amount
from rivals import joint
from section import publish, rounds_of

HEADING = "## Several outputs"
# Outputs, inputs, poles of each output.
PROBLEMS = ((2, 2, 2), (3, 3, 4))
ENTRANTS = {
    "modfun ml": (joint.modfun_ml, 20),
    "SciPy output error": (joint.scipy_output_error, 3),
    "SIPPY N4SID": (joint.sippy_n4sid, 3),
    "jax-sysid": (joint.jax_sysid, 1),
}
TEXT = """
Linear systems of docs/performance.md, "How joint fits grow": {samples} samples, held random inputs, noise of
{percent:.0f} % of each output's rms. modfun and SciPy fit a denominator and full numerators for each output,
N4SID and jax-sysid a state space with as many states. Error: rms of what the model makes of other inputs,
from rest, less the true system's outputs, over their rms, worst output; mean of {records} records. Time:
processor time of a call, minimum, in one process on one thread.

{machine}
"""


def row(name: str, size: tuple[int, int, int], records: int, rounds: int) -> str:
    """Time and error of an entrant, a row of the table."""
    fit, turns = ENTRANTS[name]
    other = record(size, 1000, 0.0)
    spent, errors = [], []
    for seed in range(1, records + 1):
        rec = record(size, seed, NSR)
        for _ in range(min(turns, rounds)):
            start = process_time()
            with silence():
                simulated = fit(rec, size[2])
            spent.append(process_time() - start)
        miss = simulated(other.u) - other.y
        errors.append(np.max(np.linalg.norm(miss, axis=1) / np.linalg.norm(other.y, axis=1)))
    return f"| {name} | {amount(1e9 * min(spent))} | {100 * np.mean(errors):.2g} % |"


def main() -> int:
    given = rounds_of(__doc__, "one problem, one round, nobody who has to be installed", seconds=0)
    warnings.simplefilter("ignore")
    records = 1 if given.quick else 3
    names = list(ENTRANTS)[:2] if given.quick else list(ENTRANTS)
    lines = [HEADING, TEXT.format(samples=SAMPLES, percent=100 * NSR, records=records, machine=machine())]
    for size in PROBLEMS[:1] if given.quick else PROBLEMS:
        outputs, inputs, poles = size
        lines += [f"**{outputs} outputs, {inputs} inputs, {poles} poles each**", ""]
        lines += ["| | a fit | error |", "|---|---:|---:|"]
        lines += [row(name, size, records, given.rounds) for name in names]
        lines.append("")
    publish(given.out, lines)
    return 0


if __name__ == "__main__":
    sys.exit(main())
