"""Channels of a record in other units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

from ..base.names import nearest
from ..base.units import angle_of, any_scale, scale
from ..errors import SpecError
from .samples import Samples

__all__ = ["agreeing", "converted", "mixed_angles", "mixed_inputs"]

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


def mixed_angles(record: Samples) -> Iterator[str]:
    """Say that outputs have angles in two units, which no equation between them can do without a factor."""
    first = _first_with(record)
    if first.keys() >= {"deg", "rad"}:
        deg, rad = first["deg"], first["rad"]
        yield (
            f"Output {deg!r} is in {record.units[deg]} and {rad!r} in {record.units[rad]}: equations between "
            "them need one unit of angle; rec.convert changes it."
        )


def mixed_inputs(record: Samples) -> Iterator[tuple[str, str]]:
    """Inputs whose angles have another unit than those of all outputs, with what that does to derivatives.

    No residual shows it: an input in another unit changes its own derivatives alone.
    """
    first = _first_with(record)
    if len(known := first.keys() & {"deg", "rad"}) != 1:
        return  # not known, or outputs are in two units, which is said before
    (own,) = known
    for name in record.inputs:
        other = angle_of(record.units.get(name, ""))
        if other in ("deg", "rad") and other != own:
            output, size = first[own], "smaller" if other == "deg" else "larger"
            yield (
                name,
                f"Input {name!r} is in {record.units[name]} and output {output!r} in {record.units[output]}: "
                f"what {name!r} does to angles comes out 57.3 times {size} than with one unit of angle; "
                "rec.convert changes it.",
            )


def _first_with(record: Samples) -> dict[str, str]:
    """The first output with each unit of angle."""
    return {angle_of(record.units.get(name, "")): name for name in reversed(record.outputs)}
