"""What every command of `modfun` says and writes: JSON, and words on standard error."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..files.writing import write_text
from ..results.storage import told

__all__ = ["Json", "command_line", "say", "write_json"]

Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON to a file, or - for standard output.")
]


def command_line(context: typer.Context) -> str:
    """The command as it was given, files by their names alone."""
    words, files = ["modfun", *context.command_path.split()[1:]], []
    for option in context.command.params:
        source = context.get_parameter_source(option.name or "")
        if source is None or source.name != "COMMANDLINE":
            continue
        given = context.params[option.name or ""]
        every = given if isinstance(given, list | tuple) else [given]
        texts = [one.name if isinstance(one, Path) else str(one) for one in every]
        if option.param_type_name == "argument":
            files += texts
        elif isinstance(given, bool):
            words.append(option.opts[0] if given else option.secondary_opts[0])
        else:
            words += [word for text in texts for word in (max(option.opts, key=len), text)]
    return shlex.join([*words, *files])


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
        write_text("--json", to, text + "\n")
        say(f"wrote {to}")


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else str(value)
