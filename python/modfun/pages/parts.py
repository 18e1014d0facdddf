"""What a page is made of: sections of words, tables, figures and formulas."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base import html
from ..base.tables import Table
from ..errors import InternalError, ModfunError

__all__ = [
    "Block",
    "Code",
    "Facts",
    "Figure",
    "Grid",
    "Markup",
    "Notes",
    "Page",
    "Section",
    "Words",
    "plain_table",
    "section",
]

LONG = 30  # rows beyond which a table is folded


@dataclass(frozen=True)
class Words:
    """A paragraph."""

    text: str
    kind: str = "words"


@dataclass(frozen=True)
class Notes:
    """Sentences as a list."""

    sentences: tuple[str, ...]
    kind: str = "notes"


@dataclass(frozen=True)
class Facts:
    """Names and what they are; `code`: to be copied as it stands."""

    rows: tuple[tuple[str, str], ...]
    code: bool = False
    kind: str = "facts"


@dataclass(frozen=True)
class Code:
    """A text as it stands in a file, under its name."""

    caption: str
    text: str
    kind: str = "code"


@dataclass(frozen=True)
class Markup:
    """HTML or MathML of modfun's own making, in which every text is escaped."""

    html: str
    kind: str = "markup"


@dataclass(frozen=True)
class Grid:
    """A table; a long one is folded."""

    caption: str
    html: str
    folded: bool = False
    kind: str = "grid"

    @classmethod
    def of(cls, table: Table, caption: str) -> Grid:
        """A `Table` under a caption of its own."""
        untitled = Table({name: table[name] for name in table.columns}, units=table.units)
        return cls(caption, untitled._repr_html_(), len(table) > LONG)


@dataclass(frozen=True)
class Figure:
    """A drawing (SVG), what it shows in a sentence for who cannot see it, and its caption."""

    svg: str
    alt: str
    caption: str
    kind: str = "figure"


Block = Words | Notes | Facts | Code | Markup | Grid | Figure


@dataclass(frozen=True)
class Section:
    """Blocks under a heading."""

    name: str
    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A whole page: what it is about, the verdict in words, sections."""

    title: str
    facts: tuple[tuple[str, str], ...]
    verdict: str
    tone: str  # "good", "doubtful" or "bad"; "plain" where nothing is judged
    findings: tuple[str, ...]
    sections: tuple[Section, ...]


def section(name: str, heading: str, *makers: Callable[[], Block | Iterable[Block]]) -> Section:
    """A section of which each part that cannot be made says why.

    Only what modfun refuses and what numbers do not allow becomes words; a defect is raised.
    """
    blocks: list[Block] = []
    for make in makers:
        try:
            made = make()
            for block in [made] if isinstance(made, Block) else made:
                blocks.append(block)
        except InternalError:
            raise
        except (ModfunError, FloatingPointError, OverflowError, np.linalg.LinAlgError) as error:
            blocks.append(Words(f"Left out: {error}"))
    return Section(name, heading, tuple(blocks))


def plain_table(header: Sequence[str], rows: Iterable[Sequence[Any]], caption: str) -> Grid:
    """A table of texts."""
    texts = [[str(cell) for cell in row] for row in rows]
    return Grid(caption, html.table(header, texts), len(texts) > LONG)
