"""Masked samples in a fit: what stands in their place, and how little it may be trusted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._core import noise_level
from ..base.arrays import F64
from ..errors import DataError
from ..records.record import Record

__all__ = ["bridged", "relative", "variances", "weighs"]

LONGEST = 0.1  # of a record may be hidden in a row; beyond, errors are far too small
UNEVEN = 0.3  # scatter of the steps, over their mean, that correlates lines
IGNORED = 1e8  # variance of a sample that counts for nothing, over the others'
NEAR, FAR = 4, 6  # good samples through which a polynomial bridges a gap, and more to see its error


def bridged(rec: Record) -> tuple[F64, F64, F64]:
    """Outputs with masked samples interpolated, how far each may be off, and the noise in each.

    A polynomial through the `FAR` nearest good samples bridges a gap; the difference from that through the
    `NEAR` nearest ones is treated as its error. Across long gaps it grows beyond all measure.

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
        # A sum over the record counts each sample 1 + c times, c the sum of its weights in a gap's samples.
        own = np.sum(np.add.reduceat(weights, begins) ** 2, axis=1) if gaps.size else lengths
        noise[i, gaps] = np.repeat(1 + own / lengths, lengths)
    # What flies off tells nothing: the neighbours' range is all that can be said.
    wild = ~np.isfinite(y) | (np.abs(y - rec.y) > np.ptp(rec.y, axis=1, keepdims=True))
    y, off = np.where(wild, rec.y, y), np.where(wild, np.inf, off)
    return np.ascontiguousarray(y), off, noise


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
            own = found * noise + (off / level[:, None]) ** 2
        found = np.where(rec.mask, found, np.where(np.isfinite(own), own, np.inf))
    return np.ascontiguousarray(found)


def relative(variance: F64) -> F64:
    """Variances of samples over the median of their channel; what tells nothing has a large one."""
    usual = np.array([np.median(row[np.isfinite(row)]) for row in variance])[:, None]
    return np.asarray(np.minimum(variance / usual, IGNORED))


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
