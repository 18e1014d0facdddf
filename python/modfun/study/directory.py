"""A study in a directory: its description, a manifest and one file a part, each checked when it is read.

A study may be killed at any moment, and several processes may work in one directory: files appear whole,
everybody looks before a part is begun, and the same part has the same numbers whoever made it.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import STREAM_VERSION, __version__
from ..base.arrays import F64
from ..errors import DataError, ModfunWarning, SpecError
from .files import SampleFile, alone, append, made, packed, read_part, swept, unpacked, write, write_part
from .frozen import freeze, thaw
from .plan import Plan
from .tally import Tally
from .work import Part, Work, parts

__all__ = ["FILE", "MANIFEST", "OWN", "SAMPLES", "Directory", "drawn_there"]


KIND, SCHEMA = "modfun.study", 1
STUDY, TRUTH, MANIFEST, PARTS, SAMPLES = "study.json", "truth.npz", "manifest.json", "parts", "samples.npy"
RUNS, FILE = "runs.jsonl", "study.toml"
OWN = {STUDY, TRUTH, MANIFEST, PARTS, SAMPLES, RUNS, FILE}


class Directory:
    """Parts of one study on disk; made by `open` (to run) or `read` (to look).

    Attributes
    ----------
    path : Path
    manifest : dict
        Hash of the study, replicates of a part, replicates wanted so far, versions, checksums.
    samples : SampleFile or None
        Estimates, where they are to be kept.
    """

    def __init__(self, path: Path, manifest: dict[str, Any]) -> None:
        self.path, self.manifest = path, manifest
        self.samples: SampleFile | None = None

    @classmethod
    def open(cls, path: str | Path, work: Work) -> Directory:
        """The directory of a study about to run, made if it is not there.

        Raises
        ------
        SpecError
            Another study's directory, or one with other files.
        DataError
            A damaged manifest.
        ModfunError
            The disk does not take the files.
        """
        place = Path(path)
        if not (place / MANIFEST).exists():
            _unused(place, "run")
        arrays: dict[str, NDArray[Any]] = {}
        described = json.dumps({"plan": freeze(work.plan, arrays), "draw": work.draw}).encode()
        files = {STUDY: described, TRUTH: packed(arrays)}
        made(place)
        with alone(place):
            if (place / MANIFEST).exists():
                found = cls(place, _manifest(place))
                found._check(work)
            else:
                found = cls(place, _described(work))
            known = found.manifest.get("files", {})
            for name, data in files.items():
                if known.get(name) != _digest(place / name):
                    write(place / name, data)
            found.manifest["files"] = {name: _digest(place / name) for name in files}
            found._save()
        for folder in (place, place / PARTS):
            swept(folder)
        if work.samples:
            found.samples = SampleFile(place / SAMPLES, work.plan.shape)
        return found

    @classmethod
    def read(cls, path: str | Path) -> Directory:
        """The directory of a study that was run.

        Raises
        ------
        SpecError
            No directory of a study.
        DataError
            A damaged manifest.
        """
        place = Path(path)
        if not (place / MANIFEST).is_file():
            raise SpecError(f"{str(place)!r} is no directory of a study: it has no {MANIFEST}")
        return cls(place, _manifest(place))

    @classmethod
    def copied(cls, path: str | Path, other: Directory, samples: bool) -> Directory:
        """A directory of the same study as another's, made if it is not there; parts are not copied."""
        place = Path(path)
        if (place / MANIFEST).exists():
            found = cls.read(place)
            if found.manifest["study"] != other.manifest["study"]:
                raise SpecError(f"merge: {str(place)!r} and {str(other.path)!r} hold different studies")
        else:
            _unused(place, "merge")
            other.study()  # checked
            for name in (STUDY, TRUTH):
                write(place / name, (other.path / name).read_bytes())
            found = cls(place, other.manifest | {"replicates": 0})
            found._save()
        if samples:
            found.samples = SampleFile(place / SAMPLES, other.study()[0].shape)
        return found

    # Replicates --------------------------------------------------------------------------------------

    @property
    def replicates(self) -> int:
        """Replicates wanted so far."""
        return int(self.manifest["replicates"])

    @property
    def parts(self) -> Iterator[Part]:
        """All parts of the replicates wanted so far."""
        return parts(self.manifest["part"], self.replicates)

    def want(self, replicates: int) -> None:
        """Want at least so many replicates; a directory never shrinks."""
        with alone(self.path):
            now = _manifest(self.path)["replicates"]  # another process may want more
            self.manifest["replicates"] = max(replicates, self.replicates, now)
            if self.replicates > now:
                self._save()
            if self.samples is not None:
                self.samples.grow(self.replicates)

    def missing(self) -> list[Part]:
        """Parts that are not there, or damaged."""
        return [part for part in self.parts if not self.holds(part)]

    # Parts -------------------------------------------------------------------------------------------

    def damaged(self, left: Sequence[Part]) -> Iterator[str]:
        """Files of missing parts that are there and are no part of this study."""
        for part in left:
            path = self._file(part.number)
            if path.exists() and self._part(part.number) is None:
                yield str(path)

    def written(self, part: Part) -> float:
        """When the file of a part was written, s since 1970."""
        return self._file(part.number).stat().st_mtime

    def holds(self, part: Part) -> bool:
        """Whether this very part is there, undamaged, with its estimates if they are to be kept."""
        found = self._part(part.number)
        if found is None or found[0] != part:
            return False
        if self.samples is None:
            return True
        digest = found[1]["samples"].tobytes()
        return bool(digest) and digest == self.samples.digest(part)

    def load(self, part: Part) -> Tally:
        """A part that is there."""
        found = self._part(part.number)
        if found is None or found[0] != part:
            raise DataError(
                f"part {part.number} of {str(self.path)!r} is missing or damaged; run the study again with "
                "this directory= to make it again"
            )
        del found[1]["samples"]
        return Tally.of(found[1])

    def save(self, part: Part, tally: Tally) -> None:
        """Keep a part, unless a longer one is there already."""
        digest = b""
        if self.samples is not None and tally.samples is not None:
            self.samples.put(part.first, tally.samples)
            digest = self.samples.digest(part) or b""
        arrays = tally.arrays() | {"samples": np.frombuffer(digest, np.uint8)}
        with alone(self.path):
            found = self._part(part.number)
            if found is None or found[0].replicates <= part.replicates:
                write_part(self._file(part.number), self.manifest["study"], part, arrays)

    def take(self, part: Part, other: Directory) -> bool:
        """Copy a part from another directory of this study, if it is there."""
        if self.samples is not None:
            other.samples = SampleFile(other.path / SAMPLES, self.samples.sizes)
        if not other.holds(part):
            return False
        tally = other.load(part)
        if other.samples is not None:
            rows = other.samples.rows(part.first + part.replicates)
            tally = replace(tally, samples=rows[part.first :])
        self.save(part, tally)
        written = other.written(part)
        os.utime(self._file(part.number), (written, written))
        return True

    def sampled(self, plan: Plan, *, check: bool) -> F64 | None:
        """Estimates (replicate, group, level, estimator, parameter) mapped from the file, if all are in.

        A run has looked at them part by part; who only reads the directory lets them be checked.
        """
        file = SampleFile(self.path / SAMPLES, plan.shape)
        for part in self.parts:
            found = self._part(part.number)
            if found is None or found[1]["samples"].size == 0:
                return None
            if check and file.digest(part) != found[1]["samples"].tobytes():
                raise DataError(
                    f"{str(file.path)!r} is missing or damaged at replicates {part.first} to "
                    f"{part.first + part.replicates - 1}; run the study again with this directory= and "
                    'keep="samples", it makes only these'
                )
        return file.rows(self.replicates)

    def _part(self, number: int) -> tuple[Part, dict[str, NDArray[Any]]] | None:
        return read_part(self._file(number), self.manifest["study"], number, self.manifest["part"])

    def _file(self, number: int) -> Path:
        return self.path / PARTS / f"{number:08d}.part"

    # Who made it -------------------------------------------------------------------------------------

    def note(self, **said: Any) -> None:
        """Add a line on a run that begins: when, by which command and versions, and what is said."""
        versions = {"modfun": __version__, "python": platform.python_version(), "numpy": np.__version__}
        begun = datetime.now(UTC).isoformat(timespec="seconds")
        machine = f"{platform.system()} {platform.machine()}"
        self._append(
            {"begun": begun, "command": shlex.join(sys.argv), **said, **versions, "machine": machine}
        )

    def notes(self) -> list[dict[str, Any]]:
        """What was noted on the runs so far; lines cut short by a crash are left out."""
        found = []
        path = self.path / RUNS
        for line in path.read_text(errors="replace").splitlines() if path.exists() else []:
            with suppress(ValueError):
                found.append(json.loads(line))
        return [note for note in found if isinstance(note, dict)]

    def adopt(self, other: Directory) -> None:
        """Take over what was noted on another directory's runs, and its study file if there is none here."""
        known = self.notes()
        for note in other.notes():
            if note not in known:
                self._append(note)
        if (other.path / FILE).is_file() and not (self.path / FILE).exists():
            write(self.path / FILE, (other.path / FILE).read_bytes())

    def _append(self, note: dict[str, Any]) -> None:
        append(self.path / RUNS, json.dumps(note).encode() + b"\n")

    # Description -------------------------------------------------------------------------------------

    def study(self) -> tuple[Plan, str]:
        """The study as it was laid out, and how its noise was drawn."""
        for name in (STUDY, TRUTH):
            if _digest(self.path / name) != self.manifest["files"][name]:
                raise DataError(
                    f"{str(self.path / name)!r} is damaged or missing; run the study again with this "
                    "directory=, which writes it anew and keeps the parts"
                )
        arrays = unpacked((self.path / TRUTH).read_bytes())
        told = json.loads((self.path / STUDY).read_text())
        plan: Plan = thaw(told["plan"], arrays)
        return plan, told["draw"]

    def _check(self, work: Work) -> None:
        """Refuse another study, with what differs."""
        own = _described(work)
        if self.manifest["study"] != own["study"]:
            differ = [
                f"{name} {self.manifest.get(name)!r} there, {own[name]!r} here"
                for name in ("seed", "draw", "coverage", "streams")
                if self.manifest.get(name) != own[name]
            ]
            raise SpecError(
                f"run: {str(self.path)!r} holds another study ("
                f"{'; '.join(differ) or 'other signals, noise levels, estimators or functions'}); give this "
                "one a directory of its own"
            )
        if self.manifest["modfun"] != own["modfun"]:
            warnings.warn(
                f"run: {str(self.path)!r} was begun with modfun {self.manifest['modfun']}, this is "
                f"{own['modfun']}; parts made now may differ in the last bits",
                ModfunWarning,
                stacklevel=5,
            )

    def _save(self) -> None:
        told = self.manifest | {"sum": _sum(self.manifest)}
        write(self.path / MANIFEST, json.dumps(told, indent=1).encode())


