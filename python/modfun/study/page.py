"""The page about a Monte Carlo study: its figures, failures and provenance."""

from __future__ import annotations

import os
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..base.tables import Table
from ..pages import provenance
from ..pages.figures import drawn
from ..pages.page import check_place, save
from ..pages.parts import Block, Code, Facts, Figure, Grid, Page, Section, Words, plain_table, section
from .directory import FILE, Directory
from .drawing import study, study_rows
from .figures import Figures

__all__ = ["page_of", "write_study"]


def write_study(
    results: Figures,
    path: str | os.PathLike[str],
    *,
    directory: str | os.PathLike[str] | None = None,
    title: str | None = None,
) -> Path:
    """Write the report of a study; see `Results.report`."""
    check_place(path, "report")
    return save(page_of(results, directory, title), path, "report")


def page_of(results: Figures, directory: str | os.PathLike[str] | None, title: str | None) -> Page:
    """The page.

    Parameters
    ----------
    results : Results
    directory : path or None
        Of the study, for hashes, runs and the study's file.
    title : str or None
        Default: the name of the directory.
    """
    store = None if directory is None else Directory.read(Path(directory))
    named = "Monte Carlo study" + ("" if store is None else f" {store.path.name}")
    told = _provenance(results) if store is None else _of_directory(store)
    made = (
        section(
            "relative",
            "Relative to the true parameters",
            lambda: Grid.of(
                results.relative(),
                "Root mean square over the parameters, % of the true values. Of a bias it is never "
                "0, but about sd/√R where there is none",
            ),
        ),
        section("figure", "Bias and standard deviation", lambda: _figure(results)),
        section(
            "figures", "Every figure", lambda: Grid.of(results.table(), "Every figure, one row per parameter")
        ),
        *([] if not results.metrics else [_metrics(results)]),
        section("failures", "Failures", lambda: _failures(results)),
        section("provenance", "Provenance", lambda: told),
    )
    cells = results.failures[..., 0].size
    facts = [
        ("Replicates", f"{results.replicates:,} in each of {cells} cell{'s' if cells > 1 else ''}"),
        ("Estimators", ", ".join(results.estimators)),
        ("Parameters", ", ".join(results.param_names)),
        *([("Report made", provenance.now())] if store is None else []),
    ]
    said = (
        f"{results.replicates:,} replicates in each of {cells} cell{'s' if cells > 1 else ''}; _mcse is the "
        "Monte Carlo standard error of the figure before it, crlb the Cramér–Rao bound under white noise "
        "(nan where the noise or the records are the user's own)."
    )
    return Page(title or named, tuple(facts), said, "plain", tuple(_findings(results)), made)


def _findings(results: Figures) -> Iterable[str]:
    """What each estimator did, over all cells, and what has to be known to read the figures."""
    yield from results.notes
    for k, name in enumerate(results.estimators):
        tried, failed = (
            results.failures[..., k].size * results.replicates,
            int(results.failures[..., k].sum()),
        )
        said = (
            f"{name}: no estimate in {failed:,} of {tried:,} replicates"
            if failed
            else f"{name}: never failed"
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.abs(results.bias[..., k, :]) / results.sd[..., k, :]
        held = results.coverage[..., k, :]
        unsettled = int(results.status["maxiter"][..., k].sum())
        if unsettled:
            said += f"; {unsettled:,} estimates in the figures did not settle (maxiter)"
        if np.any(np.isfinite(share)):
            said += f"; largest bias {np.nanmax(share[np.isfinite(share)]):.3g} standard deviations"
        if np.any(np.isfinite(held)):
            said += (
                f"; 95 % intervals{_kind(results, k)} contain the true value in "
                f"{100 * np.nanmin(held):.1f} to "
                f"{100 * np.nanmax(held):.1f} % of replicates"
            )
        yield f"{said}."


def _kind(results: Figures, k: int) -> str:
    """Whose intervals were counted, of an estimator that is not a function."""
    own = results._plan.contenders[k].estimators
    return f" ({own[0].options.cov_type})" if own else ""


def _figure(results: Figures) -> Block:
    rows = len(study_rows(results)[2])
    return Figure(
        drawn(partial(study, results), rows, columns=2, height=3.4, sharex=True),
        "Bias on the left and standard deviation on the right, of each estimator.",
        "Root mean squares over the parameters, % of the true values. Bars are ± 2 Monte Carlo standard "
        "errors, the dotted line is the Cramér–Rao bound under white noise, where there is one.",
    )


def _metrics(results: Figures) -> Section:
    return section("metrics", "Metrics", lambda: Grid.of(results.metrics.table(), "Metrics"))


def _failures(results: Figures) -> Iterable[Block]:
    count: dict[str, list[Any]] = {"estimator": list(results.estimators)}
    for word, counts in results.status.items():
        count[word] = counts.reshape(-1, len(results.estimators)).sum(axis=0)
    yield Grid.of(Table(count), "Estimates of all cells by outcome")
    if len(results.messages):
        yield Grid.of(results.messages, "What failed: first replicate and count of each text")


def _provenance(results: Figures) -> Iterable[Block]:
    yield Facts(
        (("Seed", str(results._plan.seed)), ("Noise", f"drawn as {results.draw}"), *provenance.versions())
    )
    yield Words("Results in memory; those of a directory have its hashes and runs here, too.")


def _of_directory(store: Directory) -> Iterable[Block]:
    told = store.manifest
    yield Facts(
        (
            ("Study", f"{told['study']} (hash of all that changes its numbers)"),
            ("Seed", str(told["seed"])),
            ("Noise", f"drawn as {told['draw']}, version {told['streams']} of the random streams"),
            ("Parts", f"of {told['part']:,} replicates"),
            ("Begun with", f"modfun {told['modfun']}"),
        )
    )
    yield Facts(provenance.versions())
    yield plain_table(("file", "SHA-256"), told["files"].items(), "SHA-256 of the files")
    notes = store.notes()
    if notes:
        names = ["begun", "command", "replicates", "shard", "modfun", "python", "numpy", "machine"]
        yield plain_table(names, ([_word(name, note.get(name)) for name in names] for note in notes), "Runs")
    file = store.path / FILE
    if file.is_file():
        yield Code(FILE, file.read_text(errors="replace"))


def _word(name: str, value: Any) -> str:
    if value is None:
        return ""
    if name == "command":
        return provenance.bare(str(value))
    return "/".join(map(str, value)) if isinstance(value, list) else str(value)
