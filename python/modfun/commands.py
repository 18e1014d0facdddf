"""The commands of `modfun`; needs the extra `cli`."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from . import __version__, estimation
from .command_output import Json, say, write_json
from .commands_study import mc
from .errors import SpecError
from .records import Record
from .results import Fit
from .structures import TransferFunction

__all__ = ["app"]

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Identify continuous-time systems from short, noisy, transient records (seconds, rad/s).",
)
reproduce = typer.Typer(no_args_is_help=True, help="Make published figures again.")
app.add_typer(reproduce, name="reproduce")
app.add_typer(mc, name="mc")

Files = Annotated[list[Path], typer.Argument(metavar="FILE", help=".csv, .npz, .mat or .parquet.")]
Outputs = Annotated[list[str] | None, typer.Option("--output", "-y", help="Column of the output.")]
Inputs = Annotated[
    list[str] | None, typer.Option("--input", "-u", help="Column of an input; repeat for several.")
]
Time = Annotated[str | None, typer.Option("--time", "-t", help="Column of time in s.")]
Step = Annotated[
    float | None, typer.Option("--dt", help="Sampling interval in s, where there is no time column.")
]
Between = Annotated[
    list[str] | None,
    typer.Option("--intersample", help="Inputs between samples: smooth, zoh or foh; once, or one an input."),
]
Part = Annotated[str | None, typer.Option(help="Struct or experiment of a .mat file that holds several.")]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"modfun {__version__}")
        raise typer.Exit


@app.callback()
def _modfun(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def check(
    files: Files,
    output: Outputs = None,
    input: Inputs = None,
    time: Time = None,
    dt: Step = None,
    intersample: Between = None,
    part: Part = None,
    json_to: Json = None,
) -> None:
    """Show the columns of files; with --output, say what is wrong or doubtful about the record."""
    from .io import columns

    answers: list[dict[str, Any]] = []
    for file in files:
        table = columns(file, part=part)
        answer: dict[str, Any] = {"file": str(file), "columns": table.to_dict()}
        if json_to != "-":
            print(f"{file}\n{table}")
        if output or "output" in table["note"].tolist():  # an exported iddata says itself what is what
            rec = _record(file, output, input, time, dt, intersample, part)
            findings = rec.check()
            answer["findings"] = list(findings)
            if json_to != "-":
                print(f"\n{rec}\n{findings}")
        answers.append(answer)
    write_json(json_to, answers)


@app.command()
def fit(
    files: Files,
    output: Outputs = None,
    input: Inputs = None,
    poles: Annotated[int, typer.Option(help="Number of poles.")] = 2,
    zeros: Annotated[
        list[str] | None,
        typer.Option(help="Number of zeros, default poles - 1; once, or one an input (none: no path)."),
    ] = None,
    delay: Annotated[
        list[float] | None, typer.Option(help="Known delay in s; once, or one an input.")
    ] = None,
    time: Time = None,
    dt: Step = None,
    intersample: Between = None,
    part: Part = None,
    method: Annotated[str, typer.Option(help="ml, awls, wls or ls.")] = "ml",
    band: Annotated[str | None, typer.Option(help="Upper edge, or lower:upper, in rad/s.")] = None,
    harmonics: Annotated[
        int | None, typer.Option(help="Highest modulating index M instead of a band.")
    ] = None,
    trend: Annotated[str, typer.Option(help="auto, none, constant or linear.")] = "auto",
    noise: Annotated[str, typer.Option(help="output or equation.")] = "output",
    cov_type: Annotated[str, typer.Option(help="HC3 or nonrobust.")] = "HC3",
    rule: Annotated[str, typer.Option(help="gregory, parabolic, trapezoid or staircase.")] = "gregory",
    json_to: Json = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw response and Bode plot to a file (.png, .pdf, .svg).")
    ] = None,
) -> None:
    """Fit a transfer function to one file, or to several files as one problem."""
    if not output or len(output) != 1:
        raise SpecError("fit: give exactly one --output, the column to be modelled")
    records = [_record(file, output, input, time, dt, intersample, part) for file in files]
    structure = TransferFunction(poles=poles, zeros=_zeros(zeros), delay=_one_or_all(delay) or 0.0)
    result = estimation.fit(
        records,
        structure,
        method=method,
        band=_band(band),
        harmonics=harmonics,
        trend=None if trend == "none" else trend,
        noise=noise,
        cov_type=cov_type,
        rule=rule,
    )
    usable = result.status in ("ok", "maxiter")
    if json_to != "-":
        print(result.summary())
        if usable:
            print(f"\nSimulated against measured\n{result.score()}")
    write_json(json_to, result.to_dict())
    if plot is not None and usable:
        _draw(result, plot)
    if not result.success:
        raise typer.Exit(1)


@reproduce.command("report")
def _report(
    out: Annotated[Path, typer.Option(help="Folder for tables and figures.")] = Path("figures"),
    runs: Annotated[int, typer.Option(help="Monte Carlo runs a point of the large study.")] = 100_000,
    quick: Annotated[bool, typer.Option(help="A small study, to see that all works.")] = False,
    json_to: Json = None,
) -> None:
    """The Monte Carlo study of NASA report NAG-1-1065: Figs. 1(c) and 2, as table and figures."""
    reproduction = import_module("modfun.reproduction")
    answer = reproduction.report(out, many=runs, quick=quick, progress="auto")
    if json_to is not None:
        write_json(json_to, answer.to_dict() if hasattr(answer, "to_dict") else answer)


# From words to objects ----------------------------------------------------------------------------


def _record(
    file: Path,
    output: list[str] | None,
    input: list[str] | None,
    time: str | None,
    dt: float | None,
    intersample: list[str] | None,
    part: str | None,
) -> Record:
    from .io import read

    between = _one_or_all(intersample)
    return read(file, time=time, dt=dt, outputs=output, inputs=input, intersample=between, part=part)


def _zeros(given: list[str] | None) -> Any:
    if not given:
        return None
    found: list[int | None] = []
    for word in given:
        if word.lower() == "none":
            found.append(None)
        elif word.lstrip("-").isdigit():
            found.append(int(word))
        else:
            raise SpecError(f"--zeros {word}: give a whole number, or none for an input without a path")
    return _one_or_all(found)


def _one_or_all(given: list[Any] | None) -> Any:
    return given[0] if given and len(given) == 1 and given[0] is not None else given


def _band(given: str | None) -> float | tuple[float, float] | None:
    if given is None:
        return None
    try:
        edges = [float(part) for part in given.split(":")]
    except ValueError:
        edges = []
    if len(edges) not in (1, 2):
        raise SpecError(f"--band {given}: give the upper edge, or lower:upper, in rad/s, such as 0.5:8")
    return edges[0] if len(edges) == 1 else (edges[0], edges[1])


def _draw(result: Fit, to: Path) -> None:
    from . import plot
    from .extras import optional

    optional("matplotlib", "plot", "--plot").use("Agg")
    pyplot = optional("matplotlib.pyplot", "plot", "--plot")
    known = pyplot.gcf().canvas.get_supported_filetypes()
    if to.suffix.lstrip(".").lower() not in known:
        raise SpecError(f"--plot {to}: unknown kind of picture; end the name in .png, .pdf or .svg")
    pyplot.close("all")
    across = 2 if result.inputs else 1
    figure, axes = pyplot.subplots(
        2, across, figsize=(6.0 * across, 5.5), squeeze=False, layout="constrained"
    )
    plot.response(result, 0, ax=axes[:, 0])
    if result.inputs:
        plot.bode(result, ax=axes[:, 1])
    figure.savefig(to, dpi=120)
    pyplot.close(figure)
    say(f"drew {to}")
