"""Single samples that are wrong: of outputs in the residuals, of inputs by a fit without them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .._core import sharpest
from ..base.arrays import F64
from ..base.cached import kept
from ..base.student import likelihood
from ..errors import ModfunError
from ..records.mask import runs
from ..records.record import Record
from ..records.spikes import SHARE, lone
from ..records.words import first_times, without_samples
from .cures import WORTH, again, bic_beside, on_band
from .doubts import Doubt
from .estimates import Estimates
from .misfit import suspicious

__all__ = ["spikes"]

SHARP = 6.0  # times the mean fourth difference, below which no sample of an output sticks out of its noise
BESIDE = 3  # samples on either side of a residual that it is compared with; ends have none
AROUND = 32  # the same that show how strong the noise is there
FAR, BEYOND = 6.0, 4.0  # times the noise: the largest spike at least, and others
TAILS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0)  # degrees of freedom of noise without spikes
GAIN = 4.0  # of log likelihood of spikes in normal noise over such noise
QUIET = 0.1  # of the usual noise of a record, at least, is that around a sample
RUN = 2  # samples in a row, at most: what lasts is an event
STEPS = 4.0  # of the resolution of a channel, at least: rounding makes smaller ones
FINE = 0.01  # of the standard deviation of an output, at least
NEAR = 2  # samples after a jump of an input at which an output may jump, too
INPUTS = 3.0, 0.1  # usual bends of an input, and part of its standard deviation, that are tried


@kept
def spikes(fit: Estimates) -> Doubt | None:
    """That single samples are far from all that the model and its noise explain.

    Of an output: normal noise with spikes is likelier than noise with heavy tails. Of an input: with the
    samples beside them in their place BIC falls, which it does not where an input was an impulse.
    """
    records = fit.records or ()
    for k, rec in enumerate(records):
        for name in rec.inputs:
            found, fallen = _of_input(fit, k, name)
            if found.size:
                return _told(rec, name, found, k, fallen)
    for k, rec in enumerate(records):
        for name in rec.outputs:
            found = _of_output(fit, rec, name)
            if found.size:
                return _told(rec, name, found, k, "The model and its noise explain no such sample")
    return None


def _told(rec: Record, name: str, places: NDArray[np.intp], k: int, why: str) -> Doubt:
    where = f" of record {k}" if k else ""
    kind, cure = "Output" if name in rec.outputs else "Input", without_samples(rec, name, places)
    several = "a spike" if places.size == 1 else f"{places.size} spikes"
    other = ", or weight all samples, robust=True" if name in rec.outputs else ""
    return Doubt(
        f"{kind} {name!r}{where} has {several}, at t = {first_times(rec, places)} s. {why}. "
        f"First {cure}{other}."
    )


def _of_output(fit: Estimates, rec: Record, name: str) -> NDArray[np.intp]:
    """Samples of an output that residuals show to be wrong; none where weights take care of them."""
    none, i = np.zeros(0, np.intp), rec.outputs.index(name)
    weighed = fit.options.robust or rec.sigma is not None
    if weighed or np.count_nonzero(rec._good(name)) < 2 * AROUND:
        return none
    if not (sharpest(rec.y[i : i + 1]) > SHARP or suspicious(fit)):
        return none
    errors = _errors(fit, rec)
    if errors is None:
        return none
    steps = np.diff(np.unique(rec.y[i]))
    least = max(STEPS * float(steps.min(initial=0.0)), FINE * float(rec.y[i].std()))
    good = np.flatnonzero(rec._good(name))  # what stands for masked samples is no measurement
    off, usual, near = _apart(errors[i, good])
    z = np.abs(off) / np.maximum(usual, near)
    found = (z > BEYOND) & (np.abs(off) > least)
    found[:BESIDE] = found[-BESIDE:] = False
    if not 0 < found.sum() <= SHARE * z.size + 1 or not z[found].max() > FAR:
        return none
    places, lengths = good[found], runs(found)[1]
    several = lengths.max() > RUN or 2 * np.count_nonzero(lengths > 1) > lengths.size
    if several or 2 * _at_jumps(rec, places) >= places.size:
        return none
    return places if _gain(off / np.maximum(near, QUIET * usual), found) > GAIN else none


def _apart(errors: F64) -> tuple[F64, float, F64]:
    """How far residuals are from the median of those beside them; the noise of all, and around each."""
    beside = np.delete(_windows(errors, 2 * BESIDE + 1), BESIDE, axis=1)
    off = errors - np.median(beside, axis=1)
    size = 1.4826 * np.abs(off)
    usual = float(np.median(size)) + 1e-12 * float(np.ptp(errors)) + 1e-300
    return off, usual, np.median(_windows(size, 2 * AROUND + 1), axis=1)


def _windows(row: F64, count: int) -> F64:
    return np.lib.stride_tricks.sliding_window_view(np.pad(row, count // 2, mode="reflect"), count)


def _gain(z: F64, spike: NDArray[np.bool_]) -> float:
    """Log likelihood of spikes of any size in normal noise, over that of noise with heavy tails."""
    n, k, rest = z.size, int(spike.sum()), z[~spike]
    inside = -0.5 * (n - k) * (math.log(2 * math.pi * float(np.mean(rest**2))) + 1)
    outside = -k * math.log(2 * float(np.abs(z).max()))
    split = k * math.log(k / n) + (n - k) * math.log1p(-k / n)
    return inside + outside + split - max(likelihood(z, tail)[0] for tail in TAILS)


def _errors(fit: Estimates, rec: Record) -> F64 | None:
    """Outputs less their simulation; None where that leaves the range of numbers."""
    try:
        errors: F64 = rec.y - fit.simulate(rec)[0]
    except (ModfunError, np.linalg.LinAlgError):
        return None
    return errors if np.all(np.isfinite(errors)) else None


def _at_jumps(rec: Record, places: NDArray[np.intp]) -> int:
    """How many of these samples are where an input jumps as it seldom does."""
    near = np.zeros(rec.t.size, bool)
    for u in rec.u:
        change = np.abs(np.diff(u))
        large = change > max(5 * float(np.median(change)), 0.1 * float(np.ptp(u)))
        if large.mean() < SHARE:
            for late in range(NEAR + 1):
                near[1 + late :] |= large[: large.size - late]
    return int(near[places].sum())


def _of_input(fit: Estimates, k: int, name: str) -> tuple[NDArray[np.intp], str]:
    """Samples of an input that explain more where those beside them stand in their place, and how much."""
    none, records = (np.zeros(0, np.intp), ""), fit.records or ()
    rec = records[k]
    times, part = INPUTS
    found = lone(rec[name], times, part * float(rec[name].std()))
    if fit.again is None or not 0 < found.size <= SHARE * rec.t.size + 1:
        return none
    good = np.ones(rec.t.size, bool)
    good[found] = False
    u = rec.u.copy()
    u[rec.inputs.index(name)] = np.interp(rec.t, rec.t[good], rec[name][good])
    filled = rec._like(u=u)
    options = on_band(fit, fit.band).replace(robust=False)
    plain = fit if not math.isfinite(fit.tail) else again(fit, records, fit.structure, options)
    changed = tuple([filled if own is rec else own for own in records])
    other = again(fit, changed, fit.structure, options)
    if plain is None or other is None:
        return none
    before, after = bic_beside(plain, plain), bic_beside(other, plain)
    if not after < before - WORTH - found.size * math.log(rec.t.size):
        return none
    return found, f"With the samples beside them in their place BIC falls from {before:.4g} to {after:.4g}"
