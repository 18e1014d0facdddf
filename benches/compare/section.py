"""Sections of pages that benches write, each its own and nothing else."""

import argparse
import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "performance.md"


def write(page: Path, heading: str, section: str) -> None:
    """Put a section in place of the one with the same heading, or at the end."""
    text = page.read_text() if page.exists() else "# Performance\n"
    old = re.compile(rf"^{re.escape(heading)}\n.*?(?=^## |\Z)", re.DOTALL | re.MULTILINE)
    if old.search(text):
        text = old.sub(lambda _: section.rstrip() + "\n\n", text)
    else:
        text = f"{text.rstrip()}\n\n{section.rstrip()}\n"
    page.write_text(text.rstrip("\n") + "\n")


def publish(page: Path, lines: list[str]) -> None:
    """Print a section, whose first line is its heading, and write it into the page."""
    section = "\n".join(lines)
    print(section)
    write(page, lines[0], section)


def arguments(about: str) -> argparse.ArgumentParser:
    """What a bench that writes a section is told."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--out", type=Path, default=PAGE, help="the page whose section is written")
    return parser


def rounds_of(about: str, quick: str, seconds: float) -> argparse.Namespace:
    """What a bench in rounds was told; a quick one has a single round."""
    parser = arguments(about)
    parser.add_argument("--quick", action="store_true", help=quick)
    parser.add_argument("--rounds", type=int, default=20, help="most rounds")
    parser.add_argument("--seconds", type=float, default=seconds, help="most seconds of rounds")
    given = parser.parse_args()
    given.rounds = 1 if given.quick else given.rounds
    return given
