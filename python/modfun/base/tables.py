"""Tables that print themselves: what every tabular answer of modfun is."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SpecError
from . import html
from .arguments import public, shown
from .names import nearest
from .optional import optional
from .writing import write_text

__all__ = ["Findings", "Table"]

DIGITS = 5  # significant digits of the largest number of a column
MOST = 9  # the same where a small number beside it has a small error
ESTIMATES = ("value", "low", "high")  # columns in the units of a column "se" or "bse", as limits in per cent


@public
class Table:
    """Named columns of equal length; prints aligned, cannot be changed.

    ``len(table)`` is the number of rows, iteration gives the rows as dictionaries.

    Parameters
    ----------
    columns : mapping of str to sequence
        Values by column name. Numbers become NumPy arrays, anything else an object array.
    title : str, optional
        A line printed above the table.
    units : mapping of str to str, optional
        Units by column name, printed below the names; those of other columns are left out.

    Raises
    ------
    SpecError
        If the columns differ in length.

    See Also
    --------
    modfun.Results.table : A table of a study.
    modfun.Fit.score : A table of scores.

    References
    ----------
    The column formats are those of the guide docs/monte_carlo.md.

    Examples
    --------
    >>> table = Table({"mode": [1, 2], "omega": [2.828, 14.5]}, units={"omega": "rad/s"})
    >>> print(table)
    mode   omega
           rad/s
       1   2.828
       2  14.500
    """

    __slots__ = ("_columns", "_units", "title")

    _columns: dict[str, NDArray[Any]]
    _units: dict[str, str]
    title: str | None

    def __init__(
        self,
        columns: Mapping[str, Sequence[Any] | NDArray[Any]],
        title: str | None = None,
        *,
        units: Mapping[str, str] | None = None,
    ) -> None:
        arrays = {str(name): _column(values) for name, values in columns.items()}
        lengths = {name: len(values) for name, values in arrays.items()}
        if len(set(lengths.values())) > 1:
            raise SpecError(f"a Table needs columns of equal length, these have {lengths}")
        object.__setattr__(self, "_columns", arrays)
        object.__setattr__(self, "_units", {n: str(u) for n, u in (units or {}).items() if u and n in arrays})
        object.__setattr__(self, "title", title)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("a Table cannot be changed; make a new one from .to_dict()")

    def __delattr__(self, name: str) -> None:
        raise AttributeError("a Table cannot be changed; make a new one from .to_dict()")

    def __reduce__(self) -> tuple[Any, ...]:
        return _made, (type(self), self._columns, self.title, self._units)

    @property
    def units(self) -> dict[str, str]:
        """Units by column name, of the columns that have one (a copy)."""
        return dict(self._units)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self._columns)

    @property
    def rows(self) -> tuple[dict[str, Any], ...]:
        """Rows as dictionaries of plain Python values."""
        lists = self.to_dict()
        return tuple(dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True))

    def __len__(self) -> int:
        return len(next(iter(self._columns.values()), ()))

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self.rows)

    def __getitem__(self, column: str) -> NDArray[Any]:
        """Return the values of a column, read only."""
        try:
            return self._columns[column]
        except KeyError:
            raise SpecError(f"this Table has no column {column!r}; {nearest(column, self.columns)}") from None

    def __contains__(self, column: object) -> bool:
        return column in self._columns

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Table):
            return NotImplemented
        return (self.title, self.columns, self._units) == (other.title, other.columns, other._units) and all(
            _same(self[name], other[name]) for name in self.columns
        )

    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> dict[str, list[Any]]:
        """Return the columns as lists of plain Python values."""
        return {name: values.tolist() for name, values in self._columns.items()}

    def to_pandas(self) -> Any:
        """Return a pandas.DataFrame (extra ``pandas``); its ``attrs["units"]`` are `units`."""
        frame = optional("pandas", "pandas", "Table.to_pandas").DataFrame(self.to_dict())
        frame.attrs["units"] = self.units
        return frame

    def to_csv(self, path: str | PathLike[str] | None = None) -> str:
        r"""Return the table as comma-separated text, numbers with all their digits, units in brackets.

        Parameters
        ----------
        path : str or path, optional
            A file that the text is written to, too.

        Examples
        --------
        >>> Table({"mode": [1, 2], "omega": [2.828, 14.5]}).to_csv()
        'mode,omega\n1,2.828\n2,14.5\n'
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self._headings())
        writer.writerows(zip(*self.to_dict().values(), strict=True))
        return _written("to_csv", text.getvalue(), path)

    def to_markdown(self, path: str | PathLike[str] | None = None) -> str:
        """Return the table as Markdown, numbers as they are printed.

        Parameters
        ----------
        path : str or path, optional
            A file that the text is written to, too.

        Examples
        --------
        >>> print(Table({"mode": [1, 2], "omega": [2.828, 14.5]}).to_markdown())
        | mode | omega |
        |---:|---:|
        | 1 | 2.828 |
        | 2 | 14.500 |
        """
        texts, flush = self._cells()
        lines = [self._headings(), *zip(*texts, strict=True)]
        rows = ["| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines]
        rule = "|" + "|".join("---:" if right else "---" for right in flush) + "|"
        return _written("to_markdown", "\n".join([rows[0], rule, *rows[1:]]), path)

    def to_latex(self, path: str | PathLike[str] | None = None) -> str:
        r"""Return the table as a LaTeX tabular, numbers as they are printed.

        Parameters
        ----------
        path : str or path, optional
            A file that the text is written to, too.

        Examples
        --------
        >>> print(Table({"mode": [1, 2], "omega": [2.828, 14.5]}).to_latex())
        \begin{tabular}{rr}
        \hline
        mode & omega \\
        \hline
        1 & 2.828 \\
        2 & 14.500 \\
        \hline
        \end{tabular}
        """
        texts, flush = self._cells()
        lines = [self._headings(), *zip(*texts, strict=True)]
        rows = [" & ".join(map(_latex, line)) + r" \\" for line in lines]
        layout = "".join("r" if right else "l" for right in flush)
        head = [rf"\begin{{tabular}}{{{layout}}}", r"\hline", rows[0], r"\hline"]
        return _written("to_latex", "\n".join([*head, *rows[1:], r"\hline", r"\end{tabular}"]), path)

    def _headings(self) -> list[str]:
        """Names of the columns with their units in brackets."""
        return [f"{name} ({self._units[name]})" if name in self._units else name for name in self.columns]

    def _cells(self) -> tuple[list[list[str]], list[bool]]:
        """The columns as texts, and which of them are numbers."""
        fine = self._decimals_of_errors()
        texts = [
            _texts(values, fine if name in ESTIMATES or name.endswith(" %") else 0)
            for name, values in self._columns.items()
        ]
        return texts, [_is_number(values) for values in self._columns.values()]

    def _decimals_of_errors(self) -> int:
        """Decimals that show two digits of the smallest standard error; 0 without one."""
        errors = self._columns.get("se", self._columns.get("bse"))
        if errors is None or errors.dtype.kind != "f":
            return 0
        errors = errors[np.isfinite(errors) & (errors > 0)]
        return max(1 - math.floor(math.log10(errors.min())), 0) if errors.size else 0

    def __repr__(self) -> str:
        texts, flush = self._cells()
        units = [self._units.get(name, "") for name in self.columns]
        widths = [
            max(map(len, [name, unit, *cells]))
            for name, unit, cells in zip(self._columns, units, texts, strict=True)
        ]

        def line(cells: Sequence[str]) -> str:
            padded = (
                cell.rjust(width) if right else cell.ljust(width)
                for cell, width, right in zip(cells, widths, flush, strict=True)
            )
            return "  ".join(padded).rstrip()

        head = [self.columns, *([units] if any(units) else [])]
        lines = [line(row) for row in (*head, *zip(*texts, strict=True))]
        return "\n".join([self.title, *lines] if self.title else lines)

    def _repr_html_(self) -> str:
        texts, flush = self._cells()
        return html.table(self._headings(), zip(*texts, strict=True), title=self.title, right=flush)


class Findings:
    """What a check found, in sentences; prints as a list, cannot be changed.

    True where there is something to say: ``if rec.check(): ...``.

    Parameters
    ----------
    title : str
        What was checked.
    sentences : sequence of str
        One sentence a finding, most important first.
    note : str, default ""
        What could not be checked, and why, or what errors do not count; no finding.
    """

    __slots__ = ("note", "sentences", "title")

    title: str
    sentences: tuple[str, ...]
    note: str

    def __init__(self, title: str, sentences: Sequence[str], note: str = "") -> None:
        object.__setattr__(self, "title", title)
        object.__setattr__(self, "note", note)
        object.__setattr__(self, "sentences", tuple(sentences))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("findings cannot be changed")

    def __reduce__(self) -> tuple[Any, ...]:
        return Findings, (self.title, self.sentences, self.note)

    def __len__(self) -> int:
        return len(self.sentences)

    def __iter__(self) -> Iterator[str]:
        return iter(self.sentences)

    def __contains__(self, text: str) -> bool:
        """Tell whether a text occurs in one of the sentences."""
        return any(text in sentence for sentence in self.sentences)

    @property
    def nothing(self) -> str:
        """What is said where nothing was found."""
        return f"nothing wrong was found. {self.note}".rstrip()

    def __repr__(self) -> str:
        if not self.sentences:
            return f"{self.title}: {self.nothing}"
        more = [f"  {self.note}"] if self.note else []
        return "\n".join([f"{self.title}:", *(f"* {sentence}" for sentence in self.sentences), *more])

    def _repr_html_(self) -> str:
        title = f"{self.title}:" if self.sentences else repr(self)
        note = self.note if self.sentences else ""
        return html.listing(self.sentences, title=title) + html.listing((), title=note)


def _made(kind: type[Table], columns: Any, title: str | None, units: Mapping[str, str]) -> Table:
    return kind(columns, title, units=units)


def _column(values: Sequence[Any] | NDArray[Any]) -> NDArray[Any]:
    try:
        plain = [None if value is np.ma.masked else value for value in values]
    except Exception:  # of whatever an unknown object raises
        raise SpecError(f"Table: {shown(values)} is not a column; give a list of values") from None
    try:
        array = np.array(plain)
    except ValueError:  # ragged sequences
        array = np.empty(0, dtype=object)
    if array.ndim != 1 or array.dtype.kind not in "biufc" or len(array) != len(plain):
        array = np.empty(len(plain), dtype=object)
        array[:] = plain
    array.flags.writeable = False
    return array


def _written(how: str, text: str, path: str | PathLike[str] | None) -> str:
    """The text, written to a file, too, where one is named."""
    if path is not None:
        write_text(f"Table.{how}", path, text if text.endswith("\n") else text + "\n")
    return text


def _same(a: NDArray[Any], b: NDArray[Any]) -> bool:
    if a.dtype.kind in "fc" and b.dtype.kind in "fc":
        return bool(np.array_equal(a, b, equal_nan=True))
    return bool(np.array_equal(a, b))


def _is_number(values: NDArray[Any]) -> bool:
    if values.dtype.kind in "iufc":
        return True
    given = [v for v in values if v is not None]
    return bool(given) and all(
        isinstance(v, int | float | np.number) and not isinstance(v, bool) for v in given
    )


LATEX = {c: "\\" + c for c in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}


def _latex(text: str) -> str:
    return "".join(LATEX.get(c, c) for c in text)


def _texts(values: NDArray[Any], decimals: int = 0) -> list[str]:
    """The values as text; numbers in fixed point with so many decimals at least."""
    if values.dtype.kind == "f":
        return _floats(values, decimals)
    if values.dtype.kind == "c":
        return [f"{v:.{DIGITS}g}" for v in values]
    if values.dtype.kind == "O" and _is_number(values):
        numbers = iter(_floats(np.array([v for v in values if v is not None], dtype=float)))
        return ["" if v is None else next(numbers) for v in values]
    return [_text(v) for v in values]


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return str(value)


def _floats(values: NDArray[Any], least: int = 0) -> list[str]:
    """Fixed point with common decimals where the column's range allows it, else the short form."""
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    if sizes.size == 0 or (np.all(sizes == np.round(sizes)) and sizes.max() < 1e9):
        return [f"{v:.0f}" for v in values]
    low, high = math.floor(math.log10(sizes.min())), math.floor(math.log10(sizes.max()))
    if low >= -4 and high <= 5 and high - low <= 3:
        decimals = max(DIGITS - 1 - high, 2 - low, least if high + least < MOST else 0, 0)
        trimmed = max((len(f"{v:.{decimals}f}".rstrip("0").partition(".")[2]) for v in sizes), default=0)
        return [f"{v:.{min(decimals, trimmed)}f}" for v in values]
    return [f"{v:.{DIGITS}g}" for v in values]
