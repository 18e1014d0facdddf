"""Matrices whose entries are numbers, parameters and expressions of these: read, and written as equations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..base.arguments import shown
from ..errors import SpecError
from ..language.parser import expression

__all__ = [
    "Entry",
    "Matrix",
    "column_of",
    "delays_of",
    "late_name",
    "line",
    "matrix_of",
    "names_in",
    "row_of",
    "rows_of",
    "state_of",
]

Entry = float | str
Matrix = tuple[tuple[Entry, ...], ...]


def rows_of(matrix: Any) -> int:
    """Rows of A, which says how many states there are."""
    try:
        return len(matrix)
    except Exception:  # of whatever an unknown object raises
        raise SpecError(
            f"StateSpace: A={shown(matrix)} is not a matrix; give rows of numbers and names"
        ) from None


def matrix_of(name: str, given: Any, rows: int | None, columns: int | None) -> Matrix:
    """A matrix of so many rows and columns (None: of any number), checked entry by entry."""
    try:
        table = [list(row) for row in given]
    except TypeError:
        raise SpecError(f"StateSpace: {name} must be a matrix, a list of rows") from None
    shape = (len(table), len(table[0]) if table else 0)
    wanted = (shape[0] if rows is None else rows, shape[1] if columns is None else columns)
    if uneven := [k for k, row in enumerate(table) if len(row) != shape[1]]:
        raise SpecError(
            f"StateSpace: row {uneven[0] + 1} of {name} has {len(table[uneven[0]])} entries, its first "
            f"row {shape[1]}"
        )
    if shape != wanted or not table:
        raise SpecError(f"StateSpace: {name} has shape {shape}, with this A it is {wanted}")
    return tuple(
        tuple(_entry(f"{name}[{i}][{j}]", one) for j, one in enumerate(row)) for i, row in enumerate(table)
    )


def _entry(where: str, given: Any) -> Entry:
    if isinstance(given, str):
        source = expression(given, f"entry {where}")
        for node in source.tree.walk():
            if node.kind in ("prime", "compare") or node.primes or (node.kind == "name" and node.parts):
                source.refuse(
                    node.at, node.end, "is neither a number nor a parameter; a matrix has no signals"
                )
        return float(given) if source.tree.kind == "number" else given
    if type(given).__module__.partition(".")[0] == "sympy":
        from .symbolic.words import said  # SymPy's own object: it is loaded already

        return _entry(where, said(given, exact=True))
    try:
        if isinstance(given, bool) or given is np.ma.masked:
            raise TypeError
        number = float(given)
    except Exception:  # of whatever the conversion of an unknown object raises
        raise SpecError(
            f"StateSpace: {where} is {shown(given)}; give a number, a name or an expression"
        ) from None
    if not np.isfinite(number):
        raise SpecError(f"StateSpace: {where} is {number}; entries are finite")
    return number


def column_of(given: Any, n: int) -> Any:
    """B of one input may be given as n entries."""
    flat = _is_flat("B", given)
    return [[one] for one in given] if flat and len(given) == n else given


def row_of(given: Any) -> Any:
    """C or D of one output may be given as a row."""
    return [given] if _is_flat("C or D", given) else given


def _is_flat(name: str, given: Any) -> bool:
    try:
        return all(isinstance(one, str) or np.ndim(one) == 0 for one in given)
    except Exception:  # of whatever an unknown object raises
        raise SpecError(f"StateSpace: {name}={shown(given)} is not a matrix; give rows") from None


def delays_of(given: Any, inputs: Sequence[str]) -> tuple[Entry, ...]:
    """A delay for each input: seconds, or the name of a parameter."""
    if isinstance(given, str) or np.ndim(given) == 0:
        given = [given] * len(inputs)
    (delays,) = matrix_of("delay", [given], 1, len(inputs)) if inputs else ((),)
    for name, late in zip(inputs, delays, strict=True):
        if not (late.isidentifier() if isinstance(late, str) else late >= 0):
            raise SpecError(
                f"StateSpace: the delay of {name} is {late!r}; give seconds of at least 0, or the name of a "
                'parameter, as delay="h", params={"h": mf.Free(min=0, max=0.2)}'
            )
    return delays


def late_name(name: str, delay: Entry) -> str:
    """An input as it stands in the equations: u, u(t - h) or u(t - 0.1)."""
    return f"{name}(t - {delay if isinstance(delay, str) else f'{delay:g}'})" if delay else name


def state_of(c: Sequence[Entry], d: Sequence[Entry]) -> int | None:
    """The state that an output is, if it is one."""
    set_ = [j for j, one in enumerate(c) if one != 0]
    return set_[0] if len(set_) == 1 and c[set_[0]] == 1 and all(one == 0 for one in d) else None


def names_in(*matrices: Matrix) -> list[str]:
    """Names in the entries, as often as they stand there."""
    texts = [one for matrix in matrices for row in matrix for one in row if isinstance(one, str)]
    nodes = [node for text in texts for node in expression(text).tree.walk() if node.kind == "name"]
    return [str(node.value) for node in nodes if node.value != "pi"]


def line(left: str, entries: Iterable[tuple[Entry, str]]) -> str:
    """One equation: what stands on the left, then entries times signals."""
    parts = []
    for entry, name in entries:
        if entry == 0:
            continue
        if isinstance(entry, str):
            sign, factor = "+", entry if entry.isalnum() else f"({entry})"
        else:
            sign, factor = "-" if entry < 0 else "+", "" if abs(entry) == 1 else f"{abs(entry):g}"
        parts += [sign, f"{factor}*{name}" if factor else name]
    first = "-" if parts[:1] == ["-"] else ""
    return f"{left} = {first}{' '.join(parts[1:]) or '0'}"
