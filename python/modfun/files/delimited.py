"""Text files of numbers: delimiter, header and rows, with line numbers for what is wrong in them."""

from __future__ import annotations

import gzip
import io
import math
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..base.arrays import F64
from ..base.names import listed
from ..base.writing import refuse_large, write_text
from ..errors import DataError

__all__ = ["Delimited", "is_date", "numbers", "of_lines", "read_delimited", "write_delimited"]


TRUTH = {"true": 1.0, "false": 0.0, "good": 1.0}  # of a quality, where bad is no number
CLOCK = re.compile(  # days (IRIG), hours, minutes, seconds, half of the day
    r"(?:(\d{1,3}):)?(\d{1,2}):([0-5]\d):([0-5]\d(?:[.,]\d*)?)(?:\s*([AaPp])[Mm])?"
)
DAY = 86400.0
DATE = re.compile(  # ISO 8601, day.month.year or month/day/year: day, hours to seconds, fraction, half, zone
    r"(\d{4}-\d\d-\d\d|\d{1,2}\.\d{1,2}\.(?:\d{4}|\d\d)|\d{1,2}/\d{1,2}/(?:\d{4}|\d\d))"
    r"(?:[T ](\d{1,2}:\d\d(?::\d\d)?)(?:[.,](\d+))?\s*(?:([AaPp])[Mm]|(Z|z|[+-]\d\d(?::?\d\d)?))?)?"
)
GROUPED = re.compile(r"\s*[+-]?[1-9]\d{0,2}(?:\.\d{3})+(?:,\d*)?\s*")  # points as thousands marks
COMMA = re.compile(r"\s*[+-]?(?:\d*|[1-9]\d{0,2}(?:\.\d{3})+),\d+(?:[eE][+-]?\d+)?\s*")  # a decimal comma
POINTED = re.compile(r"\s*[+-]?[\d,]*\.[\d.,]*(?:[eE][+-]?\d+)?\s*")
DECIMAL = re.compile(  # a point that cannot be a thousands mark, as in 0.5, 1.0415 and 2.5e-3
    r"\s*[+-]?(?:0?\.\d+|\d*\.\d{4,}|\d*\.\d+(?=[eE]))(?:[eE][+-]?\d+)?\s*"
)
LONG = re.compile(r"\s*[+-]?\d{4,}(?:,\d*)?\s*")  # a number that thousands marks would split
SAMPLE = 20  # lines that show where a table begins
LONGEST_UNIT = 12  # letters; more is a description
UTF16 = (b"\xff\xfe", b"\xfe\xff")  # how a file of "Unicode text" begins
SEPARATOR = re.compile(r"sep=([,;\t])")  # the first line that Excel writes and reads
MISSING = frozenset((
    "", "nan", "na", "n/a", "<na>", "nat", "null", "none", "-", "--", "---", ".", "#nv", "#n/a",
    # What spreadsheets write where a formula fails,
    "#value!", "#ref!", "#div/0!", "#num!", "#name?", "#wert!", "#bezug!", "#zahl!",
    # and data historians where a value is of bad quality.
    "bad", "bad data", "bad input", "bad quality", "bad value", "set to bad", "no data", "no good data",
    "no result", "no value", "invalid", "invalid data", "invalid float", "i/o timeout", "timeout",
    "scan timeout", "scan off", "comm fail", "comm error", "calc failed", "equip fail", "intf shut",
    "shutdown", "out of serv", "out of service", "not connect", "not connected", "pt created", "configure",
    "failed", "error", "over range", "under range", "arc off-line", "unit down", "keine daten",
))  # fmt: skip


def number(text: str, marks: frozenset[str] = frozenset()) -> float | None:
    """Return the number a text stands for, nan for the usual marks of a missing value, else None.

    `marks`: further ones, in lower case.

    Times of day, ``14:05:36.02`` or with the day of the year before, ``325:14:05:36.02``, are seconds; dates,
    ``2026-03-01T14:05:36.02Z``, ``1.3.2026 14:05:36.02`` or ``3/1/2026 2:05 PM``, are seconds from 1970 on.
    """
    stripped = text.strip()
    if stripped.lower() in MISSING or stripped.lower() in marks:
        return math.nan
    if stripped.lower() in TRUTH:
        return TRUTH[stripped.lower()]
    try:
        return float(stripped)
    except ValueError:
        clock = CLOCK.fullmatch(stripped)
        if clock is None:
            date = _nanoseconds(stripped)
            date = _nanoseconds(stripped, day_first=True) if date is None else date
            return None if date is None else date / 1e9
        days, hours, minutes, seconds, half = clock.groups(default="0")
        hour = _hour(hours, half)
        return (
            None
            if hour is None
            else (
                86400.0 * int(days) + 3600.0 * hour + 60.0 * int(minutes) + float(seconds.replace(",", "."))
            )
        )


