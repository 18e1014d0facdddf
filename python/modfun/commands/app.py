"""The commands of `modfun`; needs the extra `cli`."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from .._core import __version__
from ..base.tables import Table
from ..errors import DataError, SpecError
from ..fitting import fit as estimation
from ..pages.page import check_place
from ..results.fit import Fit
from ..results.storage import told
from .reading import Files, Part, Reading, reads
from .structures import structure_of
from .study import mc
from .words import (
    Json,
    band_of,
    command_line,
    delay_of,
    one_or_all,
    poles_of,
    say,
    state_of,
    write_json,
)  # fmt: skip

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

Delay = Annotated[
    list[str] | None,
    typer.Option(
        metavar="SECONDS|[START:]MIN:MAX",
        help="Delay in s: known, or to be estimated within bounds; once, or one per input.",
    ),
]
Band = Annotated[str | None, typer.Option(help="Upper edge, or lower:upper, in rad/s.")]
Harmonics = Annotated[int | None, typer.Option(help="Highest modulating index M instead of a band.")]
Trend = Annotated[str, typer.Option(help="auto, none, constant or linear.")]
Picture = Annotated[Path | None, typer.Option(help="Draw to a file (.png, .pdf, .svg).")]
ReportTo = Annotated[
    Path | None, typer.Option("--report", metavar="FILE.html", help="Write a page about it.")
]


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
def sample(file: Annotated[Path, typer.Argument(help="Where to, .csv.")] = Path("flight.csv")) -> None:
    """Write a small simulated flight (t, pitch rate q, elevator de) to try the other commands on."""
    from .. import signals
    from ..experiments import simulation
    from ..systems import making

    if file.exists():
        raise SpecError(f"sample: {file} is there already; give another name")
    steps = signals.multistep("de", [3, 2, 1, 1], unit=0.6, dt=0.02, amplitude=2.0, duration=10, before=1)
    doublet = signals.doublet("de", width=0.8, dt=0.02, amplitude=2.0, duration=10, before=1)
    aircraft, moving = making.tf([-4, -3], [1, 1.8, 5]), [1.0, -1.0]
    run = simulation.simulate(
        aircraft, input=steps.then(doublet), nsr=0.05, initial_state=moving, outputs="q", seed=7
    )
    run.assign(q=run["q"] + 0.5).to_csv(file)
    say(f"wrote {file}; next: modfun check {file} --output q --input de")


@app.command("columns")
def _columns(files: Files, part: Part = None, json_to: Json = None) -> None:
    """List the columns of files: units, ranges, missing values, which one is the time."""
    from ..records.reading import columns

    tables = {str(file): columns(file, part=part) for file in files}
    if json_to != "-":
        print("\n\n".join(map(str, tables.values())))
    write_json(json_to, [{"file": name, "columns": table.to_dict()} for name, table in tables.items()])


@app.command()
@reads
def check(
    data: Reading,
    json_to: Json = None,
) -> None:
    """Show the columns of files; with --output, say what is wrong or doubtful about the record."""
    from ..records.reading import columns

    answers: list[dict[str, Any]] = []
    for file in data.files:
        table = columns(file, part=data.part)
        answer: dict[str, Any] = {"file": str(file), "columns": table.to_dict()}
        if json_to != "-":
            print(f"{file}\n{table}")
        if data.output or "output" in table["note"].tolist():  # an exported iddata says itself what is what
            found = replace(data, files=[file]).records()
            answer["findings"] = [text for rec in found for text in rec.check()]
            if json_to != "-":
                print("".join(f"\n{rec}\n{rec.check()}\n" for rec in found), end="")
        elif json_to != "-":
            print(_next(file, table))
        answers.append(answer)
    write_json(json_to, answers)


def _next(file: Path, table: Table) -> str:
    """How to check the record in a file of these columns."""
    notes = zip(table["column"].tolist(), table["note"].tolist(), strict=True)
    named = [shlex.quote(str(name)) for name, note in notes if not str(note).startswith("time")]
    words = " ".join(f"{word} {name}" for word, name in zip(("--output", "--input"), named, strict=False))
    return f"next, with your outputs and inputs: modfun check {shlex.quote(str(file))} {words}"


@app.command()
@reads
def fit(
    context: typer.Context,
    data: Reading,
    poles: Annotated[
        list[int] | None, typer.Option(help="Number of poles, default 2; with separate, also one per output.")
    ] = None,
    zeros: Annotated[
        list[str] | None,
        typer.Option(
            help="Number of zeros, default poles - 1; once, or one per input (none: no path), or one "
            "per output with commas between inputs (1,none)."
        ),
    ] = None,
    delay: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SECONDS|[START:]MIN:MAX",
            help="Delay in s: known, or to be estimated within bounds; once, or as --zeros. Of a state space "
            "known, or the name of a parameter; once, or one per input.",
        ),
    ] = None,
    denominator: Annotated[
        str | None, typer.Option(help="Of several outputs: common or separate poles.")
    ] = None,
    equation: Annotated[
        list[str] | None,
        typer.Option(
            "--equation",
            "-e",
            help="Instead of poles, such as \"y'' + d*y' + k*y = b*u\"; repeat for several.",
        ),
    ] = None,
    hidden: Annotated[
        list[str] | None, typer.Option(help="Signal of the equations that is not measured; repeat.")
    ] = None,
    a: Annotated[
        str | None,
        typer.Option("--A", metavar="ROWS", help='Instead of poles, a state matrix such as "Za 1; Ma Mq".'),
    ] = None,
    b: Annotated[str | None, typer.Option("--B", metavar="ROWS", help="Its input matrix.")] = None,
    c: Annotated[
        str | None,
        typer.Option("--C", metavar="ROWS", help="Its output matrix. Default: all states."),
    ] = None,
    d: Annotated[str | None, typer.Option("--D", metavar="ROWS", help="Its feedthrough.")] = None,
    states: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Names of the states, with commas between.")
    ] = None,
    param: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE|NAME=[START:]MIN:MAX|NAME=MEAN+-SD",
            help="Hold a parameter (a2=0), bound it (a1=0:, from 0 on) or give a prior (a1=3+-0.1).",
        ),
    ] = None,
    method: Annotated[str, typer.Option(help="ml, awls, wls or ls.")] = "ml",
    band: Band = None,
    harmonics: Harmonics = None,
    trend: Trend = "auto",
    noise: Annotated[
        str, typer.Option(help="output, process, coloured, errors-in-variables or equation.")
    ] = "output",
    cov_type: Annotated[str, typer.Option(help="spectral, HC3 or nonrobust.")] = "spectral",
    rule: Annotated[str, typer.Option(help="gregory, parabolic, trapezoid or staircase.")] = "gregory",
    initial_state: Annotated[
        str,
        typer.Option(
            help="unknown, zero, rest (steady before the first sample), periodic, or y,y',... in numbers."
        ),
    ] = "unknown",
    robust: Annotated[
        bool, typer.Option("--robust", help="Weight samples by Student's t, for spikes and heavy tails.")
    ] = False,
    stable: Annotated[
        bool, typer.Option("--stable", help="Of an unstable estimate, take the nearest stable model.")
    ] = False,
    reference: Annotated[list[str] | None, typer.Option(help="Command of a control loop; a column.")] = None,
    json_to: Json = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the fit on one sheet (.png, .pdf, .svg).")] = None,
    report: ReportTo = None,
) -> None:
    """Fit a transfer function, equations or a state space to one file, or to several as one problem."""
    if not data.output:
        raise SpecError("fit: give --output, the column to be modelled; repeat it for several")
    if report is not None:
        check_place(report, "--report")
    records = data.records(keep=reference)
    given = {name: text for name, text in zip("ABCD", (a, b, c, d), strict=True) if text is not None}
    structure = structure_of(
        data, records[0], equation=equation, hidden=hidden, matrices=given, states=states, poles=poles,
        zeros=zeros, delay=delay, denominator=denominator, param=param,
    )  # fmt: skip
    result = estimation.fit(
        records,
        structure,
        method=method,
        band=band_of(band),
        harmonics=harmonics,
        trend=None if trend == "none" else trend,
        noise=noise,
        cov_type=cov_type,
        rule=rule,
        initial_state=state_of(initial_state),
        robust=robust,
        stable=stable,
        reference=reference,
    )
    usable = result.status in ("ok", "maxiter")
    # Files first: whoever reads what is printed, as head does, may close before the end.
    if plot is not None and usable:
        try:
            _save(plot, lambda pyplot: result.plot(0))
        except DataError as overflow:  # of an unstable model
            say(f"{plot} is not drawn; {overflow}")
    if report is not None:
        say(f"wrote {result.report(report, command=command_line(context))}")
    write_json(json_to, result.to_dict())
    if json_to != "-":
        print(result.summary())
        if usable:
            print(f"\nSimulated against measured\n{_scored(result)}")
    if not result.success:
        raise typer.Exit(1)


def _scored(result: Any) -> object:
    """The scores of a fit, or why an unstable one has none: it was made all the same."""
    try:
        return result.score()
    except DataError as overflow:
        return f"not scored; {overflow}"


@app.command()
@reads
def order(
    data: Reading,
    poles: Annotated[str, typer.Option(help="Number of poles, or fewest:most.")] = "1:5",
    zeros: Annotated[
        list[int] | None, typer.Option(help="Number of zeros to try; repeat. Default: all below the poles.")
    ] = None,
    delay: Delay = None,
    method: Annotated[str, typer.Option(help="ml or awls.")] = "ml",
    band: Band = None,
    harmonics: Harmonics = None,
    trend: Trend = "auto",
    json_to: Json = None,
    plot: Picture = None,
) -> None:
    """Compare transfer functions of several orders, on one file or several as one problem."""
    from ..inference.order import select_order

    if len(data.outputs) != 1:
        raise SpecError("order: give exactly one --output, the column to be modelled")
    found = select_order(
        data.records(),
        poles=poles_of(poles),
        zeros=zeros or "any",
        delay=one_or_all([delay_of(word) for word in delay or ()]) or 0.0,
        method=method,
        band=band_of(band),
        harmonics=harmonics,
        trend=None if trend == "none" else trend,
    )
    if json_to != "-":
        print(f"{found}\n\n{found.best}")
    answer = {"table": found.table.to_dict(), "criterion": found.criterion, "band": found.band}
    write_json(json_to, answer | {"notes": found.notes, "best": found.best.to_dict()})
    if plot is not None:
        _save(plot, lambda pyplot: _figure(found.plot()))
    if not found.best.success:
        raise typer.Exit(1)


@app.command()
@reads
def terms(
    data: Reading,
    library: Annotated[
        str | None, typer.Option(help='Candidates, such as "y, y**3, u" or "polynomials of y, u up to 3".')
    ] = None,
    target: Annotated[
        list[str] | None, typer.Option(help="Left side, y''; repeat for several. Default: y' of each output.")
    ] = None,
    keep: Annotated[str | None, typer.Option(help="Terms that are known to belong.")] = None,
    sign: Annotated[list[str] | None, typer.Option(help="Sign of a coefficient, y**3=-; repeatable.")] = None,
    hierarchy: Annotated[bool, typer.Option(help="A product comes in only with its factors.")] = False,
    json_to: Json = None,
    plot: Picture = None,
) -> None:
    """Find the terms of differential equations among candidates, on one file or several as one problem."""
    from ..inference.terms import select_terms

    if not data.output or not library:
        raise SpecError("terms: give --output, the measured states, and --library, the candidate terms")
    found = select_terms(
        data.records(),
        library,
        target=target or None,
        keep=keep,
        signs={name: own for name, _, own in (one.rpartition("=") for one in sign or ())} or None,
        hierarchy=hierarchy,
    )
    if json_to != "-":
        print(f"{found.summary()}\n\n{found.fit}")
    answer = {"terms": dict(found.terms), "alike": found.alike, "band": found.band, "notes": found.notes}
    tables = {"path": found.path.to_dict(), "inclusion": found.inclusion.to_dict()}
    write_json(json_to, answer | tables | {"fit": found.fit.to_dict()})
    if plot is not None:
        _save(plot, lambda pyplot: _figure(found.plot()))
    chosen = any(found.terms.values())
    if not chosen:
        say("terms: no candidate explains a derivative beyond the noise, so nothing is chosen; give others")
    if not (chosen and found.fit.success):
        raise typer.Exit(1)


@app.command()
@reads
def frf(
    data: Reading,
    method: Annotated[str, typer.Option(help="lrm, lpm or modulating.")] = "lrm",
    degree: Annotated[int, typer.Option(help="Of the local polynomials.")] = 2,
    halfwidth: Annotated[
        int | None, typer.Option(help="Lines on each side of a frequency. Default: by cross-validation.")
    ] = None,
    band: Band = None,
    json_to: Json = None,
    plot: Picture = None,
) -> None:
    """Estimate the frequency response without a model, from one file or several."""
    from ..responses.frf import frf

    if not data.output or not data.input:
        raise SpecError("frf: give --output and --input, the columns between which the response is wanted")
    found = frf(
        data.records(),
        method=method,
        degree=degree,
        halfwidth=halfwidth,
        band=band_of(band),
    )
    if json_to != "-":
        print(f"{found}\n\n{found.table()}")
    write_json(json_to, told(found.to_dict()))
    if plot is not None:
        _save(plot, lambda pyplot: _figure(found.plot()))


@app.command()
@reads
def compare(data: Reading, json_to: Json = None, plot: Picture = None) -> None:
    """Score fits (.json of modfun fit) on a record, the last file.

    Its columns are read by the names of the fits' channels; --output NAME=COLUMN and --input give others.
    """
    from ..inference.comparison import compare
    from ..study.loading import load

    *paths, file = data.files
    if not paths or file.suffix == ".json":
        raise SpecError("compare: give one or more fits, written by modfun fit --json, and then one record")
    fits = {str(path): load(path) for path in paths}
    for path, fit in fits.items():
        if not isinstance(fit, Fit):
            raise SpecError(f"compare: {path} holds no fit; make one with modfun fit --json")
    first = next(iter(fits.values()))
    wanted = replace(
        data,
        files=[file],
        output=data.output or list(first.outputs),
        input=data.input or list(first.inputs),
        intersample=data.intersample or list(first.intersample),
    )
    try:
        rec, *more = wanted.records()
    except SpecError as error:
        if data.output and data.input:
            raise
        raise SpecError(
            f"{str(error).rstrip('.')}. Columns were looked for by the names of the fit's channels "
            f"({', '.join((*first.outputs, *first.inputs))}); where the file has others, repeat --output "
            "NAME=COLUMN, --input NAME=COLUMN and --convert as given to modfun fit"
        ) from error
    if more:
        raise SpecError(f"compare: --on {data.on} makes {1 + len(more)} records; say with --only which one")
    table = compare(fits, rec)
    if json_to != "-":
        print(table)
    write_json(json_to, table.to_dict())
    if plot is not None:
        _save(plot, lambda pyplot: _figure(table.plot()))


@reproduce.command("report")
def _report(
    out: Annotated[Path, typer.Option(help="Folder for tables and figures.")] = Path("figures"),
    runs: Annotated[int, typer.Option(help="Monte Carlo runs a point of the large study.")] = 100_000,
    quick: Annotated[bool, typer.Option(help="A small study, to see that all works.")] = False,
    json_to: Json = None,
) -> None:
    """The Monte Carlo study of NASA report NAG-1-1065: Figs. 1(c) and 2, as table and figures."""
    reproduction = import_module("modfun.commands.reproduction")
    answer = reproduction.report(out, many=runs, quick=quick, progress="auto")
    if json_to is not None:
        write_json(json_to, answer.to_dict() if hasattr(answer, "to_dict") else answer)


# Pictures -----------------------------------------------------------------------------------------


def _save(to: Path, draw: Callable[[Any], Any]) -> None:
    """Save the figure that a function makes with pyplot."""
    from ..base.optional import optional

    optional("matplotlib", "plot", "--plot").use("Agg")
    pyplot = optional("matplotlib.pyplot", "plot", "--plot")
    known = pyplot.gcf().canvas.get_supported_filetypes()
    if to.suffix.lstrip(".").lower() not in known:
        raise SpecError(f"--plot {to}: unknown kind of picture; end the name in .png, .pdf or .svg")
    pyplot.close("all")
    draw(pyplot).savefig(to, dpi=120)
    pyplot.close("all")
    say(f"drew {to}")


def _figure(axes: Any) -> Any:
    """The figure of what a plot returns: Axes, or an array of them."""
    return getattr(axes, "flat", [axes])[0].figure
