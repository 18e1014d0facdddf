"""The variables of .mat files of all versions as plain values.

Arrays are squeezed as MATLAB shapes them, texts are str, cells are lists (column after column), structs are
dictionaries, arrays of structs lists of them; what only MATLAB can open is an `Opaque`.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.optional import optional
from ..base.writing import refuse_large
from ..errors import DataError

__all__ = ["Opaque", "load_mat"]

HDF5 = b"\x89HDF\r\n\x1a\n"
# Kinds of elements of versions 5 to 7.
MATRIX, COMPRESSED = 14, 15
PLAIN = {1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18}  # numbers and texts
NESTING = {1, 2, 3, 16, 17}  # classes of matrices that hold matrices: cell, struct, object, function, opaque


@dataclass(frozen=True)
class Opaque:
    """A value that cannot be read, by its class in MATLAB."""

    kind: str


def load_mat(path: Path) -> dict[str, Any]:
    """Return the variables of a file, version 4 to 7.3.

    Raises
    ------
    DataError
        If the file is damaged, cut short or no .mat file.
    ImportError
        If it is of version 7.3 and h5py is absent; the message says how to install it.
    """
    with path.open("rb") as file:
        head = file.read(520)
    hdf5 = HDF5 in (head[:8], head[512:])
    h5py = optional("h5py", "mat", f"reading {path.name} (a .mat file of version 7.3)") if hdf5 else None
    try:
        return _load_hdf5(path, h5py) if hdf5 else _load_old(path)
    except DataError:
        raise
    except Exception as problem:  # SciPy and h5py raise a dozen kinds for damaged files
        said = str(problem).splitlines()[0] if str(problem) else type(problem).__name__
        raise DataError(
            f"{path.name} cannot be read as .mat ({said}); it is damaged, cut short or of another kind: save "
            "it again in MATLAB, save run.mat -v7, or give a .csv"
        ) from None


# Versions 4 to 7 ----------------------------------------------------------------------------------


def _load_old(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat, matlab

    content = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(content[126:128])
    if order:
        _refuse_damaged(memoryview(content)[128:], order, PLAIN | {MATRIX, COMPRESSED})
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = loadmat(path, squeeze_me=True, chars_as_strings=True)
    for warning in said:  # SciPy goes on after a variable that it could not read
        if "nreadable" in str(warning.message):
            raise ValueError(str(warning.message))
    return {
        _text(value["s0"]) if isinstance(value, matlab.MatlabOpaque) else name: _plain(value)
        for name, value in found.items()
        if not name.startswith("__")
    }


def _refuse_damaged(content: memoryview, order: str, kinds: set[int]) -> None:
    """Look at each element's kind and length: SciPy looks up kinds unchecked, which ends the process."""
    at = 0
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        start = at + 8
        if kind >> 16:  # up to four bytes stand in the tag itself
            kind, size, start = kind & 0xFFFF, kind >> 16, at + 4
        if kind not in kinds or size > (4 if start == at + 4 else len(content) - start):
            raise ValueError(f"an element of kind {kind} and {size} bytes")
        inner = content[start : start + size]
        if kind == COMPRESSED:
            _refuse_damaged(memoryview(zlib.decompress(inner)), order, PLAIN | {MATRIX})
        elif kind == MATRIX:
            nests = size < 12 or struct.unpack_from(f"{order}I", inner, 8)[0] & 0xFF in NESTING
            _refuse_damaged(inner, order, PLAIN | {MATRIX} if nests else PLAIN)
        length = start + size - at
        at += length if kind == COMPRESSED else length + -length % 8


def _plain(value: Any) -> Any:
    from scipy.io import matlab

    if isinstance(value, matlab.MatlabOpaque):
        return Opaque(_text(value["s2"]))
    if isinstance(value, matlab.MatlabFunction):
        return Opaque("function_handle")
    if isinstance(value, np.void):
        value = np.asarray(value)
    if not isinstance(value, np.ndarray):
        return (
            value
            if isinstance(value, str)
            else Opaque("sparse")
            if hasattr(value, "tocsc")
            else np.asarray(value)
        )
    if value.dtype.names:
        structs = [{name: _plain(one[name]) for name in value.dtype.names} for one in value.ravel(order="F")]
        return structs[0] if len(structs) == 1 else structs
    if value.dtype.kind == "O":
        cells = [_plain(one) for one in value.ravel(order="F")]
        return cells[0] if value.ndim == 0 else cells
    if value.dtype.kind in "US":
        return [str(text) for text in value.ravel(order="F")] if value.ndim else str(value)
    return value


def _text(value: Any) -> str:
    found = np.ravel(value)[0] if np.size(value) else ""
    return found.decode() if isinstance(found, bytes) else str(found)


# Version 7.3: HDF5, with axes in the other order -------------------------------------------------------


def _load_hdf5(path: Path, h5py: Any) -> dict[str, Any]:
    with h5py.File(path, "r") as file:
        return {name: _item(value, file, h5py) for name, value in file.items() if not name.startswith("#")}


def _item(item: Any, file: Any, h5py: Any) -> Any:
    kind = _text(item.attrs.get("MATLAB_class", b"double"))
    if "MATLAB_sparse" in item.attrs:
        return Opaque("sparse")
    if "MATLAB_object_decode" in item.attrs and kind not in ("struct", "cell"):
        return Opaque(kind)
    if isinstance(item, h5py.Group):
        fields = {name: _item(value, file, h5py) for name, value in item.items()}
        bare = [isinstance(one, h5py.Dataset) and "MATLAB_class" not in one.attrs for one in item.values()]
        if bare and all(bare):  # an array of structs keeps bare references, one per struct, by field
            return [dict(zip(fields, values, strict=True)) for values in zip(*fields.values(), strict=True)]
        return fields
    if item.attrs.get("MATLAB_empty", 0):
        return "" if kind == "char" else [] if kind == "cell" else np.zeros(0)
    refuse_large(f"{Path(file.filename).name}: {item.name}", item.nbytes)
    values = item[()]
    if item.dtype == h5py.ref_dtype:
        return [_item(file[reference], file, h5py) for reference in np.ravel(values)]
    if kind == "char":
        rows = ["".join(map(chr, row)) for row in np.atleast_2d(values.T)]
        return rows[0] if len(rows) == 1 else rows
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    return np.squeeze(values.T) if values.dtype.kind in "biufc" else Opaque(kind)
