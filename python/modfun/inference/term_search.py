"""The search for terms: likelihood of a subset, best subsets of its moments, and so on until both agree."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..errors import FitError
from .common import contradicts
from .moments import Estimate, Lines, estimate
from .subsets import Subsets

__all__ = ["FALSE_ALARM", "Search", "Searched", "penalties"]

FALSE_ALARM = 0.01  # chance that any superfluous term of a library comes in
COLOURINGS = 6  # weights from residuals, those of the whole library first
ROUNDS = 12  # of likelihood and subsets
LEAST = 1e-4  # residual variance over that of the levels: less is next to none
MISFIT = 2.0  # times the cost: what was taken from the outputs was no noise
CHANCE = NormalDist().inv_cdf(1 - FALSE_ALARM)  # standard deviations between costs of unlike weights
FINALISTS, NEAR = 4, 4.0  # refitted by likelihood: how many, and how far above the best criterion


@dataclass(frozen=True)
class Searched:
    """What a search found.

    Attributes
    ----------
    chosen : ndarray of bool
    estimate : Estimate
        Maximum likelihood of the chosen candidates.
    subsets : list of (ndarray of bool, float)
        Those seen with their criteria, best first.
    moments : Subsets
        Of the chosen estimate; its costs are in units of the noise.
    scale : float
        Residual variance of the whole library over that of the noise levels; 1 where it is below by chance.
    excess : float
        The same, as it is.
    freedom : int
        Real equations less transient coefficients and candidates.
    coloured : bool
        Whether the residuals contradicted white noise of the levels, and gave the weights instead.
    """

    chosen: Any
    estimate: Estimate
    subsets: list[tuple[Any, float]]
    moments: Subsets
    scale: float
    excess: float
    freedom: int
    coloured: bool = False

    @property
    def criterion(self) -> float:
        """Of the chosen candidates."""
        return self.moments.found.get(np.asarray(self.chosen).tobytes(), np.inf)


def penalties(keep: Any, degrees: Sequence[int], signs: Any = 0) -> F64:
    """What each candidate must lower chi-squared by to come in.

    A superfluous one lowers it by more than its penalty with probability FALSE_ALARM/(2^(d+1) n), n the
    number of candidates of its degree d that are not kept. All probabilities together are below
    FALSE_ALARM, and simple terms come in more easily than those of high degree. A superfluous term has the
    sign that is asked for half of the time.
    """
    degree, free = np.asarray(degrees), ~np.asarray(keep, dtype=bool)
    count = np.bincount(degree[free], minlength=int(degree.max()) + 1)
    share = FALSE_ALARM / (2.0 ** (degree + 1) * np.maximum(count[degree], 1))
    share = np.where(np.asarray(signs) != 0, 2 * share, share)
    return np.array([NormalDist().inv_cdf(one / 2) ** 2 for one in share])


class Search:
    """Looks for the subset of candidates with the lowest cost/scale + penalties.

    Parameters
    ----------
    lines : sequence of Lines
        One per record.
    keep : ndarray of bool
        Candidates that stay.
    degrees : sequence of int
        Of the candidates, as `penalties` has them.
    signs, needs : array_like
        Rules of `Subsets`.
    high_df : float
        Degrees of freedom of the noise levels.
    given : bool
        Whether the levels were given, not read.
    tick : callable
        Called before each search of subsets.
    """

    def __init__(
        self,
        lines: Sequence[Lines],
        keep: Any,
        degrees: Sequence[int],
        signs: Any,
        needs: Any,
        high_df: float,
        given: bool,
        tick: Callable[[], None],
    ) -> None:
        self.lines, self.keep = lines, np.asarray(keep, dtype=bool)
        self.signs, self.needs, self.high_df, self.tick = signs, needs, high_df, tick
        self.given = given
        rows = sum((2 * one.top + 1) * len(one.orders) - one.transient.shape[1] for one in lines)
        self.rows = rows
        self.penalty = penalties(self.keep, degrees, signs)
        self.degrees = np.asarray(degrees)
        self.implicit = np.any([one.implicit for one in lines], axis=0) & ~self.keep

    def run(self) -> Searched:
        """Walks from a first guess, the whole library and its explicit part; goes on from the best end."""
        ends = [self._walk(self._guess())]
        every = ends[0].moments.independent
        whole = estimate(self.lines, every, ends[0].estimate.theta)
        if np.isfinite(whole.cost):
            ends.append(self._walk(whole))
        for less in self._explicit(every):
            ends.append(self._walk(estimate(self.lines, less, ends[0].moments.estimate(less))))
        first = best = self._divided(ends)
        coloured = self._contradicts(first.excess, first.freedom)
        if coloured:
            # A library that leaves more than a part of it went astray.
            near = whole.cost <= best.estimate.cost
            theta, which = whole.theta if near else best.moments.estimate(every), every
            for _ in range(COLOURINGS):
                for one in self.lines:
                    one.colour(theta, which)
                best = self._walk(estimate(self.lines, best.chosen, best.estimate.theta))
                if np.array_equal(best.chosen, which):
                    break
                theta, which = best.estimate.theta, best.chosen
        straight = [one.slopes for one in self.lines]
        for one, y in zip(self.lines, best.estimate.smooth, strict=True):
            one.bend(y)
        bent = estimate(self.lines, best.chosen, best.estimate.theta)
        if bent.cost < MISFIT * best.estimate.cost:
            best = self._walk(bent)
        else:
            for one, slopes in zip(self.lines, straight, strict=True):
                one.slopes = slopes
        rivals = [best]
        for chosen, value in best.subsets[1 : FINALISTS + 1]:
            if value < best.subsets[0][1] + NEAR:
                rivals.append(self._at(estimate(self.lines, chosen, best.moments.estimate(chosen))))
        best = self._divided([self._better(rivals)])
        return replace(best, excess=first.excess, coloured=coloured)

    def _guess(self) -> Estimate:
        """Equal weights on all lines, the noise as large as what the whole library leaves."""
        found = [one.rough() for one in self.lines]
        gram, right = (np.sum(parts, axis=0) for parts in zip(*found, strict=True))
        total = float(sum(len(one.orders) for one in self.lines))
        subsets = self._subsets(gram, right, total)
        every = subsets.independent
        left = (total - right @ subsets.estimate(every)) / (self.rows - every.sum())
        subsets.penalty = self.penalty * max(left, 1e-12)
        chosen = self._found(subsets)[0][0]
        return estimate(self.lines, chosen, subsets.estimate(chosen))

    def _subsets(self, gram: F64, right: F64, constant: float) -> Subsets:
        return Subsets(gram, right, constant, self.penalty, self.keep, self.signs, self.needs)

    def _found(self, subsets: Subsets, seeds: Sequence[Any] = ()) -> list[tuple[Any, float]]:
        self.tick()
        found = subsets.search(seeds)
        if not found:
            raise FitError(
                "select_terms: no subset with the terms of keep= obeys signs= and hierarchy=; keep fewer "
                "terms, or give fewer signs"
            )
        return found

    def _walk(self, start: Estimate) -> Searched:
        """From the moments of one estimate to the best subset, to its estimate, until it stays."""
        now, seen = start, set[bytes]()
        while True:
            found = self._at(now)
            best = found.subsets[0][0]
            if (best == found.chosen).all() or best.tobytes() in seen or len(seen) == ROUNDS:
                return found
            seen.add(best.tobytes())
            now = estimate(self.lines, best, found.moments.estimate(best))

    def _at(self, now: Estimate) -> Searched:
        """The best subsets by the moments of an estimate."""
        q = now.quadratic
        chosen = now.theta != 0
        chosen = chosen | self.keep
        if not np.isfinite(q.cost):
            moments = self._subsets(q.gram, q.right, q.constant)
            return Searched(chosen, now, [(chosen, np.inf)], moments, 1.0, 1.0, self.rows)
        plain = self._subsets(q.gram, q.right, q.constant)
        every = plain.independent
        freedom = self.rows - int(every.sum())
        excess = float(q.constant - q.right @ plain.estimate(every)) / freedom
        scale = max(excess, LEAST) if excess > 1 or self._contradicts(excess, freedom) else 1.0
        moments = self._subsets(q.gram / scale, q.right / scale, q.constant / scale)
        return Searched(chosen, now, self._found(moments, [chosen]), moments, scale, excess, freedom)

    def _contradicts(self, excess: float, freedom: int) -> bool:
        """Whether residuals of the whole library are not what the levels say.

        Below levels that were read they show signal in the high band, as of few samples per period. Levels
        that are given may be larger on purpose.
        """
        return not (self.given and excess < 1) and contradicts(excess, freedom, self.high_df)

    def _explicit(self, which: Any) -> Iterator[Any]:
        """Candidates without the implicit one of the highest degree, without that and the next, and so on."""
        held = np.flatnonzero(which & self.implicit)
        for k in np.argsort(-self.degrees[held], kind="stable"):
            which = which & (np.arange(which.size) != held[k])
            yield which

    def _divided(self, ends: Sequence[Searched]) -> Searched:
        """The best end, also from the chosen terms without one of the implicit ones, or without all.

        Where the true equation E and E + λ·signal·E both fit, E seems absurd with the weights of the latter:
        walks from fewer terms judge it by its own.
        """
        ends, seen = list(ends), set[bytes]()
        while True:
            best = self._shorter(ends)
            held = best.chosen & self.implicit
            more = [best.chosen & (np.arange(held.size) != k) for k in np.flatnonzero(held)]
            new = {less.tobytes(): less for less in (*more, best.chosen & ~held)}
            new = {key: less for key, less in new.items() if held.any() and key not in seen}
            if not new:
                return best
            seen.update(new)
            for less in new.values():
                ends.append(self._walk(estimate(self.lines, less, best.moments.estimate(less))))

    def _shorter(self, ends: Sequence[Searched]) -> Searched:
        """The best end, or one of smaller penalties whose weights may account for the difference.

        Both whitened by weights of their own, residuals of two right equations are not the same numbers, and
        the difference of their sums of squares has a variance beyond that of nested equations: twice that of
        either sum for each part of them that the two do not share.
        """
        best = self._better(ends)
        while True:
            near = [one for one in ends if self._like(one, best)]
            if not near:
                return best
            best = self._better(near)

    def _like(self, end: Searched, best: Searched) -> bool:
        """Whether an end of smaller penalties is worse than the best by chance only."""
        (barred, value), (_, least) = self._ranks([end, best])
        fewer = self.penalty[end.chosen].sum() < self.penalty[best.chosen].sum()
        if barred or not fewer or not np.any((end.chosen ^ best.chosen) & self.implicit):
            return False
        theta, other = end.estimate.theta, best.estimate.theta
        apart = self.rows - sum(one.shared(theta, other) for one in self.lines)
        return bool(value - least < CHANCE * 2 * np.sqrt(max(apart, 0.0)))

    def _better(self, ends: Sequence[Searched]) -> Searched:
        """The end of the lowest criterion."""
        ranks = self._ranks(ends)
        return ends[min(range(len(ends)), key=ranks.__getitem__)]

    def _ranks(self, ends: Sequence[Searched]) -> list[tuple[bool, float]]:
        """Whether each end breaks a rule, and its criterion, all in units of the same noise."""
        scale = min((end.scale for end in ends if np.isfinite(end.estimate.cost)), default=1.0)
        return [
            (
                np.asarray(end.chosen).tobytes() in end.moments.barred,
                end.estimate.cost / scale + float(self.penalty[end.chosen].sum()),
            )
            for end in ends
        ]