def _hour(text: str, half: str | None) -> int | None:
    """The hour of the day, of 12 with AM or PM, else of 24; None of 13 PM."""
    hour = int(text)
    if half is None or half == "0":
        return hour
    return hour % 12 + 12 * (half in "Pp") if 1 <= hour <= 12 else None


def is_date(text: str) -> bool:
    """Tell whether a text is a date or a time of day."""
    return bool(CLOCK.fullmatch(text.strip()) or DATE.fullmatch(text.strip()))


def numbers(texts: Sequence[str], marks: frozenset[str] = frozenset()) -> tuple[F64, int | None]:
    """Return the numbers of a column of texts, and the first row that holds none; `marks` as in `number`.

    Dates become seconds from the first one. Times of day without a day go on over midnight.
    """
    values = np.full(len(texts), np.nan)
    for row, text in enumerate(texts):
        found = number(text, marks)
        if found is None:
            return values, row
        values[row] = found
    known = np.isfinite(values)
    leading = texts[int(np.argmax(known))].strip() if known.any() else ""
    if DATE.fullmatch(leading):
        return _dates([text.strip() for text in texts]), None
    if (clock := CLOCK.fullmatch(leading)) and clock[1] is None:
        values[known] += DAY * np.cumsum(np.diff(values[known], prepend=values[known][:1]) < -DAY / 2)
    return values, None


def _dates(texts: Sequence[str]) -> F64:
    """Seconds from the first of dates, nan of others.

    Of 3/5/2026 the month is first, unless that leaves dates that are none or go back, or a longer record.
    """
    best: tuple[tuple[int, bool, int], list[int | None]] | None = None
    for day_first in (False, True) if any("/" in text for text in texts) else (False,):
        found = [_nanoseconds(text, day_first) for text in texts]
        known = [date for date in found if date is not None]
        back = any(b < a for a, b in pairwise(known))
        rank = (-len(known), back, max(known, default=0) - min(known, default=0))
        best = (rank, found) if best is None or rank < best[0] else best
    assert best is not None
    first = next(date for date in best[1] if date is not None)
    return np.array([np.nan if date is None else (date - first) / 1e9 for date in best[1]])


