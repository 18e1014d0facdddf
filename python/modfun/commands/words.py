"""Words of the command line: read as numbers and parameters, and what commands say and write."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Annotated, Any

import typer

from ..base.writing import write_text
from ..errors import SpecError
from ..models.free import Free
from ..results.storage import told

__all__ = [
    "Json", "band_of", "by_path", "command_line", "degree_of", "delay_of", "matrix_rows", "one_or_all",
    "pairs_of", "param_of", "picked", "poles_of", "say", "window_of", "write_json",
]  # fmt: skip

Json = Annotated[
    str | None, typer.Option("--json", metavar="FILE", help="Write JSON to a file, or - for standard output.")
]

# What is read -------------------------------------------------------------------------------------


def by_path(
    option: str, given: list[str] | None, one: Callable[[str], Any], channels: tuple[int, int]
) -> Any:
    """What was given once, one per input, or one per output with commas between the inputs."""
    if not given:
        return None
    rows = [[one(part) for part in word.split(",")] for word in given]
    outputs, inputs = channels
    single = all(len(row) == 1 for row in rows)
    if single and (len(rows) == 1 or inputs > 1 or outputs == 1):
        return one_or_all([row[0] for row in rows])
    if len(rows) != outputs or any(len(row) != inputs for row in rows):
        raise SpecError(
            f"{option} {f' {option} '.join(given)}: there are {outputs} output(s) and {inputs} input(s); "
            "give one value, one per input, or one list per output with commas between the inputs"
        )
    return rows if outputs > 1 else rows[0]


def degree_of(word: str) -> int | None:
    if word.lower() == "none":
        return None
    if word.lstrip("-").isdecimal():
        return int(word)
    raise SpecError(f"--zeros {word}: give a whole number, or none for an input without a path")


def delay_of(word: str) -> float | Free:
    found = _number_or_bounds("--delay", word)
    if isinstance(found, Free) and found.max == inf:
        raise SpecError(f"--delay {word}: a delay to be estimated needs its most, such as 0:0.5")
    return found


def param_of(word: str) -> tuple[str, float | Free]:
    name, equals, value = word.partition("=")
    if not (name and equals):
        raise SpecError(f"--param {word}: give NAME=VALUE, such as a2=0, NAME=MIN:MAX or NAME=MEAN+-SD")
    return name, _number_or_bounds("--param", value)


def _number_or_bounds(option: str, word: str) -> float | Free:
    """A number, or [start:]min:max to be estimated, a bound left out is none; or mean+-sd beforehand."""
    parts = word.split(":")
    mean, known, sd = word.partition("+-")
    try:
        if known:
            return Free(float(mean), sd=float(sd))
        if len(parts) == 1:
            return float(word)
        low, high = (float(part or end) for part, end in zip(parts[-2:], ("-inf", "inf"), strict=True))
        start = float(parts[0]) if len(parts) == 3 and parts[0] else None
        if len(parts) <= 3:
            return Free(start, min=low, max=high)
    except ValueError as error:
        if isinstance(error, SpecError):
            raise SpecError(f"{option} {word}: {error}") from None
    raise SpecError(
        f"{option} {word}: give a number, or [start:]min:max to have it estimated, such as 0.1:0:0.5, "
        "or mean+-sd beforehand"
    )


def state_of(given: str) -> Any:
    """A word, or numbers with commas between."""
    try:
        return [float(part) for part in given.split(",")]
    except ValueError:
        return given


def one_or_all(given: list[Any] | None) -> Any:
    return given[0] if given and len(given) == 1 and given[0] is not None else given


def band_of(given: str | None) -> float | tuple[float, float] | None:
    if given is None:
        return None
    try:
        edges = [float(part) for part in given.split(":")]
    except ValueError:
        edges = []
    if len(edges) not in (1, 2):
        raise SpecError(f"--band {given}: give the upper edge, or lower:upper, in rad/s, such as 0.5:8")
    return edges[0] if len(edges) == 1 else (edges[0], edges[1])


def poles_of(given: str) -> Any:
    ends = given.split(":")
    if len(ends) > 2 or not all(word.isdecimal() for word in ends):
        raise SpecError(f"--poles {given}: give a whole number, or fewest:most, such as 1:5")
    return range(int(ends[0]), int(ends[-1]) + 1)


def pairs_of(
    option: str, given: list[str] | None, form: str = "NAME=UNIT, such as q=deg/s"
) -> dict[str, str]:
    """Names and what belongs to them, NAME=VALUE each."""
    pairs = [word.partition("=") for word in given or ()]
    if wrong := [
        f"{name}{equals}{value}" for name, equals, value in pairs if not (name and equals and value)
    ]:
        raise SpecError(f"{option} {wrong[0]}: give {form}")
    return {name: value for name, _, value in pairs}


def window_of(given: str, first: float, last: float) -> tuple[float, float]:
    """Ends of a part of a record in s; those left out are its own."""
    ends = given.split(":")
    try:
        if len(ends) != 2:
            raise ValueError
        return float(ends[0] or first), float(ends[1] or last)
    except ValueError:
        raise SpecError(f"--window {given}: give FROM:TO in s, such as 2:10 or 2:") from None


def matrix_rows(given: str) -> list[list[Any]]:
    """A matrix as text: rows apart by semicolons, entries by commas, or by blanks where there is none."""
    rows = [row.split(",") if "," in row else row.split() for row in given.split(";")]
    return [[_entry(entry.strip()) for entry in row] for row in rows]


def _entry(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text


def picked(found: list[Any], given: str) -> list[Any]:
    """Those of a list that are named by numbers from 0 with commas between."""
    numbers = [int(word) if word.strip().isdecimal() else -1 for word in given.split(",")]
    if any(not 0 <= number < len(found) for number in numbers):
        raise SpecError(
            f"--only {given}: give numbers from 0 to {len(found) - 1} with commas between; there are "
            f"{len(found)} records"
        )
    return [found[number] for number in numbers]


# What is said and written --------------------------------------------------------------------------


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
