"""Directories of studies after the run: loaded, looked at, and several of shards made one."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import DataError, SpecError
from ..records.record import Record
from .directory import SAMPLES, Directory
from .replicate import replicate as made_again
from .results import Results
from .run import collected, far_from, summed
from .work import Part

__all__ = ["Status", "load", "merge", "replicate", "status"]

LAST, FEWEST = 50, 3  # parts whose times of writing tell the pace


@dataclass(frozen=True)
class Status:
    """How far a study in a directory is.

    Attributes
    ----------
    parts, missing : int
        Parts of the replicates wanted so far, and those not there or damaged.
    replicates, done : int
        Replicates wanted so far, and those in parts that are there.
    left : tuple of Part
        The missing parts.
    damaged : tuple of str
        Files of parts that are no longer what was written.
    rate, idle : float or None
        Replicates a second over the parts written last, and seconds since then; None where too few tell.
    until : dict of str to float, or None
        Monte Carlo errors that the last run was to reach, if all parts are there and they are not reached.
    """

    parts: int
    missing: int
    replicates: int
    done: int
    left: tuple[Part, ...] = field(default=(), compare=False)
    damaged: tuple[str, ...] = ()
    rate: float | None = field(default=None, compare=False)
    idle: float | None = field(default=None, compare=False)
    until: dict[str, float] | None = None

    @property
    def complete(self) -> bool:
        """Whether nothing is left to be done."""
        return self.done == self.replicates > 0 and self.until is None


def status(directory: str | Path) -> Status:
    """How far the study in a directory is; every part is checked.

    Raises
    ------
    SpecError, DataError
        No directory of a study, or a damaged manifest.
    """
    store = Directory.read(directory)
    left = store.missing()
    gone = {part.number for part in left}
    kept = [part for part in store.parts if part.number not in gone]
    rate, idle = _pace(store, kept)
    return Status(
        parts=len(kept) + len(left),
        missing=len(left),
        replicates=store.replicates,
        done=sum(part.replicates for part in kept),
        left=tuple(left),
        damaged=tuple(store.damaged(left)),
        rate=rate,
        idle=idle,
        until=_unreached(store) if kept and not left else None,
    )


def _unreached(store: Directory) -> dict[str, float] | None:
    """The limits of the last run's `until`, where one is not reached."""
    limits: dict[str, float] | None = next((note.get("until") for note in reversed(store.notes())), None)
    return limits if limits and far_from(summed(store), store.study()[0], limits) > 1 else None


def _pace(store: Directory, kept: Sequence[Part]) -> tuple[float | None, float | None]:
    """Replicates a second over the last parts written, and seconds since the last; None where unknown."""
    written = sorted((store.written(part), part.replicates) for part in kept)[-LAST:]
    if not written:
        return None, None
    idle = max(time.time() - written[-1][0], 0.0)
    span = written[-1][0] - written[0][0]
    made = sum(replicates for _, replicates in written[1:])
    return (made / span if len(written) >= FEWEST and span > 0 else None), idle


def load(directory: str | Path) -> Results:
    """Results of a study that was run with `directory`.

    Parameters
    ----------
    directory : str or Path

    Returns
    -------
    Results
        As `MonteCarlo.run` gave them, `replicate` and kept samples included.

    Raises
    ------
    SpecError
        No directory of a study.
    DataError
        Parts are missing or damaged; run the study again to make them.
    """
    store = Directory.read(directory)
    missing = store.missing()
    if missing:
        raise DataError(
            f"load: {len(missing)} of {len(list(store.parts))} parts of {str(store.path)!r} are missing or "
            "damaged; run the study again with this directory=, it makes only these"
        )
    plan, draw = store.study()
    return collected(store, plan, draw, store.sampled(plan, check=True))


def replicate(directory: str | Path, number: int, cell: Mapping[str, Any]) -> tuple[Record, dict[str, Any]]:
    """A replicate of the study in a directory, as `Results.replicate`, whether its part is there or not."""
    store = Directory.read(directory)
    plan, draw = store.study()
    return made_again(plan, draw, store.replicates, number, cell)


def merge(out: str | Path, directories: Sequence[str | Path]) -> Status:
    """Bring the parts of several directories of one study together, as those of shards on several machines.

    Parameters
    ----------
    out : str or Path
        Directory that gets them: a new one, or one of the same study.
    directories : sequence of str or Path
        Where they are; they stay as they are.

    Returns
    -------
    Status
        How far the study is now; `load` gives its results when no part is missing.

    Raises
    ------
    SpecError
        No directory, or directories of different studies.
    DataError
        A damaged manifest or description.
    """
    if not directories:
        raise SpecError("merge: no directories were given; name those of the shards")
    sources = [Directory.read(place) for place in directories]
    first = sources[0]
    for other in sources[1:]:
        if other.manifest["study"] != first.manifest["study"]:
            raise SpecError(f"merge: {str(first.path)!r} and {str(other.path)!r} hold different studies")
    target = Directory.copied(out, first, all((source.path / SAMPLES).exists() for source in sources))
    target.want(max(source.replicates for source in sources))
    for source in sources:
        target.adopt(source)
    for part in target.missing():
        for source in sources:
            if target.take(part, source):
                break
    return status(out)