def _nanoseconds(text: str, day_first: bool = False) -> int | None:
    """Nanoseconds from 1970 of a date and time of `DATE`, else None; without a zone it is that of UTC."""
    found = DATE.fullmatch(text)
    if found is None:
        return None
    day, clock = found[1], found[2] or "00:00"
    if "." in day:
        day = "-".join(f"{part:0>2}" for part in reversed(_long_year(day, ".")))
    if "/" in day:
        one, other, year = (f"{part:0>2}" for part in _long_year(day, "/"))
        day = f"{year}-{other}-{one}" if day_first else f"{year}-{one}-{other}"
    hours, _, rest = clock.partition(":")
    hour = _hour(hours, found[4])
    try:
        whole = datetime.fromisoformat(f"{day}T{hour:02d}:{rest}{(found[5] or '+00:00').upper()}")
    except (TypeError, ValueError):  # of 13 PM, and of a thirteenth month
        return None
    seconds = round((whole - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds())
    return seconds * 10**9 + int((found[3] or "")[:9].ljust(9, "0"))


def _long_year(day: str, mark: str) -> list[str]:
    """The parts of a date whose year is last; one of two digits lies in 1970 to 2069."""
    *parts, year = day.split(mark)
    return [*parts, year if len(year) == 4 else f"{'19' if year >= '70' else '20'}{year}"]


def _with_points(text: str) -> str:
    """A text with a decimal point instead of a decimal comma, and without thousands marks beside a comma."""
    return (text.replace(".", "") if "," in text and GROUPED.fullmatch(text) else text).replace(",", ".")


@dataclass(frozen=True)
class Delimited:
    """The rows of a text file, not yet numbers."""

    file: str
    names: tuple[str, ...]
    delimiter: str
    rows: list[str]
    line_numbers: list[int]
    units: dict[str, str]
    sheet: bool = False  # of a workbook, whose cells may be numbers beside texts with decimal commas
    marks: frozenset[str] = frozenset()  # of missing values, beside the usual ones, in lower case

    def load(self, names: Sequence[str]) -> dict[str, F64]:
        """Return the numbers of some columns, nan where one is missing.

        Raises
        ------
        DataError
            If a field holds text, or a point that may be a decimal point or a thousands mark; the message
            names line, column and text.
        """
        places = [self.names.index(name) for name in names]
        try:  # NumPy's parser is fast but says little about what stopped it
            if self._comma is not None:
                raise ValueError("a point may be a thousands mark")
            table = np.loadtxt(
                self.rows, delimiter=self.delimiter, usecols=places, comments=None, quotechar='"', ndmin=2
            )
        except ValueError:
            table = np.column_stack([self._column(place, self._texts[place]) for place in places])
        return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}

    @cached_property
    def _texts(self) -> list[tuple[str, ...]]:
        return list(zip(*(_fields(row, self.delimiter) for row in self.rows), strict=True))

    @cached_property
    def _comma(self) -> tuple[int, int] | None:
        """Column and row of a number with a decimal comma, in a column of numbers, if the file has one."""
        if self.delimiter == "," or not any("," in row for row in self.rows):
            return None
        for place, texts in enumerate(self._texts):
            row = next((k for k, text in enumerate(texts) if COMMA.fullmatch(text)), None)
            if row is None:
                continue
            read = sum(number(_with_points(text), self.marks) is not None for text in texts)
            if 2 * read > len(texts):  # others are words that nobody knows, which are refused by name
                return place, row
        return None

    def _without_thousands(self, place: int, texts: Sequence[str]) -> Sequence[str]:
        """The texts of a column of a file of decimal commas, with decimal points."""
        assert self._comma is not None
        points = {
            k for k, text in enumerate(texts) if POINTED.fullmatch(text) and not DATE.fullmatch(text.strip())
        }
        points -= {k for k in points if texts[k].strip() in MISSING}
        grouped = {k for k in points if GROUPED.fullmatch(texts[k])}
        if not any(COMMA.fullmatch(text) for text in texts) and (
            any(DECIMAL.fullmatch(texts[k]) for k in points) or (self.sheet and not grouped)
        ):
            return texts  # points are decimal points, or cells are numbers
        where, row = self._comma
        beside = (
            f"while column {self.names[where]!r} has decimal commas ({self._texts[where][row].strip()!r} in "
            f"line {self.line_numbers[row]})"
        )
        if points - grouped:
            wrong = min(points - grouped)
            raise DataError(
                f"{self.file}, line {self.line_numbers[wrong]}: column {self.names[place]!r} holds "
                f"{texts[wrong].strip()!r}, whose point is no thousands mark, {beside}; write all decimals "
                "of the file with the same mark"
            )
        long = next((k for k, text in enumerate(texts) if grouped and LONG.fullmatch(text)), None)
        if long is not None:
            wrong = min(grouped)
            raise DataError(
                f"{self.file}, line {self.line_numbers[wrong]}: column {self.names[place]!r} holds "
                f"{texts[wrong].strip()!r} and, in line {self.line_numbers[long]}, {texts[long].strip()!r} "
                f"without a thousands mark, {beside}; remove the points if they mark thousands, else write "
                "commas"
            )
        plain = [text.replace(".", "") if k in grouped else text for k, text in enumerate(texts)]
        return [text.replace(",", ".") for text in plain]

    def _column(self, place: int, texts: Sequence[str]) -> F64:
        read = texts if self._comma is None else self._without_thousands(place, texts)
        values, wrong = numbers(read, self.marks)
        if wrong is not None:
            text = texts[wrong].strip()
            cure = (
                "correct it, put # before the line to skip it, or give "
                f"missing_values={text!r} if it marks a missing value"
            )
            if "," in text and number(text.replace(",", ".")) is not None:
                cure = "decimal commas are read where another mark separates the columns"
            raise DataError(
                f"{self.file}, line {self.line_numbers[wrong]}: column {self.names[place]!r} holds {text!r} "
                f"where a number is needed; {cure}"
            )
        return values


