"""Sections of pages that benches write, each its own and nothing else."""

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
