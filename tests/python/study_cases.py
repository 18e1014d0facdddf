"""Studies for the tests of engines and directories, and what a function in another process needs."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import modfun as mf
import numpy as np
from modfun.study.work import CHUNK, Work

FIGURES = (
    "bias", "bias_mcse", "sd", "sd_mcse", "rmse", "rmse_mcse", "median", "median_mcse", "coverage",
    "coverage_mcse", "failures", "nit",
)  # fmt: skip


def study(**changes: Any) -> mf.MonteCarlo:
    """Two systems of different order and two noise levels."""
    given: dict[str, Any] = {
        "system": {"two": mf.tf([5], [1, 3, 8]), "one": mf.tf([1], [1, 1])}, "input": "sin(t**2/5)",
        "duration": 10.0, "intervals": 64, "nsr": [0.1, 0.4], "estimators": ["ls", "ml"],
        "initial_state": "random", "replicates": 5 * CHUNK + 100, "seed": 3,
    } | changes  # fmt: skip
    if "ml" in given["estimators"]:
        given.setdefault("harmonics", 6)
    return mf.MonteCarlo(**given)


def quick_study(replicates: int) -> mf.MonteCarlo:
    """One cell by least squares: most of the work is writing."""
    return study(replicates=replicates, nsr=0.1, system=mf.tf([1], [1, 1]), estimators=["ls"], harmonics=6)


def small_parts(monkeypatch: Any) -> None:
    """Parts of one chunk, so that short studies have several."""
    monkeypatch.setattr("modfun.study.work.PART", 1.0)


def same(one: mf.Results, two: mf.Results) -> bool:
    """Whether all numbers are the same bits."""
    pairs = [(getattr(one, name), getattr(two, name)) for name in FIGURES]
    if one.samples is not None or two.samples is not None:
        pairs.append((one.samples, two.samples))
    return one.replicates == two.replicates and all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def part_size(made: mf.MonteCarlo) -> int:
    """Replicates of a part."""
    return Work(made.plan, "samples", True, False).part


def made_parts(place: Path) -> int:
    """Parts in a directory."""
    return len(list((place / "parts").glob("*.part"))) if (place / "parts").exists() else 0


def wait_for(place: Path, parts: int) -> None:
    """Wait until a directory holds so many parts."""
    deadline = time.monotonic() + 30
    while made_parts(place) < parts:
        assert time.monotonic() < deadline
        time.sleep(0.001)


def mine(rec: mf.Record, rng: np.random.Generator) -> mf.Fit:
    """An estimator of a user."""
    if rng.random() < 0.05:
        raise RuntimeError("bad day")
    return mf.fit(rec, mf.TransferFunction(poles=rec.y.size % 2 or 1, zeros=0), method="ls", harmonics=6)


def dies(rec: mf.Record, rng: np.random.Generator) -> list[float]:
    """Takes its process with it."""
    os._exit(1)


def backwards(function: Any, items: Iterable[Any]) -> Iterator[Any]:
    """A map-like function that gives the last result first."""
    return map(function, reversed(list(items)))


def dies_once(rec: mf.Record, rng: np.random.Generator) -> list[float]:
    """Takes its process with it, unless that has happened in this folder."""
    if rec.y[0, -1] > 0 and not Path("dead").exists():
        Path("dead").touch()
        os._exit(1)
    return [1.0, float(rec.y[0, -1])]
