"""The compiled core as it is shipped: its size, and no call of `fma` in the vector kernels.

A multiply-add that does not become an instruction becomes a call of the C function `fma`, which makes a
kernel many times slower and shows in no result. Here the library is disassembled. A vector kernel is a
function with packed multiply-adds on 256- or 512-bit registers. `fma` is the C library's where it is
imported, or else the one that the Rust compiler brings along, known by its choice between the scalar FMA3
and FMA4 instructions at run time. Proved is that no chain of calls leads from a vector kernel to `fma`; calls
through the linker's table of addresses are followed, those through other pointers are not. The portable
kernels do call it, which shows that it is seen. On 64-bit Arm every multiply-add is an instruction, and
nothing calls `fma`.
"""

import bisect
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from modfun import _core
from places import ROOT

LIBRARY = Path(_core.__file__)
LARGEST = 9_000_000  # bytes without symbols: what a wheel of it may take of a network and of a disk

LINE = re.compile(r"\s*([0-9a-f]+):\t(\S+)\s*(.*)")
TARGET = re.compile(r"([0-9a-f]+)(?: <|$)")
DATA = re.compile(r"# ([0-9a-f]+)\b")
PACKED = re.compile(r"vfn?m(?:add|sub)(?:add|sub)?\d+p[ds]")
FRAME = re.compile(r" FDE .* pc=([0-9a-f]+)\.\.([0-9a-f]+)")
SLOT = re.compile(r"([0-9a-f]+) R_\w+\s+(?:(fma)(?:@\S+)?|\*ABS\*\+0x([0-9a-f]+))$", re.MULTILINE)


def tool(name, *arguments):
    if shutil.which(name) is None or not sys.platform.startswith("linux"):
        pytest.skip(f"needs {name} and a Linux library")
    return subprocess.run([name, *arguments], capture_output=True, text=True, check=True).stdout


class Code:
    """The functions of the library, each known by its first address."""

    def __init__(self):
        self.ends = {
            int(a, 16): int(b, 16) for a, b in FRAME.findall(tool("objdump", "--dwarf=frames", LIBRARY))
        }
        self.starts = sorted(self.ends)
        # Addresses that hold the imported fma, and those that hold a function of the library.
        slots = SLOT.findall(tool("objdump", "-R", LIBRARY))
        self.imported = {int(at, 16) for at, fma, _ in slots if fma}
        self.slots = {int(at, 16): int(to, 16) for at, _, to in slots if to}
        self.calls = {}  # functions it calls or jumps to, also through the table of addresses
        self.data = {}  # addresses it reads, writes or takes
        self.kernels = set()
        self.named = set()  # functions that call an `fma` that has a name
        self.stored = {}  # addresses at which it stores 64 bits of %rax
        self.choices = set()  # functions that are one FMA4 instruction
        for line in tool("objdump", "-d", "--no-show-raw-insn", LIBRARY).splitlines():
            found = LINE.match(line)
            function = self.around(int(found[1], 16)) if found else None
            if function is not None:
                self.read(function, found[2], found[3])

    def around(self, address):
        """The function that an address lies in; None between functions."""
        k = bisect.bisect_right(self.starts, address) - 1
        return self.starts[k] if k >= 0 and address < self.ends[self.starts[k]] else None

    def read(self, function, word, operands):
        if PACKED.fullmatch(word) and ("%ymm" in operands or "%zmm" in operands):
            self.kernels.add(function)
        if word == "vfmaddsd":
            self.choices.add(function)
        if data := DATA.search(operands):
            self.data.setdefault(function, set()).add(int(data[1], 16))
            if (callee := self.slots.get(int(data[1], 16))) in self.ends:
                self.calls.setdefault(function, set()).add(callee)
            if word == "mov" and operands.startswith("%rax,"):
                self.stored.setdefault(function, set()).add(int(data[1], 16))
        if word.startswith(("call", "j")):
            if re.search(r"<fma[@>]", operands):
                self.named.add(function)
            target = TARGET.match(operands)
            callee = self.around(int(target[1], 16)) if target else None
            if callee not in (None, function):
                self.calls.setdefault(function, set()).add(callee)

    def touching(self, addresses):
        return {f for f, data in self.data.items() if data & addresses}

    def fused_in_software(self):
        """Functions that call `fma`, or are it."""
        choosers = self.touching(self.choices)
        pointers = set().union(*(self.stored.get(f, set()) for f in choosers))
        return self.named | choosers | self.touching(self.imported | pointers)

    def reached(self, function):
        """The function and all that it calls, directly or not."""
        seen, new = {function}, [function]
        while new:
            callees = self.calls.get(new.pop(), set()) - seen
            seen |= callees
            new += callees
        return seen


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads instructions of x86")
def test_no_vector_kernel_calls_fma():
    code = Code()
    fma = code.fused_in_software()
    portable = {f for f in code.calls if f not in code.kernels and code.calls[f] & fma}
    assert len(code.kernels) > 10
    assert portable, "no call of fma at all: tell this test how the compiler now makes it"
    guilty = {hex(f): sorted(map(hex, code.reached(f) & fma)) for f in code.kernels}
    guilty = {kernel: path for kernel, path in guilty.items() if path}
    assert not guilty, f"of {len(code.kernels)} vector kernels these reach fma: {guilty}"


@pytest.mark.skipif(platform.machine() not in ("aarch64", "arm64"), reason="reads instructions of 64-bit Arm")
def test_on_arm_multiply_adds_are_instructions():
    sys.path.append(str(ROOT / "packaging"))
    import arm

    assert arm.instructions(tool("objdump", "-d", "--no-show-raw-insn", LIBRARY)) == []


def test_the_stripped_library_is_small(tmp_path):
    bare = tmp_path / LIBRARY.name
    tool("strip", "-o", bare, LIBRARY)
    size = bare.stat().st_size
    assert size <= LARGEST, f"{size / 1e6:.1f} MB"