def _described(work: Work) -> dict[str, Any]:
    return {
        "kind": KIND, "schema": SCHEMA, "study": work.key, "seed": work.plan.seed, "draw": work.draw,
        "coverage": work.coverage, "part": work.part, "streams": STREAM_VERSION,
        "modfun": __version__, "replicates": 0,
    }  # fmt: skip


def drawn_there(path: str | Path) -> str | None:
    """How noise was drawn in a directory, where a study is kept there."""
    place = Path(path)
    return str(_manifest(place)["draw"]) if (place / MANIFEST).exists() else None


def _manifest(place: Path) -> dict[str, Any]:
    """The manifest of a directory, checked."""
    path = place / MANIFEST
    try:
        found = json.loads(path.read_bytes())
        sound = found["kind"] == KIND and found["sum"] == _sum(found)
        why = "its checksum does not match"
    except (OSError, ValueError, KeyError, TypeError) as error:
        sound, why = False, str(error)
    if not sound:
        raise DataError(
            f"{str(path)!r} is damaged ({why}); parts know their study by themselves: delete this file, and "
            "run the study again with this directory="
        )
    if found["schema"] != SCHEMA:
        raise DataError(
            f"{str(path)!r} has schema {found['schema']!r} (modfun {found.get('modfun')}), this version "
            f"reads {SCHEMA}; install that modfun"
        )
    checked: dict[str, Any] = found
    return checked


def _unused(place: Path, what: str) -> None:
    """Refuse a place that holds something else than a study."""
    if place.exists() and not place.is_dir():
        raise SpecError(f"{what}: {str(place)!r} is a file; name a directory for the study")
    listed = os.listdir(place) if place.exists() else []
    others = sorted(name for name in listed if name not in OWN and not name.startswith("."))
    if others:
        raise SpecError(
            f"{what}: {str(place)!r} holds {', '.join(others[:3])}{', …' if len(others) > 3 else ''}, which "
            "no study wrote; give the study a directory of its own"
        )


def _sum(manifest: dict[str, Any]) -> str:
    told = {name: value for name, value in manifest.items() if name != "sum"}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def _digest(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""
