"""Compares what benches/bits.rs printed on several machines: what is exact to the bit, what is close nearly.

python packaging/same_bits.py FILE FILE ...
"""

import struct
import sys
from pathlib import Path

# Of the larger of two numbers. Fits are found to 2e-11, coefficients by an FFT to 2e-14.
CLOSE = 1e-8
MOST = 10  # differences that are shown


def read(text: str) -> dict[tuple[str, str, int], int]:
    """The bits of each number by its kind, name and place."""
    rows = (line.split("\t") for line in text.splitlines())
    return {(kind, name, int(place)): int(bits, 16) for kind, name, place, bits, _ in rows}


def number(bits: int) -> float:
    """The double of these bits."""
    return float(struct.unpack("<d", bits.to_bytes(8, "little"))[0])


def differences(first: str, other: str) -> list[str]:
    """What the one text says and the other does not."""
    left, right = read(first), read(other)
    said = [f"{kind} {name} {place}: only one has it" for kind, name, place in left.keys() ^ right.keys()]
    for key in left.keys() & right.keys():
        kind, name, place = key
        a, b = number(left[key]), number(right[key])
        near = kind == "close" and abs(a - b) <= CLOSE * max(abs(a), abs(b))
        if left[key] != right[key] and not near:
            said.append(f"{kind} {name} {place}: {a!r} and {b!r}")
    return sorted(said)


def main() -> int:
    texts = {name: Path(name).read_text() for name in sys.argv[1:]}
    if len(texts) < 2:
        print(__doc__)
        return 2
    (one, first), *others = texts.items()
    if not first:
        print(f"{one}: empty")
        return 1
    failed = 0
    for name, other in others:
        found = differences(first, other)
        failed += bool(found)
        print(f"{name} beside {one}: " + (f"{len(found)} differences" if found else "the same"))
        print("\n".join(found[:MOST]), end="\n" if found else "")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
