"""From files, frames and dictionaries to records."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .delimited import number, read_delimited
from .errors import DataError, SpecError
from .records import Record
from .samples import even_step
from .tables import Table, nearest

__all__ = ["columns", "read"]

F64 = NDArray[np.float64]
Channels = str | Sequence[str] | Mapping[str, str]

SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
}


def read(
    source: str | os.PathLike[str] | Mapping[str, ArrayLike] | Any,
    *,
    outputs: Channels,
    inputs: Channels | None = None,
    time: str | None = None,
    keep: Channels | None = None,
    dt: float | None = None,
    units: Mapping[str, str] | None = None,
    intersample: str | Sequence[str] | Mapping[str, str] = "smooth",
) -> Record:
    """Make a Record from a file, a frame or a dictionary of arrays.

    Parameters
    ----------
    source : path, frame or mapping
        A text file (.csv, .tsv, .txt, .dat; columns separated by comma, semicolon or tab; see Notes), an
        .npz file of arrays, a frame with ``columns`` (pandas, polars), or arrays by name.
    outputs, inputs : str, sequence of str or mapping
        Columns by name, or ``{new name: name in the source}``.
    time : str, optional
        Column of times, increasing. It is converted to seconds where its name says the unit, as in
        ``TIME [ms]`` or ``t_ms``. Default: the one column named t or time (with or without a unit), unless
        `dt` is given.
    keep : str, sequence of str or mapping, optional
        Further columns to carry along, such as an event marker for `Record.split`.
    dt : float, optional
        Sampling interval in seconds, instead of a column of times.
    units : mapping of str to str, optional
        Units by (new) channel name; default: what stands in brackets in the column's name.
    intersample : optional
        How the inputs go between samples, as in `Record`.

    Returns
    -------
    Record

    Raises
    ------
    DataError
        If the file is missing, empty or ragged, or a column that is used holds text or gaps; the message
        names lines.
    SpecError
        If a column does not exist (the message lists the nearest), or the time is not clear.

    Notes
    -----
    In text files, empty lines and lines that begin with # or % are skipped, the first line names the
    columns (``column1``, ``column2``, ... if it is all numbers) and a line of units below it is skipped.
    An .npz file or mapping may hold arrays (channel, time): ``y`` gives the columns ``y1``, ``y2``, ...

    Examples
    --------
    >>> import numpy as np
    >>> t = 0.1 * np.arange(50)
    >>> rec = read({"t": t, "Q (deg/s)": np.sin(t)}, outputs={"q": "Q (deg/s)"})
    >>> rec.outputs, rec.units["q"], round(rec.dt, 6)
    (('q',), 'deg/s', 0.1)
    """
    table = _open(source)
    if time is not None and dt is not None:
        raise SpecError(f"read: give time={time!r} or dt={dt!r}, not both")
    clock = _guess_time(table) if time is None and dt is None else time
    roles = [
        _roles(given, option) for given, option in ((outputs, "outputs"), (inputs, "inputs"), (keep, "keep"))
    ]
    old = list(
        dict.fromkeys([*([clock] if clock else []), *(name for role in roles for name in role.values())])
    )
    for name in old:
        _refuse_unknown(table, name)
    values = table.load(old)
    for name in old:
        _refuse_missing(table, name, values[name])
    out, into, kept = roles
    named = {new: unit for role in roles for new, name in role.items() if (unit := _unit(name))}
    count = len(values[old[0]]) if old else 0
    return Record(
        y=np.reshape([values[name] for name in out.values()], (len(out), count)),
        u=np.reshape([values[name] for name in into.values()], (len(into), count)) if into else None,
        dt=dt,
        t=None if clock is None else values[clock] * _seconds(clock),
        outputs=tuple(out),
        inputs=tuple(into),
        units={**named, **(units or {})},
        intersample=intersample,
        keep={new: values[name] for new, name in kept.items()},
    )


def columns(source: str | os.PathLike[str] | Mapping[str, ArrayLike] | Any) -> Table:
    """List the columns of a source that `read` takes.

    Parameters
    ----------
    source : path, frame or mapping
        As in `read`.

    Returns
    -------
    Table
        ``column``, ``unit``, ``min``, ``max``, ``missing`` (values), ``note``: which one is the time and
        how even it is, which are constant or text.
    """
    table = _open(source)
    times = _time_candidates(table)
    rows: list[tuple[Any, ...]] = []
    count = 0
    for name, values in _loadable(table).items():
        if values is None:
            rows.append((name, _unit(name), None, None, None, "text"))
            continue
        count = len(values)
        good = values[np.isfinite(values)]
        low, high = (float(good.min()), float(good.max())) if good.size else (None, None)
        note = "empty" if low is None else "constant" if low == high else ""
        if name in times:
            note = f"time, {_pace(values * _seconds(name))}"
        rows.append((name, _unit(name), low, high, len(values) - good.size, note))
    header = ("column", "unit", "min", "max", "missing", "note")
    return Table(
        dict(zip(header, zip(*rows, strict=True), strict=True)), title=f"{table.label}: {count} rows"
    )


# Sources: anything that has named columns ---------------------------------------------------------


@dataclass(frozen=True)
class _Source:
    label: str
    names: tuple[str, ...]
    load: Callable[[Sequence[str]], dict[str, F64]]
    place: Callable[[int], str]  # what a row is called in messages


def _open(source: Any) -> _Source:
    if isinstance(source, str | os.PathLike):
        return _open_file(Path(source))
    if isinstance(source, Mapping):
        return _from_arrays(source, "the dictionary")
    if hasattr(source, "columns") and hasattr(source, "__getitem__"):
        arrays = {str(name): source[name] for name in source.columns}
        index = getattr(source, "index", None)
        label = getattr(index, "name", None)
        if isinstance(label, str) and label not in arrays:  # pandas often keeps the times there
            arrays = {label: index, **arrays}
        return _from_arrays(arrays, "the frame")
    raise SpecError(
        f"read: {type(source).__name__} is no source; give a path to a .csv or .npz file, a pandas or polars "
        "frame, or a dictionary of arrays"
    )


def _open_file(path: Path) -> _Source:
    if not path.is_file():
        if path.exists():
            raise DataError(
                f"read: {os.fspath(path)!r} is not a regular file; give the path of a .csv or .npz"
            )
        here = [other.name for other in path.parent.iterdir()] if path.parent.is_dir() else []
        close = nearest(path.name, here).partition("there are")[0].strip()
        raise DataError(f"read: there is no file {os.fspath(path)!r}; {close or 'check the path'}")
    kind = path.suffix.lower()
    if kind == ".npz":
        try:
            with np.load(path, allow_pickle=False) as arrays:
                return _from_arrays(dict(arrays), path.name)
        except (OSError, ValueError) as problem:
            raise DataError(f"{path.name} cannot be read as .npz: {problem}") from None
    if kind not in ("", ".csv", ".tsv", ".txt", ".dat"):
        raise SpecError(f"read: {path.name}: files of kind {kind} are not read; convert it to .csv or .npz")
    text = read_delimited(path)
    return _Source(path.name, text.names, text.load, lambda row: f"line {text.line_numbers[row]}")


def _from_arrays(given: Mapping[Any, Any], label: str) -> _Source:
    arrays: dict[str, NDArray[Any]] = {}
    for key, values in given.items():
        array = np.asarray(values)
        if array.ndim == 1:
            arrays[str(key)] = array
        elif array.ndim == 2:
            if array.shape[0] > array.shape[1]:
                raise DataError(
                    f"{label}: {key!r} has shape {array.shape}, {array.shape[0]} channels of "
                    f"{array.shape[1]} "
                    "samples; give it as (channel, time), transposed"
                )
            arrays.update({f"{key}{k}": row for k, row in enumerate(array, start=1)})
    if not arrays:
        raise DataError(f"{label} holds no 1-D or 2-D array")

    def load(names: Sequence[str]) -> dict[str, F64]:
        loaded = {name: _numeric(arrays[name], name, label) for name in names}
        lengths = {name: len(values) for name, values in loaded.items()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise DataError(f"{label}: the columns differ in length ({listed}); all must be sampled alike")
        return loaded

    return _Source(label, tuple(arrays), load, lambda row: f"row {row}")


def _numeric(array: NDArray[Any], name: str, label: str) -> F64:
    if array.dtype.kind in "biuf":
        return np.asarray(array, dtype=np.float64)
    if array.dtype.kind in "mM":  # dates: seconds from the first
        return np.asarray((array - array[:1]) / np.timedelta64(1, "s"), dtype=np.float64)
    if array.dtype.kind == "c":
        raise DataError(f"{label}: column {name!r} is complex; give real and imaginary part as two columns")
    values = np.empty(len(array))
    for row, value in enumerate(array):
        found = number(str(value))
        if found is None:
            raise DataError(
                f"{label}, row {row}: column {name!r} holds {value!r} where a number is needed; correct or "
                "drop it"
            )
        values[row] = found
    return values


def _loadable(table: _Source) -> dict[str, F64 | None]:
    """Return every column, None for those that are text."""
    names = list(dict.fromkeys(table.names))
    try:
        return dict(table.load(names))
    except DataError:
        loaded: dict[str, F64 | None] = {}
        for name in names:
            try:
                loaded[name] = table.load([name])[name]
            except DataError:
                loaded[name] = None
        return loaded


# Names, units and times ---------------------------------------------------------------------------


def _roles(given: Channels | None, option: str) -> dict[str, str]:
    """Return {new name: name in the source}."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {str(new): str(old) for new, old in given.items()}
    names = [given] if isinstance(given, str) else [str(name) for name in given]
    if len(set(names)) < len(names):
        raise SpecError(f"read: {option} names a column twice: {', '.join(names)}")
    return {name: name for name in names}


