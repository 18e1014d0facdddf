"""What can be checked of 64-bit Arm on another Linux machine: bits, instructions, the wheel. `make test-arm`.

The core is compiled for aarch64 and run under emulation. Programs of one thread run there; one that starts
a thread, as the harness of the tests does, hangs in qemu 7.2. The wheel is imported by a Python that is
unpacked under target/arm and nowhere installed, and a fit by it is this machine's.
"""

import math
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import contents
from same_bits import CLOSE, MOST, differences

ROOT = Path(__file__).resolve().parents[1]
TARGET = "aarch64-unknown-linux-gnu"
FOLDER = ROOT / "target" / "arm"  # of its own, as another compiler makes it
GCC, OBJDUMP, QEMU = "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-objdump", "qemu-aarch64"
LIBRARIES = Path("/usr/aarch64-linux-gnu")
DEBIAN = """\
    dpkg --add-architecture arm64 && apt-get update
    apt-get install rustc-web libstd-rust-web-dev:arm64 gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user
or, instead of the first two packages, `rustup target add aarch64-unknown-linux-gnu`."""
PYTHON = FOLDER / "python"
PACKAGES = ("libexpat1", "libgcc-s1", "libstdc++6", "zlib1g")
FIT = """
import modfun as mf
rec = mf.simulate(mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=256, nsr=0.1, seed=0)
fit = mf.fit(rec, mf.TransferFunction(poles=2, zeros=0))
print(*map(float, [*fit.params, *fit.bse]))
"""
FUSED = re.compile(r"\bfmla\s+v\d+\.2d\b")
CALLED = re.compile(r"\bbl?\s+[0-9a-f]+ <fma[f@>]")


def compiler() -> str | None:
    """A compiler that has Rust's library for aarch64."""
    for rustc in (os.environ.get("RUSTC"), shutil.which("rustc"), "/usr/bin/rustc"):
        if rustc and Path(rustc).exists():
            asked = [rustc, "--print", "target-libdir", "--target", TARGET]
            told = subprocess.run(asked, capture_output=True, text=True).stdout.strip()
            if told and list(Path(told).glob("libstd-*.rlib")):
                return rustc
    return None


def missing() -> list[str]:
    """What is not there."""
    said = [f"the program {tool}" for tool in (GCC, OBJDUMP, QEMU) if shutil.which(tool) is None]
    said += [] if compiler() else [f"a Rust compiler with the library for {TARGET}"]
    return said + ([] if LIBRARIES.is_dir() else [f"the C library in {LIBRARIES}"])


def cargo(*arguments: str, **environment: str) -> None:
    subprocess.run(["cargo", *arguments], cwd=ROOT, check=True, env=os.environ | environment)


def printed(*command: str | Path, **environment: str) -> str:
    """What a program prints."""
    return subprocess.run(
        command, check=True, stdout=subprocess.PIPE, text=True, timeout=900, env=os.environ | environment
    ).stdout


def instructions(disassembly: str) -> list[str]:
    """What is wrong with the code: multiply-adds that are calls, or none of two lanes."""
    fused = len(FUSED.findall(disassembly))
    calls = len(CALLED.findall(disassembly))
    print(f"{fused} multiply-adds of two lanes, {calls} calls of fma")
    return [f"{calls} calls of fma"] * bool(calls) + ["no kernel has fmla of two lanes"] * (fused < 1000)


def wheel(cross: dict[str, str]) -> Path:
    """The wheel for aarch64, linked by zig for the C library of manylinux2014."""
    shutil.rmtree(FOLDER / "dist", ignore_errors=True)
    # What another linker made is not made again by itself.
    cargo("clean", "--quiet", "--release", "--target", TARGET, "--package", "modfun-py", **cross)
    command = ["maturin", "build", "--release", "--locked", "--zig", "--compatibility", "manylinux2014"]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(
        [*command, "--target", TARGET, "--out", FOLDER / "dist"],
        cwd=ROOT,
        check=True,
        env=os.environ | cross | {"PATH": path},
    )
    return next((FOLDER / "dist").glob("*.whl"))


