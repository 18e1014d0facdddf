"""Fits of equations: from records to the core's formulas, and its answer as an `EquationFit`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from math import ceil, isqrt, log, nan
from typing import Any

import numpy as np

from .._core import TermsFitter, noise_level
from ..base.arrays import F64, geometric_mean
from ..base.effort import spend
from ..equations.layout import EquationLayout, layout_of, with_excess, with_spread
from ..errors import DataError, SpecError
from ..models.noise import Noise
from ..models.options import Options
from ..models.process import refuse_unknown, with_inputs
from ..records.batches import Batch
from ..records.corners import driving
from ..records.forms import forms_of
from ..records.record import Record
from ..records.spectra import too_short
from ..results.doubts import noise_free
from ..results.of_equations import HUGE, EquationFit
from ..results.refits import AWAY, ran_away
from .arguments import sensible
from .astray import settled_levels
from .centred import centred_starts
from .delay_starts import delay_starts
from .few_lines import at_least_white
from .gaps import across, blind, bridged, relative, variances
from .matched import likelier, matched
from .own_levels import by_own_levels
from .prepared import KEPT, LONGEST, refuse_known_start, refuse_uneven
from .restarts import restarted, settled_within
from .signs import as_begun, as_written, positive
from .spread import spread_of

__all__ = ["PreparedEquation", "batch_of", "fit_equation", "prepare_equation"]

ITERATION = 1e-7  # work of an iteration of the core, for each operation and sample
QUIET = log(0.01)  # of the outputs' size: less in the high band may be kinks alone


def _levels(noise: Any, outputs: int, inputs: int) -> list[float] | None:
    if not isinstance(noise, Noise):
        return None
    found: list[float] = []
    for given, count, name in ((noise.y, outputs, "y"), (noise.u, inputs, "u")):
        if given is None:
            continue
        try:
            levels = np.broadcast_to(np.asarray(given, dtype=float), (count,))
        except (TypeError, ValueError):
            raise SpecError(
                f"fit: noise=Noise({name}=...) of equations: give standard deviations, "
                f"one or one per channel ({count})"
            ) from None
        found += levels.tolist()
    return found


@dataclass(frozen=True, slots=True)
class PreparedEquation:
    """Equations with options for records of some lengths and steps; as `prepared.Prepared`."""

    core: Any
    layout: EquationLayout
    intervals: tuple[int, ...]


def prepare_equation(
    structure: Any,
    options: Options,
    data: Batch | Sequence[Record],
    uneven: Sequence[F64 | None] = (None,),
    levels: list[float] | None = None,
    learn: bool = True,
    starts: Sequence[float | None] | None = None,
    within: tuple[tuple[float, float], ...] | None = None,
    less: bool = False,
    near: bool = False,
    own_noise: bool = False,
) -> PreparedEquation:
    """What fits of equations share whatever the samples.

    `learn`: levels of noise with the parameters; `starts`: values of these from which the search begins,
    None where it is free; `within`: their bounds instead of those of the equations; `less`: whether equations
    have a known signal each, which is taken from them; `near`: whether the starts are estimates of these
    equations, beside which no others are tried; `own_noise`: whether the channels end with the noise of each
    sample of the outputs.

    Raises
    ------
    DataError, SpecError
        As in `fit`.
    """
    refuse_known_start(options)
    first: Batch | Record
    sampling: tuple[tuple[int, Any], ...]
    if isinstance(data, Batch):
        first = data
        sampling = ((data.y.shape[2], data.dt),)
    else:
        first = data[0]
        sampling = tuple([(rec.y.shape[1], rec.t if rec.dt is None else rec.dt) for rec in data])
    layout = layout_of(structure, options, first.outputs, first.inputs, forms_of(data))
    layout = with_spread(layout) if own_noise else layout
    layout = with_excess(layout, options.rule) if less else layout
    trend = structure.trend if options.trend == "auto" else options.trend
    levels = levels or _levels(options.noise, len(first.outputs), len(first.inputs))
    words = options.core() | {"trend": trend, "intersample": ()}
    words["noise"] = "process" if options.drives else "equation" if options.noise == "equation" else "output"
    words["shapes"] = tuple(own for _, own in getattr(options.noise, "filters", ()))
    words["coloured"] = options.noise == "coloured"
    # Noise of inputs and outputs cannot be told apart by how large the residuals are.
    own = len(layout.formulas.noisy) == len(layout.outputs)
    words["learn"] = learn and own and options.noise in ("output", "coloured")
    even = all([rec is None for rec in uneven]) and all([np.isscalar(step) for _, step in sampling])
    short = sum([samples for samples, _ in sampling]) <= LONGEST
    given = (layout, tuple(words.items()), sampling, None if levels is None else tuple(levels), within)
    return _kept(*given) if even and short and starts is None else _made(*given, uneven, starts, near)


def _made(
    layout: EquationLayout,
    words: tuple[tuple[str, Any], ...],
    sampling: tuple[tuple[int, Any], ...],
    levels: tuple[float, ...] | None,
    within: tuple[tuple[float, float], ...] | None,
    uneven: Sequence[F64 | None] = (),
    starts: Sequence[float | None] | None = None,
    near: bool = False,
) -> PreparedEquation:
    """As `prepare_equation`; `sampling` holds the number of samples and the step (or times) a record."""
    formulas = layout.formulas.words | ({} if starts is None else {"starts": list(starts), "near": near})
    formulas |= {} if within is None else {"bounds": list(within)}
    late = layout.longest_delay
    for _, step in sampling:
        if late and not isinstance(step, float):
            refuse_uneven(late, step)
    core = TermsFitter(
        [samples for samples, _ in sampling],
        [step for _, step in sampling],
        list(uneven) or [None] * len(sampling),
        **formulas,
        levels=levels,
        **dict(words),
    )
    intervals = tuple([samples - 1 - (ceil(late / step - 1e-9) if late else 0) for samples, step in sampling])
    return PreparedEquation(core, layout, intervals)


_kept = lru_cache(KEPT)(_made)


def fit_equation(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    again: Callable[..., Any] | None = None,
    levels: Sequence[float] | None = None,
    starts: Sequence[float] | None = None,
    less: Sequence[F64] = (),
    near: bool = False,
) -> EquationFit:
    """One fit of equations, without its warnings.

    `again` makes others like it; `levels`: noise of the outputs where more is known than the high band shows;
    `starts`: values of the parameters from which the search begins; `less`: samples (equation, time) of each
    record that are taken from the equations; `near`: whether the starts are estimates of these equations,
    from much the same samples.
    """
    refuse_unknown(options.noise, structure.inputs)
    records = tuple([structure.own_channels(with_inputs(rec, options.noise)) for rec in records])
    first = records[0]
    layout = layout_of(structure, options, first.outputs, first.inputs, forms_of(records))
    _refuse_constants(layout, records, options)
    if levels is None:
        alone = by_own_levels(
            records,
            layout,
            options,
            lambda own: fit_equation(records, structure, options, again, own, starts, less, near),
        )
        if alone is not None:
            return alone
    within = sensible(layout, records)
    if starts is None and again is not None:
        late = delay_starts(structure, layout, records, options, again)
        fit = _sought(records, structure, options, layout, again, levels, late, within) if late else None
        if fit and fit.success and not fit.at_bound:
            return fit
    sought_from = partial(_sought, records, structure, options, layout, again, levels, less=less)
    if within and starts is None:
        fitted = partial(fit_equation, levels=levels)
        centred = centred_starts(structure, layout, records, options, within, fitted)
        if centred and (fit := sought_from(centred, None, near=True)).success:
            return fit
    sought = partial(sought_from, starts, near=near)
    if within and starts and any(not a <= x <= b for x, (a, b) in zip(starts, within, strict=True)):
        within = None  # a start that was found farther out
    fit = sought(within)
    if within is not None and not (fit.success and not fit.at_bound):
        fit = sought(None)
    told = layout.formulas.words["starts"]
    learns = options.noise in ("output", "coloured") and len(layout.outputs) > 1
    if starts is not None:
        return fit

    def begun_anew() -> EquationFit | None:
        """The fit from other starts: by free coefficients, or of sizes that the equations ask for."""
        others = partial(_with_others, records, options, again, levels, less)
        found = matched(others, sought_from, structure, layout, records)
        return found or restarted(sought_from, structure, layout, records, learns)

    if fit.success:
        found = as_begun(as_written(positive(fit, sought_from), sought_from), sought_from)
        found = likelier(found, sought_from, structure, layout, records)
        # Far above the noise it may be a false minimum: Hill terms had such in one of four records.
        lost = again is not None and ran_away(found) and not any([start is not None for start in told])
        return (begun_anew() or found) if lost else found
    if any([start is not None for start in told]):
        # A start may lie beside a false minimum; where it leads nowhere, others of its sign are tried.
        signed = tuple(
            (max(low, 0.0) if start and start > 0 else low, min(high, 0.0) if start and start < 0 else high)
            for start, (low, high) in zip(told, within or layout.formulas.words["bounds"], strict=True)
        )
        other = sought_from([None] * len(told), signed)
        if settled_within(other, layout):
            return other
    return begun_anew() or fit


def _with_others(
    records: tuple[Record, ...],
    options: Options,
    again: Callable[..., Any] | None,
    levels: Sequence[float] | None,
    less: Sequence[F64],
    equations: Any,
) -> EquationFit:
    """The fit of other equations for the same channels to the same records."""
    first = records[0]
    layout = layout_of(equations, options, first.outputs, first.inputs, forms_of(records))
    return _sought(records, equations, options, layout, again, levels, None, None, less=less)


def _sought(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    layout: EquationLayout,
    again: Callable[..., Any] | None,
    levels: Sequence[float] | None,
    starts: Sequence[float | None] | None,
    within: tuple[tuple[float, float], ...] | None,
    learnt: bool = True,
    less: Sequence[F64] = (),
    near: bool = False,
) -> EquationFit:
    """The fit within bounds, those of the equations where None; `learnt`: whether levels of noise may be.

    Where the search from `near` starts does not settle, it begins from others, too.
    """
    filled = [(rec, *bridged(rec)) for rec in records]
    order = max(layout.orders)
    uneven = [variances(rec, off, noise, order) for rec, _, off, noise in filled]
    capped = [None if v is None else relative(v) for v in uneven]
    seen = _seen(records, layout) if not isinstance(options.noise, Noise) else None
    learns = options.noise in ("output", "coloured") and len(layout.outputs) * len(records) > 1
    weighed = any([rec.sigma is not None for rec in records]) and not options.drives
    own_noise = weighed and with_spread(layout) is not layout
    absolute = levels is None and not isinstance(options.noise, Noise)
    each = [spread_of(rec, order, absolute) for rec in records] if own_noise else []
    if each:  # in units of the same level
        both = zip(capped, each, strict=True)
        capped = [None if v is None else v * own.usual[:, None] ** 2 for v, own in both]
    spread = [_all_noisy(layout, v) for v in capped]
    own = levels is not None and any([too_short(rec.t.size, order) for rec in records])
    blurred = seen is not None or own  # levels that residuals cannot be judged by

    def fitted(ys: list[F64], learn: bool = True) -> EquationFit:
        shown = seen if levels is None else list(levels)
        learns = learn and learnt
        given = (records, spread, shown, learns, starts, within, bool(len(less)))
        made = prepare_equation(structure, options, *given, near, own_noise)
        rows = [
            layout.formulas.rows(y, driving(rec), rec.t, record=k)
            for k, (rec, y) in enumerate(zip(records, ys, strict=True))
        ]
        _refuse_not_finite(layout, rows)
        for more in ([own.rows for own in each], less):
            rows = [np.vstack(both) for both in zip(rows, more, strict=True)] if len(more) else rows

        def counted(options: Options) -> dict[str, Any]:
            return _counted(prepare_equation(structure, options, *given, own_noise=own_noise), rows)

        found = _counted(made, rows)
        if near and found["status"] != "ok":
            found = counted(options)
        made = replace(made, layout=layout)  # that of `less` has a signal more
        if learns and options.noise == "output" and options.band is None and options.harmonics is None:
            found = settled_levels(found, lambda band: counted(options.replace(band=band)))
        for k, own in enumerate(each):  # levels are those of the usual sample
            for name in ("levels", "seen"):
                found[name][k, : len(own.usual)] *= own.usual
        return _of_found(found, structure, made, options, records, blurred, again)

    outputs = [y for _, y, _, _ in filled]
    quiet = learns and _quiet(records, order)
    held = any(["zoh" in rec.intersample for rec in records])
    told = fitted(outputs, learn=False) if quiet and held else None
    fit = told if told and told.success and noise_free(told) else fitted(outputs)
    if quiet and not (fit.success and _holds(fit, records)):  # an output counts for nothing
        told = told or fitted(outputs, learn=False)
        fit = told if told.success else fit
    elif learns and fit.success and _at_the_cost_of_others(fit, records, order):
        told = fitted(outputs, learn=False)
        fit = told if told.success else fit
    blinds = [blind(rec, v) for rec, v in zip(records, uneven, strict=True)]
    return across(fit, outputs, blinds, fitted)


def _counted(made: PreparedEquation, rows: list[F64]) -> dict[str, Any]:
    """What the core finds, its work counted by its iterations."""
    found: dict[str, Any] = made.core.fit(rows)
    samples = sum([row.shape[1] for row in rows])
    spend(ITERATION * samples * len(made.layout.formulas.words["formulas"][0]) * found["nit"])
    return found


def _at_the_cost_of_others(fit: EquationFit, records: Sequence[Record], order: int) -> bool:
    """Whether a record's level ran far below its high band's, as parameters fit it alone, and others' rose.

    With a lag that is not there levels of 0.0075, 0.068 and 0.26 were learnt of one sensor in three records
    of a Duffing oscillator, for a noise of 0.08, and BIC fell by 130.
    """
    if any([rec.dt is None or rec.mask is not None or rec.sigma is not None for rec in records]):
        return False
    if any([too_short(rec.t.size, order) for rec in records]):
        return False
    over = fit.levels / np.array([noise_level(np.ascontiguousarray(rec.y), order) for rec in records])
    return bool(np.any((over.min(axis=0) < 1 / AWAY) & (over.max(axis=0) > 1.0)))


def _quiet(records: Sequence[Record], order: int) -> bool:
    """Whether the outputs may be without noise: their high band holds no more than kinks of held inputs do.

    The residuals are then errors of the quadrature, and levels of white noise learnt from these may run away.
    """
    if any([rec.dt is None or rec.mask is not None for rec in records]):
        return False
    ys = [np.ascontiguousarray(rec.y) for rec in records if rec.intervals >= 8 * (order + 4)]
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = [np.log(noise_level(y, order) / y.std(axis=1)) for y in ys]
    return bool(parts) and float(np.mean(parts)) < QUIET


def _of_found(
    found: dict[str, Any],
    structure: Any,
    made: PreparedEquation,
    options: Options,
    records: tuple[Record, ...],
    seen: bool,
    again: Callable[..., Any] | None,
) -> EquationFit:
    """The fit that the core found; `seen`: by noise levels that the records show."""
    layout = made.layout
    if found["status"] == "rank" and np.abs(found["theta"]).max(initial=0.0) > HUGE:
        found["status"] = "nonfinite"  # on the way there: which of the two comes first is rounding
    if found["status"] == "nonfinite":
        found["theta"] = np.full_like(found["theta"], nan)  # which is where the search began
    levels = found["levels"]
    own = levels[:, : len(layout.outputs)]
    known = geometric_mean(own, [2 * (hi - lo + 1) - (lo == 0) for lo, hi in found["lines"]])
    # Where levels do not matter the core makes do with ones.
    even = all([rec.dt is not None and rec.sigma is None for rec in records])
    told = even or layout.formulas.needs_levels or isinstance(options.noise, Noise)
    if seen and even and all([rec.mask is None for rec in records]):
        told = False  # records too short to see levels in: theirs are those of the residuals
    driven = "process_levels" in found  # one level of each kind for all records, some of which may be 0
    coloured = options.noise == "coloured"
    cost = found["cost"] * (known[0] ** 2 if levels.shape[1] == 1 and not driven else 1.0)
    over = np.ones_like(own) if driven else own / known
    # Noise inside the system has a spectrum that its levels tell.
    found = found if driven else at_least_white(found)
    noise = np.outer(known, known) * np.mean(_correlations(found, len(known)), axis=0) * found["scale"]
    return EquationFit.of_core(
        found | {"cost": cost, "noise": noise, "record_levels": over},
        structure,
        layout,
        options,
        records,
        made.intervals,
        # Levels read between gaps are too rough to judge residuals by; coloured noise has none in the band.
        noise_scale=nan if seen or coloured else found["scale"],
        levels=levels,
        seen=found["seen"] if told and not coloured else np.full_like(levels, nan),
        df_hc3=found["df_hc3"],
        bend=found["bend"],
        again=again,
    )


def _correlations(found: dict[str, Any], outputs: int) -> F64:
    """Correlation of the noise of the outputs, (record, output, output)."""
    each = np.asarray(found["correlation"])
    channels = isqrt(each.shape[1])
    each = each.reshape(-1, channels, channels)
    return each[:, :outputs, :outputs]


def _holds(fit: EquationFit, records: Sequence[Record]) -> bool:
    """Whether no level ran away: noise is no larger than what an output moves by."""
    scatter = np.array([np.ptp(rec.y, axis=1) for rec in records])
    return bool(np.all(fit.levels[:, : scatter.shape[1]] < scatter))


def _seen(records: Sequence[Record], layout: EquationLayout) -> list[float] | None:
    """Noise levels that the core cannot see: of masked records, and of uneven ones where they matter."""
    uneven = layout.formulas.needs_levels and any(rec.dt is None for rec in records)
    if not uneven and all(rec.mask is None for rec in records):
        return None
    order = max(layout.orders)
    tables = [
        dict(zip(table["channel"], table["noise_sd"], strict=True))
        for table in (rec.noise_level(order) for rec in records)
    ]
    return [float(np.sqrt(np.mean([table[name] ** 2 for table in tables]))) for name in layout.formulas.noisy]


def _all_noisy(layout: EquationLayout, variance: F64 | None) -> F64 | None:
    """Variances of the outputs' samples, followed by ones for noisy inputs."""
    if variance is None:
        return None
    more = len(layout.formulas.noisy) - len(variance)
    return np.ascontiguousarray(np.vstack([variance, np.ones((more, variance.shape[1]))]))


