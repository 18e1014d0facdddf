"""Contestants in turn, pinned to one core, minima over rounds; and the machine they ran on.

For who is pinned, time is the processor's, of all threads together: on an idle machine that is what passes,
on a busy one it leaves out what others took. Who may use two cores is timed by the clock on the wall.
"""

import gc
import os
import platform
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter, process_time

SHARE = 0.04  # seconds a turn
FLAGS = ("sse4_2", "avx", "avx2", "fma", "avx512f", "avx512dq")


@dataclass
class Contestant:
    """Something to time: `run(count)` does `count` pieces of work, or returns as a float the ns of one."""

    name: str
    run: Callable[[int], object]
    unit: int = 512  # counts are multiples of this
    least: int = 1  # multiples
    pinned: bool = True
    count: int = 0
    ns: list[float] = field(default_factory=list)

    def turn(self) -> float:
        """One turn, ns a piece."""
        clock = process_time if self.pinned else perf_counter
        start = clock()
        told = self.run(self.count)
        spent = clock() - start
        return told if isinstance(told, float) else 1e9 * spent / self.count

    def settle(self, share: float) -> None:
        """Warm up, and choose a count that takes about so many seconds."""
        self.count = self.unit * self.least
        if not share:
            return
        self.turn()
        each = min(self.turn() for _ in range(2))
        self.count = self.unit * max(self.least, round(share / (1e-9 * each * self.unit)))

    @property
    def best(self) -> float:
        """Minimum over the rounds, ns."""
        return min(self.ns)


def compete(contestants: list[Contestant], rounds: int, seconds: float) -> int:
    """Time all in turn, at most so many rounds or seconds (three rounds at least); the number of rounds.

    One round is for the tests of the benches: nothing is warmed up, every turn is as short as it may be.
    """
    cores = os.sched_getaffinity(0)
    one = {min(cores)}
    done, start = 0, perf_counter()
    try:
        os.sched_setaffinity(0, one)
        for c in contestants:
            c.settle(SHARE if rounds > 1 else 0.0)
        gc.collect()
        gc.disable()
        while done < rounds and (done < 3 or perf_counter() - start < seconds):
            for c in contestants:
                os.sched_setaffinity(0, one if c.pinned else cores)
                c.ns.append(c.turn())
            done += 1
    finally:
        gc.enable()
        os.sched_setaffinity(0, cores)
    return done


def _processor_values() -> dict[str, str]:
    """What Linux says of the processor; nothing elsewhere."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    fields = dict(line.split(":", 1) for line in info.splitlines() if ":" in line)
    return {name.strip(): value.strip() for name, value in fields.items()}


def processor() -> str:
    """Name of the processor."""
    values = _processor_values()
    family = f" (family {values['cpu family']}, model {values['model']})" if "cpu family" in values else ""
    return f"{values.get('model name') or platform.processor() or platform.machine()}{family}"


def instruction_set() -> str:
    """The one that modfun takes here."""
    flags = _processor_values().get("flags", "").split()
    widest = "avx512" if has_avx512() else "avx2" if "avx2" in flags else "plain"
    best = "neon" if platform.machine() in ("aarch64", "arm64") else widest
    return os.environ.get("MODFUN_ISA") or best


def machine() -> str:
    """Processor, instruction sets, system, versions, commit, date and load: what the head of a page says."""
    sets = [flag for flag in FLAGS if flag in _processor_values().get("flags", "").split()]
    versions = ", ".join(f"{name} {_version(name)}" for name in ("numpy", "scipy", "numba", "jax"))
    return (
        f"{processor()}, {len(os.sched_getaffinity(0))} cores; "
        f"{' '.join(sets)}; {platform.system()} {platform.release().split('-')[0]}. "
        f"modfun {_version('modfun')}{_commit()}, instruction set {instruction_set()}; "
        f"Python {platform.python_version()}, {versions}{_compiler()}. "
        f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, load average {os.getloadavg()[0]:.1f}."
    )


def has_avx512() -> bool:
    """Whether the processor has what modfun's widest path needs."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    return "avx512f" in info and "avx512dq" in info


def _said(*command: str) -> str:
    """What a program prints, "" where it is not there or fails."""
    try:
        done = subprocess.run(
            command, cwd=Path(__file__).parent, check=True, capture_output=True, text=True, timeout=30
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def commit() -> str:
    """The last commit that changed what is measured, and whether it was changed since."""
    last = _said("git", "log", "-1", "--format=%h", "--", ":/rust", ":/python/modfun")
    changed = _said("git", "status", "--porcelain", "--untracked-files=no", "--", ":/rust", ":/python/modfun")
    return f"{last}{', changed' if changed else ''}" if last else ""


def _commit() -> str:
    return f" ({commit()})" if commit() else ""


def _compiler() -> str:
    said = _said("rustc", "--version").split()
    return f", rustc {said[1]}" if len(said) > 1 else ""


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "(not installed)"
