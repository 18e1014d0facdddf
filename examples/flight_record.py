"""Fit a transfer function from an elevator to a pitch rate, from a CSV file with columns t, de, q.

python examples/flight_record.py              # makes a sample record and fits that
python examples/flight_record.py run7.csv     # your own record, same columns
"""

import sys
import tempfile
from pathlib import Path

import modfun as mf
import numpy as np


def write_sample(path: Path) -> None:
    """Short-period motion after two 3-2-1-1 commands, trimmed at 0.01 rad/s, with 2 % of noise."""
    steps = [0, 1, 1, 1, -1, -1, 1, -1, 0, 0, 0, 0]
    de = 0.02 * np.repeat(steps + [-s for s in steps], 50)
    aircraft = mf.tf([-4.0, -3.0], [1, 1.8, 5.0])
    q = aircraft.simulate(u=de, dt=0.02, intersample="zoh")
    q = q + 0.01 + 0.02 * np.std(q) * np.random.default_rng(7).normal(size=q.size)
    table = np.column_stack([0.02 * np.arange(q.size), de, q])
    np.savetxt(path, table, delimiter=",", header="t,de,q", comments="", fmt="%.8g")


def analyse(path: Path) -> mf.Fit:
    """Read, look, fit the first half, predict the second."""
    print(mf.columns(path))
    rec = mf.read(path, time="t", outputs=["q"], inputs=["de"], intersample="zoh")  # a held command
    print(rec.check())

    middle = rec.t[0] + rec.duration / 2
    first, second = rec.window(rec.t[0], middle), rec.window(middle, rec.t[-1])
    fit = mf.fit(first, mf.TransferFunction(poles=2, zeros=1))
    print(fit.summary())
    print()
    print("Simulated against the half it was fitted to, and against the half it has not seen:")
    print(fit.score(first))
    print(fit.score(second))
    return fit


def main(arguments: list[str]) -> mf.Fit:
    """Analyse the file given, or a sample made for the purpose."""
    if arguments:
        return analyse(Path(arguments[0]))
    with tempfile.TemporaryDirectory() as folder:
        sample = Path(folder) / "sample.csv"
        write_sample(sample)
        return analyse(sample)


if __name__ == "__main__":
    main(sys.argv[1:])
