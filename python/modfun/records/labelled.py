"""Records as xarray data sets and pandas frames, and these as columns.

A data set names the role of each variable in its attributes; a frame holds the same in ``frame.attrs``, which
.parquet files keep.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.optional import optional
from ..errors import DataError, SpecError
from .columns import Columns, Told, from_arrays, time_candidates
from .functions import texts_of
from .samples import Samples

__all__ = ["open_frame", "open_xarray", "to_pandas", "to_xarray", "told_of_frame"]

ATTRS = "modfun"  # where a pandas frame keeps what a record knows beside the samples
TIMES = ("t", "time", "timestamp")


def to_pandas(rec: Samples) -> Any:
    """Return the frame of `Record.to_pandas`."""
    pandas = optional("pandas", "pandas", "Record.to_pandas")
    sigma = _sigma_names(rec)
    columns = {name: rec._shown(name) for name in rec.channels}
    if rec.sigma is not None:
        columns.update(zip(sigma.values(), rec.sigma, strict=True))
    frame = pandas.DataFrame(columns, index=pandas.Index(rec.t, name="t"))
    frame.attrs[ATTRS] = {
        "outputs": list(rec.outputs),
        "inputs": list(rec.inputs),
        "kept": list(rec.kept),
        "time": "t",
        "dt": rec.dt,
        "units": rec.units,
        "intersample": dict(zip(rec.inputs, rec.intersample, strict=True)),
        "functions": texts_of(rec, "to_pandas"),
        "masked": rec.mask is not None,
        "sigma": sigma,
    }
    return frame


def to_xarray(rec: Samples) -> Any:
    """Return the data set of `Record.to_xarray`."""
    xarray = optional("xarray", "xarray", "Record.to_xarray")
    if "t" in rec.channels:
        raise SpecError("to_xarray: a channel is named 't', as the times are; rename it")
    variables: dict[str, Any] = {}
    functions = texts_of(rec, "to_xarray")
    for role, names in (("output", rec.outputs), ("input", rec.inputs), ("kept", rec.kept)):
        for name in names:
            attrs: dict[str, Any] = {"role": role}
            if name in rec.units:
                attrs["units"] = rec.units[name]
            if role == "input":
                attrs["intersample"] = rec.intersample[rec.inputs.index(name)]
                attrs |= {"function": functions[name]} if name in functions else {}
            if role == "output" and rec.mask is not None:
                attrs["masked"] = int((~rec.mask[rec.outputs.index(name)]).sum())
            variables[name] = ("t", rec._shown(name), attrs)
    if rec.sigma is not None:
        for (name, column), row in zip(_sigma_names(rec).items(), rec.sigma, strict=True):
            variables[column] = ("t", row, {"role": "sigma", "of": name})
    clock = {"t": ("t", rec.t, {"units": "s"})}
    return xarray.Dataset(variables, coords=clock, attrs={} if rec.dt is None else {"dt": rec.dt})


def _sigma_names(rec: Samples) -> dict[str, str]:
    """Return a free name for the sigma of each output."""
    names: dict[str, str] = {}
    for output in rec.outputs if rec.sigma is not None else ():
        name = f"{output}_sigma"
        while name in rec.channels:
            name += "_"
        names[output] = name
    return names


def open_frame(frame: Any, label: str, attrs: Any, marks: frozenset[str] = frozenset()) -> Columns:
    """Return the columns of a pandas or polars frame; `attrs` is what it knows beside them."""
    arrays = {str(name): frame[name] for name in frame.columns}
    index = getattr(frame, "index", None)
    name = getattr(index, "name", None)
    if name is None and getattr(getattr(index, "dtype", None), "kind", "") in ("f", "M", "m"):
        # Nobody numbers rows by these.
        name = None if time_candidates(from_arrays(arrays, label)) else "t"
    if isinstance(name, str) and name not in arrays:  # pandas often keeps the times there
        arrays = {name: index, **arrays}
    return from_arrays(arrays, label, told_of_frame(attrs, arrays), marks)


def told_of_frame(attrs: Any, names: Any) -> Told:
    """What `Record.to_pandas` wrote, of the columns that are still there."""
    about = attrs.get(ATTRS) if isinstance(attrs, dict) else None
    if not isinstance(about, dict):
        return Told()

    def there(role: str) -> tuple[str, ...]:
        return tuple(name for name in about.get(role, ()) if name in names)

    return Told(
        outputs=there("outputs"),
        inputs=there("inputs"),
        kept=there("kept"),
        time=about["time"] if about.get("time") in names else None,
        dt=about.get("dt"),
        units=about.get("units", {}),
        intersample=about.get("intersample", {}),
        functions=about.get("functions", {}),
        masked=about.get("masked", False),
        sigma={name: column for name, column in about.get("sigma", {}).items() if column in names},
    )


def open_xarray(data: Any) -> Columns:
    """Return the columns of an xarray.Dataset or DataArray."""
    variables = data.data_vars if hasattr(data, "data_vars") else {data.name or "y": data}
    clock = _time_dim(data)
    arrays: dict[str, Any] = {}
    said: dict[str, dict[str, Any]] = {}
    if clock in data.coords:
        arrays[clock], said[clock] = data.coords[clock].values, dict(data.coords[clock].attrs)
    coordinates = {name: values for name, values in data.coords.items() if name not in data.dims}
    for key, values in {**coordinates, **variables}.items():
        if clock not in values.dims:
            continue
        others = [dim for dim in values.dims if dim != clock]
        if len(others) > 1:
            raise DataError(
                f"the data set: {key!r} has the dimensions {', '.join(map(str, values.dims))}; a record has "
                f"channels over time: take one of the others with .isel({others[0]}=0)"
            )
        names = _channel_names(str(key), data, values, others)
        rows = values.transpose(*others, clock).values.reshape(len(names), -1)
        for name, row in zip(names, rows, strict=True):
            arrays[name], said[name] = row, dict(values.attrs)
    if not set(arrays) - {clock}:
        raise DataError(f"the data set holds no variable over {clock!r}")
    return from_arrays(arrays, "the data set", _told(said, clock if clock in arrays else None, data.attrs))


def _time_dim(data: Any) -> str:
    dims = [str(dim) for dim in data.dims]
    named = [dim for dim in dims if dim.lower() in TIMES]
    dated = [dim for dim in dims if dim in data.coords and data.coords[dim].dtype.kind in "mM"]
    for found in (named, dated, dims):
        if len(found) == 1:
            return found[0]
    raise SpecError(
        f"read: the data set has the dimensions {', '.join(dims) or 'none'}; name the one of the times 't' "
        "or 'time' with .rename"
    )


def _channel_names(key: str, data: Any, values: Any, others: list[Any]) -> list[str]:
    if not others:
        return [key]
    labels = data.coords[others[0]].values if others[0] in data.coords else np.zeros(0)
    count = values.sizes[others[0]]
    if labels.dtype.kind in "UOT" and len(set(labels.tolist())) == count:
        alone = not hasattr(data, "data_vars") or len(data.data_vars) == 1
        return [str(label) if alone else f"{key} {label}" for label in labels]
    return [f"{key}{k}" for k in range(1, count + 1)]


def _told(said: dict[str, dict[str, Any]], clock: str | None, attrs: Any) -> Told:
    dt = attrs.get("dt")
    roles: dict[str, list[str]] = {"output": [], "input": [], "kept": []}
    for name, about in said.items():
        roles.get(str(about.get("role")), []).append(name)
    return Told(
        outputs=tuple(roles["output"]),
        inputs=tuple(roles["input"]),
        kept=tuple(roles["kept"]),
        time=clock,
        dt=float(dt) if clock is not None and isinstance(dt, int | float | np.number) else None,
        units={name: str(about["units"]) for name, about in said.items() if "units" in about},
        intersample={n: str(about["intersample"]) for n, about in said.items() if "intersample" in about},
        functions={n: str(about["function"]) for n, about in said.items() if "function" in about},
        masked=any("masked" in about for about in said.values()),
        sigma={str(a["of"]): name for name, a in said.items() if a.get("role") == "sigma" and "of" in a},
    )
