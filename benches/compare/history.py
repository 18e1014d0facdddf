"""Times the programs of benches/programs.rs, keeps them beside all earlier ones, and draws them.

`make bench` calls it. benches/history.csv has date, commit, machine, name and minimum in ns of each, which
docs/performance.md shows.
"""

import csv
import sys
from datetime import UTC, datetime
from pathlib import Path

from cargo_bench import ROOT, programs
from measure import commit, instruction_set, machine, processor
from report import amount
from section import arguments, publish

KEPT = ROOT / "benches" / "history.csv"
FIGURE = ROOT / "docs" / "figures" / "history.png"
FIELDS = ("date", "commit", "machine", "name", "ns")
HEADING = "## Times kept"
TEXT = """
Written by `make bench`; do not edit. Every run adds date, commit, machine and minima to
`benches/history.csv`: of the programs of `cargo bench --bench fits`, whose names are those of `make counts`,
and of the calls of the table above. In the figure each line is a machine's, over its own first value; a
shared machine shows in its jumps. `make bench-compare BASE=<commit>` says what a change did: both commits in
turn on one machine.

![Minima of each program over time, relative to the first](figures/history.png)

The last run: {machine}

| program | minimum a piece |
|---|---:|
"""


def append(minima: dict[str, float], kept: Path = KEPT) -> None:
    """Adds a run's minima in ns."""
    new = not kept.exists()
    with kept.open("a", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        if new:
            rows.writerow(FIELDS)
        for name, ns in minima.items():
            now, where = datetime.now(UTC), f"{processor()} {instruction_set()}"
            rows.writerow((f"{now:%Y-%m-%dT%H:%M}", commit(), where, name, f"{ns:.4g}"))


def read(kept: Path = KEPT) -> dict[str, dict[str, list[tuple[datetime, float]]]]:
    """Times and minima of each machine, by name."""
    found: dict[str, dict[str, list[tuple[datetime, float]]]] = {}
    with kept.open(newline="") as file:
        for row in csv.DictReader(file):
            lines = found.setdefault(row["name"], {})
            point = (datetime.fromisoformat(row["date"]), float(row["ns"]))
            lines.setdefault(row["machine"], []).append(point)
    return found


def draw(kept: Path = KEPT, figure: Path = FIGURE) -> None:
    """One panel a name, one line a machine, each over its first value."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.dates import ConciseDateFormatter, date2num

    found = read(kept)
    machines = sorted({who for lines in found.values() for who in lines})
    rows = -(-len(found) // 4)
    drawn, axes = plt.subplots(rows, 4, figsize=(11, 1.7 * rows), sharey=True, layout="constrained")
    for axis, (name, lines) in zip(axes.flat, found.items(), strict=False):
        for who, points in lines.items():
            when, ns = zip(*points, strict=True)
            colour = f"C{machines.index(who)}"
            axis.semilogy(when, [value / ns[0] for value in ns], "o-", color=colour, ms=3, label=who)
        axis.set_title(name, fontsize=8)
        axis.tick_params(labelsize=6)
        axis.grid(alpha=0.3)
    for axis in list(axes.flat)[len(found) :]:
        axis.set_axis_off()
    days = [date2num(when) for lines in found.values() for points in lines.values() for when, _ in points]
    for axis in axes.flat:
        axis.set_xlim(min(days) - 1, max(days) + 1)
        axis.set_ylim(min(0.5, axis.get_ylim()[0]), max(2.0, axis.get_ylim()[1]))
        axis.xaxis.set_major_formatter(
            ConciseDateFormatter(axis.xaxis.get_major_locator(), show_offset=False)
        )
    named = [axis.get_legend_handles_labels() for axis in axes.flat]
    legend = {
        label: handle for handles, labels in named for handle, label in zip(handles, labels, strict=True)
    }
    drawn.legend(legend.values(), legend.keys(), loc="outside lower center", fontsize=7)
    drawn.savefig(figure, dpi=110)
    plt.close(drawn)


def main() -> int:
    parser = arguments(__doc__)
    parser.add_argument("--draw", action="store_true", help="draw what is kept and time nothing")
    given = parser.parse_args()
    if not given.draw:
        about, minima = machine(), programs()
        append(minima)
        rows = [f"| {name} | {amount(ns)} |" for name, ns in minima.items()]
        publish(given.out, [HEADING, TEXT.format(machine=about).rstrip(), *rows])
    draw()
    return 0


if __name__ == "__main__":
    sys.exit(main())
