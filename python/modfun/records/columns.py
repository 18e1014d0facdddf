"""What the names of columns say: units, and which column is the time."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from ..base.samples import even_step
from ..base.tables import listed
from ..errors import SpecError
from .sources import Source, Told

__all__ = ["SECONDS", "guess_time", "pace", "seconds_of", "time_candidates", "unit_of"]

F64 = NDArray[np.float64]

SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "milliseconds": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "microseconds": 1e-6,
    "ns": 1e-9,
    "nanoseconds": 1e-9,
    "min": 60.0,
    "minutes": 60.0,
    "h": 3600.0,
    "hours": 3600.0,
    "days": 86400.0,
    "weeks": 604800.0,
}


def unit_of(name: str, told: Told | None = None) -> str:
    """Return the unit the source tells, or what stands in brackets at the end of a column's name."""
    if told is not None and name in told.units:
        return told.units[name]
    match = re.search(r"[\[(]([^\[\]()]+)[\])]\s*$", name)
    return match[1].strip() if match else ""


def _time_word(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the unit, both in lower case: "TIME [s]", "t_s"."""
    unit = unit_of(name)
    if unit:
        return re.split(r"[\[(]", name)[0].strip(" _").lower(), unit.lower()
    word, mark, tail = name.strip().lower().rpartition("_")
    return (word, tail) if mark and tail in SECONDS else (name.strip().lower(), "")


def seconds_of(name: str, told: Told) -> float:
    """Return how many seconds the unit of a column of times is."""
    return SECONDS.get(told.units.get(name, "").strip().lower() or _time_word(name)[1], 1.0)


def time_candidates(table: Source) -> list[str]:
    """Return the columns that look like times by their names."""
    if table.told.time is not None:
        return [table.told.time]
    return [name for name in table.names if _time_word(name)[0] in ("t", "time", "timestamp", "elapsed time")]


def guess_time(table: Source) -> str:
    """Return the one column of times."""
    found = time_candidates(table)
    if len(found) == 1:
        return found[0]
    problem = (
        f"several columns may be the time ({', '.join(found)})" if found else "no column is named t or time"
    )
    cure = "say which with time=" if found else "name it with time=, or give dt="
    raise SpecError(f"read: {table.label}: {problem}; {cure}. The columns are: {listed(table.names)}")


def pace(times: F64) -> str:
    """Say how even times in seconds are."""
    if times.size < 2 or not np.isfinite(times).all() or not (times[1:] > times[:-1]).all():
        return "but it does not increase everywhere"
    steps = np.diff(times)
    usual = float(np.median(steps))
    gaps = int((steps > 1.5 * usual).sum())
    if gaps:
        return f"{gaps} gap{'s' * (gaps > 1)}, usual step {usual:.6g} s"
    step = even_step(times)
    return (
        f"uneven, steps {steps.min():.4g} to {steps.max():.4g} s"
        if step is None
        else f"even, dt = {step:.6g} s"
    )
