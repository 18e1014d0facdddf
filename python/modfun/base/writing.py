"""Files written whole or not at all, and memory asked for before a file or an option takes all of it."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import DataError, ModfunError, SpecError

__all__ = ["SCRATCH", "memory", "named", "refuse_large", "unwritten", "write", "write_text"]

SCRATCH = ".writing"  # end of the name of a file that is not all there


def write(path: Path, data: bytes) -> None:
    """Write a file under a temporary name, flush it to the disk, rename it; folders are made.

    Raises
    ------
    OSError
        The disk does not take it; what was there before is still there.
    """
    scratch = path.with_name(f".{path.name}.{os.getpid()}.{os.urandom(4).hex()}{SCRATCH}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(scratch, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(scratch, path)
    finally:  # Ctrl-C, too, leaves nothing behind
        with suppress(OSError):
            scratch.unlink()
    with suppress(OSError):  # some file systems do not flush a directory
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def named(what: str, path: Any) -> Path:
    """The place that a user named."""
    try:
        return Path(path)
    except TypeError:
        raise SpecError(f"{what}: the file is {path!r}; give its name as a text or a Path") from None


def write_text(what: str, path: str | os.PathLike[str], text: str) -> None:
    """Write a file that a user named; `what` begins the message.

    Raises
    ------
    SpecError
        There is no such folder.
    ModfunError
        It cannot be written; what was there before is still there.
    """
    place = Path(os.path.realpath(named(what, path)))  # of a link the file it leads to
    try:
        if place.exists() and not place.is_file():  # /dev/stdout, a pipe
            place.write_text(text, encoding="utf-8")
            return
        if not place.parent.is_dir():
            raise SpecError(
                f"{what}: {str(path)!r} cannot be written, there is no folder {str(place.parent)!r}; make it "
                "first, or name another place"
            )
        mode = place.stat().st_mode if place.exists() else None
        write(place, text.encode())
        if mode is not None:
            place.chmod(mode & 0o7777)
    except OSError as error:
        raise unwritten(what, Path(path), error, "make room, or give another place") from error


def unwritten(what: str, path: Path, error: OSError, cure: str) -> ModfunError:
    """The error for a file that the disk does not take."""
    return ModfunError(f"{what}: {str(path)!r} cannot be written ({error.strerror or error}); {cure}")


def memory() -> int | None:
    """Bytes of memory that may still be used, where the system tells."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError):
        return None


def refuse_large(what: str, size: int) -> None:
    """Refuse to unpack more than there is room for.

    Raises
    ------
    DataError
        With both sizes.
    """
    free = memory()
    if free is not None and size > free:
        raise DataError(
            f"{what} unpacks to {size / 2**30:.1f} GiB and {free / 2**30:.1f} GiB of memory are free; check "
            "where the file comes from, or write the columns that are needed to a file of their own"
        )
