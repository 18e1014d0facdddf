"""Channels of a record in other units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from ..base.names import nearest
from ..base.units import any_scale, scale
from ..errors import SpecError
from .samples import Samples

__all__ = ["agreeing", "converted"]

Own = TypeVar("Own", bound=Samples)


def converted(rec: Own, units: Mapping[str, str]) -> Own:
    """The record with channels in these units; see `Record.convert`."""
    y, u, keep, labels = rec.y.copy(), rec.u.copy(), {name: rec[name] for name in rec.kept}, rec.units
    functions = dict(rec._functions)
    for name, unit in units.items():
        if name not in rec.channels:
            raise SpecError(f"convert: there is no channel {name!r}; {nearest(name, rec.channels)}")
        if name not in labels:
            raise SpecError(
                f"convert: the unit of {name!r} is not known; say it first, "
                f"rec.assign(units={{{name!r}: ...}}), or in mf.read"
            )
        step = any_scale("convert", labels[name], str(unit))
        values = step.factor * rec[name] + step.offset
        if name in rec.outputs:
            y[rec.outputs.index(name)] = values
        elif name in rec.inputs:
            u[rec.inputs.index(name)] = values
        else:
            keep[name] = values
        labels[name] = str(unit)
        source = functions.pop(name, None)
        if isinstance(source, str):  # a function of Python's is left out: its samples are in the new unit
            functions[name] = f"{step.factor!r}*({source}) + {step.offset!r}"
    return rec._like(y=y, u=u, _keep=keep, _units=labels, _functions=functions)


def agreeing(what: str, rec: Own, units: Mapping[str, str], whose: str) -> Own:
    """The record, whose channels must not have other units than these, where both are known."""
    for name in (*rec.outputs, *rec.inputs):
        own, other = rec.units.get(name), units.get(name)
        if not own or not other or own == other:
            continue
        try:
            step = scale(what, own, other)
        except SpecError:  # words of the user's
            continue
        if (step.factor, step.offset) != (1.0, 0.0):
            cure = f"{name}={other!r}" if name.isidentifier() else f"{{{name!r}: {other!r}}}"
            raise SpecError(
                f"{what}: the record has {name} in {own}, {whose} in {other}; take rec.convert({cure})"
            )
    return rec