def python(made: Path) -> list[str | Path]:
    """A Python for aarch64 with the wheel and NumPy, to be run under emulation."""
    version = re.search(r"^Version: (\d+\.\d+)", printed("apt-cache", "show", "python3-minimal:arm64"), re.M)
    which = f"python{version[1] if version else ''}"
    shutil.rmtree(PYTHON, ignore_errors=True)
    PYTHON.mkdir(parents=True)
    packages = (f"{which}-minimal", f"lib{which}-minimal", f"lib{which}-stdlib", *PACKAGES)
    asked = ["apt-get", "download", "--quiet", *(f"{name}:arm64" for name in packages)]
    subprocess.run(asked, cwd=PYTHON, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for package in PYTHON.glob("*.deb"):
        subprocess.run(["dpkg-deb", "-x", package, PYTHON], check=True)
    site = PYTHON / "site"
    pip: list[str | Path] = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--only-binary=:all:",
        "--target",
        site,
    ]
    pip += ["--platform=manylinux_2_28_aarch64", "--platform=manylinux2014_aarch64"]
    pip += ["--python-version", which.removeprefix("python"), made]
    subprocess.run(pip, check=True)
    libraries = ":".join(str(PYTHON / folder / "aarch64-linux-gnu") for folder in ("lib", "usr/lib"))
    told = {
        "LD_LIBRARY_PATH": libraries,
        "PYTHONHOME": PYTHON / "usr",
        "PYTHONPATH": site,
        "OPENBLAS_NUM_THREADS": "1",
    }
    options = [word for name, value in told.items() for word in ("-E", f"{name}={value}")]
    return [QEMU, "-L", LIBRARIES, *options, PYTHON / "usr" / "bin" / which]


def main() -> int:
    if platform.machine() in ("aarch64", "arm64"):
        print("test-arm: this machine is one: `make test` says more than an emulator")
        return 0
    lacking = missing()
    if lacking:
        print(f"test-arm: there is not {', nor '.join(lacking)}. On Debian, as root:\n{DEBIAN}")
        return 1
    build = ["build", "--release", "--locked", "--package", "modfun", "--example", "bits"]
    cargo(*build)
    cross = {"RUSTC": str(compiler()), "CARGO_TARGET_DIR": str(FOLDER)}
    cargo(*build, "--target", TARGET, CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=GCC, **cross)
    here = printed(ROOT / "target" / "release" / "examples" / "bits")
    program = FOLDER / TARGET / "release" / "examples" / "bits"
    failed = []
    for isa in ("neon", "plain"):
        there = printed(QEMU, "-L", LIBRARIES, program, MODFUN_ISA=isa)
        found = differences(here, there)
        print(f"{len(there.splitlines())} numbers by {isa}: {len(found)} differ from this machine's")
        print("\n".join(found[:MOST]), end="\n" if found else "")
        failed += [f"{isa}: {len(found)} numbers differ"] * bool(found)
    failed += instructions(printed(OBJDUMP, "-d", "--no-show-raw-insn", program))
    made = wheel(cross)
    failed += [f"the wheel {word}" for word in contents.wheel(made)]
    if shutil.which("apt-get") is None:
        print(f"{made.name} is not imported: Debian's Python for arm64 cannot be had here")
    else:
        fits = [printed(*run, "-c", FIT) for run in ([ROOT / ".venv/bin/python"], python(made))]
        one, other = ([float(word) for word in fit.split()] for fit in fits)
        # Sines of the input are NumPy's, and differ by processor in last bits.
        near = all(math.isclose(a, b, rel_tol=CLOSE) for a, b in zip(one, other, strict=True))
        print(f"{made.name} is imported, and fits {other}")
        failed += [] if near else [f"a fit by the wheel is {other}, here {one}"]
    print("test-arm: " + ("; ".join(failed) or "as it should be"))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
