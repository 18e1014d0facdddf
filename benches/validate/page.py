"""What all sections of docs/validation.md are made of: tables, verdicts with reasons, a summary on top."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scipy.stats import norm

FALSE_ALARM = 0.01  # of a whole table, right code given

HEAD = """# Numerical trust

Written by `make validate`; do not edit. What modfun computes is held here against the report (A. E. Pearson, NASA NAG-1-1065, 1993), published benchmarks, the statistics it claims, slow twins written from the formulas, the orders of convergence that theory gives, and itself under other threads, processes and instruction sets. What single tests assert is in [accuracy.md](accuracy.md).

Every section has its command, machine and date; seeds are fixed, so that numbers come again, on one machine bit for bit. `make validate ONLY=orders` makes one section and leaves the others. A row says **off** where it breaks the rule of its table, with the reason; a row that is off without a reason known makes the command fail. ± is one Monte Carlo standard error.
"""
SUMMARY = "## Summary"


@dataclass
class Section:
    """Lines of a section; `judge` counts verdicts."""

    title: str
    lines: list[str] = field(default_factory=list)
    reasons: Mapping[str, str] = field(default_factory=dict)
    count: int = 0
    off: int = 0
    unexplained: int = 0
    command: str = ""
    machine: str = ""
    seconds: float = 0.0

    @property
    def heading(self) -> str:
        return f"## {self.title}"

    def say(self, *paragraphs: str) -> None:
        """Paragraphs."""
        for text in paragraphs:
            self.lines += [text, ""]

    def under(self, heading: str) -> None:
        """A heading within the section."""
        self.lines += [f"### {heading}", ""]

    def table(self, columns: Sequence[str], rows: Iterable[Sequence[object]], left: int = 1) -> None:
        """A table; the first `left` columns hold words."""
        marks = ["---"] * left + ["---:"] * (len(columns) - left)
        marks = ["---" if name in ("", "why") else mark for name, mark in zip(columns, marks, strict=True)]
        self.lines += [f"| {' | '.join(columns)} |", f"|{'|'.join(marks)}|"]
        self.lines += [f"| {' | '.join(str(cell) for cell in row)} |" for row in rows]
        self.lines.append("")

    def judge(self, name: str, good: bool) -> str:
        """The verdict of a row: "ok", or that it is off and why."""
        self.count += 1
        if good:
            return "ok"
        self.off += 1
        for start, reason in self.reasons.items():
            if name.startswith(start):
                return f"**off**: {reason}"
        self.unexplained += 1
        return "**off**: reason not known"

    def text(self) -> str:
        """The section as it stands in the page."""
        result = f"Result: {self.count} checks, {self.count - self.off} ok, {self.off} off."
        made = f"`{self.command}`, {self.seconds:.0f} s. {self.machine}"
        return "\n".join([self.heading, "", made, "", result, "", *self.lines]).rstrip() + "\n"


def limit(count: int) -> float:
    """Standard errors beyond which one of `count` normal deviations calls a false alarm (Bonferroni)."""
    return float(norm.isf(FALSE_ALARM / (2 * max(count, 1))))


def absent(folder: Path) -> str:
    """What a table says whose files are not there."""
    return (
        f"Not made in this run: {folder.name} is not there. The records are no part of the project; "
        "name their folder in MODFUN_DATA."
    )


def begin(page: Path) -> None:
    """The head of the page, whatever stands in it already."""
    text = page.read_text() if page.exists() else ""
    found = re.search(r"^## ", text, re.MULTILINE)
    page.write_text(HEAD + "\n" + (text[found.start() :] if found else f"{SUMMARY}\n"))


def summarise(page: Path) -> None:
    """One line a section, counted from the page itself."""
    text = page.read_text()
    rows = []
    for heading, body in re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE):
        found = re.search(r"^Result: (\d+) checks, (\d+) ok, (\d+) off\.$", body, re.MULTILINE)
        if found:
            command = re.search(r"`(make validate [^`]+)`, (\d+) s", body)
            rows.append((heading, *found.groups(), f"`{command[1]}`", command[2]))
    own = Section(SUMMARY[3:])
    own.table(["section", "checks", "ok", "off", "command", "seconds"], rows)
    from section import write

    write(page, SUMMARY, "\n".join([SUMMARY, "", *own.lines]))
