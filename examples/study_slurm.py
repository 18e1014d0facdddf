"""A study as a job array: one share of its parts, or all shares brought together; see study_slurm.sh.

python examples/study_slurm.py K N
python examples/study_slurm.py merge
"""

import sys
from pathlib import Path
from typing import Any

import modfun as mf
from modfun.study.shards import merge

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
PLACE = Path("runs/slurm")


def main(words: list[str]) -> None:
    """A job that is requeued goes on with its share."""
    if words == ["merge"]:
        merge(PLACE / "all", sorted(PLACE.glob("shard-*")))
        print(mf.load(PLACE / "all"))
    else:
        k, n = map(int, words)
        mf.MonteCarlo(**STUDY).run(directory=PLACE / f"shard-{k}", shard=(k, n), progress=False)


if __name__ == "__main__":
    main(sys.argv[1:])
