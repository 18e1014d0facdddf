"""Many fits at once: how `fit_many` gets there."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.progress import Progress
from ..base.words import STATUS
from ..equations.layout import EquationLayout
from ..errors import DataError, FitError, ModfunError
from ..models.options import Options
from ..models.process import refuse_unknown, with_inputs
from ..models.transfer_function import TransferFunction
from ..records.batches import Batch
from ..records.corners import driving
from ..records.record import Record
from ..results.cures import on_band
from ..results.diagnosis import level_ratio
from ..results.fit import Fit
from ..results.many import FitMany
from ..results.refits import AWAY
from .changes import Alone, Changes, may_change
from .few_lines import many_at_least_white
from .of_equations import PreparedEquation, batch_of, prepare_equation
from .prepared import Prepared, prepare, refuse_cut_off, refuse_standing
from .restarts import compared
from .signs import starts_choose, untold
from .wider import ENOUGH, LOOKED, NEARLY

__all__ = ["fit_batch", "fit_each"]

NONFINITE = STATUS.index("nonfinite")
TOLD = 3.0  # standard errors from 0, at which a record tells a parameter's sign
TRIED = 3  # records, of which the first that settles gives the starts of all
SHOWN = ("fitting", "records")  # of their progress


def fit_batch(
    data: Batch | tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_one: Callable[[tuple[Record, ...], Any, Options], Fit],
    threads: int,
    progress: str | bool,
    notes: tuple[str, ...],
) -> FitMany:
    """Fit records of one length and step in the compiled core, which chooses one band for all."""
    if not isinstance(data, Batch):
        data = tuple([with_inputs(rec, options.noise) for rec in data])
        if not isinstance(structure, TransferFunction):
            refuse_unknown(options.noise, structure.inputs)
            data = tuple([structure.own_channels(rec) for rec in data])
    sample = data if isinstance(data, Batch) else data[:1]

    @cache
    def single(k: int) -> Fit | None:
        """Record k fitted alone; None where it makes no record, or is refused."""
        try:
            return fit_one((data[k],), structure, options)
        except ModfunError:
            return None

    starts: list[float] | None = None
    near = False  # whether searches stay beside their start
    rates: set[int] = set()  # parameters beside signals in denominators
    first: Any = None
    made: Prepared | PreparedEquation
    if isinstance(structure, TransferFunction):
        made = prepare(structure, options, sample)
        y, u = (
            (data.y, driving(data))
            if isinstance(data, Batch)
            else ([r.y for r in data], [driving(r) for r in data])
        )
        refuse_standing(made.layout, [y[0]], [u[0]], options.initial_state)
        t = np.arange(float(data.u.shape[-1])) * data.dt if isinstance(data, Batch) else data[0].t
        refuse_cut_off(made.layout, [t], [u[0]])
    else:
        made = prepare_equation(structure, options, sample)
        y, u = batch_of(made, data)
        linear, rates = made.layout.formulas.words["linear"], compared(made.layout.compiled)
        rates = set() if options.drives else rates
        first = _first(data, single) if rates or not linear else None
        if first is not None and not linear:
            starts, near = [float(value) for value in first.params], starts_choose(first)
            made = prepare_equation(structure, options, sample, starts=starts, near=near)
    with Progress(progress, *SHOWN) as bar:
        found = made.core.fit_many(y, u, threads=threads, progress=bar)
        if isinstance(made, PreparedEquation) and (wide := _wider(found, options, single)) is not None:
            made = prepare_equation(structure, wide, sample, starts=starts, near=near)
            found = made.core.fit_many(y, u, threads=threads, progress=bar)
    if isinstance(made, PreparedEquation) and not options.drives:
        found = many_at_least_white(found)
    failed = isinstance(structure, TransferFunction) and found["status"][0] == NONFINITE
    if failed and not any(np.isfinite(samples).all() for samples in y):
        raise DataError(
            f"fit_many: every record holds values that are not finite, record 0 at sample "
            f"{int(np.argmin(np.isfinite(y[0][0])))}; cut them off, or fill them"
        )
    alone = Alone(data, structure, options, found["lines"][0], found["omega0"][0], fit_one)
    look = None
    if may_change(made.layout, options, made.intervals[0]):
        look = Changes(alone, made.layout, made.intervals[0], progress)
    many = FitMany.of_core(found, made.layout, structure, options, alone, look, notes)
    if not (rates and isinstance(made, PreparedEquation)):
        return many
    fits: dict[int, Fit] = {}
    astray = np.flatnonzero(_astray(many, made.layout, rates, first)).tolist()
    with Progress(progress, "fitting those alone that may have gone astray", "records") as bar:
        for done, k in enumerate(astray):
            bar(done, len(astray))
            with suppress(ModfunError):  # what a single fit refuses
                fits[k] = alone(k)
    return many.with_fits(fits)


def _astray(many: FitMany, layout: EquationLayout, rates: set[int], first: Any) -> NDArray[np.bool_]:
    """Records of rate laws whose search may have ended at a false minimum, which single fits leave.

    Multiplied out, -V*s/(K + s) is K*s' + s*s' + V*s = 0: the noise of s' takes unweighted rows, at whose
    least squares a search begins, to a K below 0, and the pole inside the record holds it there. It ended so
    for 11 of 20 records at 5 % of noise. `rates`: what is beside signals in denominators; `first`: the fit of
    a record alone.
    """
    free, params = untold(layout.formulas.words), many.params
    beside = np.isin(np.arange(free.size), list(rates))
    if first is None:
        return np.asarray(~many.success | np.any((params < 0) & free & beside, axis=1))
    told = np.abs(first.params) > TOLD * first.spread
    odd = ~many.success | np.any((params < 0) & free & beside & ~told, axis=1)
    odd |= np.any((params * first.params < 0) & (beside | told), axis=1)
    if many.options.noise == "output" and layout.formulas.needs_levels:  # in which costs are counted
        odd |= many.cost > (AWAY * max(1.0, level_ratio(first))) ** 2 * many.df_resid
    return np.asarray(odd)


def _first(data: Batch | tuple[Record, ...], single: Callable[[int], Fit | None]) -> Any:
    """The first record's fit that settles, at whose estimates searches of all begin; None where none does.

    A single fit begins again elsewhere where a search leads astray, which the core does not: by itself it led
    all of 20 records of a Monod reactor to Ks = 7.6 instead of 0.6.
    """
    for k in range(min(TRIED, len(data))):
        first = single(k)
        if first is not None and first.success and not first.at_bound:
            return first
    return None


def _wider(found: dict[str, Any], options: Options, single: Callable[[int], Fit | None]) -> Options | None:
    """The options with the band of the first record's fit, where that may be wider than the core's."""
    last = found["lines"][0][1]
    enough = found["df_resid"] >= ENOUGH and last < NEARLY * LOOKED
    if options.band is not None or options.harmonics is not None or enough:
        return None
    first = single(0)
    wider = first is not None and first.band[1] > (last + 0.5) * found["omega0"][0]
    return on_band(first, first.band) if first is not None and wider else None


def fit_each(
    data: Batch | tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_one: Callable[[tuple[Record, ...], Any, Options], Fit],
    progress: str | bool,
    notes: tuple[str, ...],
) -> FitMany:
    """Fit records one after the other, with the band of the first that has a fit.

    Robust fits take each record's own band, since weights decide how far lines inform: over the band of
    another record they were up to a standard error from single fits.

    A record whose fit ends in a FitError has no estimate, as those that the core cannot fit, and neither has
    a replicate of a batch that makes no record; where there is no other, the error is raised.
    """
    caught = (FitError, DataError) if isinstance(data, Batch) else FitError
    fits: list[Fit | None] = []
    failures: dict[int, FitError | DataError] = {}
    shared = options
    with Progress(progress, *SHOWN) as bar:
        for k in range(len(data)):
            bar(k, len(data))
            try:
                fit = fit_one((data[k],), structure, shared)
            except caught as error:
                fits.append(None)
                failures[k] = error
            except DataError as error:
                raise DataError(f"fit_many: record {k} of {len(data)}: {error}") from None
            else:
                if len(failures) == k and not options.robust:  # the first
                    shared = options.replace(harmonics=None, band=fit.band)
                fits.append(fit)
    if len(failures) == len(data):
        raise failures[0]
    if failures:
        k, text = next(iter(failures.items()))
        notes = (*notes, f"{len(failures)} of {len(data)} records have no estimate; record {k}: {text}")
    return FitMany.of_fits(fits, structure, options, notes)