def _refuse_constants(layout: EquationLayout, records: Sequence[Record], options: Options) -> None:
    """Refuse parameters that stand alone where no record's band holds line 0."""
    low = 0.0 if options.band is None else options.band[0]
    if low * max([rec.duration for rec in records]) > 1e-9 and layout.constants:
        name = layout.constants[0]
        raise SpecError(
            f"fit: {name} stands alone in an equation, so that the mean of the record (line 0) alone tells "
            f"it, and band= begins at {low:.4g} rad/s; begin it at 0, or take {name} out of the equation and "
            'give trend="constant"'
        )


def _refuse_not_finite(layout: EquationLayout, rows: Sequence[F64]) -> None:
    for k, values in enumerate(rows):
        for channel, row in zip(layout.formulas.channels, values, strict=True):
            bad = ~np.isfinite(row)
            if not bad.any():
                continue
            at = int(np.argmax(bad))
            if channel.kind == "log":
                raise DataError(
                    f'fit: noise="log-normal" takes the logarithm of {layout.outputs[channel.of]!r}, which '
                    f'is not positive at sample {at} of record {k}; use noise="output"'
                )
            raise DataError(
                f"fit: {channel.symbol} is not finite at sample {at} of record {k}; change the known "
                "function or the record there"
            )


def batch_of(made: PreparedEquation, data: Batch | tuple[Record, ...]) -> tuple[list[F64], F64]:
    """Channels of each record, and those that all share."""
    formulas = made.layout.formulas
    if isinstance(data, Batch):
        t = np.arange(data.y.shape[2], dtype=np.float64) * data.dt
        us = driving(data)
        if len(us) == 1 or not data.inputs:
            own = [formulas.rows(y, us[0], t, own=True) for y in data.y]
            return own, formulas.rows(data.y[0], us[0], t, own=False)
        own = [formulas.rows(y, u, t) for y, u in zip(data.y, us, strict=True)]
        return own, np.empty((0, t.size))
    return [formulas.rows(r.y, driving(r), r.t) for r in data], np.empty((0, data[0].t.size))
