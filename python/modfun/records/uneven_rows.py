"""Records of uneven steps: rows written when a value changed, long gaps, and the way to an even grid."""

from __future__ import annotations

import warnings
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arguments import real
from ..base.arrays import F64
from ..base.names import listed
from ..base.samples import FEWEST, MOST_SAMPLES, grid_step
from ..errors import DataError, ModfunWarning, SpecError
from .dead_band import CHANGES, missing_small
from .functions import sampled
from .lost_rows import LONGEST, at_rows
from .mask import present, runs
from .samples import Samples

__all__ = ["bridged", "even", "gaps", "refuse_gap", "unit_of_time", "written_at_changes"]

MANY = 10  # usual steps make a gap
SPREAD = 3.0  # the 90 % quantile of the steps over that of 10 %, at least, of rows written at changes
OVERSHOT = 1.5  # dead bands: the usual change over long steps, at most; any other signal moves further
PAUSE = 15  # mean steps: of samples at random times, 1 step in 3 million is longer
MOVED = 0.6  # of a deviation, missed by lines over pauses: of 1.0, 1 fit of 24 was right, of 0.25 5 of 5 were
STILL = 0.3  # of its deviation: what an input moves around lost rows, at most, where it stood meanwhile
FEW = 256  # samples that are soon simulated
OFTEN = 0.5  # of the steps, at which an input moves that is sampled
KNOWN = 0.5  # of the longest gap that fits take: apart of values between rows that say "no change"

Own = TypeVar("Own", bound=Samples)


def _dead_bands(rec: Samples) -> dict[str, float]:
    """The dead band of each output where a row was written only when a value had changed; else nothing.

    Rows at which an input moves are written whatever the outputs did, and say nothing of their bands.
    """
    if rec.dt is not None or rec.mask is not None:
        return {}
    steps = np.diff(rec.t)
    low, high = np.quantile(steps, (0.1, 0.9))
    changes = np.abs(np.diff(rec.y, axis=1))
    still = ~np.diff(rec.u, axis=1).any(axis=0)
    if high < SPREAD * low or np.count_nonzero(still) < CHANGES or not changes[:, still].any(axis=0).all():
        return {}
    found = {}
    for name, change in zip(rec.outputs, changes, strict=True):
        own = still & (change > 0)
        if np.count_nonzero(own) < CHANGES or not missing_small(change[own]):
            return {}
        long = own & (steps >= np.quantile(steps[own], 0.75))
        found[name] = float(change[own].min())
        if np.median(change[long]) > OVERSHOT * found[name]:
            return {}
    return found


def written_at_changes(rec: Samples) -> str:
    """Say what rows written by exception mean, and how to make them even; nothing of other records."""
    bands = [f"{name!r} by {band:.3g}" for name, band in _dead_bands(rec).items()]
    if not bands:
        return ""
    return (
        f"A row seems to be written only when a value changed, {' or '.join(bands)} or more: no row means no "
        f"change, not a gap. First make it even, rec.resample({grid_step(rec.t):.6g})."
    )


def even(rec: Own, dt: float) -> Own:
    """The record on an even grid; see `Record.resample`."""
    step = real("resample", "dt", dt)
    if rec.dt is not None:
        raise SpecError(f"resample: the samples are even already, dt={rec.dt:g} s, and fits take them")
    if not step > 0 or not rec.duration / step < MOST_SAMPLES:
        raise SpecError(
            f"resample: dt={step:g} s of a record of {rec.duration:.6g} s; give a step above 0 that "
            f"makes fewer than {MOST_SAMPLES:g} samples"
        )
    rows = np.rint((rec.t - rec.t[0]) / step).astype(np.intp)
    last = np.append(np.diff(rows) > 0, True)  # of several samples at one instant of the grid
    if np.count_nonzero(last) < FEWEST:
        raise DataError(
            f"resample: steps of {step:g} s leave {np.count_nonzero(last)} of {rows.size} samples, at least "
            f"{FEWEST} are needed; give a shorter dt"
        )
    fields = rec._fields()
    for name in ("t", "y", "u", "mask", "sigma"):
        if fields[name] is not None:
            fields[name] = fields[name][..., last]
    fields["_keep"] = {name: own[last] for name, own in rec._keep.items()}
    found = at_rows(fields, rows[last], step)
    if _dead_bands(rec):
        for good in found["mask"]:
            _know(good)
        warnings.warn(
            "resample: rows seem to be written only when a value changed, and standard errors of fits do not "
            "count that dead band: estimates may be 5 of them off, a few per cent; export samples if you can",
            ModfunWarning,
            stacklevel=4,
        )
    functions = {name: f for name, f in rec._functions.items() if name in rec.inputs}
    for name, source in functions.items():
        found["u"][rec.inputs.index(name)] = sampled(source, found["t"])
    return rec._like(**{**found, "_lost": None, "_functions": functions})


