"""Sheets of .xlsx files as rows of text, read as those of text files are."""

from __future__ import annotations

from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from ..base.names import nearest
from ..base.optional import optional
from ..errors import DataError, SpecError
from .delimited import GROUPED, Delimited, of_lines

__all__ = ["read_excel"]


def read_excel(path: Path, sheet: str | None) -> Delimited:
    """Read the only sheet of a workbook, or the one that is named (extra ``excel``).

    Raises
    ------
    DataError
        A file that is damaged, or as in `of_lines`.
    SpecError
        A sheet that does not exist, or none named where there are several.
    """
    reader = optional("openpyxl", "excel", f"reading {path.name}")
    try:
        book = reader.load_workbook(path, read_only=True, data_only=True)
    except Exception as problem:  # openpyxl, zipfile and the parser of XML have their own
        raise DataError(
            f"{path.name} cannot be read as .xlsx ({problem}); it is damaged or of another kind: write it "
            "again, or give a .csv"
        ) from None
    try:
        names = book.sheetnames
        if sheet is None and len(names) > 1:
            raise SpecError(
                f"read: {path.name} holds {len(names)} sheets; choose one with part=: {', '.join(names)}"
            )
        if sheet is not None and sheet not in names:
            raise SpecError(f"read: {path.name} has no sheet {sheet!r}; {nearest(sheet, names)}")
        rows = book[names[0] if sheet is None else sheet].iter_rows(values_only=True)
        lines = ["\t".join(map(_text, row)) for row in rows]
    finally:
        book.close()
    return of_lines(path.name, lines, sheet=True)


def _text(cell: Any) -> str:
    """A cell as it would stand in a text file."""
    if cell is None:
        return ""
    if isinstance(cell, datetime | date | time):
        return cell.isoformat()
    text = " ".join(str(cell).split())
    # A cell that is the number 1.234 is no text with a thousands mark.
    return f"{text}0" if isinstance(cell, float) and GROUPED.fullmatch(text) else text
