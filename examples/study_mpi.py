"""A study on MPI: one process hands out the parts, the others compute them.

mpiexec -n 5 python -m mpi4py.futures examples/study_mpi.py
"""

from typing import Any

import modfun as mf
from mpi4py.futures import MPIPoolExecutor

STUDY: dict[str, Any] = {
    "system": mf.tf([5], [1, 3, 8]),
    "input": "sin(t**2/5)",
    "duration": 10.0,
    "intervals": 128,
    "nsr": 0.1,
    "estimators": {"ml": "ml", "oe": mf.rivals.output_error(mf.TransferFunction(poles=2, zeros=0))},
    "harmonics": 8,
    "replicates": 256,
}


def main() -> None:
    """Run it; where it is killed, run it again and it goes on."""
    with MPIPoolExecutor() as pool:
        res = mf.MonteCarlo(**STUDY).run(executor=pool, directory="runs/mpi")
    print(res)


if __name__ == "__main__":  # the other processes import this file
    main()
