"""Coverage of 95 % intervals by how uncertain the worst mode is: when standard errors say too little.

    python benches/uncertain_modes.py [records]  # 60 of each of 60 cells by default, some two minutes

A mode's uncertainty is the standard error of its real part over that part, or over 4/T of the record's
length T where it decays more slowly. Beyond 0.25 `fit.check()` names it, beyond 0.3 the fit warns. The table
is quoted in docs/howto/read_uncertainty.md.
"""

from __future__ import annotations

import sys
import warnings
from itertools import pairwise

import modfun as mf
import numpy as np
from modfun.results.uncertain_poles import worst_mode

# Numerator, denominator, input, duration in s, intervals.
CASES = (
    ([800, 8000], [1, 4, 130, 300, 2500], "sin(t**2/5) + sin(7*t)", 20.0, 512),
    ([800, 8000], [1, 4, 130, 300, 2500], "sin(t**2/3)", 20.0, 512),
    ([8, 80], [1, 0.5, 130, 40, 2500], "sin(t**2/3)", 20.0, 512),
    ([5], [1, 3, 8], "sin(t**2/5)", 10.0, 256),
    ([5], [1, 3, 8], "sin(0.5*t)", 10.0, 256),
    ([5], [1, 0.3, 8], "sin(t**2/5)", 10.0, 256),
    ([5], [1, 0.02, 8], "sin(t**2/5)", 10.0, 256),
    ([5], [1, 1, 8], "sin(t**2/2)", 5.0, 256),
    ([5], [1, 1, 0], "sin(t**2/5)", 10.0, 256),
    ([10], [1, 4, 9, 10], "sin(t**2/5)", 10.0, 256),
    ([1, 20], [1, 6, 30, 20], "sin(t**2/5)", 10.0, 256),
    ([2], [1, 0.5], "sin(t)", 10.0, 256),
)
NOISE = (0.05, 0.15, 0.3, 0.6, 1.0)
EDGES = (0.0, 0.1, 0.2, 0.25, 0.3, 0.4, 0.5, np.inf)


def main(records: int) -> None:
    """Print the table."""
    rows = []
    for num, den, source, duration, intervals in CASES:
        system = mf.tf(num, den)
        structure = mf.TransferFunction(poles=len(den) - 1, zeros=len(num) - 1)
        truth = np.array([*den[1:], *num], dtype=float)
        for nsr in NOISE:
            for seed in range(records):
                rec = mf.simulate(
                    system, input=source, duration=duration, intervals=intervals, nsr=nsr, seed=seed
                )
                fit = mf.fit(rec, structure)
                if fit.usable and np.all(fit.bse > 0):
                    low, high = fit.conf_int().T
                    rows.append((worst_mode(fit)[0], np.mean((low < truth) & (truth < high))))
    worst, inside = np.array(rows).T
    print("uncertainty   fits  coverage of 95 % intervals")
    for low, high in pairwise(EDGES):
        here = (low <= worst) & (worst < high)
        print(f"{low:4.2f} to {high:4.2f}  {here.sum():5d}  {100 * inside[here].mean():.0f} %")


if __name__ == "__main__":
    warnings.simplefilter("ignore", mf.ModfunWarning)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60)
