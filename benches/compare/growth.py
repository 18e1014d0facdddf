"""How the cost of a fit grows with samples, harmonics, order and inputs, into docs/performance.md.

`make bench` calls it. --quick: two rows of each table and one round, for the tests.
"""

import os
import sys
import warnings
from dataclasses import dataclass, replace

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # before NumPy loads

import modfun as mf
import numpy as np
from measure import Contestant, compete, machine
from section import publish, rounds_of

HEADING = "## How cost grows"
DURATION, NSR = 10.0, 0.05
FACTORS = [(1, 1.6, 4), (1, 3), (1, 4, 25), (1, 5)]  # of denominators: poles at 2, 3, 5 and 5 rad/s
METHODS = ("awls", "ml")
SWEEPS = {
    "intervals": ("N", (64, 256, 1024, 4096, 16384, 65536)),
    "harmonics": ("M", (4, 8, 16, 32, 62, 64, 128)),
    "order": ("n", (1, 2, 3, 4, 5)),
    "inputs": ("inputs", (1, 2, 3, 4)),
}
TEXT = """
Written by `make bench` from one run; do not edit. A fit of one record by `mf.fit`, and of one out of many by
`mf.fit_many` on one thread, to the default tolerance, no trend, noise of 5 % of the output's rms. What is not
varied is N = 1024 intervals, M = 16, order n = 2, one input. Processor time, minimum of {rounds} rounds; in
brackets the mean number of steps.

{machine}
"""


@dataclass(frozen=True)
class Setting:
    """One row."""

    intervals: int = 1024
    harmonics: int = 16
    order: int = 2
    inputs: int = 1


def clean(setting: Setting) -> mf.Record:
    """The noise-free record."""
    chosen = {1: [1], 2: [0], 3: [0, 1], 4: [0, 2], 5: [0, 1, 2]}[setting.order]
    den = np.array([1.0])
    for k in chosen:
        den = np.convolve(den, FACTORS[k])
    chirps = [f"sin({(1 + 0.4 * k) / 3} * t**2 + {k})" for k in range(setting.inputs)]
    system = mf.tf([[[den[-1]]] * setting.inputs], den)
    return mf.simulate(system, input=chirps, duration=DURATION, intervals=setting.intervals)


def contestants(setting: Setting) -> dict[str, Contestant]:
    """Both methods, in a batch and alone; the number of steps is in the name."""
    rec = clean(setting)
    size = min(512, max(64, 2**22 // setting.intervals))
    noise = np.random.default_rng(1).standard_normal((size, 1, setting.intervals + 1))
    y = rec.y + NSR * np.sqrt(np.mean(rec.y**2)) * noise
    words = {"u": rec.u, "dt": rec.dt, "intersample": "smooth"}
    batch, one = mf.Batch(y=y, **words), mf.Record(y=y[0], **words)
    structure = mf.TransferFunction(poles=setting.order, zeros=0)
    found = {}
    for method in METHODS:
        options = {"method": method, "harmonics": setting.harmonics, "trend": None}

        def many(count, options=options):
            for _ in range(count // size):
                mf.fit_many(batch, structure, threads=1, progress=False, **options)

        def single(count, options=options):
            for _ in range(count):
                mf.fit(one, structure, **options)

        fits = mf.fit_many(batch, structure, threads=1, progress=False, **options)
        if fits.success.mean() < 0.9:
            raise AssertionError(f"{setting}: {fits!r}")
        found[f"{method}, many"] = Contestant(f"{fits.nit.mean():.1f}", many, unit=size)
        found[f"{method}, one"] = Contestant(f"{mf.fit(one, structure, **options).nit}", single, unit=1)
    return found


def main() -> int:
    given = rounds_of(__doc__, "two rows of each table, one round", seconds=120)
    warnings.simplefilter("ignore", mf.ModfunWarning)
    said = machine()
    timed = {}
    for name, (_, values) in SWEEPS.items():
        for value in values[:2] if given.quick else values:
            setting = replace(Setting(), **{name: value})
            if setting not in timed:
                timed[setting] = contestants(setting)
    every = [c for row in timed.values() for c in row.values()]
    rounds = compete(every, given.rounds, given.seconds)
    text = [HEADING, TEXT.format(rounds=rounds, machine=said)]
    for name, (symbol, values) in SWEEPS.items():
        columns = list(next(iter(timed.values())))
        text += [f"| {symbol} | {' | '.join(columns)} |", "|---:" * (1 + len(columns)) + "|"]
        for value in values[:2] if given.quick else values:
            row = timed[replace(Setting(), **{name: value})]
            cells = [f"{row[c].best / 1e3:.3g} µs ({row[c].name})" for c in columns]
            text.append(f"| {value} | {' | '.join(cells)} |")
        text.append("")
    publish(given.out, text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
