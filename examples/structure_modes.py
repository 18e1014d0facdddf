"""Modes of a steel structure: responses without a model, then a model of each resonance.

The record is the flexible structure of DaISy (two shakers, two accelerometers, 1024 Hz, four seconds), of
which the project has no copy.

python examples/structure_modes.py [FOLDER]     # of daisy_flexible_structure_2x2; default: $MODFUN_DATA
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import modfun as mf
import numpy as np


def record(folder: Path) -> mf.Record:
    path = folder / "daisy_flexible_structure_2x2" / "flex_0_4096.csv"
    return mf.read(path, time="t_s", outputs=["y1", "y2"], inputs=["u1", "u2"], intersample="smooth")


def peaks(frf: mf.FrequencyResponse, count: int) -> list[float]:
    """Frequencies, rad/s, at which the largest gain of all paths stands out most from its neighbourhood."""
    from scipy.signal import find_peaks

    largest = np.max(frf.magnitude_db, axis=(0, 1))
    found, about = find_peaks(largest, prominence=6.0, distance=20)
    strongest = np.argsort(-about["prominences"])[:count]
    return sorted(frf.omega[found[strongest]].tolist())


def modes(folder: Path, count: int = 10) -> mf.Table:
    """Frequency (Hz) and damping ratio of modes with standard errors, each from the gains around it."""
    frf = mf.frf(record(folder), band=(2 * np.pi * 40, 2 * np.pi * 490), progress=False)
    # One mode, and what all others add nearby: two poles that all paths share, as many zeros.
    one = mf.TransferFunction(poles=2, zeros=2, denominator="common")
    rows = []
    for peak in peaks(frf, count):
        fit = mf.fit(frf.select((peak - 25, peak + 25)), one)
        mode = fit.damp().rows[0]
        rows.append(
            {
                "Hz": mode["omega"] / (2 * np.pi),
                "se Hz": mode["omega_bse"] / (2 * np.pi),
                "zeta %": 100 * mode["zeta"],
                "se %": 100 * mode["zeta_bse"],
            }
        )
    return mf.Table({name: [row[name] for row in rows] for name in rows[0]})


if __name__ == "__main__":
    folder = sys.argv[1] if sys.argv[1:] else os.environ.get("MODFUN_DATA")
    print(modes(Path(folder or sys.exit("give the folder of the records, or set MODFUN_DATA"))))
