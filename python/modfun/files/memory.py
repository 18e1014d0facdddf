"""How much memory there is, asked before a file or an option takes all of it."""

from __future__ import annotations

from pathlib import Path

from ..errors import DataError

__all__ = ["available", "refuse_large"]


def available() -> int | None:
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
    free = available()
    if free is not None and size > free:
        raise DataError(
            f"{what} unpacks to {size / 2**30:.1f} GiB and {free / 2**30:.1f} GiB of memory are free; check "
            "where the file comes from, or write the columns that are needed to a file of their own"
        )
