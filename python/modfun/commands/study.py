"""The commands `modfun mc`: Monte Carlo studies from a file, in a directory."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..base.progress import clock
from ..base.tables import Table
from ..errors import SpecError
from ..results.fit import Fit
from ..study import shards, toml_file
from ..study.directory import FILE, MANIFEST, OWN, Directory
from ..study.files import write
from ..study.results import Results
from ..study.shards import Status
from .words import Json, say, write_json

__all__ = ["mc"]

mc = typer.Typer(no_args_is_help=True, help="Monte Carlo studies from a file, kept in a directory.")

StudyFile = Annotated[
    Path, typer.Argument(metavar="STUDY.TOML", help="The study; `modfun mc init` writes one.")
]
Place = Annotated[Path, typer.Argument(metavar="DIRECTORY", help="Directory of a study.")]


class Keep(StrEnum):
    """Words of --keep."""

    summary = "summary"
    samples = "samples"


class Draw(StrEnum):
    """Words of --draw."""

    auto = "auto"
    coefficients = "coefficients"
    samples = "samples"


@mc.command()
def init(file: StudyFile = Path("study.toml")) -> None:
    """Write a small study with comments, to start from; it runs as it is."""
    try:
        with open(file, "x", encoding="utf-8") as new:
            new.write(toml_file.EXAMPLE)
    except FileExistsError:
        raise SpecError(
            f"mc init: {str(file)!r} is there already and stays as it is; name another file"
        ) from None
    say(f"wrote {file}; next: modfun mc run {file} --out runs/{file.stem}")


@mc.command()
def run(
    file: StudyFile,
    out: Annotated[Path, typer.Option(help="Directory where the study is kept; one that is there goes on.")],
    shard: Annotated[
        str | None,
        typer.Option(metavar="K/N", help="Do the share K of N only; K counts from 0, to N - 1."),
    ] = None,
    replicates: Annotated[
        int | None, typer.Option(help="Records a cell instead of those in the file; with --until the most.")
    ] = None,
    until: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIGURE=LIMIT",
            help="Go on to this Monte Carlo error in units of parameters, as bias=0.001; repeat for several.",
        ),
    ] = None,
    threads: Annotated[int | None, typer.Option(help="Default: MODFUN_NUM_THREADS, else all cores.")] = None,
    keep: Annotated[Keep, typer.Option(help="samples: every estimate, too, in samples.npy.")] = Keep.summary,
    draw: Annotated[
        Draw,
        typer.Option(
            help="Noise of the Fourier coefficients or of the samples; auto: coefficients where they serve "
            "all estimators and are less work."
        ),
    ] = Draw.auto,
    progress: Annotated[
        bool | None, typer.Option("--progress/--no-progress", help="Default: from two seconds on.")
    ] = None,
    json_to: Json = None,
) -> None:
    """Run a study; stopped at any moment, the same command goes on with the same numbers."""
    share = _shard(shard)
    limits = (
        None if not until else {name: _number(name, text) for name, text in _pairs("--until", until).items()}
    )
    study = toml_file.load(file)
    try:
        found = study.run(
            directory=out, shard=share, replicates=replicates, until=limits, threads=threads, keep=keep.value,
            draw=draw.value, progress="auto" if progress is None else progress,
        )  # fmt: skip
    except KeyboardInterrupt:
        say(f"stopped; the parts that were finished are kept in {out}: the same command goes on from there")
        raise typer.Exit(130) from None
    write(out / FILE, file.read_bytes())
    if found is None:
        write_json(json_to, _told(out, shards.status(out)))
    else:
        _show(found, json_to)


@mc.command()
def status(directory: Place, json_to: Json = None) -> None:
    """Say how far a study is; every part is checked. Exit code 0 if it is complete, else 1."""
    found = shards.status(directory)
    if json_to != "-":
        print(_shares(directory, found))
        print(_words(found))
    write_json(json_to, _told(directory, found))
    if not found.complete:
        raise typer.Exit(1)


@mc.command()
def merge(
    directories: Annotated[list[Path], typer.Argument(metavar="DIRECTORY...", help="Those of the shards.")],
    out: Annotated[Path, typer.Option(help="Directory for all parts, a new one or one of the same study.")],
    json_to: Json = None,
) -> None:
    """Bring the parts of several directories of one study together. Exit code 1 while parts are missing."""
    found = shards.merge(out, directories)
    if found.missing:
        say(_words(found))
        write_json(json_to, _told(out, found))
        raise typer.Exit(1)
    _show(shards.load(out), json_to)


@mc.command()
def replicate(
    directory: Place,
    number: Annotated[int, typer.Argument(help="From 0 on.")],
    cell: Annotated[
        list[str] | None,
        typer.Option(metavar="AXIS=LABEL", help="Where in the grid, as nsr=0.2; one for each axis."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write the record to a file.")] = None,
    json_to: Json = None,
) -> None:
    """Make one replicate again from its address and show its fits; functions are looked for here, too."""
    _here()
    axes = {axis.name: axis.labels for axis in Directory.read(directory).study()[0].axes}
    where = {name: _label(axes.get(name, ()), text) for name, text in _pairs("--cell", cell or []).items()}
    rec, fits = shards.replicate(directory, number, where)
    if csv is not None:
        rec.to_csv(csv)
        say(f"wrote {csv}")
    if json_to != "-":
        print(rec)
        for name, found in fits.items():
            print(f"\n{name}\n{_estimate(found)}")
    write_json(json_to, {name: _plain_estimate(found) for name, found in fits.items()})


@mc.command()
def report(
    directory: Place,
    out: Annotated[Path, typer.Option(help="The page, a single file that needs nothing else.")],
    json_to: Json = None,
) -> None:
    """Write tables, figure, failures and provenance of a study as one HTML page."""
    _page(out)
    results = shards.load(directory)
    say(f"wrote {results.report(out, directory=directory)}")
    write_json(json_to, results.to_dict())


# From words to values -----------------------------------------------------------------------------


def _shard(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    found = re.fullmatch(r"(\d+)/(\d+)", text)
    k, n = (int(found[1]), int(found[2])) if found else (0, 0)
    if found and 0 <= k < n:
        return k, n
    last = (
        f"with {n} shares K is 0 to {n - 1} (SLURM: --array=0-{n - 1})" if n else "K from 0 to N - 1, as 3/64"
    )
    raise SpecError(f"--shard {text}: give K/N; {last}")


def _pairs(option: str, given: list[str]) -> dict[str, str]:
    found = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not (equals and name and value):
            raise SpecError(f"{option} {text}: give a name and a value, as {EXAMPLES[option]}")
        if name in found:
            raise SpecError(f"{option} {text}: {name} is given twice")
        found[name] = value
    return found


EXAMPLES = {"--until": "bias=0.001", "--cell": "nsr=0.2"}


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise SpecError(f"--until {name}={text}: {text!r} is not a number; give it as {name}=0.001") from None


def _label(labels: Sequence[Any], text: str) -> Any:
    """The label that a text means; the text itself where it means none."""
    for label in labels:
        if str(label) == text:
            return label
    with suppress(ValueError):
        value = float(text)
        return next((label for label in labels if not isinstance(label, str) and label == value), text)
    return text


def _here() -> None:
    """Functions of a study are imported again, from the folder where the command is called, too."""
    if "" not in sys.path:
        sys.path.insert(0, "")


def _page(out: Path) -> None:
    """Refuse to write a page over a file of a study, or over anything else that is no page."""
    place = out.resolve()
    for folder in (place.parent, place.parent.parent):
        own = place.relative_to(folder).parts
        if own and own[0] in OWN and (folder / MANIFEST).exists():
            raise SpecError(
                f"mc report: --out {out} is the place of {own[0]}, which belongs to the study in "
                f"{str(folder)!r}; name another file, as report.html"
            )
    if place.is_file() and place.suffix.lower() not in (".html", ".htm"):
        raise SpecError(
            f"mc report: --out {out} is there already and no .html file, so that it stays as it is; name a "
            "new file, as report.html"
        )


# Looks --------------------------------------------------------------------------------------------


def _show(results: Results, json_to: str | None) -> None:
    """Print results; exit code 1 where an estimator found nothing at all."""
    if json_to != "-":
        print(results)
        if results.metrics:
            print(f"\n{results.metrics}")
    if len(results.messages):
        print(f"\n{results.messages}", file=sys.stderr)
    write_json(json_to, results.to_dict())
    for k, name in enumerate(results.estimators):
        if not np.any(results.failures[..., k] < results.replicates):
            say(f"{name} failed in every replicate")
            raise typer.Exit(1)


def _shares(directory: Path, found: Status) -> Table:
    """A row for each shard of the last run, or one for all."""
    store = Directory.read(directory)
    n = next((note["shard"][1] for note in reversed(store.notes()) if note.get("shard")), None)
    count = n or 1
    sums = np.zeros((4, count), np.int64)
    for row, parts in ((0, store.parts), (2, found.left)):
        for part in parts:
            sums[row : row + 2, part.number % count] += (1, part.replicates)
    columns = {
        "shard": [f"{k}/{n}" for k in range(n)] if n else ["all"],
        "parts": sums[0],
        "missing": sums[2],
        "replicates": sums[1],
        "done": sums[1] - sums[3],
    }
    return Table(columns, title=str(directory))


def _words(found: Status) -> str:
    """How far a study is, and for how long it will go on."""
    if found.complete:
        return f"complete: {found.done:,} replicates in {found.parts} parts"
    if found.until is not None:
        limits = ", ".join(f"{name}={limit:g}" for name, limit in found.until.items())
        return f"{found.done:,} replicates are there; --until {limits} is not reached"
    said = [
        f"{found.done:,} of {found.replicates:,} replicates are there; {found.missing} of {found.parts} "
        "parts are missing"
    ]
    if found.damaged:
        said.append(f"damaged, and made again by the next run: {', '.join(found.damaged)}")
    if found.rate is not None and found.idle is not None:
        left = clock((found.replicates - found.done) / found.rate)
        said.append(
            f"{found.rate:.3g} replicates/s over the last parts, at which {left} are left; the last part was "
            f"written {clock(found.idle)} ago"
        )
    return "\n".join(said)


def _told(directory: Path, found: Status) -> dict[str, Any]:
    names = ("complete", "parts", "missing", "replicates", "done", "damaged", "rate", "idle", "until")
    told = {name: getattr(found, name) for name in names}
    return told | {"shards": _shares(directory, found).to_dict()}


def _estimate(found: Any) -> str:
    if isinstance(found, Exception):
        return f"failed: {type(found).__name__}: {found}"
    return str(found.summary()) if isinstance(found, Fit) else str(found)


def _plain_estimate(found: Any) -> Any:
    if isinstance(found, Exception):
        return {"failed": f"{type(found).__name__}: {found}"}
    return found.to_dict() if isinstance(found, Fit) else found
