"""From files, frames and dictionaries to records."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict, Unpack, overload

import numpy as np
from numpy.typing import ArrayLike

from ..base.arguments import public
from ..base.arrays import F64
from ..base.names import listed, nearest
from ..base.samples import EVEN, Origin, even_step
from ..base.tables import Table
from ..base.units import TIMES, seconds_in
from ..errors import DataError, ModfunWarning, SpecError
from .codes import code_in
from .columns import (
    DAY,
    Columns,
    Told,
    are_serial,
    dated,
    doubtful_step,
    guess_time,
    pace,
    refuse_other_step,
    seconds_of,
    since_1970,
    time_candidates,
    unit_of,
    unit_of_times,
)  # fmt: skip
from .gaps import held, marks_of, refuse_missing, refuse_other_word
from .mask import Mask, mask_of
from .opening import open_columns
from .record import Record

__all__ = ["columns", "read"]

Channels = str | Sequence[str] | Mapping[str, str]
PerOutput = str | Mapping[str, str]


class Words(TypedDict, total=False):
    """The options of `read`."""

    outputs: Channels | None
    inputs: Channels | None
    time: str | Sequence[str] | None
    keep: Channels | None
    dt: float | None
    units: Mapping[str, str] | None
    intersample: str | Sequence[str] | Mapping[str, str] | None
    mask: PerOutput | None
    sigma: PerOutput | None
    missing: str
    missing_values: str | Sequence[str] | None
    part: str | None


@overload
def read(source: list[Any] | tuple[Any, ...], **options: Unpack[Words]) -> list[Record]: ...
@overload
def read(
    source: str | os.PathLike[str] | Mapping[str, ArrayLike] | Any, **options: Unpack[Words]
) -> Record: ...
@public
def read(
    source: str | os.PathLike[str] | Mapping[str, ArrayLike] | Any,
    *,
    outputs: Channels | None = None,
    inputs: Channels | None = None,
    time: str | Sequence[str] | None = None,
    keep: Channels | None = None,
    dt: float | None = None,
    units: Mapping[str, str] | None = None,
    intersample: str | Sequence[str] | Mapping[str, str] | None = None,
    mask: PerOutput | None = None,
    sigma: PerOutput | None = None,
    missing: str = "refuse",
    missing_values: str | Sequence[str] | None = None,
    part: str | None = None,
) -> Record | list[Record]:
    """Make a Record from a file, a frame or a dictionary of arrays, or several from a list of these.

    Parameters
    ----------
    source : path, frame or mapping, or a list of these
        A text file (.csv, .tsv, .txt, .dat, and these with .gz; columns separated by comma, semicolon, tab
        or blanks; see Notes), an .xlsx file (extra ``excel``), an .npz file of arrays, a .mat file (extra
        ``mat`` for version 7.3), a .parquet or .feather file (extra ``parquet``), a frame with ``columns``
        (pandas, polars), an xarray.Dataset or DataArray, or arrays by name.
    outputs, inputs : str, sequence of str or mapping
        Columns by name, or ``{new name: name in the source}``. Both may be left out where the source says
        them itself: an exported iddata, what `Record.to_pandas` and `Record.to_xarray` made.
    time : str or two of them, optional
        Column of times, increasing. It is converted to seconds where its name says the unit, as in
        ``TIME [ms]``, ``t_ms`` or ``Zeit/min``; an unknown unit in brackets is refused.
        ``["Date", "Time"]`` are two columns, of dates and of times of day. Default: the one column named t
        or time (with or without a unit) that is no channel, unless `dt` is given.
    keep : str, sequence of str or mapping, optional
        Further columns to carry along, such as an event marker for `Record.split`.
    dt : float, optional
        Sampling interval in seconds, instead of a column of times. Where there is one with other steps, dt is
        refused, unless the column is kept as a channel.
    units : mapping of str to str, optional
        Units by (new) channel name; default: what the source says, or what stands in brackets in the
        column's name. That of the column of times is what it is converted from: ``{"t": "ms"}``.
    intersample : optional
        How the inputs go between samples, as in `Record`; default: what the source says, or "auto".
    mask : str or mapping of str to str, optional
        Column that is 1, true or good where a sample of the outputs counts, 0, false, bad or empty where it
        is left out; ``{output: column}`` for some outputs only.
    sigma : str or mapping of str to str, optional
        Column of the relative noise of each sample, for all outputs or by output.
    missing : {"refuse", "mask", "hold"}, default "refuse"
        What to do with missing and infinite values: "mask" leaves those of outputs out; "hold" does, too,
        and inputs and columns to keep have their last value there. Elsewhere they are refused.
    missing_values : str or sequence of str, optional
        Texts that mark missing values beside the usual ones (see Notes), such as "Out of range"; whatever
        their case.
    part : str, optional
        Which struct of a .mat file, ``"z2"``, which experiment of an iddata, ``"Exp2"`` or
        ``"z2.Exp2"``, or which sheet of an .xlsx file, where there are several.

    Returns
    -------
    Record, or list of Record
        A list where the source is one.

    Raises
    ------
    DataError
        If the file is missing, empty or ragged, or a column that is used holds text or gaps; the message
        names lines.
    SpecError
        If a column does not exist (the message lists the nearest), or the time is not clear.

    Warns
    -----
    ModfunWarning
        Where times without a unit are whole numbers with steps of 2 or more, as milliseconds and
        microseconds are, or look like the serial dates of spreadsheets, which are days.

    See Also
    --------
    modfun.columns : What is in a file.
    modfun.Record : Records of arrays.

    Notes
    -----
    In text files and sheets, empty lines and lines that begin with # or % are skipped, the first line names
    the columns (if it is all numbers, the comment above it does, as numpy.savetxt writes it, or they are
    ``column1``, ``column2``, ...), a line below it without a number holds the units. Times of day,
    ``14:05:36.02`` or ``325:14:05:36.02`` with the day before, become seconds, and go on over midnight;
    dates, ``2026-03-01T14:05:36.02Z``, ``1.3.2026 14:05`` or ``3/1/2026 2:05 PM``, and seconds since 1970
    become seconds from the first. Decimal commas are read where another mark separates the columns; points
    of such a file are thousands marks, 1.040 is 1040, and a column whose points may be either is refused.
    Lines of a title above the names, of fewer fields, are skipped. Columns of one name are ``q#1``,
    ``q#2``, ... Empty fields, ``nan``, ``n/a``, ``-``, and words of bad quality such as ``Bad``, ``No Data``,
    ``I/O Timeout`` and ``#NV`` are missing values.
    An .npz file or mapping may hold arrays (channel, time): ``y`` gives the columns ``y1``, ``y2``, ...; in
    a .mat file the longer axis is time. An iddata object must be saved as a struct, ``s = get(z)``. Fields
    of other structs are columns ``struct.field``.

    References
    ----------
    The guide docs/howto/read_file.md.

    Examples
    --------
    >>> import numpy as np
    >>> t = 0.1 * np.arange(50)
    >>> rec = read({"t": t, "Q (deg/s)": np.sin(t)}, outputs={"q": "Q (deg/s)"})
    >>> rec.outputs, rec.units["q"], round(rec.dt, 6)
    (('q',), 'deg/s', 0.1)
    """
    if time is not None and dt is not None:
        raise SpecError(f"read: give time={time!r} or dt={dt!r}, not both")
    refuse_other_word(missing)
    if isinstance(source, list | tuple):
        if not source:
            raise SpecError("read: the list of sources is empty; give at least one file")
        words: Words = {
            "outputs": outputs, "inputs": inputs, "time": time, "keep": keep, "dt": dt, "units": units,
            "intersample": intersample, "mask": mask, "sigma": sigma, "missing": missing,
            "missing_values": missing_values, "part": part,
        }  # fmt: skip
        each: Sequence[Mapping[str, Any]] = source  # or whatever else is read
        return [read(one, **words) for one in each]
    table = open_columns(source, part, marks_of(missing_values))
    if time is not None and not isinstance(time, str):
        table, time = dated(table, time)
    told = table.told
    if outputs is None and not told.outputs:
        raise SpecError(f"read: say with outputs= which of the columns they are: {listed(table.names)}")
    out = _roles(told.outputs if outputs is None else outputs, "outputs")
    into = _roles(_left(told.inputs, out) if inputs is None else inputs, "inputs")
    kept = _roles(_left(told.kept, out, into) if keep is None else keep, "keep")
    named = {new: name for role in (out, into, kept) for new, name in role.items()}
    clock = _clock_of(table, list(named.values())) if time is None and dt is None else time
    good = _per_output(mask, out, "mask")
    trust = _per_output(sigma, out, "sigma")
    if sigma is None:
        trust = {new: told.sigma[name] for new, name in out.items() if name in told.sigma}
    if units and (key := _clock_in(units, table, clock, named)):
        name, word = key
        table, units = _timed(table, name, units[word]), {n: u for n, u in units.items() if n != word}
        told = table.told
    complete = [*([] if clock is None else [clock]), *into.values(), *kept.values()]
    wanted = list(dict.fromkeys([*complete, *good.values(), *out.values(), *trust.values()]))
    for name in wanted:
        _refuse_unknown(table, name)
    if isinstance(dt, int | float) and dt > 0:
        refuse_other_step(table, dt, wanted)
    values = table.load(wanted)
    values |= {name: np.nan_to_num(values[name], nan=0.0) for name in {*good.values()} - {*complete}}
    may_miss = () if missing == "refuse" and not told.masked else (*out.values(), *trust.values())
    holds = {*into.values(), *kept.values()} - {clock}
    if missing == "hold":
        values |= {name: held(values[name]) for name in holds}
    for name in wanted:
        if name in complete or name not in may_miss:
            role = "output" if name in out.values() else "held" if name in holds else ""
            refuse_missing(table, name, values[name], role, missing)
    count = len(values[wanted[0]]) if wanted else 0
    ok = _mask(values, out, good, count)
    forms = {new: told.intersample[name] for new, name in into.items() if name in told.intersample}
    if clock is not None and (doubt := doubtful_step(values[clock], clock, told)) is not None:
        step, unit = doubt
        word = "days, as the dates of spreadsheets" if unit == "d" else TIMES[unit][1][-2]
        warnings.warn(
            f"read: {table.label}: {clock!r} has no unit and steps of {step:g}, which are taken as seconds; "
            f"if they are {word}, give units={{{clock!r}: {unit!r}}}, else units={{{clock!r}: 's'}}",
            ModfunWarning,
            stacklevel=3,
        )
    record = Record(
        y=np.reshape([values[name] for name in out.values()], (len(out), count)),
        u=np.reshape([values[name] for name in into.values()], (len(into), count)) if into else None,
        **_sampling(table, values, clock, dt),
        outputs=tuple(out),
        inputs=tuple(into),
        units={**{new: u for new, name in named.items() if (u := unit_of(name, told))}, **(units or {})},
        intersample=forms if intersample is None else intersample,
        keep={new: values[name] for new, name in kept.items()},
        mask=ok,
        sigma=[values[trust[new]] if new in trust else np.ones(count) for new in out] if trust else None,
    )
    if isinstance(source, str | os.PathLike):
        record = record._like(source=_origin(Path(source)))
    if clock is not None and (unit_of_times(clock, told) or since_1970(values[clock])):
        record = record._like(_timed=True)
    if texts := {new: told.functions[name] for new, name in into.items() if name in told.functions}:
        record = record._like(_functions=texts)
    if clock is not None and record.dt is not None and record.dt == told.dt and record._lost is None:
        return record._like(t=values[clock] * seconds_of(clock, told))  # as written, to the last bit
    return record


def _origin(path: Path) -> Origin:
    with open(path, "rb") as file:
        return Origin(path.name, hashlib.file_digest(file, "sha256").hexdigest())


@public
def columns(
    source: str | os.PathLike[str] | Mapping[str, ArrayLike] | Any, *, part: str | None = None
) -> Table:
    """List the columns of a source that `read` takes.

    Parameters
    ----------
    source : path, frame or mapping
        As in `read`.
    part : str, optional
        As in `read`.

    Returns
    -------
    Table
        ``column``, ``unit``, ``min``, ``max``, ``missing`` (values), ``note``: which one is the time and
        how even it is, which are constant or text.

    See Also
    --------
    modfun.read : Records of what was found.

    References
    ----------
    The guide docs/howto/read_file.md.

    Examples
    --------
    >>> import modfun as mf
    >>> table = mf.columns({"t": [0.0, 0.1, 0.2], "q": [0.0, 1.0, 0.5]})
    >>> table["column"].tolist()
    ['t', 'q']
    """
    table = open_columns(source, part)
    times = time_candidates(table)
    rows: list[tuple[Any, ...]] = []
    count = 0
    for name, values in _loadable(table).items():
        if values is None:
            rows.append((name, unit_of(name, table.told), None, None, None, "text"))
            continue
        count = len(values)
        good = values[np.isfinite(values)]
        low, high = (float(good.min()), float(good.max())) if good.size else (None, None)
        note = "empty" if low is None else "constant" if low == high else _told_role(name, table.told)
        if code := code_in(good):
            note += f"{', ' * bool(note)}{code[1]} values of {code[0]:g}: a code?"
        if name in times:
            note = f"time, {_paced(values, name, table.told)}"
            if (doubt := doubtful_step(values, name, table.told)) is not None:
                note += f"; or in {doubt[1]}?"
        rows.append((name, unit_of(name, table.told), low, high, len(values) - good.size, note))
    header = ("column", "unit", "min", "max", "missing", "note")
    step = f", dt = {table.told.dt:.6g} s" if table.told.dt and not times else ""
    return Table(
        dict(zip(header, zip(*rows, strict=True), strict=True)), title=f"{table.label}: {count} rows{step}"
    )


def _paced(values: F64, name: str, told: Told) -> str:
    """Say how even a column of times is, or that its unit is not known."""
    try:
        instants, even = _seconds(values, name, told)
    except SpecError:
        return f"in an unknown unit; give units={{{name!r}: 's'}} or the like"
    return pace(np.asarray(instants if even is None else even * np.arange(len(values))))


def _told_role(name: str, told: Told) -> str:
    if name in told.inputs:
        return ", ".join(["input", *([told.intersample[name]] if name in told.intersample else [])])
    return "output" if name in told.outputs else ""


def _loadable(table: Columns) -> dict[str, F64 | None]:
    """Return every column, None for those that are text."""
    names = list(dict.fromkeys(table.names))
    try:
        return dict(table.load(names))
    except DataError:
        loaded: dict[str, F64 | None] = {}
        for name in names:
            try:
                loaded[name] = table.load([name])[name]
            except DataError:
                loaded[name] = None
        return loaded


# Which column is what ----------------------------------------------------------------------------


def _roles(given: Channels | None, option: str) -> dict[str, str]:
    """Return {new name: name in the source}."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {str(new): str(old) for new, old in given.items()}
    names = [given] if isinstance(given, str) else [str(name) for name in given]
    if len(set(names)) < len(names):
        raise SpecError(f"read: {option} names a column twice: {', '.join(names)}")
    return {name: name for name in names}


