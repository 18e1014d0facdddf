"""The little HTML that notebooks and reports show: escaped text, tables, lists, a page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

__all__ = ["escape", "listing", "page", "table"]

STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, sans-serif; color: #1b1f24; background: #fff; margin: 2rem auto; \
max-width: 72rem; padding: 0 1.2rem; }
h1 { font-size: 1.5rem; margin-bottom: 0; }
h2 { font-size: 1.1rem; margin-top: 2.2rem; border-bottom: 1px solid #d5d9de; padding-bottom: .2rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin-bottom: 1.2rem; \
font-size: 13px; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: #5a636e; padding-bottom: .3rem; }
th, td { padding: .15rem .7rem .15rem 0; white-space: nowrap; vertical-align: top; }
thead th { border-bottom: 1px solid #1b1f24; }
tbody tr:nth-child(even) { background: #f4f6f8; }
pre { background: #f4f6f8; padding: .8rem; overflow-x: auto; font-size: 13px; }
svg { max-width: 100%; height: auto; }
"""


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
        return "".join(
            f'<{tag} style="text-align:{"right" if flush else "left"}">{escape(text)}</{tag}>'
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


def page(title: str, sections: Iterable[tuple[str, str]]) -> str:
    """Return a whole page that loads nothing; sections are headings, escaped here, and HTML."""
    body = "".join(
        f'<section><h2>{escape(head)}</h2><div class="wide">{inner}</div></section>\n'
        for head, inner in sections
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{STYLE}</style></head>\n<body><h1>{escape(title)}</h1>\n{body}</body></html>\n"
    )
