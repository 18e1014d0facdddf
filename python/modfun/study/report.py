"""The report of a study in a directory: one HTML page with tables, figure, failures and provenance."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from .. import html
from .._core import __version__
from ..errors import SpecError
from ..extras import optional
from ..tables import Table
from .directory import FILE, Directory
from .results import Results

__all__ = ["page"]


def page(directory: str | Path, results: Results) -> str:
    """The page as text; it loads nothing from anywhere.

    Parameters
    ----------
    directory : str or Path
        Directory of the study.
    results : Results
        Its results.

    Raises
    ------
    ImportError
        matplotlib is not installed.
    """
    store = Directory.read(directory)
    sections = [
        ("Relative to the true parameters", f"{_said(results)}{results.relative()._repr_html_()}"),
        ("Bias and standard deviation", _figure(results)),
        ("Every figure", results.table()._repr_html_()),
    ]
    if results.metrics:
        sections.append(("Metrics", results.metrics._repr_html_()))
    sections.append(("Failures", _failures(results)))
    sections.append(("Provenance", _provenance(store)))
    file = store.path / FILE
    if file.is_file():
        sections.append((FILE, f"<pre>{html.escape(file.read_text(errors='replace'))}</pre>"))
    return html.page(f"Monte Carlo study {store.path.name}", sections)


def _said(results: Results) -> str:
    cells = results.failures[..., 0].size
    text = (
        f"{results.replicates:,} replicates in each of {cells} cell{'s' if cells > 1 else ''}; _mcse is the "
        "Monte Carlo standard error of the figure before it, crlb the Cramér–Rao bound."
    )
    return f"<p>{html.escape(text)}</p>"


def _figure(results: Results) -> str:
    """The figure as SVG within the page, or why there is none."""
    optional("matplotlib", "plot", "a report").use("Agg")
    pyplot = optional("matplotlib.pyplot", "plot", "a report")
    with pyplot.rc_context({"svg.hashsalt": "modfun"}):
        try:
            axes = results.plot()
        except SpecError as error:
            return f"<p>{html.escape(str(error))}</p>"
        figure, drawn = axes[0].figure, io.StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        pyplot.close(figure)
    text = drawn.getvalue()
    return text[text.index("<svg") :]


def _failures(results: Results) -> str:
    """How many estimates ended how, and what was raised."""
    count: dict[str, list[Any]] = {"estimator": list(results.estimators)}
    for word, counts in results.status.items():
        count[word] = counts.reshape(-1, len(results.estimators)).sum(axis=0)
    found = Table(count, title="Estimates of all cells by outcome")._repr_html_()
    return found + (results.messages._repr_html_() if len(results.messages) else "")


def _provenance(store: Directory) -> str:
    told = store.manifest
    rows = [
        ("study", f"{told['study']} (hash of all that changes its numbers)"),
        ("seed", str(told["seed"])),
        ("noise", f"drawn as {told['draw']}, version {told['streams']} of the random streams"),
        ("parts", f"of {told['part']:,} replicates"),
        *((f"SHA-256 of {name}", digest) for name, digest in told["files"].items()),
        ("begun with", f"modfun {told['modfun']}"),
        ("report by", f"modfun {__version__}"),
    ]
    found = html.table([], rows)
    notes = store.notes()
    names = ["begun", "command", "replicates", "shard", "modfun", "python", "numpy", "machine"]
    runs = html.table(names, ([_word(note.get(name)) for name in names] for note in notes), title="Runs")
    return found + (runs if notes else "")


def _word(value: Any) -> str:
    if value is None:
        return ""
    return "/".join(map(str, value)) if isinstance(value, list) else str(value)
