"""Memory that one transform of 2²² samples takes beyond the samples, in MB: `long_record.py modfun | numpy`.

In a process of its own, since only the peak of a whole process can be seen.
"""

import resource
import sys
from pathlib import Path

import numpy as np

SIZE, HARMONICS = 2**22, 30


def record():
    """The samples."""
    import modfun as mf

    return mf.Record(y=np.random.default_rng(1).standard_normal(SIZE), dt=0.01)


def transforms(rec):
    """What is compared: all harmonics from 0 to M by modfun, half the spectrum by NumPy."""
    import modfun as mf

    return {"modfun": lambda: mf.coefficients(rec, HARMONICS), "numpy": lambda: np.fft.rfft(rec.y[0])}


def peak() -> float:
    """Peak resident memory, MB."""
    status = Path("/proc/self/status")
    if status.exists():
        return int(status.read_text().split("VmHWM:")[1].split()[0]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main():
    rec = record()
    small = type(rec)(y=rec.y[0, :4096], dt=0.01)
    transforms(small)[sys.argv[1]]()  # code and tables come in
    reset = Path("/proc/self/clear_refs")
    if reset.exists():
        reset.write_text("5")  # the peak starts again from what is resident now
    before = peak()
    transforms(rec)[sys.argv[1]]()
    print(peak() - before)


if __name__ == "__main__":
    main()
