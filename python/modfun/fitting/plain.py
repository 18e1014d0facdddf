"""One fit of transfer functions by the core: from records to its answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..base.arrays import F64
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.corners import driving
from ..records.record import Record
from ..results.cures import on_band
from ..results.fit import Fit
from .gaps import across
from .mirrored import as_likely, mirrored
from .prepared import prepare, refuse_cut_off, refuse_standing

__all__ = ["fit_plain"]


def fit_plain(
    records: tuple[Record, ...],
    structure: TransferFunction,
    options: Options,
    again: Callable[[tuple[Record, ...], Any, Options], Any],
    near: F64 | None = None,
) -> Fit:
    """The fit of the records' samples; `again` makes others like it.

    `near`: parameters of a structure with free delays, by which its search begins on a band that is given.
    """
    made = prepare(structure, options, records)
    ys, us = [rec.y for rec in records], [driving(rec, options.rule) for rec in records]
    refuse_standing(made.layout, ys, us, options.initial_state)
    refuse_cut_off(made.layout, [rec.t for rec in records], us)

    def told(found: dict[str, Any]) -> Fit:
        return Fit.of_core(found, structure, made.layout, options, records, made.intervals, again=again)

    begin = {} if near is None else {"near": near.tolist()}

    def fitted(outputs: list[F64]) -> Fit:
        return told(made.core.fit(outputs, us, **begin))

    measured = list(made.outputs) or ys
    fit = across(fitted(measured), made.outputs, made.blinds, fitted)
    if not made.layout.free_delays or (stable := mirrored(fit)) is None:
        return fit
    on_lines = prepare(structure, on_band(fit, fit.band), records)
    twin = told(on_lines.core.fit(measured, us, near=stable.tolist()) | {"band_rule": fit.band_rule})
    return twin if as_likely(fit, twin) else fit