def read_delimited(path: Path) -> Delimited:
    """Read a text file with columns separated by comma, semicolon, tab or blanks.

    Empty lines and lines that begin with # or % are skipped, and so are lines of a title, of fewer fields
    than the names of the columns below them. The first line names the columns, unless it is all numbers:
    then the comment above it does if it has as many words, as numpy.savetxt writes it; else they are
    ``column1``, ``column2``, ... A line below the header without a number in it holds the units.

    Raises
    ------
    DataError
        If the file is empty or its rows differ in their number of fields.
    """
    data = _bytes_of(path)
    try:
        text = data.decode("utf-16" if data.startswith(UTF16) else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # older loggers write the degree sign so
    return of_lines(path.name, text.splitlines())


def _bytes_of(path: Path) -> bytes:
    """The bytes of a file, unpacked where its name ends in .gz."""
    data = path.read_bytes()
    if path.suffix.lower() != ".gz":
        return data
    refuse_large(path.name, int.from_bytes(data[-4:], "little"))
    try:
        return gzip.decompress(data)
    except (OSError, EOFError, zlib.error) as problem:
        raise DataError(
            f"{path.name} cannot be unpacked ({problem}); it is damaged or cut short: write it again"
        ) from None


def of_lines(label: str, lines: list[str], sheet: bool = False) -> Delimited:
    """The rows of a text or of a sheet; as `read_delimited`."""
    kept = [k for k, line in enumerate(lines) if line and _holds_data(line)]
    separator = SEPARATOR.fullmatch(lines[kept[0]].strip(" ")) if kept else None
    kept = kept[1:] if separator else kept
    if not kept:
        raise DataError(f"{label} holds no data; it needs a line of column names and rows of numbers")
    kept = kept[_above(lines, kept, separator[1] if separator else ";\t,") :]
    if _blanks_separate([lines[k] for k in kept[:2]]):
        for k in kept:
            lines[k] = "\t".join(lines[k].split())
    first = lines[kept[0]]
    units: dict[str, str] = {}
    delimiter = max(",;\t", key=lambda mark: len(_fields(first, mark)))
    delimiter = next((mark for mark in ";\t" if mark in first and _all_numbers(first, mark)), delimiter)
    delimiter = separator[1] if separator else delimiter
    names, heading = tuple(field.strip() for field in _fields(first, delimiter)), kept[0]
    if _all_numbers(first, delimiter):
        names = _commented_names(lines[: kept[0]], delimiter, len(names))
    else:
        kept = kept[1:]
        second = [field.strip() for field in _fields(lines[kept[0]], delimiter)] if kept else []
        said = {
            name: field
            for name, field in zip(_numbered(names), second, strict=False)
            if field.lower() not in MISSING
        }
        if said and all(number(_with_points(field)) is None for field in said.values()):
            units = {name: unit.strip("()[]") for name, unit in said.items() if len(unit) <= LONGEST_UNIT}
            kept = kept[1:]
    if not kept:
        raise DataError(f"{label} has column names ({listed(names)}) but no rows of numbers")
    rows = [lines[k] for k in kept]
    marks = len(names) - 1
    for k, row in enumerate(rows):  # counting marks is enough where nothing is quoted, and fast
        if row.count(delimiter) != marks and (count := len(_fields(row, delimiter))) != len(names):
            _refuse_title(label, heading + 1, names, rows, kept)
            raise DataError(
                f"{label}, line {kept[k] + 1}: {count} fields where the header has {len(names)}; "
                "correct the line, or put # before it to skip it"
            )
    names = _numbered(names)
    for name, text in zip(names, _fields(rows[0], delimiter), strict=False):
        if is_date(text):
            units[name] = "s"
    return Delimited(label, names, delimiter, rows, [k + 1 for k in kept], units, sheet)


def _numbered(names: tuple[str, ...]) -> tuple[str, ...]:
    """Names of which those that stand several times are numbered: x#1, x#2."""
    repeated = {name for name in names if name and names.count(name) > 1}
    return tuple(
        [f"{name}#{names[: k + 1].count(name)}" if name in repeated else name for k, name in enumerate(names)]
    )


def _above(lines: Sequence[str], kept: Sequence[int], marks: str) -> int:
    """Number of lines of a title above the header: it alone has a text for each column of the rows below.

    Lines of a title have fewer fields, or at most half of them filled, as spreadsheets write it.
    """
    for mark in marks:
        counts = {len(_fields(lines[k], mark)) for k in kept[len(kept) // 2 :][:SAMPLE]}
        if len(counts) > 1 or (count := counts.pop()) < 2:
            continue
        for at, k in enumerate(kept[:SAMPLE]):
            fields = [field.strip() for field in _fields(lines[k], mark)]
            filled = [field for field in fields if field]
            if at and not filled:  # a line between the title and the names
                continue
            if len(fields) == count and len(set(filled)) == count:
                below = [
                    _fields(lines[n], mark) for n in kept[at + 1 : at + 3]
                ]  # units, perhaps, and numbers
                told = any(2 * sum(_is_number(text, mark) for text in row) >= count for row in below)
                return at if told and not any(_is_number(text, mark) for text in fields) else 0
            if not fields[0] or len(fields) > count or (len(fields) == count and 2 * len(filled) > count):
                return 0
    return 0


def _refuse_title(label: str, line: int, names: Sequence[str], rows: Sequence[str], kept: list[int]) -> None:
    """Refuse first lines of fewer fields than all rows below have."""
    for mark in ";\t,":
        counts = [len(_fields(row, mark)) for row in rows]
        first = counts.index(counts[-1])
        if len(set(counts[first:])) == 1 and counts[-1] > max(len(names), *counts[:first], 1):
            fields = f"{len(names)} field{'s' * (len(names) > 1)}"
            titles = f"lines {line} to {kept[first]} if they are"
            titles = titles if kept[first] > line else f"line {line} if it is"
            raise DataError(
                f"{label}, line {line}: the header has {fields} where all rows have {counts[-1]}; put # "
                f"before {titles} a title, else name every column in it"
            )


def _commented_names(above: list[str], delimiter: str, columns: int) -> tuple[str, ...]:
    """Names in the comment above the numbers, as numpy.savetxt writes them; else column1, column2, ..."""
    comment = next((line for line in reversed(above) if line.strip()), "").lstrip("#% \t")
    said = comment.split() if delimiter == "\t" and delimiter not in comment else _fields(comment, delimiter)
    names = tuple(name.strip() for name in said)
    if len(set(names)) == columns and all(name and number(name) is None for name in names):
        return names
    return tuple(f"column{k}" for k in range(1, columns + 1))


def _all_numbers(line: str, delimiter: str) -> bool:
    """Tell whether all fields are numbers, with decimal commas where another mark separates them."""
    texts = _fields(line, delimiter)
    return all(number(text if delimiter == "," else _with_points(text)) is not None for text in texts)


def _is_number(text: str, delimiter: str) -> bool:
    """Tell whether a field is a number and not a missing one."""
    if text.strip().lower() in MISSING:
        return False
    return number(text if delimiter == "," else _with_points(text)) is not None


def _blanks_separate(lines: Sequence[str]) -> bool:
    """Tell whether columns are separated by blanks: no other mark, and as many words in both lines."""
    words = {len(line.split()) for line in lines}
    return (
        len(lines) == 2
        and not any(mark in line for line in lines for mark in ",;\t")
        and len(words) == 1 < max(words)
    )


def _holds_data(line: str) -> bool:
    """Tell whether a line is more than blanks and comment; ``#N/A`` in the first column is no comment."""
    if line[0] not in " \t#%":
        return True
    if line.isspace():
        return False
    return line.lstrip()[0] not in "#%" or re.split("[,;\t]", line)[0].strip().lower() in MISSING


def _fields(line: str, delimiter: str) -> list[str]:
    if '"' not in line:
        return line.split(delimiter)
    import csv

    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))


def write_delimited(
    what: str,
    path: str | Path,
    names: Sequence[str],
    columns: Sequence[F64],
    digits: int | None = None,
    units: Sequence[str] | None = None,
) -> None:
    """Write columns with commas between, whole or not at all; numbers to the last bit, or with these digits.

    A line of units follows the names; a unit that would read as a number, such as 1, is left out.

    Raises
    ------
    ModfunError
        As `writing.write_text`; `what` begins the message.
    """
    import csv  # not needed to read

    rows = np.column_stack(columns).tolist()
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    if units is not None:
        writer.writerow([unit if number(unit) is None else "" for unit in units])
    writer.writerows(rows if digits is None else ([f"{x:.{digits}g}" for x in row] for row in rows))
    write_text(what, path, text.getvalue())
