"""Sources of samples: whatever has named columns, made alike for `read` and `columns`."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from ..base.optional import optional
from ..base.tables import nearest
from ..errors import DataError, SpecError
from ..files.delimited import number, read_delimited
from ..files.memory import refuse_large

__all__ = ["ATTRS", "Source", "Told", "from_arrays", "open_source"]

F64 = NDArray[np.float64]

KINDS = ".csv, .npz, .mat or .parquet"
ATTRS = "modfun"  # where a pandas frame keeps what a record knows beside the samples
PANDAS = "PANDAS_ATTRS"  # where a .parquet file keeps the attrs of a frame


@dataclass(frozen=True)
class Told:
    """What a source says of its columns beside their names; empty for most."""

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    time: str | None = None
    dt: float | None = None  # beside a column of times: the step they were made with
    t0: float = 0.0
    units: Mapping[str, str] = field(default_factory=dict)
    intersample: Mapping[str, str] = field(default_factory=dict)
    masked: bool = False  # nan in an output is a masked sample
    sigma: Mapping[str, str] = field(default_factory=dict)  # output: column


@dataclass(frozen=True)
class Source:
    """Named columns, loaded when asked for."""

    label: str
    names: tuple[str, ...]
    load: Callable[[Sequence[str]], dict[str, F64]]
    place: Callable[[int], str] = "row {}".format  # what a row is called in messages
    told: Told = Told()


def open_source(source: Any, part: str | None = None) -> Source:
    """Return the columns of a file, frame, data set or mapping; `part` is for .mat files."""
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        _refuse_absent(path)
        if path.suffix.lower() == ".mat":
            from .matlab import open_mat

            return open_mat(path, part)
    if part is not None:
        raise SpecError(f"read: part={part!r} is for .mat files that hold several structs; leave it out")
    if isinstance(source, str | os.PathLike):
        return _open_file(path)
    if hasattr(source, "dims") and hasattr(source, "coords"):
        from .labelled import open_xarray

        return open_xarray(source)
    if isinstance(source, Mapping):
        return from_arrays(source, "the dictionary")
    if hasattr(source, "columns") and hasattr(source, "__getitem__"):
        return _open_frame(source, "the frame", getattr(source, "attrs", None))
    raise SpecError(
        f"read: {type(source).__name__} is no source; give a path to a {KINDS} file, a pandas or polars "
        "frame, an xarray object, or a dictionary of arrays"
    )


def _refuse_absent(path: Path) -> None:
    # os.path says False where Path raises: of a name that is too long, or holds a zero byte.
    if os.path.isfile(path):
        return
    if os.path.exists(path):
        raise DataError(f"read: {os.fspath(path)!r} is not a regular file; give the path of a {KINDS}")
    here = [other.name for other in path.parent.iterdir()] if os.path.isdir(path.parent) else []
    close = nearest(path.name, here).partition("there are")[0].strip()
    raise DataError(f"read: there is no file {os.fspath(path)!r}; {close or 'check the path'}")


def _open_file(path: Path) -> Source:
    kind = path.suffix.lower()
    if kind == ".npz":
        try:
            with ZipFile(path) as packed:
                refuse_large(path.name, sum(one.file_size for one in packed.infolist()))
            with path.open("rb") as file, np.load(file, allow_pickle=False) as held:
                arrays = dict(held)
        except DataError:
            raise
        except Exception as problem:  # NumPy, zipfile and zlib have their own for damaged files
            raise _damaged(path, problem) from None
        return from_arrays(arrays, path.name)
    if kind == ".parquet":
        return _open_parquet(path)
    if kind == ".nc":
        raise SpecError(f"read: {path.name}: give xarray.open_dataset({path.name!r}) instead of the file")
    if kind not in ("", ".csv", ".tsv", ".txt", ".dat"):
        raise SpecError(f"read: {path.name}: files of kind {kind} are not read; convert it to {KINDS}")
    text = read_delimited(path)
    told = Told(units=text.units)
    return Source(path.name, text.names, text.load, lambda row: f"line {text.line_numbers[row]}", told)


def _open_parquet(path: Path) -> Source:
    """Columns by pyarrow, or by polars where only that is installed."""
    alone = find_spec("pyarrow") is None and find_spec("polars") is not None
    reader = optional("polars" if alone else "pyarrow.parquet", "parquet", f"reading {path.name}")
    try:
        if alone:
            attrs = json.loads(reader.read_parquet_metadata(path).get(PANDAS, "{}"))
            return _open_frame(reader.read_parquet(path), path.name, attrs)
        schema = reader.read_schema(path)
        attrs = json.loads((schema.metadata or {}).get(PANDAS.encode(), b"{}"))
    except Exception as problem:  # each reader has its own
        raise _damaged(path, problem) from None

    def load(names: Sequence[str]) -> dict[str, F64]:
        try:
            with reader.ParquetFile(path) as file:
                table = file.read(columns=list(names))
            arrays = {name: table[name].to_numpy() for name in names}
        except Exception as problem:
            raise _damaged(path, problem) from None
        return {name: _numeric(values, name, path.name) for name, values in arrays.items()}

    return Source(path.name, tuple(schema.names), load, told=_told(attrs, schema.names))


def _damaged(path: Path, problem: Exception) -> DataError:
    said = str(problem).partition("\n")[0] or type(problem).__name__
    return DataError(
        f"{path.name} cannot be read as {path.suffix.lower()} ({said}); it is damaged, cut short or of "
        "another kind: write it again, or give a .csv"
    )


def _open_frame(frame: Any, label: str, attrs: Any) -> Source:
    arrays = {str(name): frame[name] for name in frame.columns}
    name = getattr(getattr(frame, "index", None), "name", None)
    if isinstance(name, str) and name not in arrays:  # pandas often keeps the times there
        arrays = {name: frame.index, **arrays}
    return from_arrays(arrays, label, _told(attrs, arrays))


def _told(attrs: Any, names: Any) -> Told:
    """What `Record.to_pandas` wrote, of the columns that are still there."""
    about = attrs.get(ATTRS) if isinstance(attrs, dict) else None
    if not isinstance(about, dict):
        return Told()

    def there(role: str) -> tuple[str, ...]:
        return tuple(name for name in about.get(role, ()) if name in names)

    return Told(
        outputs=there("outputs"),
        inputs=there("inputs"),
        kept=there("kept"),
        time=about["time"] if about.get("time") in names else None,
        dt=about.get("dt"),
        units=about.get("units", {}),
        intersample=about.get("intersample", {}),
        masked=about.get("masked", False),
        sigma={name: column for name, column in about.get("sigma", {}).items() if column in names},
    )


def from_arrays(given: Mapping[Any, Any], label: str, told: Told | None = None) -> Source:
    """Return the columns of arrays by name: 1-D, or 2-D (channel, time)."""
    arrays: dict[str, NDArray[Any]] = {}
    for key, values in given.items():
        try:
            array = np.asarray(values)
        except Exception as error:  # of whatever the conversion of an unknown object raises
            raise DataError(f"{label}: {key!r} cannot be read as an array ({error}); give numbers") from None
        if array.ndim == 1:
            arrays[str(key)] = array
        elif array.ndim == 2:
            if array.shape[0] > array.shape[1]:
                raise DataError(
                    f"{label}: {key!r} has shape {array.shape}, {array.shape[0]} channels of "
                    f"{array.shape[1]} samples; give it as (channel, time), transposed"
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

    return Source(label, tuple(arrays), load, told=told or Told())


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
