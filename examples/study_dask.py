"""A study on a dask cluster: of two processes here, or the one of a scheduler.

python examples/study_dask.py [tcp://scheduler:8786]
"""

import sys
from typing import Any

import modfun as mf
from distributed import Client

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
    here = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}  # a part takes one thread
    with Client(sys.argv[1]) if sys.argv[1:] else Client(**here) as client:
        res = mf.MonteCarlo(**STUDY).run(executor=client.get_executor(), directory="runs/dask")
    print(res)


if __name__ == "__main__":  # worker processes import this file
    main()
