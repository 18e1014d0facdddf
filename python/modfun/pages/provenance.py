"""Where numbers come from: versions, hashes of the samples, options, and the call that makes them again."""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Any

import numpy as np

from .._core import __version__
from ..base.samples import Origin
from .parts import Block, Facts, plain_table

__all__ = ["bare", "call", "hashes", "hashes_of_gains", "now", "versions"]

AS_HELD = "(bytes of the arrays as modfun holds them)"


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


def hashes(records: Iterable[tuple[Origin | None, Mapping[str, Any]]]) -> list[Block]:
    """SHA-256 of each record's arrays by name, and of the file that it was read from."""
    rows = []
    for k, (source, arrays) in enumerate(records):
        if source is not None:
            rows.append((k, f"file {source.name}", source.sha256))
        for name, values in arrays.items():
            if values is not None and values.size:
                shape = " × ".join(map(str, values.shape))
                rows.append((k, f"{name} ({shape}, {values.dtype})", _digest(values)))
    return [plain_table(("record", "what", "SHA-256"), rows, f"SHA-256 of the samples {AS_HELD}")]


def hashes_of_gains(arrays: Mapping[str, Any]) -> list[Block]:
    """SHA-256 of frequencies, gains and their covariance, by name."""
    rows = [(name, _digest(values)) for name, values in arrays.items() if values is not None]
    return [plain_table(("what", "SHA-256"), rows, f"SHA-256 of the gains {AS_HELD}")]


def _digest(values: Any) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def bare(command: str) -> str:
    """A command line without the folders of its files, which are nobody's business."""
    words = shlex.split(command)
    return shlex.join(PurePath(word).name if PurePath(word).is_absolute() else word for word in words)


def call(lines: Sequence[str]) -> Facts:
    """Lines of code or a command, to be copied."""
    return Facts((("To make it again", "\n".join(lines)),), code=True)
