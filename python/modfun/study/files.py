"""Files of a study directory: written whole or not at all, and checked to the last bit when read."""

from __future__ import annotations

import hashlib
import io
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
from numpy.lib.format import write_array
from numpy.typing import NDArray

from ..base import writing as whole
from ..base.arrays import F64
from ..base.writing import SCRATCH
from ..errors import ModfunError
from .work import Part

__all__ = [
    "SampleFile",
    "alone",
    "append",
    "made",
    "packed",
    "read_part",
    "swept",
    "unpacked",
    "write",
    "write_part",
]

OLD = 3600.0  # s after which a file under a temporary name was left by a process that was killed
HEADER = 128  # bytes before the numbers of a sample file, enough for any number of replicates


def write(path: Path, data: bytes) -> None:
    """Write a file of a study whole.

    Raises
    ------
    ModfunError
        The disk does not take it; what was there before is still there.
    """
    try:
        whole.write(path, data)
    except OSError as error:
        raise _unwritten(path, error) from error


def append(path: Path, line: bytes) -> None:
    """Add a line to a file that several processes may write.

    Raises
    ------
    ModfunError
        The disk does not take it.
    """
    try:
        with open(path, "ab", buffering=0) as file:
            file.write(line)
    except OSError as error:
        raise _unwritten(path, error) from error


def made(folder: Path) -> None:
    """Make a folder, if it is not there.

    Raises
    ------
    ModfunError
        It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritten(folder, error) from error


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep others from changing what is read here and then written; a killed process leaves no lock.

    Where there are no such locks, two runs that want different numbers of replicates may forget one of them
    for the directory; parts are never lost.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    locked = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # some network file systems
            fcntl.flock(locked, fcntl.LOCK_EX)
        yield
    finally:
        os.close(locked)


def swept(folder: Path) -> None:
    """Remove what processes that were killed while they wrote left in a folder long ago."""
    for path in folder.glob(f".*.*{SCRATCH}"):
        with suppress(OSError):
            if time.time() - path.stat().st_mtime > OLD:
                path.unlink()


def packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Arrays by name as bytes, the same for the same arrays."""
    buffer = io.BytesIO()
    with ZipFile(buffer, "w") as archive:  # np.savez of NumPy before 2.1 takes allow_pickle for an array
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                write_array(file, np.asanyarray(array), allow_pickle=False)
    return buffer.getvalue()


def unpacked(data: bytes) -> dict[str, NDArray[Any]]:
    """What `packed` was given."""
    with np.load(io.BytesIO(data), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


# Parts -------------------------------------------------------------------------------------------


def write_part(path: Path, study: str, part: Part, arrays: Mapping[str, NDArray[Any]]) -> None:
    """One line that says what it is and what its bytes must be, then the arrays."""
    payload = packed(arrays)
    write(path, _title(study, part, payload) + payload)


def read_part(path: Path, study: str, number: int, size: int) -> tuple[Part, dict[str, NDArray[Any]]] | None:
    """Part and arrays, or None where the file is missing, damaged, cut short, or of something else."""
    try:
        data = path.read_bytes() if path.is_file() else b""  # of a pipe one would wait for ever
    except OSError:
        return None
    title, _, payload = data.partition(b"\n")
    try:
        part = Part(number, number * size, int(title.split()[-2]))
    except (ValueError, IndexError):
        return None
    if title + b"\n" != _title(study, part, payload):
        return None
    return part, unpacked(payload)


def _title(study: str, part: Part, payload: bytes) -> bytes:
    what = f"modfun part 2 {study} {part.number} {part.replicates}".encode()
    return b"%s %s\n" % (what, hashlib.sha256(what + payload).hexdigest().encode())


# Estimates ---------------------------------------------------------------------------------------


class SampleFile:
    """A .npy file of estimates (replicate, …) that grows part by part and is never in memory."""

    def __init__(self, path: Path, sizes: tuple[int, ...]) -> None:
        self.path, self.sizes = path, sizes
        self._row = 8 * int(np.prod(sizes))

    def grow(self, rows: int) -> None:
        """Make place for so many replicates; it never shrinks."""
        try:
            with open(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666), "r+b") as file:
                size = os.fstat(file.fileno()).st_size
                rows = max(rows, (size - HEADER) // self._row)
                file.truncate(HEADER + rows * self._row)
                file.write(self._header(rows))
        except OSError as error:
            raise _unwritten(self.path, error) from error

    def put(self, first: int, samples: F64) -> None:
        """Write the replicates from `first` on, through to the disk."""
        data = np.ascontiguousarray(samples, "<f8").data.cast("B")
        try:
            with open(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666), "r+b", buffering=0) as file:
                at = HEADER + first * self._row
                while data:
                    done = os.pwrite(file.fileno(), data, at)
                    at, data = at + done, data[done:]
                os.fsync(file.fileno())
        except OSError as error:
            raise _unwritten(self.path, error) from error

    def rows(self, count: int) -> F64:
        """The first replicates, mapped from the file."""
        return np.memmap(self.path, "<f8", "r", offset=HEADER, shape=(count, *self.sizes))

    def digest(self, part: Part) -> bytes | None:
        """Checksum of a part's estimates; None where they are not all there."""
        try:
            with open(self.path, "rb") as file:
                file.seek(HEADER + part.first * self._row)
                data = file.read(part.replicates * self._row)
        except OSError:
            return None
        return hashlib.sha256(data).digest() if len(data) == part.replicates * self._row else None

    def _header(self, rows: int) -> bytes:
        words = {"descr": "<f8", "fortran_order": False, "shape": (rows, *self.sizes)}
        text = repr(words).encode().ljust(HEADER - 11) + b"\n"
        return b"\x93NUMPY\x01\x00" + (HEADER - 10).to_bytes(2, "little") + text


def _unwritten(path: Path, error: OSError) -> ModfunError:
    what = "move it away" if path.is_dir() else "make room or allow writing"
    cure = f"parts finished before are kept: {what}, and run again to go on"
    return whole.unwritten("run", path, error, cure)
