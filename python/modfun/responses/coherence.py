"""Coherence that agrees with the errors of the gains, and a message where the ends of a record spoil it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import C128, F64
from ..records.record import Record
from ..systems.frequency_response import FrequencyResponse
from .fed_back import Piece, left_of_inputs

__all__ = ["agreeing", "spoiled"]

SCREENED = 0.6  # coherence below which gains are commonly left out
FEWEST = 3  # lines: fewer are left to their coherence
MOVING = 1e-3  # of an input's largest power on AROUND lines: below, nobody meant to move it
AROUND = 15
LEFT = 0.4  # of an input's power: where unknown ends leave less, they cost more than noise does


def agreeing(coherence: F64, gains: C128, cov: C128, lines: F64, degree: int) -> F64:
    """The coherence of each output, or less where its gains are known worse than that says.

    The share of power that is no transient is large, too, where transient and response are large and cancel.
    With the covariance C of the gains G of an output, the inputs explain (Gᴴ C⁻¹ G − inputs) c / lines times
    the power of the noise. Here `inputs` is what errors alone would make of it, and c = Σ (2k + 1) P_k(0)²,
    with Legendre's P_k, the variance of a local polynomial over that of an average.
    """
    from scipy.special import eval_legendre

    k = np.arange(degree + 1)
    height = float(np.sum((2 * k + 1) * eval_legendre(k, 0.0) ** 2))
    outputs, inputs, _ = gains.shape
    found = coherence.copy()
    for o in range(outputs):
        own = cov[:, o, :, o, :]
        size = np.sqrt(np.einsum("kii->ki", own).real)
        sure = np.all(np.isfinite(size) & (size > 0), axis=1)
        if not np.any(sure):
            continue
        d = size[sure]
        z = gains[o][:, sure].T / d
        shape = own[sure] / (d[:, :, None] * d[:, None, :])
        square = np.einsum("ki,kij,kj->k", z.conj(), np.linalg.pinv(shape, hermitian=True), z).real
        ratio = np.maximum(square - inputs, 0.0) * height / lines[sure]
        found[o, sure] = np.minimum(coherence[o, sure], ratio / (1 + ratio))
    return found


def spoiled(
    records: list[Record],
    pieces: list[Piece],
    found: FrequencyResponse,
    before: F64,
    degree: int,
    half: Callable[[Piece, int], int],
) -> tuple[str, ...]:
    """A message about frequencies at which errors are large because ends explain what an input does.

    `before`: the coherence that residuals alone say; the others as `left_of_inputs` takes them.
    """
    if found.coherence is None or found.halfwidth is None:
        return ()
    known = ~np.any(np.isnan(found.response), axis=(0, 1))
    fallen = known & np.any((before >= SCREENED) & (found.coherence < SCREENED), axis=0)
    if np.sum(fallen) < FEWEST:
        return ()
    names, omega = found.inputs, found.omega[fallen]
    left = left_of_inputs(pieces, range(len(names)), omega, found.halfwidth[fallen], degree, half)
    near = (left < LEFT) & _moving(pieces[0], omega)
    where = omega[np.any(near, axis=0)]
    if where.size < FEWEST:
        return ()
    moves = " and ".join(name for name, row in zip(names, near, strict=True) if np.any(row))
    longest = max(rec.duration for rec in records)
    return (
        f"At {where.size} of {found.omega.size} frequencies, from {where.min():.4g} to {where.max():.4g} "
        f"rad/s, the gains have large standard errors and a coherence below {SCREENED:g}: {moves} moves "
        "there near the beginning or end of the record only, as sweeps do, which unknown initial and final "
        "states explain as well. First let the record rest before and after the sweep, each for an eighth of "
        f"its time ({longest / 8:.3g} s) or more; else leave these gains out.",
    )


def _moving(piece: Piece, omega: F64) -> NDArray[np.bool_]:
    """Where inputs have power, (input, omega)."""
    from scipy.ndimage import uniform_filter1d

    power = np.abs(piece[2][:, 1:]) ** 2
    level = uniform_filter1d(power, min(AROUND, power.shape[1]), axis=1, mode="nearest")
    lines = np.clip(np.rint(omega / piece[0]).astype(int) - 1, 0, power.shape[1] - 1)
    moving: NDArray[np.bool_] = level[:, lines] > MOVING * level.max(axis=1, keepdims=True)
    return moving