def _left(told: tuple[str, ...], *taken: Mapping[str, str]) -> list[str]:
    """Return the columns of a role that the source tells, without those given another role."""
    used = {name for role in taken for name in role.values()}
    return [name for name in told if name not in used]


def _per_output(given: PerOutput | None, out: dict[str, str], option: str) -> dict[str, str]:
    """Return {output: column}."""
    if given is None:
        return {}
    if isinstance(given, str):
        return dict.fromkeys(out, given)
    for name in given:
        if name not in out:
            raise SpecError(
                f"read: {option} names {name!r}, which is not an output; {nearest(name, list(out))}"
            )
    return dict(given)


def _mask(values: dict[str, F64], out: dict[str, str], good: dict[str, str], count: int) -> Mask | None:
    """Return where the outputs count: where their columns are finite and those of `good` are true."""
    ok = np.array([np.isfinite(values[name]) for name in out.values()]).reshape(len(out), count)
    for row, new in zip(ok, out, strict=True):
        told = mask_of(values[good[new]], (1, count)) if new in good else None
        row &= True if told is None else told[0]
    return None if ok.all() else ok


def _clock_of(table: Columns, named: Sequence[str]) -> str | None:
    """Return the column of times, which is no channel; None where the source has a step instead."""
    if table.told.time is None and table.told.dt is not None:
        return None
    return table.told.time or guess_time(table, named)


