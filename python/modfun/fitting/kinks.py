"""Equations with held inputs: what sampling makes of kinks and jumps, taken out of the outputs."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from math import pi

import numpy as np

from .._core import coefficients, noise_level
from ..base.arrays import C128, F64
from ..errors import ModfunError
from ..records.functions import samples_of
from ..records.mask import runs
from ..records.record import Record
from ..results.cures import on_band
from ..results.misfit import suspicious
from ..results.of_equations import EquationFit
from ..results.prediction import unexplained
from .finer import BEFORE, UnevenSums, finer, response
from .own_response import excess

__all__ = ["bent", "without_kinks"]

FINE = 40  # samples per period of the highest line: with as many, kinks of held inputs are below 0.1 % noise
UNEVEN = 160  # the same at uneven times: with 70, 9,000 samples left estimates 3 standard errors off
ROUNDS = 6
SETTLED = 0.5  # of a standard error: the last step, which is taken; the next one is some twenty times smaller
CLOSE = 0.1  # the same of nonlinear equations, where the next one may be nine tenths as large
FURTHER = 3.0  # times the noise,
LOST = 0.3  # and of the outputs' motion: what a response leaves that tells nothing
LESS = 0.3  # of the first step: where the last one is not as much smaller, the estimate stays as it was
PARTS = 4  # of a sampling interval, in which the response is looked at,
GAP = 3  # samples in a row that may be masked: beside nine, estimates were 15 standard errors off
SEEN = 30  # or more, such that Simpson's rule has so many in a period of the highest line: errors of 1e-5


def without_kinks(fit: EquationFit, refit: Callable[..., EquationFit]) -> EquationFit:
    """The fit of outputs without what sampling folds into their harmonics under held inputs.

    A held input puts a kink into the output at every sample, or a jump where it acts at once, and an equation
    takes outputs as smooth. Below `FINE` samples per period of the highest line that biases estimates by
    several standard errors, with jumps by tens. The estimate's own response, simulated between the samples,
    tells what its samples' sums have too much; that is taken out of the outputs, and the fit follows anew.
    Where jumps have put the first estimate far off, the search begins from inputs as the samples see them.

    Parameters
    ----------
    fit : EquationFit
    refit : callable
        Takes records, structure and options.
    """
    if fit.records is None or not bent(fit):
        return fit
    found = _settled(fit, fit.records, refit) if fit.success else None
    if found is None and fit.inputs and (fit.success or _jumps(fit)):
        seen = tuple([rec._like(intersample=("smooth",) * len(rec.inputs)) for rec in fit.records])
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            start = refit(seen, fit.structure, fit.options)
        start = replace(start, layout=fit.layout, intersample=fit.intersample, records=fit.records)
        found = _settled(start, fit.records, refit) if start.success else None
    if found is None:
        return replace(fit, unsettled=fit.success and _whole(fit, fit.records))
    return replace(found, options=fit.options, again=fit.again)


def _jumps(fit: EquationFit) -> bool:
    """Whether an input may move an output at once."""
    formulas = fit.layout.formulas
    operations, results = formulas.words["formulas"]
    for equation, signal, order in formulas.words["terms"]:
        name, _, row, _ = operations[results[signal]]
        channel = formulas.channels[row] if name == "input" and row < len(formulas.channels) else None
        output = channel is not None and channel.kind == "output"
        if not output and name != "constant" and order >= fit.layout.orders[equation]:
            return True
    return False


def _settled(
    start: EquationFit, records: tuple[Record, ...], refit: Callable[..., EquationFit]
) -> EquationFit | None:
    """Rounds of what the estimate folds and of the estimate that follows; None where they do not settle."""
    options, now, sizes, before = on_band(start, start.band), start, list[float](), np.zeros(0)
    # What functions and products make of signals between samples, the equations themselves leave out.
    whole = _whole(start, records)
    fine = [] if whole else [_finer(start, k, rec) for k, rec in enumerate(records)]
    settled = CLOSE if whole else SETTLED
    while len(sizes) < ROUNDS and not (sizes and sizes[-1] < settled):
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                smooth = tuple([_unfolded(now, k, records[k], more) for k, more in enumerate(fine)])
                less = [excess(now, k, rec) for k, rec in enumerate(records)] if whole else ()
                after = refit(
                    smooth or records,
                    now.structure,
                    options,
                    levels=_levels(now, records),
                    starts=np.asarray(now.params).tolist(),
                    less=less,
                    near=True,
                )
        except (ModfunError, ArithmeticError, TypeError, ValueError, np.linalg.LinAlgError):
            return None  # a response that leaves the range of numbers, or a formula without a value there
        if not after.success:
            return None
        error = np.sqrt(np.diag(after.cov_nonrobust))
        free = error != 0  # one on its bound has none
        step = np.abs(np.asarray(after.params - now.params))
        sizes.append(float(np.max(step[free] / error[free], initial=0.0)))
        # In the same errors, which shrink by what is taken out.
        if len(sizes) > 1 and not sizes[-1] <= np.max(before[free] / error[free], initial=0.0):  # nor is nan
            return None
        if whole and len(sizes) == 1 and sizes[0] < CLOSE:
            return start  # which needs none
        before = step
        now = replace(after, records=records, unfolded=smooth, less=tuple(less))
    closer = sizes[-1] < max(SETTLED, LESS * sizes[0])  # nan is not
    return replace(now, band_rule=start.band_rule) if closer else None


def _finer(fit: EquationFit, k: int, rec: Record) -> Record | UnevenSums:
    """Inputs in parts of the sampling interval; sums of responses at uneven times."""
    if rec.dt is None:
        return UnevenSums(rec, fit.lines[k][1], fit.options.rule)
    parts = PARTS
    while fit.band[1] * rec.dt * SEEN > 2 * pi * parts:
        parts *= 2
    return finer(rec, parts)


def _levels(fit: EquationFit, records: tuple[Record, ...]) -> list[float] | None:
    """Noise of the outputs beside the response, whose kinks reach all frequencies; None where none shows."""
    order = max(fit.layout.orders)
    plain = all([rec.mask is None and rec.sigma is None for rec in records])
    plain = plain and all([rec.intervals >= 8 * (order + 4) for rec in records])
    if not plain or (len(records) > 1 and fit.layout.compiled.is_linear):
        return None
    each = [noise_level(np.ascontiguousarray(unexplained(fit, rec)), order) for rec in records]
    return [float(level) for level in np.sqrt(np.mean(np.square(each), axis=0))]


def bent(fit: EquationFit) -> bool:
    """Whether inputs are held, or known at all times, through lines too fast for sums over outputs.

    Or whether residuals of nonlinear equations are odd, as where signals run fast between samples.
    """
    options = fit.options
    plain = (options.initial_state, options.robust, options.reference) == ("unknown", False, ())
    plain = plain and options.noise == "output" and not fit.layout.formulas.words["priors"]
    held = any("zoh" in rec.intersample or rec.functions for rec in fit.records or ())
    enough = [rec.intervals / (FINE if rec.dt else UNEVEN) / rec.duration for rec in fit.records or ()]
    fast = any(fit.band[1] > 2 * pi * frequency for frequency in enough)
    if not (plain and fast) or fit.at_bound:
        return False
    masks = [row for rec in fit.records or () if rec.mask is not None for row in rec.mask]
    if not fit.layout.compiled.is_linear and any([runs(~row)[1].max(initial=0) > GAP for row in masks]):
        return False
    return held or (_whole(fit, fit.records or ()) and fit.success and suspicious(fit) and not _astray(fit))


def _astray(fit: EquationFit) -> bool:
    """Whether the response leaves the samples, as that of chaos does, so that its own sums tell nothing.

    The phase of a relaxation oscillator was off by what left 0.2 of its motion, which rounds brought to 0.01;
    of a Lorenz system whose response left 0.4 of it they made more.
    """
    level = np.sqrt(np.diag(fit.noise_cov))
    for rec in fit.records or ():
        left = unexplained(fit, rec).std(axis=1)
        if np.any((left > FURTHER * level) & (left > LOST * rec.y.std(axis=1))):
            return True
    return False


def _whole(fit: EquationFit, records: tuple[Record, ...]) -> bool:
    """Whether equations are told what they leave of their own response: nonlinear ones over even samples."""
    return not fit.layout.compiled.is_linear and all([rec.dt is not None for rec in records])


def _unfolded(fit: EquationFit, k: int, rec: Record, fine: Record | UnevenSums) -> Record:
    """A record less what sampling folds of the fit's response: exactly on the lines that are fitted.

    On those beyond, which products of signals bring back, without the jump from the end to the beginning.
    `fine` has the inputs between the samples.
    """
    if isinstance(fine, UnevenSums):
        return rec._like(y=rec.y - fine.excess(fit))
    intervals, last = fit.intervals[k], fit.lines[k][1]
    first, parts = rec.intervals - intervals, fine.intervals // rec.intervals
    between = response(fit, rec, fine, np.arange(0, fine.t.size, parts))[:, first * parts :]
    there = between[:, ::parts]
    closed = between - _open(between)
    high = np.fft.rfft(closed[:, :-1:parts]) / intervals - _integrals(closed, parts)
    high[:, : last + 1] = 0
    left = there - _signal(high, intervals)
    low = _sums(left, last, fit.options.rule) - _integrals(between, parts)[:, : last + 1]
    y = rec.y.copy()
    y[:, first:] -= there - left + samples_of(low, intervals, fit.options.rule)
    return rec._like(y=y)


def _open(y: F64) -> F64:
    """The parabola from zero that ends apart by as much as a signal's ends, in value and slope."""
    part = np.linspace(0, 1, y.shape[1])
    begin, end = np.gradient(y, part[1], axis=1, edge_order=2)[:, [0, -1]].T
    bend = (end - begin) / 2
    return np.asarray(np.outer(bend, part**2) + np.outer(y[:, -1] - y[:, 0] - bend, part))