def _refuse_unknown(table: _Source, name: str) -> None:
    if name not in table.names:
        raise SpecError(f"read: {table.label} has no column {name!r}; {nearest(name, table.names)}")
    if table.names.count(name) > 1:
        raise DataError(f"{table.label} has {table.names.count(name)} columns named {name!r}; rename them")


def _refuse_missing(table: _Source, name: str, values: F64) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        places = ", ".join(table.place(int(row)) for row in bad[:5]) + (", ..." if bad.size > 5 else "")
        raise DataError(
            f"{table.label}: column {name!r} has {bad.size} missing or infinite values ({places}); fill or "
            "cut these "
            "rows, or read the stretches between them as separate records"
        )


def _unit(name: str) -> str:
    """Return what stands in brackets at the end of a column's name."""
    match = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", name)
    return match[1].strip() if match else ""


def _time_word(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the unit, both in lower case: "TIME [s]", "t_s"."""
    unit = _unit(name)
    if unit:
        return re.split(r"[\[(]", name)[0].strip(" _").lower(), unit.lower()
    word, mark, tail = name.strip().lower().rpartition("_")
    return (word, tail) if mark and tail in SECONDS else (name.strip().lower(), "")


def _seconds(name: str) -> float:
    return SECONDS.get(_time_word(name)[1], 1.0)


def _time_candidates(table: _Source) -> list[str]:
    return [name for name in table.names if _time_word(name)[0] in ("t", "time", "timestamp", "elapsed time")]


def _guess_time(table: _Source) -> str:
    found = _time_candidates(table)
    if len(found) == 1:
        return found[0]
    problem = (
        f"several columns may be the time ({', '.join(found)})" if found else "no column is named t or time"
    )
    cure = "say which with time=" if found else "name it with time=, or give dt="
    raise SpecError(f"read: {table.label}: {problem}; {cure}. The columns are: {', '.join(table.names)}")


def _pace(times: F64) -> str:
    steps = np.diff(times)
    if not (steps.size and np.isfinite(times).all() and (steps > 0).all()):
        return "but it does not increase everywhere"
    usual = float(np.median(steps))
    gaps = int((steps > 1.5 * usual).sum())
    if gaps:
        return f"{gaps} gap{'s' * (gaps > 1)}, usual step {usual:.6g} s"
    step = even_step(times)
    return (
        f"uneven, steps {steps.min():.4g} to {steps.max():.4g} s"
        if step is None
        else f"even, dt = {step:.6g} s"
    )
