"""Records in MATLAB's .mat files: plain arrays, structs of them, and an iddata exported as a struct."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.names import nearest
from ..base.samples import numbered
from ..base.units import TIMES, seconds_in
from ..errors import DataError, SpecError
from ..files.mat_files import Opaque, load_mat
from .columns import Columns, Told, from_arrays

__all__ = ["open_mat"]

Fields = Mapping[str, Any]

FORMS = {"zoh": "zoh", "foh": "foh", "bl": "smooth"}


def open_mat(path: Path, part: str | None) -> Columns:
    """Return the columns of a .mat file, or of one struct or experiment in it.

    A struct with the fields OutputData (or y and Ts) is an iddata: its channels, units, sampling and the
    form of its inputs are taken from it. Other structs give columns ``struct.field``, or ``field`` where
    the struct is named by `part` or is all there is. Matrices have time along their longer axis; the names
    of their channels are those of a cell array of as many texts beside them.
    """
    variables = load_mat(path)
    records = _records(variables)
    structs = {name: value for name, value in variables.items() if isinstance(value, Mapping)}
    if part is None:
        if len(records) > 1:
            raise SpecError(
                f"read: {path.name} holds {len(records)} records; choose one with part=: {', '.join(records)}"
            )
        if records:
            return _open_iddata(*next(iter(records.values())), path.name)
        alone = len(structs) == len(variables) == 1
        return _open_plain(next(iter(structs.values())) if alone else variables, path.name)
    label = f"{path.name}, {part}"
    found = [name for name in records if name == part or name.endswith(f".{part}")]
    if len(found) == 1:
        return _open_iddata(*records[found[0]], label)
    if part in structs and not found and not _is_iddata(structs[part]):
        return _open_plain(structs[part], label)
    known = list(dict.fromkeys([*records, *structs]))
    raise SpecError(f"read: {path.name} has no part {part!r}, or several; {nearest(part, known)}")


# iddata as a struct -------------------------------------------------------------------------------


def _records(variables: Fields) -> dict[str, tuple[Fields, int]]:
    """Return fields and number of the experiment for each record that is an iddata, by its name."""
    if _is_iddata(variables):
        named = {"": variables}
    else:
        named = {}
        for name, value in variables.items():
            several = isinstance(value, list)
            for k, one in enumerate(value if several else [value], start=1):
                if isinstance(one, Mapping) and _is_iddata(one):
                    named[f"{name}({k})" if several else name] = one
    records: dict[str, tuple[Fields, int]] = {}
    for name, fields in named.items():
        samples = _field(fields, "OutputData", "y")
        if not isinstance(samples, list) or len(samples) == 1:
            records[name] = (fields, 0)
            continue
        own = _texts(_field(fields, "ExperimentName"))
        for k in range(len(samples)):
            experiment = own[k] if k < len(own) and own[k] else f"Exp{k + 1}"
            records[f"{name}.{experiment}".lstrip(".")] = (fields, k)
    return records


def _is_iddata(fields: Fields) -> bool:
    return "OutputData" in fields or {"y", "Ts"} <= set(fields)


def _open_iddata(fields: Fields, experiment: int, label: str) -> Columns:
    if _word(fields, "Domain", "time", label).startswith("freq"):
        raise DataError(f"{label} is in the frequency domain; export the record in time that it was made of")
    unit = _word(fields, "TimeUnit", "seconds", label)
    scale = seconds_in(unit)
    if scale is None:
        raise DataError(f"{label}: the unit of time {unit!r} is unknown; {nearest(unit, list(TIMES))}")
    y = _samples(fields, ("OutputData", "y"), experiment, label)
    u = _samples(fields, ("InputData", "u"), experiment, label)
    if not len(y):
        raise DataError(f"{label} has no output: OutputData is empty")
    outputs = _named(_texts(_field(fields, "OutputName")), "y", len(y))
    inputs = _named(_texts(_field(fields, "InputName")), "u", len(u))
    arrays = dict(zip((*outputs, *inputs), (*y, *u), strict=True))
    if len(arrays) < len(outputs) + len(inputs):
        raise DataError(f"{label}: names stand for two channels each ({', '.join((*outputs, *inputs))})")
    units = [*_padded(_texts(_field(fields, "OutputUnit")), len(y)),
             *_padded(_texts(_field(fields, "InputUnit")), len(u))]  # fmt: skip
    step = _number(_of(_field(fields, "Ts"), experiment))
    clock = None
    if step is None or step <= 0:
        times = _of(_field(fields, "SamplingInstants"), experiment)
        if not isinstance(times, np.ndarray) or times.shape != y.shape[1:]:
            raise DataError(f"{label}: neither Ts nor SamplingInstants says when the samples were taken")
        clock = next(name for name in ("t", "time", "SamplingInstants") if name not in arrays)
        arrays = {clock: times * scale, **arrays}
    elif "t" not in arrays and np.shape(fields.get("t", 0.0)) == y.shape[1:]:  # a workspace of t, y, u and Ts
        clock, arrays = "t", {"t": fields["t"] * scale, **arrays}
    forms = _texts(_field(fields, "InterSample"))[experiment * len(u) :][: len(u)]  # (input, experiment)
    return from_arrays(
        arrays,
        label,
        Told(
            outputs=outputs,
            inputs=inputs,
            time=clock,
            dt=step * scale if step and not clock else None,
            t0=(_number(_of(_field(fields, "Tstart"), experiment)) or 0.0) * scale,
            units={name: unit for name, unit in zip((*outputs, *inputs), units, strict=True) if unit},
            intersample={n: FORMS.get(word.lower(), word) for n, word in zip(inputs, forms, strict=False)},
        ),
    )


def _field(fields: Fields, *names: str) -> Any:
    """Return the first of the fields that is there with something in it; texts refer to another field."""
    for name in names:
        value = fields.get(name)
        if name in ("y", "u") and isinstance(value, str):
            continue
        if value is not None and (len(value) if isinstance(value, list | str) else np.size(value)):
            return value
    return None


def _of(value: Any, experiment: int) -> Any:
    """Return what belongs to one experiment, where a cell holds one per experiment."""
    if isinstance(value, list):
        return value[experiment] if experiment < len(value) else None
    return value


def _word(fields: Fields, name: str, default: str, label: str) -> str:
    """Return a text in lower case, the default where there is none."""
    value = _field(fields, name)
    if value is not None and not isinstance(value, str):
        raise DataError(f"{label}: {name} holds no text, such as {default!r}; correct or drop the field")
    return value.lower() if value else default


def _number(value: Any) -> float | None:
    return (
        float(np.ravel(value)[0]) if np.size(value) and isinstance(value, int | float | np.ndarray) else None
    )


def _samples(fields: Fields, names: tuple[str, ...], experiment: int, label: str) -> NDArray[Any]:
    """Return the channels of an experiment, (channel, time); in MATLAB they are columns."""
    given = _of(_field(fields, *names), experiment)
    if given is None:
        return np.zeros((0, 0))
    if not isinstance(given, np.ndarray) or given.ndim > 2:
        raise DataError(f"{label}: {names[0]} holds no matrix (time, channel)")
    return np.ascontiguousarray(np.reshape(given, (len(np.atleast_1d(given)), -1)).T)


def _texts(value: Any) -> list[str]:
    if value is None:
        return []
    return [text if isinstance(text, str) else "" for text in (value if isinstance(value, list) else [value])]


def _padded(texts: list[str], count: int) -> list[str]:
    return (texts + [""] * count)[:count]


def _named(texts: list[str], letter: str, count: int) -> tuple[str, ...]:
    return tuple(
        text or other for text, other in zip(_padded(texts, count), numbered(letter, count), strict=True)
    )


# Plain arrays -------------------------------------------------------------------------------------


def _named_rows(fields: Fields) -> tuple[str, dict[str, NDArray[Any]]]:
    """The one matrix, and its channels by the one cell array of as many names beside it; none without."""
    cells = [value for value in fields.values() if isinstance(value, list) and value]
    names = [[text.strip() for text in cell] for cell in cells if all(isinstance(text, str) for text in cell)]
    matrices = [name for name, value in fields.items() if isinstance(value, np.ndarray) and value.ndim == 2]
    if len(names) != 1 or len(matrices) != 1:
        return "", {}
    rows = _channels(fields[matrices[0]])
    if len(names[0]) != len(rows) or not all(names[0]) or len({*names[0], *fields}) < len(rows) + len(fields):
        return "", {}
    return matrices[0], dict(zip(names[0], rows, strict=True))


def _channels(values: NDArray[Any]) -> NDArray[Any]:
    """A matrix as (channel, time): time is its longer axis."""
    return values.T if values.ndim == 2 and values.shape[0] > values.shape[1] else values


def _open_plain(variables: Fields, label: str) -> Columns:
    arrays: dict[str, NDArray[Any]] = {}
    opaque: dict[str, str] = {}

    def gather(fields: Fields, prefix: str) -> None:
        named, rows = _named_rows(fields)
        arrays.update({prefix + name: row for name, row in rows.items()})
        for name, value in fields.items():
            if isinstance(value, Mapping):
                gather(value, f"{prefix}{name}.")
            elif isinstance(value, Opaque):
                opaque[prefix + name] = value.kind
            elif isinstance(value, np.ndarray) and value.ndim in (1, 2) and value.size > 1 and name != named:
                arrays[prefix + name] = _channels(value)

    gather(variables, "")
    if arrays:
        return from_arrays(arrays, label)
    if opaque:
        name, kind = next(iter(opaque.items()))
        cure = {
            "iddata": f"s = get({name}); save run.mat s",
            "table": f"s = table2struct({name}, 'ToScalar', true); save run.mat s",
            "timetable": f"s = table2struct(timetable2table({name}), 'ToScalar', true); save run.mat s",
        }.get(kind, f"save what {name} holds as arrays or as a struct of arrays")
        raise DataError(
            f"{label}: {name!r} is an object of MATLAB's class {kind}, which only MATLAB can open; there: "
            f"{cure}"
        )
    raise DataError(f"{label} holds no numeric array; its variables are: {', '.join(variables) or 'none'}")
