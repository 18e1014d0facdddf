"""Masked samples in a fit: what stands in their place, and how little it may be trusted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .._core import noise_level
from ..base.arrays import F64
from ..errors import DataError, ModfunError
from ..records.mask import runs
from ..records.record import Record
from ..results.cures import again, on_band
from ..results.estimates import COVARIANCES
from ..results.unknown_past import from_known_inputs, lead

__all__ = ["across", "apart", "blind", "bridged", "relative", "variances", "weighs"]

AnyFit = TypeVar("AnyFit", bound=Any)

LONGEST = 0.1  # of a record may be hidden in a row; beyond, errors are far too small
UNEVEN = 0.3  # scatter of the steps, over their mean, that correlates lines
IGNORED = 1e8  # variance of a sample that counts for nothing, over the others'
BLIND = 100.0  # the same of one whose bridged value tells nothing worth having
ROUNDS, SETTLED = 8, 0.1  # of fits with simulated values in gaps; a move in standard errors that ends them
MOST = 0.7  # of the samples that count: in pieces between gaps
SHORTEST = 16  # samples that count between gaps: a record of their own
ASTRAY = 10.0  # times the largest sample: a simulation beyond it fills no gap
REGULAR = 1.5  # times the steps between the samples beside it: a gap that is longer is no part of a rhythm
BRIDGED = 3  # samples in a row, as the polynomial of more multiplies noise, which products do not forgive
NEAR, FAR = 4, 6  # good samples through which a polynomial bridges a gap, and more to see its error


def bridged(rec: Record) -> tuple[F64, F64, F64]:
    """Outputs with masked samples interpolated, how far each may be off, and the noise in each.

    A polynomial through the `FAR` nearest good samples bridges a gap; the difference from that through the
    `NEAR` nearest ones is treated as its error. Of a gap of more than `FAR` samples nothing is known, as
    inputs may have moved in it, unless all gaps there are as long.

    Returns
    -------
    tuple of ndarray (output, time)
        The third is the noise's variance over that of a good sample. Errors and noise of one gap go together:
        both are such that independent ones of this size have no smaller sum.

    Raises
    ------
    DataError
        A gap of more than `LONGEST` of the record.
    """
    y, off, noise = rec.y.copy(), np.zeros_like(rec.y), np.ones_like(rec.y)
    if rec.mask is None:
        return y, off, noise
    for i, good in enumerate(rec.mask):
        known = np.flatnonzero(good)
        edges = np.concatenate([[-1], known, [good.size]])
        longest = int(np.argmax(np.diff(edges)))
        hidden = int(edges[longest + 1] - edges[longest] - 1)
        if hidden > LONGEST * good.size:
            raise DataError(
                f"fit: a gap hides {hidden} of {good.size} samples of {rec.outputs[i]!r} in a row, from "
                f"{rec.t[edges[longest] + 1]:.6g} s on; what lies around it are records of their own: fit "
                "them together, mf.fit([rec.window(...), rec.window(...)], model)"
            )
        gaps = np.flatnonzero(~good)
        first, _ = _through(rec.t, rec.y[i], known, gaps, NEAR)
        y[i, gaps], weights = _through(rec.t, rec.y[i], known, gaps, FAR)
        begins = np.flatnonzero(np.diff(gaps, prepend=-2) > 1)
        lengths = np.diff(begins, append=gaps.size)
        off[i, gaps] = np.abs(y[i, gaps] - first) * np.sqrt(np.repeat(lengths, lengths))
        off[i, _lost(good)] = np.inf
        # A sum over the record counts each sample 1 + c times, c the sum of its weights in a gap's samples.
        own = np.sum(np.add.reduceat(weights, begins) ** 2, axis=1) if gaps.size else lengths
        noise[i, gaps] = np.repeat(1 + own / lengths, lengths)
    # What flies off tells nothing: the neighbours' range is all that can be said.
    wild = ~np.isfinite(y) | (np.abs(y - rec.y) > np.ptp(rec.y, axis=1, keepdims=True))
    y, off = np.where(wild, rec.y, y), np.where(wild, np.inf, off)
    return np.ascontiguousarray(y), off, noise


def blind(rec: Record, variance: F64 | None) -> NDArray[np.bool_] | None:
    """Masked samples of which nothing is known (output, time); None where there are none."""
    if variance is None or rec.mask is None:
        return None
    found = ~rec.mask & ~(relative(variance) < BLIND)
    return found if found.any() else None


def across(
    fit: AnyFit,
    outputs: Sequence[F64],
    blinds: Sequence[NDArray[np.bool_] | None],
    refit: Callable[[list[F64]], AnyFit],
) -> AnyFit:
    """The fit of `outputs` with the model's own response where they are blind, `refit` until nothing moves.

    Of equations that are not linear the fit of the pieces between the gaps, if these are most of the records.

    What stands there has no weight in the criterion, but it is in the columns that each step is taken by: far
    from the response, steps lead astray or do not end. The fit of what lies around the gaps, as records of
    their own, is another start; of both ends the better one is kept.
    """
    if all(hidden is None for hidden in blinds):
        return fit
    linear = fit.layout.rational or fit.structure.linear
    pieces = _around(fit)
    if pieces is not None and not linear and _part(pieces.records, fit.records) >= MOST:
        return _between(fit, pieces, outputs, blinds, refit)  # type: ignore[no-any-return]
    found = [_settled(fit, outputs, blinds, refit)]
    if pieces is not None:
        start = replace(fit, params=pieces.params)
        if (other := _settled(start, outputs, blinds, refit)) is not start:
            found.append(other)
    return min(found, key=lambda one: (not one.usable, one.cost))


def _between(fit: Any, pieces: Any, outputs: Sequence[F64], blinds: Sequence[Any], refit: Any) -> Any:
    """The fit of pieces that are most of the records, as that of the records.

    Powers and products of what stands in a gap are in the columns of equations that are not linear, and no
    round of filling ends at the truth. Estimates and covariances are those of the pieces; residual lines
    those of the records with their response in the gaps.
    """
    own = {name: getattr(pieces, name) for name in ("params", "status", "nit", "df_spectral", *COVARIANCES)}
    filled = _filled(replace(fit, params=pieces.params), outputs, blinds)
    other = fit if filled is None else refit(filled)
    if not other.usable:  # residual lines of the pieces are better than none
        return replace(pieces, options=fit.options)
    return replace(other, **own)


def apart(rec: Record) -> list[tuple[Record, slice]]:
    """What lies around lost gaps, and where, if that is most of a record; else the record.

    What stands in a gap has no weight, but powers and products of it are in the candidates of equations.
    """
    found = _pieces(rec, BRIDGED) if rec.mask is not None else []
    return found if _part([piece for piece, _ in found], [rec]) >= MOST else [(rec, slice(None))]


def _part(pieces: Sequence[Record], records: Sequence[Record]) -> float:
    """Of the samples of records that count, those of their pieces."""
    whole, kept = (sum(int(np.sum(_counting(rec))) for rec in each) for each in (records, pieces))
    return kept / whole


def _counting(rec: Record) -> NDArray[np.bool_]:
    """Which samples count, (output, time)."""
    return np.ones_like(rec.y, bool) if rec.mask is None else rec.mask


def _settled(
    fit: AnyFit, outputs: Sequence[F64], blinds: Sequence[Any], refit: Callable[[list[F64]], AnyFit]
) -> AnyFit:
    for _ in range(ROUNDS):
        if not fit.usable or (filled := _filled(fit, outputs, blinds)) is None:
            return fit
        before, fit = fit, refit(filled)
        moved = np.max(np.abs(fit.params - before.params) / np.where(fit.bse > 0, fit.bse, np.inf), initial=0)
        if fit.success and moved < SETTLED:
            break
    return fit


def _filled(fit: Any, outputs: Sequence[F64], blinds: Sequence[Any]) -> list[F64] | None:
    """The outputs with the response where they are blind; None where a simulation goes astray."""
    try:
        simulated = [y for y, _ in map(fit.simulate, from_known_inputs(fit))]
    except ModfunError:
        return None
    found = []
    for k, (y, own, hidden) in enumerate(zip(simulated, outputs, blinds, strict=True)):
        first = lead(fit, k)  # the fit has no use for those before
        if np.max(np.abs(y[:, first:])) > ASTRAY * np.max(np.abs(own)):
            return None
        found.append(own.copy())
        if hidden is not None:
            found[-1][:, first:] = np.where(hidden, y, own)[:, first:]
    return found


def _around(fit: Any) -> Any:
    """The fit of what lies around lost gaps, as records of their own; None where there is none."""
    pieces = [piece for rec in fit.records for piece, _ in _pieces(rec)]
    if sum(piece.t.size for piece in pieces) == sum(rec.t.size for rec in fit.records):
        return None  # no gap is to be left out
    if not pieces or fit.again is None:
        return None
    options = on_band(fit, fit.band) if fit.usable else fit.options
    return again(fit, tuple(pieces), fit.structure, options)


def _pieces(rec: Record, most: int = FAR) -> list[tuple[Record, slice]]:
    """What lies around lost gaps, and where, as far as it is long enough for a record of its own."""
    pieces, counts = [], _counting(rec)
    lost = np.array([_lost(good, most, ends=False) for good in counts])
    edges = np.flatnonzero(np.diff(~lost.any(axis=0), prepend=False, append=False)).reshape(-1, 2)
    for a, b in edges:
        whole = a + np.flatnonzero(counts[:, a:b].all(axis=0))  # nothing is beyond these to lead a curve
        if lost.any() and whole.size:
            a, b = whole[0], whole[-1] + 1
        if counts[:, a:b].sum(axis=1).min() >= SHORTEST:
            pieces.append((rec.window(rec.t[a], rec.t[b - 1]), slice(a, b)))
    return pieces


def weighs(rec: Record) -> bool:
    """Whether samples count differently: masked ones, given variances, or steps of unequal length.

    Dense samples have small quadrature weights, and so has their noise, which correlates the lines.
    """
    if rec.mask is not None or rec.sigma is not None:
        return True
    if rec.dt is not None:
        return False
    steps = np.diff(rec.t)
    return bool(np.std(steps) > UNEVEN * np.mean(steps))


def variances(rec: Record, off: F64, noise: F64, order: int) -> F64 | None:
    """Variance of each sample of the outputs (output, time), infinite where nothing is known; None if even.

    An interpolated sample has the noise of those around it and the square of its possible error, in units of
    the noise that the upper harmonics show. Without noise there it counts for nothing.
    """
    if not weighs(rec):
        return None
    found = np.ones_like(rec.y) if rec.sigma is None else rec.sigma**2
    if rec.mask is not None:
        level = np.zeros(len(rec.y))
        if rec.dt is not None and rec.intervals >= 8 * (order + 4):
            level = noise_level(np.ascontiguousarray(rec.y), order)
        with np.errstate(divide="ignore", invalid="ignore"):
            usual = np.median(found, axis=1, keepdims=True)  # whose noise the level is
            own = found * noise + usual * (off / level[:, None]) ** 2
        found = np.where(rec.mask, found, np.where(np.isfinite(own), own, np.inf))
    return np.ascontiguousarray(found)


def relative(variance: F64) -> F64:
    """Variances of samples over the median of their channel; what tells nothing has a large one."""
    usual = np.array([np.median(row[np.isfinite(row)]) for row in variance])[:, None]
    return np.asarray(np.minimum(variance / usual, IGNORED))


def _lost(good: NDArray[np.bool_], most: int = FAR, *, ends: bool = True) -> NDArray[np.bool_]:
    """Samples in gaps of which nothing is known: of more than `most`, and longer than those beside them.

    A channel slower than its record has gaps all along, and a polynomial through its samples is sound.
    `ends`: with those before the first and behind the last of its samples, where it leads nowhere.
    """
    known, found = np.flatnonzero(good), np.zeros(good.size, bool)
    count = min(FAR, known.size)
    for begin, length in zip(*runs(~good), strict=True):
        if length <= most:
            continue
        at = int(np.searchsorted(known, begin))
        first = min(max(at - count // 2, 0), known.size - count)
        usual = float(np.median(np.diff(known[first : first + count])))
        found[begin : begin + length] = length > REGULAR * usual or (ends and at in (0, known.size))
    return found


def _through(t: F64, y: F64, known: NDArray[np.intp], gaps: NDArray[np.intp], count: int) -> tuple[F64, F64]:
    """Values at `gaps` of the polynomials through their nearest `known` samples, and the weights of these."""
    count = min(count, known.size)
    first = np.clip(np.searchsorted(known, gaps) - count // 2, 0, known.size - count)
    around = known[first[:, None] + np.arange(count)]
    apart = t[gaps][:, None] - t[around]
    between = t[around][:, :, None] - t[around][:, None, :]
    same = np.eye(count, dtype=bool)
    others = np.where(same, 1.0, np.broadcast_to(apart[:, None, :], between.shape)).prod(axis=2)
    weights = others / np.where(same, 1.0, between).prod(axis=2)
    return np.asarray((weights * y[around]).sum(axis=1)), np.asarray(weights)
