"""Texts and files that are not what they should be: each ends in a result or in a ModfunError.

    python fuzz/python/texts.py --cases 100000 --seed 1 [--only equation] [--case SEED:KIND:NUMBER]

Case NUMBER of a kind is the same for ever. Equations are made by a grammar, files are small valid ones with
bytes changed.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import sys
import tempfile
import traceback
import zlib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import modfun as mf
import numpy as np
from boundary import SECONDS, _alarm, outcome, place
from modfun.signals.sources import evaluate
from modfun.study import toml_file
from small_files import STUDIES, archives, fits, matlab, tables

Rng = np.random.Generator
MEMORY = 6 * 2**30  # bytes of addresses: what a header claims is not taken from the machine
T = 0.1 * np.arange(33)

WORDS = (
    "y y' y'' u u' a b c1 t pi e 1 2 0.5 1e3 0 1e-300 y(t-h) u(t-0.5) x x' y1 y2' u2 D(y,2) 1e308",
    "sin cos tan asin acos atan sinh cosh tanh exp log sqrt abs sign floor step min max where D f",
    "+ - * / ** % <",
)
ATOMS, CALLS, SIGNS = map(str.split, WORDS)
ODD = list("()'=*/%,<>.^_ \n\t\0\"`$@;:[]{}é′²\ud800eE0123456789ytu")
ODD_VALUES = (
    "nan",
    "inf",
    "-1",
    "0",
    "1e308",
    "99999999999999999999",
    '""',
    '"nothing:here"',
    "[]",
    "[[]]",
    "{}",
    "true",
)
FOURS = (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\0\0\0\x80", b"-1e9", b"nan,")


def formula(rng: Rng, depth: int) -> str:
    """A random expression, most often one that can be read."""
    kind = rng.integers(8) if depth else 0
    if kind < 2:
        return str(rng.choice(ATOMS))
    if kind < 5:
        return f"{formula(rng, depth - 1)} {rng.choice(SIGNS)} {formula(rng, depth - 1)}"
    if kind == 5:
        parts = ", ".join(formula(rng, depth - 1) for _ in range(rng.choice([1, 1, 1, 2, 3])))
        return f"{rng.choice(CALLS)}({parts})"
    return f"({formula(rng, depth - 1)}){rng.choice(['', '', chr(39)])}"


def spoilt_text(text: str, rng: Rng) -> str:
    """A text with a few characters changed, half of the times."""
    for _ in range(int(rng.choice([0, 0, 1, 2, 5]))):
        at = int(rng.integers(len(text) + 1))
        text = text[:at] + str(ODD[rng.integers(len(ODD))]) + text[at + int(rng.integers(2)) :]
    return text


def an_equation(rng: Rng) -> bytes:
    left, right = formula(rng, int(rng.integers(1, 4))), formula(rng, int(rng.integers(3)))
    return spoilt_text(f"{rng.choice(ATOMS[:3])} + {left} = {right}", rng).encode("utf-8", "surrogatepass")


def a_signal(rng: Rng) -> bytes:
    return spoilt_text(formula(rng, int(rng.integers(1, 5))).replace("'", ""), rng).encode(
        "utf-8", "surrogatepass"
    )


def spoilt_bytes(content: bytes, rng: Rng) -> bytes:
    """Bytes changed, cut, doubled, or replaced by numbers that matter."""
    found = bytearray(content)
    for _ in range(int(rng.choice([1, 1, 2, 4, 16]))):
        at = int(rng.integers(len(found) + 1))
        length = int(rng.choice([1, 1, 2, 4, 8, 30]))
        match rng.integers(6):
            case 0:
                found[at : at + 1] = rng.bytes(1)
            case 1:
                found[at : at + length] = b""
            case 2:
                found[at:at] = found[at : at + length]
            case 3:
                found[at : at + 4] = FOURS[rng.integers(len(FOURS))]
            case 4:
                if at < len(found):
                    found[at] ^= 1 << int(rng.integers(8))
            case 5:
                other = int(rng.integers(len(found) + 1))
                found[at : at + length] = found[other : other + length]
    return bytes(found)


def a_leaf(value: Any, rng: Rng) -> Any:
    """A tree of JSON with one value changed, or none."""
    odd = [None, True, "", "nan", "y", 0, -1, 10**30, 1e308, [], {}, [[]], [None], {"a": 1}, "Free"]
    if isinstance(value, dict | list) and value and rng.random() < 0.9:
        keys = list(value) if isinstance(value, dict) else list(range(len(value)))
        key = keys[rng.integers(len(keys))]
        if rng.random() < 0.1:
            del value[key]
        else:
            value[key] = a_leaf(value[key], rng)
        return value
    return odd[rng.integers(len(odd))]


def of_file(seeds: Callable[[], list[bytes]]) -> Callable[[Rng], bytes]:
    def make(rng: Rng) -> bytes:
        found = seeds()
        return spoilt_bytes(found[rng.integers(len(found))], rng)

    return make


def a_fit(rng: Rng) -> bytes:
    """Half with bytes changed, half with a value of another kind."""
    found = fits()[rng.integers(2)]
    if rng.random() < 0.4:
        return spoilt_bytes(found, rng)
    return json.dumps(a_leaf(json.loads(found), rng)).encode()


def a_study(rng: Rng) -> bytes:
    """Bytes changed, or the value of a line by that of another, or by nothing that fits."""
    found = STUDIES[rng.integers(len(STUDIES))]
    if rng.random() < 0.5:
        return spoilt_bytes(found, rng)
    lines = found.decode().splitlines()
    for _ in range(int(rng.integers(1, 3))):
        k = int(rng.integers(len(lines)))
        other = [*ODD_VALUES, lines[rng.integers(len(lines))].partition(" = ")[2] or "1"]
        lines[k] = lines[k].partition(" = ")[0] + " = " + other[rng.integers(len(other))]
    return "\n".join(lines).encode()


def read(name: str, how: Callable[[str], Any]) -> Callable[[bytes], Any]:
    def load(content: bytes) -> Any:
        Path(name).write_bytes(content)
        return how(name)

    return load


def channels(name: str) -> Any:
    return mf.read(name, outputs="y")


def text_of(content: bytes) -> str:
    return content.decode("utf-8", "surrogatepass")


# What is made of a generator, and what is done with it.
KINDS: dict[str, tuple[Callable[[Rng], bytes], Callable[[bytes], Any]]] = {
    "equation": (an_equation, lambda x: mf.Equation(text_of(x)).compiled()),
    "signal": (a_signal, lambda x: evaluate(text_of(x), T)),
    "csv": (of_file(tables), read("run.csv", channels)),
    "npz": (of_file(archives), read("run.npz", channels)),
    "mat": (of_file(matlab), read("run.mat", channels)),
    "fit": (a_fit, read("fit.json", mf.load)),
    "study": (a_study, read("study.toml", toml_file.load)),
}
COSTS = {"equation": 10.0}  # against the others


def tried(kind: str, content: bytes) -> tuple[str, BaseException | None]:
    """How a case ended, as `boundary.outcome` tells it."""
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        return outcome(SimpleNamespace(function=lambda: KINDS[kind][1](content)), {})  # type: ignore[arg-type]
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def case(kind: str, seed: int, number: int) -> bytes:
    return KINDS[kind][0](np.random.default_rng([seed, zlib.crc32(kind.encode()), number]))


def run(
    kinds: list[str], cases: int, seed: int
) -> tuple[dict[str, Counter[str]], dict[str, tuple[str, str]]]:
    """Counts of outcomes by kind, and defects by place with a case of each."""
    share = np.array([1 / COSTS.get(kind, 1.0) for kind in kinds])
    counts: dict[str, Counter[str]] = {}
    defects: dict[str, tuple[str, str]] = {}
    for kind, many in zip(kinds, np.ceil(cases * share / share.sum()).astype(int), strict=True):
        counts[kind] = Counter()
        for number in range(many):
            ended, error = tried(kind, case(kind, seed, number))
            counts[kind][ended] += 1
            if error is not None:
                text = str(error).split("\n")[0][:150]
                defects.setdefault(f"{kind}: {place(error)}", (f"{seed}:{kind}:{number}", text))
    return counts, defects


def main() -> int:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--cases", type=int, default=10_000)
    asked.add_argument("--seed", type=int, default=0)
    asked.add_argument("--only", choices=KINDS)
    asked.add_argument("--case", help="SEED:KIND:NUMBER, shown in full")
    args = asked.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    signal.signal(signal.SIGALRM, _alarm)
    os.chdir(tempfile.mkdtemp())
    if args.case:
        seed, kind, number = args.case.split(":")
        content = case(kind, int(seed), int(number))
        ended, error = tried(kind, content)
        print(content, ended, sep="\n")
        if error is not None:
            traceback.print_exception(error)
        return int(error is not None)
    counts, defects = run([args.only] if args.only else list(KINDS), args.cases, args.seed)
    for where, (told, text) in sorted(defects.items()):
        print(f"{where}\n    {text}\n    --case '{told}'")
    for kind, count in counts.items():
        print(
            f"{kind}: {sum(count.values())} cases: " + ", ".join(f"{n} {k}" for k, n in sorted(count.items()))
        )
    return int(bool(defects))


if __name__ == "__main__":
    sys.exit(main())
