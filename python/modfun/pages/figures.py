"""Plots as SVG within a page: in the page's colours, light or dark, whatever the user's settings are."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from ..base.optional import optional

__all__ = ["drawn"]

LONG = 40  # letters of a name in a drawing
MANY = 3000  # points of a line beyond which it is a picture within the drawing
# Black, greys that are dark, and white follow the page; all other colours show on both.
_COLOURS = {
    "#000000": "currentColor",
    "#4d4d4d": "var(--soft)",
    "#666666": "var(--soft)",
    "#ffffff": "var(--paper)",
}
_POWER = re.compile(r"\^\{(.*?)\}")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_COLOUR = re.compile("|".join(_COLOURS), re.IGNORECASE)


def drawn(
    draw: Callable[[list[Any]], Any],
    rows: int,
    *,
    columns: int = 1,
    height: float = 2.0,
    width: float = 8.0,
    sharex: bool = False,
) -> str:
    """What a function draws on Axes, as SVG.

    Parameters
    ----------
    draw : callable
        Takes the Axes, row by row.
    rows, columns : int
        Of Axes.
    height, width : float
        Of a row, and of the whole, in inches.
    sharex : bool, default False
        One horizontal axis for all rows.

    Raises
    ------
    ImportError
        matplotlib is not installed.
    """
    style = optional("matplotlib.style", "report", "a report")
    figures = optional("matplotlib.figure", "report", "a report")
    svg = optional("matplotlib.backends.backend_svg", "report", "a report")
    words = {"svg.fonttype": "none", "svg.hashsalt": "modfun"}
    with warnings.catch_warnings(), style.context(["default", words]):
        # The page's fonts have letters that matplotlib's own has not.
        warnings.filterwarnings("ignore", message=r"Glyph .* missing")
        warnings.filterwarnings("ignore", message="Tight layout not applied")
        figure = figures.Figure(figsize=(width, height * rows + 0.5), dpi=110)
        axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex).ravel())
        draw(axes)
        for here in figure.axes:
            _plain_names(here, height)
            for line in here.get_lines():
                line.set_rasterized(len(line.get_xdata()) > MANY)
        buffer = io.StringIO()
        nothing = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        canvas = svg.FigureCanvasSVG(figure)
        # All is measured once and drawn once; an engine of layouts, and `savefig` beside one, do it twice.
        figure.tight_layout(pad=0.4)
        for patch in (figure.patch, *(here.patch for here in figure.axes)):
            patch.set(facecolor="none", edgecolor="none")
        canvas.print_svg(buffer, metadata=nothing)
    text = buffer.getvalue()
    text = re.sub(r"<!--.*?-->", "", text[text.index("<svg") :], flags=re.DOTALL)
    return _COLOUR.sub(lambda found: _COLOURS[found[0].lower()], text)


def _plain_names(here: Any, height: float) -> None:
    """Names of channels are text: a $ in them begins no formula, and long ones are cut."""
    legend = here.get_legend()
    _cut([here.title, here.xaxis.label], LONG)
    _cut([here.yaxis.label], round(13 * height))
    _cut(legend.get_texts() if legend else [], LONG)
    for axis in (here.xaxis, here.yaxis):
        words = axis.get_major_formatter()
        if type(words).__name__ == "FuncFormatter":  # names at the ticks
            axis.set_major_formatter(partial(_tick, words))
        for of in (words, axis.get_minor_formatter()):
            if type(of).__name__.startswith("LogFormatter"):
                of.format_ticks = partial(_powers, of.format_ticks)


def _powers(labels: Callable[[Any], list[str]], places: Any) -> list[str]:
    """Powers of ten as text: matplotlib takes milliseconds to set each as a formula."""

    def text(label: str) -> str:
        plain = label.removeprefix(r"$\mathdefault{").removesuffix("}$").replace(r"\times", "×")
        return _POWER.sub(lambda found: found[1].translate(_RAISED), plain)

    return [text(label) for label in labels(places)]


def _tick(words: Any, place: float, position: int) -> str:
    return _short(words(place, position), 16)


def _cut(texts: Sequence[Any], most: int) -> None:
    for text in texts:
        text.set_parse_math(False)
        text.set_text(_short(text.get_text(), most))


def _short(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"
