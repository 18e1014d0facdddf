"""Marple's 64 complex samples: two close tones, two weak ones and coloured noise.

Usage: python examples/marple.py [FOLDER, default $MODFUN_DATA]
"""

import os
import sys
from pathlib import Path

import modfun as mf
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.complex128]

# The record was made of tones at these frequencies (turns a sample) and decibels below the strongest.
TONES = {-0.15: -20, 0.1: -20, 0.2: 0, 0.21: 0}
COUNT = 10


def read(folder: str | Path) -> Array:
    """The samples, complex."""
    columns = np.loadtxt(Path(folder) / "kay_marple64" / "marple64_complex.csv", delimiter=",", skiprows=1)
    return columns[:, 1] + 1j * columns[:, 2]


def main(folder: str | Path) -> mf.Sinusoids:
    """Tones that describe the record; all but the four are the coloured noise, taken for tones."""
    y = read(folder)
    found = mf.sinusoids(y, COUNT, dt=1.0)
    turns = found.omega / (2 * np.pi)
    errors = found.bse[: len(found)] / (2 * np.pi)
    print(f"{'turns a sample':>20}  {'dB':>6}")
    for f, error, size in zip(turns, errors, found.amplitude / found.amplitude.max(), strict=True):
        near = [known for known in TONES if abs(f - known) < 0.005]
        name = f"known: {near[0]:g}, {TONES[near[0]]} dB" if near else ""
        print(f"{f:10.4f} ± {error:.4f}  {20 * np.log10(size):6.1f}  {name}".rstrip())
    return found


if __name__ == "__main__":
    folder = sys.argv[1] if sys.argv[1:] else os.environ.get("MODFUN_DATA")
    main(Path(folder or sys.exit("give the folder of the records, or set MODFUN_DATA")))
