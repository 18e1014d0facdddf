"""The samples of a fit on its page: what they are, how they look over time and over frequency."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

from .. import plot
from ..errors import FitError
from ..records import Record
from ..results import Fit
from ..tables import Table
from .figures import drawn
from .parts import Block, Figure, Grid, Notes, Section, Words, section

__all__ = ["data_section", "spectrum_section"]

SHOWN = 4  # records that are drawn


def data_section(fit: Fit) -> Section:
    """Records, channels and what their check says; of a frequency response its gains."""
    return section("data", "Data", lambda: _tables(_records(fit)), lambda: _over_time(_records(fit)))


def spectrum_section(fit: Fit) -> Section:
    """Spectra with the harmonics that were used."""
    return section("spectrum", "Spectrum", lambda: _spectra(fit))


def _records(fit: Fit) -> Sequence[Record]:
    if fit.records is None:
        raise FitError(
            "the samples are not kept with a fit that was loaded or shortened; fit again to show them"
        )
    return fit.records


def _tables(records: Sequence[Record]) -> Iterable[Block]:
    columns: dict[str, list[object]] = {"record": list(range(len(records)))}
    columns["from"] = [rec.source.name if rec.source else "arrays" for rec in records]
    columns["samples"] = [len(rec.t) for rec in records]
    columns["start (s)"] = [rec.t0 for rec in records]
    columns["duration (s)"] = [rec.duration for rec in records]
    columns["dt (s)"] = ["uneven" if rec.dt is None else f"{rec.dt:.6g}" for rec in records]
    columns["masked"] = [0 if rec.mask is None else int((~rec.mask).sum()) for rec in records]
    yield Grid.of(Table(columns), "Records")
    first = records[0]
    names = (*first.outputs, *first.inputs)
    roles = ["output"] * len(first.outputs) + [f"input, {word}" for word in first.intersample]
    channels: dict[str, list[object]] = {"channel": list(names), "role": list(roles)}
    channels["unit"] = [first.units.get(name, "") for name in names]
    channels["lowest"] = [min(float(rec[name].min()) for rec in records) for name in names]
    channels["highest"] = [max(float(rec[name].max()) for rec in records) for name in names]
    yield Grid.of(Table(channels), "Channels" + (", over all records" if len(records) > 1 else ""))
    for k, rec in enumerate(records[:SHOWN]):
        found = rec.check()
        if found:
            yield Words(f"What the check of {'the record' if len(records) == 1 else f'record {k}'} says:")
            yield Notes(tuple(found))


def _over_time(records: Sequence[Record]) -> Iterable[Block]:
    for k, rec in enumerate(records[:SHOWN]):
        of = f" of record {k}" if len(records) > 1 else ""
        rows = len(rec.outputs) + len(rec.inputs)
        svg = drawn(partial(plot.record, rec), rows, height=1.4, sharex=True)
        masked = "" if rec.mask is None else " Masked samples are left out; dotted lines bridge them."
        yield Figure(
            svg,
            f"Outputs and inputs{of} over time.",
            f"Outputs and inputs{of} over time, as they were fitted.{masked}",
        )
    if len(records) > SHOWN:
        yield Words(f"The first {SHOWN} of {len(records)} records are drawn.")


def _spectra(fit: Fit) -> Iterable[Block]:
    low, high = fit.band
    records = _records(fit)
    for k, rec in enumerate(records[:SHOWN]):
        of = f" of record {k}" if len(records) > 1 else ""
        rows = len(rec.outputs) + len(rec.inputs)
        svg = drawn(partial(plot.spectrum, rec.spectrum()), rows, height=1.5, sharex=True)
        yield Figure(
            svg,
            f"Amplitude spectra of all channels{of}.",
            f"Amplitude spectra{of}. Used: {low:.4g} to {high:.4g} rad/s.",
        )