def _signal(lines: C128, intervals: int) -> F64:
    """What has these coefficients, from line 0 on, at the samples of a window."""
    period = np.fft.irfft(lines * intervals, intervals)
    return np.concatenate([period, period[:, :1]], axis=1)


def _sums(y: F64, last: int, rule: str) -> C128:
    """Coefficients up to a line, of samples as the fit takes them."""
    rows = np.ascontiguousarray(y)
    return np.asarray(coefficients(rows, last, [rule] * len(rows), [0.0] * len(rows), 0, None))


def _integrals(between: F64, count: int) -> C128:
    """The same up to half the sampling rate, of what runs between samples: a jump may end each interval."""
    intervals = (between.shape[1] - 1) // count
    cells = between[:, :-1].reshape(len(between), intervals, count)
    cells = np.concatenate([cells, (cells[..., -4:] @ BEFORE)[..., None]], axis=2)
    simpson = np.r_[1.0, np.tile([4.0, 2.0], count // 2)[:-1], 1.0] / (3 * count)
    parts = np.fft.rfft(cells, axis=1)
    turns = np.outer(np.arange(parts.shape[1]), np.arange(count + 1) / count) / intervals
    return np.asarray(np.sum(parts * np.exp(-2j * pi * turns) * simpson, axis=2) / intervals)
