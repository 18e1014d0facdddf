"""Named columns of a file, frame or data set, made alike, and what they say: roles, units, the time."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.names import listed
from ..base.samples import coarse_clock, even_step
from ..base.units import TIMES, counted_in, seconds_in
from ..errors import DataError, SpecError
from ..files.delimited import is_date, numbers

__all__ = [
    "DAY",
    "Columns",
    "Told",
    "are_serial",
    "dated",
    "doubtful_step",
    "from_arrays",
    "guess_time",
    "numeric",
    "pace",
    "refuse_other_step",
    "seconds_of",
    "since_1970",
    "time_candidates",
    "unit_of",
    "unit_of_times",
]


# Names of columns that are times, without their unit.
TIME_WORDS = frozenset(
    ("t", "time", "timestamp", "elapsed time", "utc", "gmt", "irig", "irig time", "zeit", "zeitstempel")
)
DAY = TIMES["d"][0]
OTHERWISE = ("d", "std", "tag")  # "t_d" is a delay, "t_std" a standard deviation, "time tag" an instant
# A name and its unit without brackets: "Zeit/min", "t_ms", "Time, s", "Zeit in Std".
GLUED = re.compile(r"(time|timestamp)(ms|us|ns)")  # the TimeUS of ArduPilot
BARE = re.compile(r"(.*?[^\s_/,])[\s_/,]+(?:in[\s_]+)?([^\s_/,]+)")
SERIAL = (20_000, 80_000)  # days
CLOCKS = (1e9, 2.2e9)  # seconds since 1970
FASTEST = 1e-4  # s: steps of slow systems are not below it
LOOSE = 0.02  # of a step: how far times that are rounded may be from it


@dataclass(frozen=True)
class Told:
    """What a source says of its columns beside their names; empty for most."""

    outputs: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    time: str | None = None
    dt: float | None = None  # beside a column of times: the step they were made with
    t0: float = 0.0
    units: Mapping[str, str] = field(default_factory=dict)
    intersample: Mapping[str, str] = field(default_factory=dict)
    functions: Mapping[str, str] = field(default_factory=dict)  # inputs that are known at all times, as text
    masked: bool = False  # nan in an output is a masked sample
    sigma: Mapping[str, str] = field(default_factory=dict)  # output: column


@dataclass(frozen=True)
class Columns:
    """Named columns, loaded when asked for."""

    label: str
    names: tuple[str, ...]
    load: Callable[[Sequence[str]], dict[str, F64]]
    place: Callable[[int], str] = "row {}".format  # what a row is called in messages
    told: Told = Told()


def from_arrays(
    given: Mapping[Any, Any], label: str, told: Told | None = None, marks: frozenset[str] = frozenset()
) -> Columns:
    """Return the columns of arrays by name: 1-D, or 2-D (channel, time); `marks` as in `numeric`."""
    arrays: dict[str, NDArray[Any]] = {}
    for key, values in given.items():
        try:
            array = np.asarray(values)
        except Exception as error:  # of whatever the conversion of an unknown object raises
            raise DataError(f"{label}: {key!r} cannot be read as an array ({error}); give numbers") from None
        if array.ndim == 1:
            arrays[str(key)] = array
        elif array.ndim == 2:
            if array.shape[0] > array.shape[1]:
                raise DataError(
                    f"{label}: {key!r} has shape {array.shape}, {array.shape[0]} channels of "
                    f"{array.shape[1]} samples; give it as (channel, time), transposed"
                )
            arrays.update({f"{key}{k}": row for k, row in enumerate(array, start=1)})
    if not arrays:
        raise DataError(f"{label} holds no 1-D or 2-D array")

    def load(names: Sequence[str]) -> dict[str, F64]:
        loaded = {name: numeric(arrays[name], name, label, marks) for name in names}
        lengths = {name: len(values) for name, values in loaded.items()}
        if len(set(lengths.values())) > 1:
            listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
            raise DataError(f"{label}: the columns differ in length ({listed}); all must be sampled alike")
        return loaded

    told = told or Told()
    dates = {name: "s" for name, array in arrays.items() if _of_dates(array)}
    return Columns(label, tuple(arrays), load, told=replace(told, units=dates | dict(told.units)))


def _of_dates(array: NDArray[Any]) -> bool:
    """Tell whether a column is of dates or times of day, which become seconds, also as text."""
    if array.dtype.kind in "mM":
        return True
    return bool(array.size and isinstance(array[0], str) and is_date(array[0]))


def numeric(array: NDArray[Any], name: str, label: str, marks: frozenset[str] = frozenset()) -> F64:
    """A column as numbers; dates as seconds from the first; `marks` are texts of missing values."""
    if array.dtype.kind in "biuf":
        return np.asarray(array, dtype=np.float64)
    if array.dtype.kind in "mM":
        return np.asarray((array - array[:1]) / np.timedelta64(1, "s"), dtype=np.float64)
    if array.dtype.kind == "c":
        raise DataError(f"{label}: column {name!r} is complex; give real and imaginary part as two columns")
    values, wrong = numbers([str(value) for value in array], marks)
    if wrong is not None:
        raise DataError(
            f"{label}, row {wrong}: column {name!r} holds {array[wrong]!r} where a number is needed; correct "
            f"or drop it, or give missing_values={str(array[wrong])!r} if it marks a missing value"
        )
    return values


# What names say -----------------------------------------------------------------------------------


def unit_of(name: str, told: Told | None = None) -> str:
    """Return the unit the source tells, or what stands in brackets at the end of a column's name."""
    if told is not None and name in told.units:
        return told.units[name]
    match = re.search(r"[\[(]([^\[\]()]+)[\])]\s*(?:#\d+)?$", name)
    return match[1].strip() if match else ""


