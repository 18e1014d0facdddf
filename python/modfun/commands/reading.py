"""What commands read: the options that say so, declared once, and the records they make."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

import typer

from ..errors import SpecError
from ..records.reading import read
from ..records.record import Record
from .words import one_or_all, pairs_of, picked, window_of

__all__ = ["Files", "Part", "Reading", "reads"]

Command = TypeVar("Command", bound=Callable[..., None])
DATA = {"rich_help_panel": "Data"}

Files = Annotated[list[Path], typer.Argument(metavar="FILE", help=".csv, .xlsx, .mat, .parquet, ...")]
Part = Annotated[
    str | None,
    typer.Option(help="Struct or experiment of a .mat file, or sheet of an .xlsx file, of several.", **DATA),
]


@dataclass(frozen=True)
class Reading:
    """The records of files: one per file, or, with --on, one each time the marker is on."""

    files: Files
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output", "-y", metavar="COLUMN|NAME=COLUMN", help="An output; repeat for several.", **DATA
        ),
    ] = None
    input: Annotated[
        list[str] | None,
        typer.Option(
            "--input", "-u", metavar="COLUMN|NAME=COLUMN", help="An input; repeat for several.", **DATA
        ),
    ] = None
    time: Annotated[
        list[str] | None,
        typer.Option("--time", "-t", help="Column of time; repeat for one of dates, one of times.", **DATA),
    ] = None
    dt: Annotated[
        float | None, typer.Option("--dt", help="Sampling interval in s, instead of --time.", **DATA)
    ] = None
    window: Annotated[
        str | None, typer.Option(metavar="FROM:TO", help="Part of each record, in s, such as 2:10.", **DATA)
    ] = None
    units: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Unit of a channel, or of the time (t=ms); repeat.", **DATA),
    ] = None
    convert: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=UNIT", help="Convert a channel to a unit, q=rad/s; repeat.", **DATA),
    ] = None
    assign: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=TEXT",
            help="An input known at all times, de=sin(t**2/5), in place of a column or beside them; repeat.",
            **DATA,
        ),
    ] = None
    intersample: Annotated[
        list[str] | None,
        typer.Option(
            help="Inputs between samples: auto, smooth, zoh or foh; once, or one per input.", **DATA
        ),
    ] = None
    part: Part = None
    on: Annotated[
        str | None,
        typer.Option(
            help="Column of an event marker: one record each time it is on, or each number.", **DATA
        ),
    ] = None
    only: Annotated[
        str | None, typer.Option(help="Which of these records, counted from 0, such as 0,1,2.", **DATA)
    ] = None
    missing: Annotated[
        str,
        typer.Option(
            help="Gaps: refuse, mask to leave those of outputs out, or hold to hold inputs, too.", **DATA
        ),
    ] = "refuse"
    missing_values: Annotated[
        list[str] | None,
        typer.Option(metavar="TEXT", help="A text that marks missing values; repeat for several.", **DATA),
    ] = None

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return list(_channels(self.output) or ())

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return list(_channels(self.input) or ())

    def records(self, keep: list[str] | None = None) -> list[Record]:
        """Read them, with further channels to keep where they are no inputs."""
        texts = pairs_of("--assign", self.assign, "NAME=TEXT, such as de=sin(t**2/5)")
        apart = [name for name in (*(keep or ()), self.on) if name and name not in self.inputs]
        found = [
            read(
                file,
                outputs=_channels(self.output),
                inputs=_channels(self.input),
                time=self.time[0] if self.time and len(self.time) == 1 else self.time or None,
                dt=self.dt,
                keep=apart or None,
                units=pairs_of("--units", self.units),
                intersample=one_or_all(self.intersample),
                missing=self.missing,
                missing_values=self.missing_values,
                part=self.part,
            )
            for file in self.files
        ]
        if self.on is not None:
            found = [piece for rec in found for piece in rec.split(on=self.on)]
        if self.only is not None:
            found = picked(found, self.only)
        if self.window is not None:
            found = [rec.window(*window_of(self.window, rec.t[0], rec.t[-1])) for rec in found]
        if self.convert:
            found = [rec.convert(pairs_of("--convert", self.convert)) for rec in found]
        return [_assigned(rec, texts) for rec in found] if texts else found


def reads(command: Command) -> Command:
    """Give a command the options of `Reading` in place of its argument ``data``."""
    hints = get_type_hints(Reading, include_extras=True)
    options = [
        inspect.Parameter(
            f.name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=inspect.Parameter.empty if f.default is MISSING else f.default,
            annotation=hints[f.name],
        )
        for f in fields(Reading)
    ]
    own = inspect.signature(command, eval_str=True)
    parameters = [
        option for p in own.parameters.values() for option in (options if p.name == "data" else [p])
    ]

    @wraps(command)
    def call(**given: Any) -> None:
        data = Reading(**{f.name: given.pop(f.name) for f in fields(Reading)})
        command(data=data, **given)

    call.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    call.__annotations__ = {p.name: p.annotation for p in parameters}
    return call  # type: ignore[return-value]


def _assigned(rec: Record, texts: dict[str, str]) -> Record:
    """The record with inputs that are known as functions of time, in the units that these had."""
    if wrong := [name for name in texts if name in rec.outputs or name in rec.kept]:
        raise SpecError(f"--assign {wrong[0]}: it is no input; functions of time are for inputs")
    units = {name: unit for name, unit in rec.units.items() if name in texts}
    known = rec.assign(units=units, **texts)
    new = [name for name in texts if name not in rec.inputs]
    return known.select(inputs=[*rec.inputs, *new]) if new else known


def _channels(given: list[str] | None) -> dict[str, str] | None:
    """Columns by the names of channels: NAME=COLUMN, or the column's own name."""
    if given is None:
        return None
    found: dict[str, str] = {}
    for word in given:
        name, equals, column = word.partition("=")
        name, column = (name, column) if equals else (word, word)
        if not (name.strip() and column.strip()) or name in found:
            raise SpecError(f"{word}: give each column once, as COLUMN or NAME=COLUMN")
        found[name] = column
    return found
