"""Memory of a long study over its replicates: writes a section of docs/faults.md.

    python benches/soak.py [replicates]

The studies run as a user would run them, each in a process of its own on one thread; what they occupy is
read from the system while they run.
"""

import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

PAGE = Path(__file__).resolve().parents[1] / "docs" / "faults.md"
HEADING = "## A long study: memory over replicates"
SHARES = (0.01, 0.1, 0.25, 0.5, 0.75, 1.0)  # of the replicates, where the table has a row
STUDY = """
import sys
import modfun as mf

study = mf.MonteCarlo(
    system=mf.tf([5], [1, 3, 8]), input="sin(t**2/5)", duration=10.0, intervals=64, nsr=0.2,
    estimators=["ls"], harmonics=6, trend=None, seed=1)
study.run(replicates=int(sys.argv[1]), threads=1, {options})
"""
RUNS = {"in memory": "progress=True", "with `directory=`": "progress=True, directory=sys.argv[2]"}


def kilobytes(process: int) -> int:
    """Resident memory of a process."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS")), 0)


def soak(options: str, replicates: int) -> tuple[list[tuple[float, int]], float, float]:
    """Memory (share of the time, kB) each second, seconds, and MB on the disk at the end."""
    seen, start = [], time.monotonic()
    with TemporaryDirectory() as folder:
        place = Path(folder, "study")
        command = [sys.executable, "-c", STUDY.format(options=options), str(replicates), str(place)]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            while process.poll() is None:
                try:
                    seen.append((time.monotonic() - start, kilobytes(process.pid)))
                except (OSError, ValueError):
                    break
                time.sleep(1.0)
            if process.wait():
                raise SystemExit(f"the study failed with exit code {process.returncode}")
        files = [file.stat().st_size for file in place.rglob("*") if file.is_file()]
    whole = time.monotonic() - start
    return [(at / whole, size) for at, size in seen if size], whole, sum(files) / 1e6


def section(replicates: int) -> str:
    """The section as Markdown."""
    from measure import machine

    lines = [
        HEADING,
        "",
        f"{replicates:,} replicates of one cell: eq. (24), N = 64, NSR 0.2, `ls` on six harmonics with its "
        "intervals, on one thread, with both runs at once. Resident memory was read every second; each "
        "column has the largest value up to that share of the time. A summary holds sums and a histogram, "
        'whose size depends on the bins, not on the replicates; `keep="samples"` would add 24 bytes per '
        "replicate, in memory or in the file of `directory=`. `make soak` writes this section.",
        "",
        machine(),
        "",
        "| run | " + " | ".join(f"{100 * share:g} %" for share in SHARES) + " | time | files |",
        "|---" * (3 + len(SHARES)) + "|",
    ]
    with ThreadPoolExecutor(len(RUNS)) as pool:
        found = list(pool.map(lambda options: soak(options, replicates), RUNS.values()))
    for name, (seen, seconds, disk) in zip(RUNS, found, strict=True):
        peaks = [max((size for at, size in seen if at <= share), default=0) / 1024 for share in SHARES]
        cells = [f"{peak:.1f} MiB" for peak in peaks]
        lines.append(f"| {name} | {' | '.join(cells)} | {seconds:,.0f} s | {disk:.1f} MB |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent / "compare"))
    from section import write

    write(PAGE, HEADING, section(int(sys.argv[1]) if len(sys.argv) > 1 else 10**8))