def _time_word(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the unit, both in lower case: "TIME [s]", "t_s"."""
    word = re.sub(r"#\d+$", "", name.lower()).strip(" _")
    unit = unit_of(name).lower()
    if unit:
        return re.split(r"[\[(]", word)[0].strip(" _"), "" if unit in TIME_WORDS else unit  # "Time (UTC)"
    bare = GLUED.fullmatch(word) or BARE.fullmatch(word)
    if bare and seconds_in(bare[2]) and (bare[2] not in OTHERWISE or bare[1] == "zeit"):
        return bare[1], bare[2]
    return word, word if seconds_in(word) else ""


def unit_of_times(name: str, told: Told) -> str:
    """Return the unit that a source says of a column of times, empty where it says none."""
    return told.units.get(name, "").strip() or _time_word(name)[1]


def seconds_of(name: str, told: Told) -> float:
    """Return how many seconds the unit of a column of times is.

    Raises
    ------
    SpecError
        A unit that is not known.
    """
    unit = unit_of_times(name, told)
    seconds = seconds_in(unit) if unit else 1.0
    if seconds is None:
        raise SpecError(
            f"read: the times {name!r} are in {unit!r}, which is no known unit of time; say in which "
            f"they are, units={{{name!r}: 's'}}, or {', '.join(map(repr, list(TIMES)[1:]))} in place of 's'"
        )
    return seconds


def time_candidates(table: Columns) -> list[str]:
    """Return the columns that look like times by their names.

    One in another unit, such as ``T [C]``, is a time in an unknown unit only where no other may be one.
    """
    if table.told.time is not None:
        return [table.told.time]
    named = [name for name in table.names if _time_word(name)[0] in TIME_WORDS]
    units = {name: unit_of_times(name, table.told) for name in named}
    return [name for name in named if not units[name] or seconds_in(units[name]) is not None] or named


def guess_time(table: Columns, named: Sequence[str] = ()) -> str:
    """Return the one column of times that is not named as a channel: T is often a temperature."""
    found = [name for name in time_candidates(table) if name not in named]
    if len(found) == 1:
        return found[0]
    problem = (
        f"several columns may be the time ({', '.join(found)})" if found else "no column is named t or time"
    )
    cure = "say which with time=" if found else "name it with time=, or give dt="
    raise SpecError(f"read: {table.label}: {problem}; {cure}. The columns are: {listed(table.names)}")


def dated(table: Columns, pair: Sequence[str]) -> tuple[Columns, str]:
    """Return the columns with times made of a column of dates and one of times of day, and their name.

    Raises
    ------
    SpecError
        If they are not two columns of the table, or not such columns.
    """
    if len(pair) != 2 or not set(pair) <= set(table.names):
        raise SpecError(
            f"read: time={list(pair)!r}: give one column, or that of the date and that of the time of day; "
            f"the columns are: {listed(table.names)}"
        )
    day, clock = pair
    name = f"{day} {clock}"

    def load(names: Sequence[str]) -> dict[str, F64]:
        found = table.load([*dict.fromkeys([*(own for own in names if own != name), *pair])])
        days, times = found[day], found[clock]
        wrong = day if np.any(days % DAY) else clock if table.told.units.get(clock) != "s" else ""
        if wrong or table.told.units.get(day) != "s":
            raise SpecError(
                f"read: time={list(pair)!r}: {wrong or day!r} is no column of "
                f"{'times of day, 14:05:36' if wrong == clock else 'dates, 2026-03-01'}; give date, then time"
            )
        seconds = days + times % DAY  # times of day went on over midnight
        return {own: found[own] for own in names if own != name} | {name: seconds - seconds[:1]}

    told = replace(table.told, units={**table.told.units, name: "s"})
    return replace(table, names=(*table.names, name), load=load, told=told), name


def refuse_other_step(table: Columns, dt: float, used: Sequence[str]) -> None:
    """Refuse a step that a column of times contradicts, unless the column is used for something else."""
    for name in time_candidates(table):
        if name in used:
            continue
        try:
            times = table.load([name])[name] * seconds_of(name, table.told)
        except (DataError, SpecError):  # text, or an unknown unit
            continue
        steps = np.diff(times)
        if not steps.size or not np.all(steps >= 0):  # nan too
            continue
        usual, mean = float(np.median(steps)), float(np.mean(steps))
        if coarse := coarse_clock(times):  # too coarse to be given instead
            if abs(coarse[1] - dt) > LOOSE * dt:
                raise SpecError(
                    f"read: dt={dt:g}, but the times {name!r} of {table.label} stand still for {coarse[0]} "
                    f"rows each, of {coarse[1]:.6g} s; give dt={coarse[1]:.6g}, or keep={name!r} if it is no "
                    "time"
                )
            continue
        if min(abs(usual - dt), abs(mean - dt)) > LOOSE * dt:
            raise SpecError(
                f"read: dt={dt:g}, but the times {name!r} of {table.label} have steps of {usual:g} s; give "
                f"time={name!r} instead of dt (units={{{name!r}: 'ms'}} where they are no seconds), or drop "
                f"this column, or keep={name!r} if it is no time"
            )


def doubtful_step(times: F64, name: str, told: Told) -> tuple[float, str] | None:
    """Return the usual step of times without a unit that may not be seconds, and the unit they may have.

    Whole numbers with steps of 2 or more may be milli-, micro- or nanoseconds, unless they are seconds since
    1970 or minutes, and serial dates are days.
    """
    if unit_of_times(name, told) or times.size < 2 or not np.isfinite(times).all():
        return None
    steps = np.diff(times)
    usual = float(np.median(steps))
    if not np.any(times != np.rint(times)):
        unit = None if since_1970(times) else counted_in(usual)
        return (usual, unit) if unit else None
    mean = float(np.mean(steps))  # of dates with few decimals the usual step is coarse
    if are_serial(times) and (0 < usual < FASTEST or any(map(_whole_of_days, (usual, mean)))):
        return usual, "d"
    return None


def are_serial(days: F64) -> bool:
    """Tell whether numbers may be the days from 1900 on that spreadsheets count, of 1954 to 2119."""
    return bool(days.size and days.min() > SERIAL[0] and days.max() < SERIAL[1])


def since_1970(seconds: F64) -> bool:
    """Tell whether numbers may be seconds since 1970, as clocks of computers count, of 2001 to 2039."""
    return bool(seconds.size and seconds.min() > CLOCKS[0] and seconds.max() < CLOCKS[1])


def _whole_of_days(step: float) -> bool:
    """Tell whether a step in days is a multiple of ten seconds; those of seconds of the day seldom are."""
    seconds = DAY * step
    return 5 < seconds < 900 and abs(seconds - 10 * round(seconds / 10)) < 1e-3 * seconds


def pace(times: F64) -> str:
    """Say how even times in seconds are."""
    if times.size < 2 or not np.isfinite(times).all() or not (times[1:] > times[:-1]).all():
        coarse = coarse_clock(times) if np.isfinite(times).all() else None
        return (
            f"but {coarse[0]} rows each have the same: give dt={coarse[1]:.6g} instead"
            if coarse
            else "but it does not increase everywhere"
        )
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
