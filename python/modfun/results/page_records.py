"""The data of a fit on its page: samples against what the model makes of them, or gains."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any

from ..base.samples import Origin
from ..base.tables import Findings, Table
from ..errors import FitError
from ..pages.figures import drawn
from ..pages.parts import Block, Facts, Figure, Grid, Notes, Section, Words, plain_table, section
from ..pages.provenance import hashes, hashes_of_gains
from ..records.forms import forms_of, in_common
from ..records.record import Record
from ..systems.frequency_response import FrequencyResponse
from . import drawing, drawing_lines
from . import page_words as words
from .estimates import Estimates
from .misfit import UNLIKELY
from .scores import score

__all__ = ["Content", "of_gains", "of_records"]

SHOWN = 4  # records that are drawn


@dataclass(frozen=True, eq=False)
class Content:
    """What the page of a fit says of its data, records or gains, and of what was told and found.

    Attributes
    ----------
    facts : sequence of (str, str)
    findings : Findings
        What the check says.
    data : tuple of Section
    level : callable
        How well the model explains the data, in numbers.
    explained : callable
        The same as pictures, and what is left: sections.
    hashes : callable
        SHA-256 of the data.
    measured : tuple of FrequencyResponse
        What is drawn beside the model's frequency response.
    """

    facts: Sequence[tuple[str, str]]
    findings: Findings
    data: tuple[Section, ...]
    level: Callable[[], Iterable[Block]]
    explained: Callable[[], tuple[Section, ...]]
    hashes: Callable[[], Iterable[Block]]
    measured: tuple[FrequencyResponse, ...] = ()


def of_records(fit: Estimates, facts: Sequence[tuple[str, str]], findings: Findings) -> Content:
    """Records, channels, what their check says, spectra; the response and what is left of them."""
    told = dict(facts)
    return Content(
        facts,
        findings,
        data=(
            section("data", "Data", lambda: chain(_tables(_records(fit)), _over_time(_records(fit)))),
            section("spectrum", "Spectrum", lambda: _spectra(fit)),
        ),
        level=lambda: _level(fit, told),
        explained=lambda: (
            section("response", "Response", lambda: _responses(fit)),
            section("residuals", "Residuals", lambda: _residuals(fit), lambda: _tests(fit)),
        ),
        hashes=lambda: () if fit.records is None else hashes(map(_arrays, fit.records)),
    )


def of_gains(data: FrequencyResponse, facts: Sequence[tuple[str, str]], findings: Findings) -> Content:
    """The gains as a table; their picture stands beside the model's, and they have no time."""
    told = dict(facts)
    return Content(
        facts,
        findings,
        data=(section("data", "Data", lambda: _gains(data)),),
        level=lambda: (Facts(tuple((name, told[name]) for name in ("Weights", "Condition", "Errors"))),),
        explained=tuple,
        hashes=lambda: hashes_of_gains({name: getattr(data, name) for name in ("omega", "response", "cov")}),
        measured=(data,),
    )


def _arrays(rec: Record) -> tuple[Origin | None, dict[str, Any]]:
    return rec.source, {name: getattr(rec, name) for name in ("t", "y", "u", "mask", "sigma")}


def _gains(data: FrequencyResponse) -> Iterable[Block]:
    yield Facts(tuple(data.facts()))
    yield Grid.of(data.table(), "Gains")


def _level(fit: Estimates, facts: Mapping[str, str]) -> Iterable[Block]:
    """How well the model explains the records."""
    yield Facts(tuple((name, facts[name]) for name in ("Trend", "Chi-square", "Condition", "Errors")))
    yield Grid.of(score(fit), "Simulated against measured")
    yield Words(
        "signal_to_error is the ratio of signal to error in dB (16 is very good); fit_percent is 100 for a "
        "perfect simulation and 0 for one no better than the mean; r2 is the explained share of the "
        "variance; theil is 0 for perfect and 1 for worst. The model was fitted to these same samples: a "
        "record that was not used tells more."
    )


def _records(fit: Estimates) -> Sequence[Record]:
    if fit.records is None:
        raise FitError(
            "the samples are not kept with a fit that was loaded or shortened; fit again to show them"
        )
    return fit.records


def _drawn(records: Sequence[Record]) -> list[tuple[int, Record, str]]:
    """The first records, by number, with what tells them apart in captions."""
    several = len(records) > 1
    return [(k, rec, f" of record {k}" if several else "") for k, rec in enumerate(records[:SHOWN])]


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
    roles = ["output"] * len(first.outputs) + [f"input, {word}" for word in in_common(forms_of(records))]
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
    for _, rec, of in _drawn(records):
        rows = len(rec.outputs) + len(rec.inputs)
        svg = drawn(rec.plot, rows, height=1.4, sharex=True)
        masked = "" if rec.mask is None else " Masked samples are left out; dotted lines bridge them."
        yield Figure(
            svg,
            f"Outputs and inputs{of} over time.",
            f"Outputs and inputs{of} over time, as they were fitted.{masked}",
        )
    if len(records) > SHOWN:
        yield Words(f"The first {SHOWN} of {len(records)} records are drawn.")


def _spectra(fit: Estimates) -> Iterable[Block]:
    low, high = fit.band
    records = _records(fit)
    rows = len(fit.outputs) + len(fit.inputs)
    for _, rec, of in _drawn(records):
        yield Figure(
            drawn(partial(drawing_lines.harmonics, fit, rec), rows, height=1.5, sharex=True),
            f"Amplitude spectra of all channels{of}, from {low:.4g} to {high:.4g} rad/s shaded.",
            f"Amplitude spectra{of} (Hann window). Shaded: the harmonics that were fitted. Dashed and "
            "dotted: where white noise of the fit's level, and of that of the unused high band, would stand.",
        )


def _responses(fit: Estimates) -> Iterable[Block]:
    records = _records(fit)
    rows = 2 * len(fit.outputs)
    for k, _, of in _drawn(records):
        svg = drawn(partial(drawing.response, fit, k), rows, height=1.7, sharex=True)
        yield Figure(
            svg,
            f"Measured and simulated {', '.join(fit.outputs)}{of} over time, and the error below.",
            f"Measured and simulated outputs{of}, and what is left. Simulated from the inputs alone; initial "
            "state and trend are fitted to the record.",
        )
    if len(records) > SHOWN:
        yield Words(f"The first {SHOWN} of {len(records)} records are drawn.")


def _residuals(fit: Estimates) -> Iterable[Block]:
    rows = len(fit.row_names)
    yield Figure(
        drawn(partial(drawing_lines.residuals, fit), 2 * rows, height=2.0),
        "Whitened residuals over frequency, and their autocorrelation, each with 95 % lines.",
        "Whitened residual lines (variance one where the model and its noise are right) and their "
        "autocorrelation; one point in twenty lies beyond the dashed lines.",
    )
    yield Figure(
        drawn(partial(drawing_lines.residual_tests, fit), rows, columns=2, height=2.6),
        "Cumulated power of the residual lines over the band, and their normal quantiles.",
        "Left: cumulated power of the lines, straight where their level is one over the band, with the 95 % "
        "band of the test. Right: their values against normal quantiles; the grey band holds each with 95 %.",
    )


def _tests(fit: Estimates) -> Iterable[Block]:
    yield plain_table(("asked", "of", "found", "answer"), words.tests(fit), "Tests of the residual lines")
    yield Words(
        f"A test objects where its p-value is below {UNLIKELY}: of right models one or two in a hundred "
        "do so by chance, in each test, where the noise is white."
    )
