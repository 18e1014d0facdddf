"""Where numbers come from: versions, hashes of the samples, options, and the call that makes them again."""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Any

import numpy as np

from .._core import __version__
from ..records import Record
from .parts import Block, Facts, Grid, plain_table

__all__ = ["bare", "call", "hashes", "now", "versions"]


def now() -> str:
    """The moment, in universal time."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")


def versions() -> tuple[tuple[str, str], ...]:
    """Of what computed the numbers, and on what."""
    return (
        ("modfun", __version__),
        ("NumPy", np.__version__),
        ("Python", f"{platform.python_version()} ({platform.python_implementation()})"),
        ("Machine", f"{platform.system()}, {platform.machine()}"),
        ("Instruction set", os.environ.get("MODFUN_ISA", "") or "the widest of the processor (same numbers)"),
    )


def hashes(records: Sequence[Record]) -> list[Block]:
    """SHA-256 of each record's arrays, and of the file that it was read from."""
    rows = []
    for k, rec in enumerate(records):
        if rec.source is not None:
            rows.append((k, f"file {rec.source.name}", rec.source.sha256))
        for name in ("t", "y", "u", "mask", "sigma"):
            values = getattr(rec, name)
            if values is not None and values.size:
                shape = " × ".join(map(str, values.shape))
                rows.append((k, f"{name} ({shape}, {values.dtype})", _digest(values)))
    table: Grid = plain_table(
        ("record", "what", "SHA-256"),
        rows,
        "SHA-256 of the samples (bytes of the arrays as modfun holds them)",
    )
    return [table]


def _digest(values: Any) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def bare(command: str) -> str:
    """A command line without the folders of its files, which are nobody's business."""
    words = shlex.split(command)
    return shlex.join(PurePath(word).name if PurePath(word).is_absolute() else word for word in words)


def call(lines: Sequence[str]) -> Facts:
    """Lines of code or a command, to be copied."""
    return Facts((("To make it again", "\n".join(lines)),), code=True)
