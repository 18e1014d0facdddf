"""Whatever has named columns, opened: files, frames, data sets and dictionaries of arrays."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from ..base.arrays import F64
from ..base.names import nearest
from ..base.optional import optional
from ..base.writing import refuse_large
from ..errors import DataError, SpecError
from ..files.delimited import Delimited, read_delimited
from ..files.excel import read_excel
from .columns import Columns, Told, from_arrays, numeric
from .labelled import open_frame, open_xarray, told_of_frame
from .matlab import open_mat

__all__ = ["open_columns"]

KINDS = ".csv, .xlsx, .npz, .mat, .parquet or .feather"
PANDAS = "PANDAS_ATTRS"  # where a .parquet file keeps the attrs of a frame


def open_columns(source: Any, part: str | None = None, marks: frozenset[str] = frozenset()) -> Columns:
    """Return the columns of a file, frame, data set or mapping.

    `part` is for .mat and .xlsx files, `marks` are texts of missing values, in lower case.
    """
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        _refuse_absent(path)
        if path.suffix.lower() == ".mat":
            return open_mat(path, part)
        if path.suffix.lower() == ".xlsx":
            return _of_text(path.name, read_excel(path, part), marks)
    if part is not None:
        raise SpecError(
            f"read: part={part!r} is for .mat files that hold several structs and .xlsx files of several "
            "sheets; leave it out"
        )
    if isinstance(source, str | os.PathLike):
        return _open_file(path, marks)
    if hasattr(source, "dims") and hasattr(source, "coords"):
        return open_xarray(source)
    if isinstance(source, Mapping):
        return from_arrays(source, "the dictionary", marks=marks)
    if hasattr(source, "columns") and hasattr(source, "__getitem__"):
        return open_frame(source, "the frame", getattr(source, "attrs", None), marks)
    raise SpecError(
        f"read: {type(source).__name__} is not a source; give a path to a {KINDS} file, a pandas or polars "
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


def _open_file(path: Path, marks: frozenset[str]) -> Columns:
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
        return from_arrays(arrays, path.name, marks=marks)
    if kind == ".parquet":
        return _open_parquet(path, marks)
    if kind == ".feather":
        return _open_feather(path, marks)
    if kind == ".nc":
        raise SpecError(f"read: {path.name}: give xarray.open_dataset({path.name!r}) instead of the file")
    unpacked = Path(path.stem).suffix.lower() if kind == ".gz" else kind
    if unpacked not in ("", ".csv", ".tsv", ".txt", ".dat"):
        raise SpecError(f"read: {path.name}: files of kind {kind} are not read; convert it to {KINDS}")
    return _of_text(path.name, read_delimited(path), marks)


def _of_text(label: str, text: Delimited, marks: frozenset[str]) -> Columns:
    text = replace(text, marks=marks)
    told = Told(units=text.units)
    return Columns(label, text.names, text.load, lambda row: f"line {text.line_numbers[row]}", told)


def _open_parquet(path: Path, marks: frozenset[str]) -> Columns:
    """Columns by pyarrow, or by polars where only that is installed."""
    alone = find_spec("pyarrow") is None and find_spec("polars") is not None
    reader = optional("polars" if alone else "pyarrow.parquet", "parquet", f"reading {path.name}")
    try:
        if alone:
            attrs = json.loads(reader.read_parquet_metadata(path).get(PANDAS, "{}"))
            return open_frame(reader.read_parquet(path), path.name, attrs, marks)
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
        return {name: numeric(values, name, path.name, marks) for name, values in arrays.items()}

    told = told_of_frame(attrs, schema.names)
    kinds = zip(schema.names, map(str, schema.types), strict=True)
    dates = {name: "s" for name, kind in kinds if kind.startswith(("timestamp", "date", "duration"))}
    told = replace(told, units=dates | dict(told.units))
    return Columns(path.name, tuple(schema.names), load, told=told)


def _open_feather(path: Path, marks: frozenset[str]) -> Columns:
    """Columns by pyarrow, or by polars where only that is installed."""
    alone = find_spec("pyarrow") is None and find_spec("polars") is not None
    reader = optional("polars" if alone else "pyarrow.feather", "parquet", f"reading {path.name}")
    try:
        frame = reader.read_ipc(path) if alone else reader.read_table(path)
        names = frame.columns if alone else frame.column_names
        arrays = {name: frame[name].to_numpy() for name in names}
    except Exception as problem:  # each reader has its own
        raise _damaged(path, problem) from None
    return from_arrays(arrays, path.name, marks=marks)


def _damaged(path: Path, problem: Exception) -> DataError:
    said = str(problem).partition("\n")[0] or type(problem).__name__
    return DataError(
        f"{path.name} cannot be read as {path.suffix.lower()} ({said}); it is damaged, cut short or of "
        "another kind: write it again, or give a .csv"
    )
