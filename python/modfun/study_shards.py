"""Directories of studies after the run: loaded, looked at, and several of shards made one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .errors import DataError, SpecError
from .study_directory import SAMPLES, Directory
from .study_results import Results
from .study_run import collected

__all__ = ["Status", "load", "merge", "status"]


@dataclass(frozen=True)
class Status:
    """How far a study in a directory is.

    Attributes
    ----------
    parts, missing : int
        Parts of the replicates wanted so far, and those not there or damaged.
    replicates, done : int
        Replicates wanted so far, and those in parts that are there.
    """

    parts: int
    missing: int
    replicates: int
    done: int


def status(directory: str | Path) -> Status:
    """How far the study in a directory is; every part is checked.

    Raises
    ------
    SpecError, DataError
        No directory of a study, or a damaged manifest.
    """
    store = Directory.read(directory)
    missing = store.missing()
    lost = sum(part.replicates for part in missing)
    return Status(len(list(store.parts)), len(missing), store.replicates, store.replicates - lost)


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
    return collected(store, plan, draw, samples=True)


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
    for part in target.missing():
        for source in sources:
            if target.take(part, source):
                break
    return status(out)