def _clock_in(
    units: Mapping[str, str], table: Columns, clock: str | None, named: Mapping[str, str]
) -> tuple[str, str] | None:
    """Return the column of times whose unit the user says, and how it is called there: `t`, too."""
    known = [clock] if clock is not None else [x for x in time_candidates(table) if x not in named.values()]
    for name in known:
        for word in units:
            meant = word not in named and word not in table.names and word.lower() in ("t", name.lower())
            if word == name or meant:
                return name, word
    return None


def _timed(table: Columns, clock: str, given: str) -> Columns:
    """Return the columns with the unit of the times that the user says."""
    unit = str(given).strip()
    if seconds_in(unit) is None:
        raise SpecError(f"read: units gives {unit!r} for the times {clock!r}; {nearest(unit, list(TIMES))}")
    return replace(table, told=replace(table.told, units={**table.told.units, clock: unit}))


def _sampling(table: Columns, values: dict[str, F64], clock: str | None, dt: float | None) -> dict[str, Any]:
    """Return the options of Record that say when the samples were taken."""
    told = table.told
    if clock is None:
        return {"dt": told.dt, "t0": told.t0} if dt is None else {"dt": dt}
    times, step = _seconds(values[clock], clock, told)
    if step is not None:
        return {"dt": step, "t0": float(times[0])}
    if told.dt is not None and len(times):
        grid = times[0] + told.dt * np.arange(len(times))
        if np.abs(times - grid).max() <= EVEN * told.dt:
            return {"dt": told.dt, "t0": float(times[0])}
    return {"t": times}