def _know(good: NDArray[np.bool_]) -> None:
    """Let values on the lines between rows count where no row for so long says that nothing changed."""
    apart = KNOWN * LONGEST * good.size
    for first, length in zip(*runs(~good), strict=True):
        if length > apart:
            parts = int(np.ceil((length + 1) / apart))
            good[first - 1 + np.arange(1, parts) * (length + 1) // parts] = True


def unit_of_time(rec: Samples) -> str:
    """What stands behind times in messages: those that nobody gave in seconds may be hours."""
    return " s" if rec._timed else ""


def gaps(rec: Samples) -> NDArray[np.intp]:
    """Rows before steps longer than what a mask may hide, or else before pauses in which the outputs move.

    A single pause of 1 s in 180 s spoils the fit of a system with a period of 2 s.
    """
    if rec.dt is not None:
        return np.empty(0, dtype=np.intp)
    steps = np.diff(rec.t)
    long = steps > max(LONGEST * rec.duration, MANY * float(np.median(steps)))
    return np.flatnonzero(long) if long.any() else _pauses(rec)


def bridged(rec: Samples) -> bool:
    """Whether all is known between the samples of an uneven record, and these are few enough to simulate.

    Inputs are held; one that moves at most samples, as commands of a controller do, moved in a gap, too.
    """
    held = not {"smooth", "foh"} & {*rec.intersample}
    return held and rec.t.size <= FEW and bool(np.all(np.mean(np.diff(rec.u) != 0, axis=1) < OFTEN))


def refuse_gap(what: str, rec: Samples, simulated: bool = False) -> None:
    """Refuse times with a gap that no sum over samples bridges.

    `simulated`: whether the fit ends in least squares of the response, which asks for no samples in a gap
    where all inputs are known.

    Raises
    ------
    DataError
    """
    if rec.dt is not None:
        _refuse_lost(what, rec)
        return
    rows = gaps(rec)
    if not rows.size or (simulated and bridged(rec)):
        return
    steps = np.diff(rec.t)
    at = rows[np.argmax(steps[rows])] if steps[rows].max() > LONGEST * rec.duration else rows[0]
    unit = unit_of_time(rec)
    where = f"{what}: the record has no samples between t = {rec.t[at]:.6g} and {rec.t[at + 1]:.6g}{unit}"
    if _dead_bands(rec):
        raise DataError(
            f"{where}, but rows seem to be written only when a value changed, so that none means no "
            f"change; make it even, mf.fit(rec.resample({grid_step(rec.t):.6g}), model)"
        )
    if steps[at] > LONGEST * rec.duration:
        where += f", {100 * steps[at] / rec.duration:.2g} % of its length"
    else:
        more = f" and in {rows.size - 1} other pause{'s' * (rows.size > 2)}" if rows.size > 1 else ""
        where += f"{more}, too long for lines to bridge as the outputs move"
    raise DataError(f"{where}; {_way_round(rec, rows)}")


def _way_round(rec: Samples, rows: NDArray[np.intp]) -> str:
    """What to do about gaps: a cut, unless it loses samples."""
    apart = float(np.diff(rec.t)[rows].min()) / 2
    cut = f"cut it there and fit the pieces together, mf.fit(rec.split(gap={apart:.2g}), model)"
    if bridged(rec):
        return (
            "as all inputs are known there, write the model as an mf.Equation and fit it in "
            'noise="output" or "log-normal", by "ml": that takes these samples as they are'
        )
    lengths = np.diff(np.concatenate([[0], rows + 1, [rec.t.size]]))
    lost = int(lengths[lengths < FEWEST].sum())
    if not lost or rec.t.size > FEW:
        return cut
    moving = listed([name for name, word in zip(rec.inputs, rec.intersample, strict=True) if word != "zoh"])
    return (
        f"if {moving or 'the inputs'} stood still between samples, say so, Record(..., "
        'intersample="zoh"), and an mf.Equation takes these samples as they are; else nothing tells what the '
        f"inputs did there, and {lost} of {rec.t.size} samples are left out: {cut}"
    )


def _refuse_lost(what: str, rec: Samples) -> None:
    """Refuse rows lost while an input moved: what it did meanwhile, nothing tells."""
    if rec._lost is None or rec.dt is None:
        return
    rows = present(rec._lost, rec.t.size)
    for first, length in zip(*runs(rec._lost), strict=True):
        if length <= PAUSE:
            continue
        around = slice(max(first - length, 0), first + 2 * length)
        beside = np.arange(rec.t.size)[around][~rec._lost[around]]
        ends = [first - 1, first + length]
        for name, u in zip(rec.inputs, rec.u, strict=True):
            apart = u[beside] - np.interp(rec.t[beside], rec.t[ends], u[ends])
            still = np.mean(apart**2) <= STILL**2 * u.var()
            if still or _missed(rec.t[rows], u[rows], length * rec.dt) <= u.var():
                continue
            raise DataError(
                f"{what}: the record has no samples between t = {rec.t[ends[0]]:.6g} and "
                f"{rec.t[ends[1]]:.6g}{unit_of_time(rec)}, where the input {name!r} moves, and nothing tells "
                "how; cut it there and fit the pieces "
                f"together, mf.fit(rec.split(gap={length * rec.dt / 2:.2g}), model)"
            )


def _pauses(rec: Samples) -> NDArray[np.intp]:
    """Rows before steps that are far longer than the others, and over which no line follows some output."""
    steps = np.diff(rec.t)
    found = np.flatnonzero(steps > PAUSE * steps.mean())
    if not found.size or _dead_bands(rec):
        return found[:0]
    short = steps <= np.median(steps)
    for length in np.unique([float(f"{step:.2g}") for step in steps[found]]):
        for y in rec.y[np.ptp(rec.y, axis=1) > 0]:
            noise = float(np.mean(np.diff(y)[short] ** 2)) / 2
            if _missed(rec.t, y, length) - 1.5 * noise > MOVED**2 * y.var():
                return np.flatnonzero(steps >= 0.95 * length)
    return found[:0]


def _missed(t: F64, y: F64, length: float) -> float:
    """Mean square of what lines over at least this time miss of samples in their middle."""
    left = np.searchsorted(t, t - length / 2, side="right") - 1
    right = np.searchsorted(t, t + length / 2)
    inside = (left >= 0) & (right < t.size)
    if not inside.any():
        return 0.0
    left, right, middle = left[inside], right[inside], t[inside]
    share = (middle - t[left]) / (t[right] - t[left])
    return float(np.mean((y[inside] - (1 - share) * y[left] - share * y[right]) ** 2))
