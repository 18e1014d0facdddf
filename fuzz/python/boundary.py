"""Public calls with spoilt arguments: each ends in finite numbers or in a ModfunError.

    python fuzz/python/boundary.py --cases 100000 --seed 1 [--only Record] [--case SEED:NAME:NUMBER]

Case NUMBER of call NAME is the same for ever: its generator is made of (seed, name, number).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import traceback
import warnings
import zlib
from collections import Counter
from typing import Any

import modfun as mf
import numpy as np
from calls import Call, calls
from hostile import anything, spoilt
from verdicts import check

SECONDS = 20  # a case takes milliseconds


class TooLong(BaseException):
    """A case that does not end."""


def arguments(call: Call, seed: int, number: int) -> dict[str, Any]:
    """The arguments of a case: those that suit, one to three of them spoilt."""
    rng = np.random.default_rng([seed, zlib.crc32(call.name.encode()), number])
    given = dict(call.given())
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        name = call.names[rng.integers(len(call.names))] if rng.random() < 0.5 or not given else (
            list(given)[rng.integers(len(given))])  # fmt: skip
        given[name] = spoilt(given[name], rng) if name in given and rng.random() < 0.6 else anything(rng)
    return given


def outcome(call: Call, given: dict[str, Any]) -> tuple[str, BaseException | None]:
    """How a case ended: "result", the name of a ModfunError, or "defect" with what was raised."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", mf.ModfunWarning)
        # An error from NumPy 2.2 on; older ones take it for false, which ends as well.
        warnings.filterwarnings("ignore", "The truth value of an empty array", DeprecationWarning)
        try:
            check(call.function(**given))
        except mf.InternalError as error:
            return "defect", error
        except mf.ModfunError as error:
            return type(error).__name__, None
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            return "defect", error
    return "result", None


def _alarm(*_: Any) -> None:
    raise TooLong(f"not done after {SECONDS} s")


def place(error: BaseException) -> str:
    """Where a defect was raised, without numbers: equal places are one defect."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "/modfun/" in f.filename]
    where = f"{frames[-1].filename.split('/modfun/')[-1]}:{frames[-1].lineno}" if frames else "-"
    return f"{type(error).__name__} at {where}"


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cases", type=int, default=10_000)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--only", help="names of calls that contain this")
    asked.add_argument("--case", help="SEED:NAME:NUMBER, shown in full")
    asked.add_argument("--out", help="counts as JSON")
    args = asked.parse_args()
    signal.signal(signal.SIGALRM, _alarm)
    if args.out:
        args.out = os.path.abspath(args.out)
    os.chdir(tempfile.mkdtemp())  # some texts are taken for the names of folders
    if args.case:
        seed, name, number = args.case.split(":")
        call = next(c for c in calls() if c.name == name)
        given = arguments(call, int(seed), int(number))
        print(given)
        signal.setitimer(signal.ITIMER_REAL, SECONDS)
        ended, error = outcome(call, given)
        print(ended)
        if error is not None:
            traceback.print_exception(error)
        return int(error is not None)
    chosen = [c for c in calls() if args.only is None or args.only in c.name]
    counts, defects = run(chosen, args.cases, args.seed)
    for where, (case, text) in sorted(defects.items()):
        print(f"{where}\n    {text}\n    --case '{case}'")
    total = Counter()
    for count in counts.values():
        total += count
    print(f"{sum(total.values())} cases: " + ", ".join(f"{n} {k}" for k, n in sorted(total.items())))
    if args.out:
        with open(args.out, "w", encoding="utf-8") as file:
            json.dump({name: dict(count) for name, count in counts.items()}, file, indent=1)
    return int(bool(defects))


def run(
    chosen: list[Call], cases: int, seed: int
) -> tuple[dict[str, Counter[str]], dict[str, tuple[str, str]]]:
    """Counts of outcomes by call, and defects by place with a case of each."""
    share = np.array([1 / (c.cost + 0.2) for c in chosen])
    each = np.ceil(cases * share / share.sum()).astype(int)
    counts: dict[str, Counter[str]] = {}
    defects: dict[str, tuple[str, str]] = {}
    for call, many in zip(chosen, each, strict=True):
        counts[call.name] = Counter()
        for number in range(many):
            given = arguments(call, seed, number)
            signal.setitimer(signal.ITIMER_REAL, SECONDS)
            ended, error = outcome(call, given)
            signal.setitimer(signal.ITIMER_REAL, 0)
            counts[call.name][ended] += 1
            if error is not None:
                text = str(error).split("\n")[0][:150]
                defects.setdefault(place(error), (f"{seed}:{call.name}:{number}", text))
    return counts, defects


if __name__ == "__main__":
    sys.exit(main())
