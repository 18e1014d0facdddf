"""What every command of `modfun` says and writes: JSON, and words on standard error."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from .storage import told

__all__ = ["Json", "say", "write_json"]

Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON to a file, or - for standard output.")
]


def say(text: str) -> None:
    """A line on standard error."""
    print(f"modfun: {text}", file=sys.stderr)


def write_json(to: str | None, value: Any) -> None:
    """Write JSON to a file, to standard output where `to` is "-", nowhere where it is None."""
    if to is None:
        return
    text = json.dumps(told(value), indent=1, default=_plain)
    if to == "-":
        print(text)
    else:
        Path(to).write_text(text + "\n", encoding="utf-8")
        say(f"wrote {to}")


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)
