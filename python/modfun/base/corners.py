"""Corners of a smooth signal, at samples and between them, and what sums over samples make of them."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

from .._core import corners as found_by_core
from .arrays import F64, I64

__all__ = ["TAPS", "Corners", "corners"]

Mask = NDArray[np.bool_]

SIDE = 3  # differences on each side, of a cubic or of a decay
CERTAIN = 64.0  # times less than a parabola leaves a decay open,
DECAY = (0.13, 0.999)  # whose differences have such quotients: of lags from half a sample on
LEAST = 1e-9  # of the range: rounding
CLOSER = 8  # rounds of Newton's method
HIGHEST = 6  # derivative whose jump is looked at
TAPS = np.arange(-2, 4)  # places around the sample before a corner
BERNOULLI = (1.0, -1 / 2, 1 / 6, 0.0, -1 / 30, 0.0, 1 / 42, 0.0, -1 / 30, 0.0, 5 / 66, 0.0, -691 / 2730)
POWERS = np.array([[comb(q, k) * BERNOULLI[q - k] if k <= q else 0.0 for k in range(13)] for q in range(13)])
# The integral of tᵐ tᵖ/p!, t counted from the corner on, has (−1)^(p+m+1) B_{p+m+1}(part)/(p! (p+m+1)) more
# than the sum over samples, with Bernoulli's polynomials: so have the taps.
ORDER = np.arange(TAPS.size)[:, None] + np.arange(1, HIGHEST + 1) + 1
MORE = (-1.0) ** ORDER / (ORDER * np.array([factorial(p) for p in range(1, HIGHEST + 1)]))


@dataclass(frozen=True)
class Corners:
    """Jumps of the slope, in the order of time.

    Attributes
    ----------
    at : ndarray of int, shape (corner,)
        Samples that they are at or after,
    part : ndarray, shape (corner,)
        by this part of a step, from 0 on.
    values : ndarray, shape (corner,)
        Of the signal.
    taps : ndarray, shape (corner, 6)
        What, added to the samples from two before `at` on, makes their sum the signal's integral.
    """

    at: I64
    part: F64
    values: F64
    taps: F64


@np.errstate(all="ignore")  # numbers of any size
def corners(samples: F64) -> Corners | None:
    """Corners of a signal in even steps; none in noise.

    On either side of a step between two samples a cubic goes through four samples, or a decay A + B exp(−t/τ)
    where that leaves far less open at the last; both meet at the corner. Those at samples are found by the
    same, of which both sides have the sample. Of two that are near, what leaves less open is one.
    """
    on, after = found_by_core(samples)
    if not on and not after:
        return None
    step = np.diff(samples)
    rounding = LEAST * float(np.ptp(samples))
    # Sides by their last sample: ahead of a corner from 0 on, behind it from SIDE on.
    (open_ahead, rising), (open_behind, falling) = _sides(step)
    between = np.repeat([0, 1], [len(on), len(after)])
    at = np.array([*on, *after], dtype=np.int64)
    found = _meeting(samples, step, at, between, (falling[at - SIDE], rising[at + between]))
    left = (open_behind[at - SIDE] + open_ahead[at + between] + rounding) / np.abs(found[2])
    left = np.where(np.isfinite(found[3]).all(axis=1), left, np.inf)
    place, kept = (found[0] + at).tolist(), list[int]()
    for k in np.argsort(left * (1 + between), kind="stable").tolist():  # those at samples are surer
        if np.isfinite(left[k]) and all([abs(place[k] - place[other]) >= SIDE for other in kept]):
            kept.append(k)
    if not kept:
        return None
    kept.sort(key=place.__getitem__)
    part, values, _, taps = (each[kept] for each in found)
    return Corners(at[kept], part, values, taps)


def _sides(step: F64) -> tuple[tuple[F64, Mask], tuple[F64, Mask]]:
    """Ahead and behind: what three differences leave open for the next step, and which decay."""
    first, middle, last = step[:-2], step[1:-1], step[2:]
    left, decay = np.abs(first - 2 * middle + last), np.abs(first * last - middle * middle)
    sides = []
    for near, quotient in ((first, middle / first), (last, last / middle)):
        size = np.abs(near)
        decays = (CERTAIN * decay < left * size) & (quotient > DECAY[0]) & (quotient < DECAY[1])
        sides.append((np.where(decays, decay / size, left), decays))
    return sides[0], sides[1]


def _meeting(
    samples: F64, step: F64, at: I64, between: I64, decays: tuple[Mask, Mask]
) -> tuple[F64, F64, F64, F64]:
    """Where both sides meet, in steps after `at`, the value, the jump of the slope and the taps."""
    behind = _Sides(step[at - 1], step[at - 2], step[at - 3], decays[0])
    first = at + between
    ahead = _Sides(step[first], step[first + 1], step[first + 2], decays[1])
    own = between * step[at]
    part = (between * 0.5).astype(np.float64)
    for _ in range(CLOSER if between.any() else 0):
        there, back = ahead.at(part - between), behind.at(-part)
        nearer: F64 = part - (own + there[0] + back[0]) / (there[1] - back[1])
        part = (between * np.clip(nearer, 0.0, 1.0)).astype(np.float64)
    there, back = ahead.at(part - between), behind.at(-part)
    jumps = there[1:] + back[1:] * (-1.0) ** np.arange(1, HIGHEST + 1)[:, None]
    bernoulli = POWERS @ part ** np.arange(len(POWERS))[:, None]
    more = np.einsum("mp,mpc,pc->cm", MORE, bernoulli[ORDER], jumps)
    powers = (TAPS - part[:, None])[:, None, :] ** np.arange(TAPS.size)[:, None]
    taps: F64 = np.linalg.solve(powers, more[..., None])[..., 0]
    return part, samples[at] - back[0], jumps[0], taps


class _Sides:
    """What runs through three differences each, nearest first, from the samples next to corners."""

    def __init__(self, near: F64, following: F64, far: F64, decays: Mask) -> None:
        self.decays, self.near = decays, near
        self.ratio = np.where(decays, following, 0.5) / np.where(decays, near, 1.0)
        self.bend, self.third = following - near, far - 2 * following + near

    def at(self, place: F64) -> F64:
        """Values over that sample's and derivatives, at places that are below 0 towards the corner."""
        powers = np.log(self.ratio) ** np.arange(HIGHEST + 1.0)[:, None]
        size = self.near / (self.ratio - 1)
        found = powers * self.ratio**place * size
        found[0] -= size
        b, c, d = self.near - self.bend / 2 + self.third / 3, (self.bend - self.third) / 2, self.third / 6
        cubic = np.zeros_like(found)
        cubic[0] = ((d * place + c) * place + b) * place
        cubic[1] = (3 * d * place + 2 * c) * place + b
        cubic[2], cubic[3] = 6 * d * place + 2 * c, 6 * d
        return np.asarray(np.where(self.decays, found, cubic))
