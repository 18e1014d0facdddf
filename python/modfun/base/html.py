"""The little HTML that notebooks and reports show: escaped text, tables and lists."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["escape", "listing", "table"]


def table(
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    title: str | None = None,
    right: Sequence[bool] | None = None,
) -> str:
    """Return an HTML table of plain texts, all of them escaped here.

    Parameters
    ----------
    header : sequence of str
        Names of the columns; an empty one leaves the head out.
    rows : iterable of sequences of str
        Cells, row by row.
    title : str, optional
        Caption above the table.
    right : sequence of bool, optional
        True for the columns set flush right (numbers); default: none.
    """
    flags = [False] * len(header) if right is None else list(right)

    def cells(tag: str, texts: Sequence[str]) -> str:
        styled = zip(texts, flags + [False] * (len(texts) - len(flags)), strict=False)
        scope = ' scope="col"' if tag == "th" else ""
        return "".join(
            f'<{tag}{scope} style="text-align:{"right" if flush else "left"}">{escape(text)}</{tag}>'
            for text, flush in styled
        )

    caption = f"<caption>{escape(title)}</caption>" if title else ""
    head = f"<thead><tr>{cells('th', header)}</tr></thead>" if header else ""
    body = "".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table>{caption}{head}<tbody>{body}</tbody></table>"


def listing(sentences: Iterable[str], *, title: str | None = None) -> str:
    """Return sentences as an HTML list, escaped here."""
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return (f"<p>{escape(title)}</p>" if title else "") + (f"<ul>{items}</ul>" if items else "")