def _seconds(values: F64, clock: str, told: Told) -> tuple[F64, float | None]:
    """Times in seconds, and their step where they are even in the decimals of another unit.

    Serial dates of spreadsheets and seconds since 1970 are counted from the first one, as other dates are.
    """
    scale = seconds_of(clock, told)
    dates = scale == DAY and are_serial(values)
    dates |= clock != "t" and told.time is None and since_1970(scale * values)
    if scale == 1 and not dates:
        return values, None
    times = scale * (values - values[0] if dates else values)
    rises = len(values) > 1 and np.isfinite(values).all() and np.all(values[1:] > values[:-1])
    step = even_step(values) if rises and told.dt is None else None
    return times, None if step is None else scale * step


def _refuse_unknown(table: Columns, name: str) -> None:
    alike = [known for known in table.names if known.rpartition("#")[0] == name]
    if name not in table.names and alike:
        raise SpecError(
            f"read: {table.label} has {len(alike)} columns named {name!r}; give one by its number: "
            f"{', '.join(map(repr, alike))}"
        )
    if name not in table.names:
        raise SpecError(f"read: {table.label} has no column {name!r}; {nearest(name, table.names)}")
    if table.names.count(name) > 1:
        raise DataError(f"{table.label} has {table.names.count(name)} columns named {name!r}; rename them")
