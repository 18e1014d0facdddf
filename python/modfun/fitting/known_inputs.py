"""Transfer functions under inputs known at all times: no error of sums over samples, and no samples lost."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, pi
from typing import Any

import numpy as np

from .._core import coefficients
from ..base.arrays import C128
from ..errors import DataError, ModfunError
from ..models.options import Options
from ..records.corners import driving
from ..records.functions import Held, integrals, known, sampled, samples_of
from ..records.record import Record
from ..results.fit import Fit
from ..results.of_equations import EquationFit
from ..results.prediction import misses
from .finer import finer
from .kinks import bent, without_kinks
from .plain import fit_plain

__all__ = ["equations_closely", "fit_known_inputs", "held_closely", "refuse_uneven"]

PARTS = 16  # of a sampling interval, in which the response is summed
ROUNDS = 12
FAR = 4.0  # standard errors
SETTLED = 0.01  # of a standard error: the last step
WIDE = 0.8  # of all lines: those of the first fit
FEW = 8.5  # samples per period of the highest line
FAST = 1.0  # steps: the inverse of a pole for which rounds of what sampling folds may not settle
UNSURE = 0.5  # standard errors over values: the lines may not hold what there is to see
WORSE = 1.02  # times the squares that a response leaves of the outputs: those of another minimum
LONG = 4096  # samples of a record for which rounds take too long


def refuse_uneven(records: Sequence[Record]) -> None:
    """Refuse inputs known as functions beside uneven steps, at which sums have no simple errors.

    Raises
    ------
    DataError
    """
    for k, rec in enumerate(records):
        if rec.dt is None and rec.functions:
            name = next(iter(rec.functions))
            raise DataError(
                f"fit: input {name!r} of record {k} is known as a function, which needs even steps, and "
                f"these are uneven; resample it, or keep its samples, rec.assign({name}=rec[{name!r}])"
            )


def fit_known_inputs(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    again: Callable[[tuple[Record, ...], Any, Options], Any],
) -> Fit:
    """The fit of records some inputs of which are known at all times.

    Samples of the inputs are such that their sums are integrals. What sums over the outputs have too much, at
    the ends and by what sampling folds, the estimate's own response between the samples tells; it is taken
    out of the outputs, and the fit follows anew until it stands, the default band too. With delays, samples
    of the inputs stand before the first one, where all of them are known.
    """
    layout = structure.layout(records[0].outputs, records[0].inputs)
    late = [k for k in range(len(layout.inputs)) if _longest(layout, k)]
    free = options.initial_state == "unknown"
    longer = tuple([_earlier(rec, layout.longest_delay, late) if free else rec for rec in records])
    leads = [more.intervals - rec.intervals for more, rec in zip(longer, records, strict=True)]
    rounds = _Rounds(records, longer, leads, structure, again)
    if _sought(options):
        # The default band is chosen without the errors of sums, which may lead astray on few lines.
        steps = [rec.dt for rec in records if rec.dt]
        wide = rounds.settle(options.replace(band=(0.0, WIDE * pi / max(steps))))
        fit = rounds.settle(options)
        if wide.success and not _agrees(fit, wide):  # a rule that judges few lines was led astray
            fit = replace(wide, options=options)
    else:
        fit = rounds.settle(options)
    if not any(leads):
        return replace(fit, records=records)
    both = zip(longer, leads, strict=True)
    return replace(fit, records=records, instrumented=tuple([_unseen(rec, lead) for rec, lead in both]))


def held_closely(fit: Fit, again: Callable[[tuple[Record, ...], Any, Options], Any]) -> Fit:
    """A fit under held inputs by rounds like these where its lines have few samples per period; else itself.

    Held inputs are known at all times, too. What the core takes out of the sums is next to all that lines of
    eight samples per period fold, but its rounds may not settle with four where poles are as fast. Where
    these do not, either, a default band goes no further than that.
    """
    records, o = fit.records or (), fit.options
    steps = [rec.dt for rec in records if rec.dt and rec.mask is None and rec.sigma is None]
    if len(steps) < len(records) or fit.band[1] * max(steps, default=0.0) * FEW < 2 * pi:
        return fit
    held = all([set(rec.intersample) == {"zoh"} and rec.intervals < LONG for rec in records])
    plain = (o.initial_state, o.noise) == ("unknown", "output") and o.trend in ("auto", "constant")
    each = zip(fit.layout.orders, fit.layout.numerators, strict=True)
    at_once = any([degree == order for order, row in each for degree in row])
    if not (held and plain and fit.usable) or at_once or fit.layout.longest_delay:
        return fit
    unsure = np.max(fit.spread / np.maximum(np.abs(fit.params), 1e-300), initial=0.0) > UNSURE
    dens = [fit.layout.polynomials(fit.params, k)[0] for k in range(len(fit.outputs))]
    if not (unsure or any([np.max(np.abs(np.roots(den))) * max(steps) > FAST for den in dens])):
        return fit
    closer = fit_known_inputs(tuple([_as_functions(rec) for rec in records]), fit.structure, o, again)
    if closer.success and misses(closer) > WORSE * misses(fit):  # in another minimum
        return fit
    if not closer.success and _sought(o):
        eight = o.replace(band=(0.0, 2 * pi / 8 / max(steps)))
        closer = replace(fit_plain(records, fit.structure, eight, again), options=o)
    return replace(closer, records=records, intersample=fit.intersample) if closer.success else fit


def equations_closely(fit: EquationFit, refit: Callable[..., EquationFit]) -> EquationFit:
    """A fit of equations without what sampling folds, over nearly all lines where inputs are known there.

    The default band of equations ends at an eighth of the number of samples, below which a mode may lie. Of
    linear ones all lines count where the response of their estimate misses the outputs by no more.
    """
    found, o = without_kinks(fit, refit), fit.options
    records = fit.records or ()
    linear: bool = fit.layout.compiled.is_linear
    plain = _sought(o) and o.noise == "output" and linear
    if not (plain and any([rec.functions for rec in records])):
        return found
    edge = WIDE * pi / max([rec.dt or 0.0 for rec in records])
    if edge <= fit.band[1]:
        return found
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        start = refit(records, fit.structure, o.replace(band=(0.0, edge)))
        wide = without_kinks(start, refit) if bent(start) else start
        worse = found.success and misses(wide) > WORSE * misses(found)
    if wide is start or worse or not wide.success:
        return found
    return replace(wide, options=o, again=fit.again)


def _sought(options: Options) -> bool:
    """Whether the lines are chosen by the default rule."""
    return options.band is None and options.harmonics is None and options.method in ("ml", "awls")


def _as_functions(rec: Record) -> Record:
    """The record with its held inputs as functions."""
    start, dt = float(rec.t[0]), float(rec.dt or 0)
    functions = {name: Held(row, start, dt) for name, row in zip(rec.inputs, rec.u, strict=True)}
    return rec._like(intersample=("smooth",) * len(rec.inputs), _functions=functions)


def _unseen(rec: Record, lead: int) -> Record:
    """The record with its first outputs masked, which were never measured."""
    good = np.ones(rec.y.shape, bool) if rec.mask is None else rec.mask.copy()
    good[:, :lead] = False
    return rec._like(mask=good)


def _agrees(fit: Fit, wide: Fit) -> bool:
    """Whether a fit is within its errors of one on nearly all lines."""
    far = np.abs(fit.params - wide.params) / np.where(wide.bse > 0, wide.bse, np.inf)
    return fit.success and bool(np.max(far, initial=0.0) < FAR)


class _Rounds:
    """Fits of records, each without what the response of the one before tells of their sums."""

    def __init__(
        self, records: Any, longer: tuple[Record, ...], leads: list[int], structure: Any, again: Any
    ) -> None:
        self.records, self.longer, self.leads = records, longer, leads
        self.structure, self.again, self.moved = structure, again, longer

    def settle(self, options: Options) -> Fit:
        """The fit at which a round changes nothing; status "maxiter" where there is none."""
        fit = fit_plain(self.moved, self.structure, options, self.again)
        for _ in range(ROUNDS):
            try:
                with warnings.catch_warnings(), np.errstate(all="ignore"):
                    warnings.simplefilter("ignore")
                    moved = self._without_excess(fit)
                    after = fit_plain(moved, self.structure, options, self.again) if moved else None
            except (ArithmeticError, ModfunError, np.linalg.LinAlgError):  # beyond the range of numbers
                after = None
            if after is None:
                break
            step = np.abs(after.params - fit.params) / np.where(after.bse > 0, after.bse, np.inf)
            same, fit, self.moved = after.lines == fit.lines, after, moved
            if same and fit.success and np.max(step, initial=0.0) < SETTLED:
                return fit
        return replace(fit, status="maxiter" if fit.success else fit.status)

    def _without_excess(self, fit: Fit) -> tuple[Record, ...]:
        """The records without what a fit says their sums have too much; none where it says nothing."""
        if not fit.usable:
            return ()
        own, count = replace(fit, records=self.records), range(len(self.records))
        each = zip(self.records, self.longer, self.leads, count, strict=True)
        moved = tuple([_moved(own, *one) for one in each])
        return moved if all(np.isfinite(rec.y).all() for rec in moved) else ()


def _longest(layout: Any, channel: int) -> float:
    """The longest delay of an input."""
    found = 0.0
    for path in layout.paths:
        if path.input == channel:
            found = max(found, getattr(path.delay, "max", path.delay))
    return found


def _earlier(rec: Record, late: float, channels: Sequence[int]) -> Record:
    """The record with as many samples before the first as delays take; itself where inputs are unknown."""
    sources = known(rec)
    lead = ceil(late / rec.dt - 1e-9) if rec.dt else 0
    if not lead or any(sources[k] is None for k in channels):
        return rec
    t = np.concatenate([rec.t[0] - rec.dt * np.arange(lead, 0, -1), rec.t])  # type: ignore[operator]

    def before(rows: Any, first: Any = None) -> Any:
        return None if rows is None else np.hstack([np.repeat(rows[:, :1], lead, axis=1), rows])

    u = before(rec.u)
    for row, source in zip(u, sources, strict=True):
        if source is not None:
            row[:] = sampled(source, t)
    good = None if rec.mask is None else np.hstack([np.ones((len(rec.y), lead), bool), rec.mask])
    return rec._like(
        y=before(rec.y), u=u, t=t, sigma=before(rec.sigma), mask=good, _keep={}, _lost=None,
        _functions=rec._functions,
    )  # fmt: skip


def _moved(fit: Fit, rec: Record, longer: Record, lead: int, k: int) -> Record:
    """The longer record, outputs less what sums over samples of the fit's response have too much."""
    rule, intervals, layout = fit.options.rule, fit.intervals[k], fit.layout
    first, top = rec.intervals - intervals, (intervals - 1) // 2
    state = fit.simulate(rec, _start(fit))[1]
    fine = fit.simulate(finer(rec, PARTS), state)[0][:, first * PARTS :]
    few, rows = np.ascontiguousarray(fine[:, ::PARTS]), len(fine)
    sums = coefficients(few, top, [rule] * rows, [0.0] * rows, 0, None)
    excess = sums - coefficients(np.ascontiguousarray(fine), top, ["gregory"] * rows, [0.0] * rows, 0, None)
    s = 2j * pi / (intervals * rec.dt) * np.arange(top + 1)  # type: ignore[operator]
    for i in range(rows):
        delays = layout.delays(fit.params, i)
        if any(delays):
            den, nums = layout.polynomials(fit.params, i)
            response = np.array([np.polyval(num, s) for num in nums]) / np.polyval(den, s)
            wrong = response * _wrong(longer, rule, delays, first + lead, top)
            wrong[:, 0] = np.where(np.isfinite(wrong[:, 0]), wrong[:, 0].real, 0.0)
            excess[i] -= wrong.sum(axis=0)
    y = longer.y.copy()
    y[:, first + lead :] -= samples_of(excess, intervals, rule)
    return longer._like(y=y)


def _start(fit: Fit) -> Any:
    told = fit.options.initial_state
    return told if isinstance(told, str) and told in ("rest", "zero") else None


def _wrong(rec: Record, rule: str, delays: Sequence[float], first: int, top: int) -> C128:
    """What sums of delayed inputs (input, line) have too much over a window that begins so late."""
    rules = [rule if kind == "smooth" else kind for kind in rec.intersample]
    late = [delay / rec.dt for delay in delays]  # type: ignore[operator]
    sums = coefficients(driving(rec, rule), top, rules, late, first, None)
    start, intervals = float(rec.t[first]), rec.intervals - first
    found = np.zeros_like(sums)
    for k, source in enumerate(known(rec)):
        if source is not None:
            found[k] = sums[k] - integrals(source, start - delays[k], rec.dt, intervals, top)  # type: ignore[arg-type]
    return found
