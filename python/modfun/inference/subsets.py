"""The best subsets of candidate terms from their Gram matrix: beams forward and backward, then exchange.

Each subset S has a table, the moments [[G, r], [rᵀ, c]] swept on S (Goodnight, Am. Stat. 33, 1979): −(G_SS)⁻¹
within S, what S leaves of G outside, its estimate and what it leaves of r in the last column, and its cost in
the corner. To put a candidate in or to take it out is one sweep, O(candidates²), and what that does to the
cost is the square of its last entry over its diagonal entry.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import cached_property

__all__ = ["Subsets"]

COLLINEAR = 1e-8  # least part of a column's power that the chosen ones leave
SAME = 1e-9  # of a penalty: a smaller change is none
RIDGE = 1e-13  # of columns of unit size
WIDTH = 16  # subsets of each size that are followed
PATIENCE = 4  # sizes without a better subset before the forward beam ends
POLISHED = 4  # best subsets that are tried for exchanges


class Subsets:
    """Subsets by cost + penalties, the cost being constant − rᵀG⁻¹r over the subset.

    Parameters
    ----------
    gram, right : ndarray, shape (candidate, candidate) and (candidate,)
        Of columns of any size.
    constant : float
        Cost of no candidate.
    penalty : ndarray, shape (candidate,)
        Of each candidate, in units of the cost.
    keep : ndarray of bool, shape (candidate,)
        What always stays.
    signs : sequence of int, optional
        1 or -1 where the sign of an estimate is given, otherwise 0.
    needs : ndarray of bool, shape (candidate, candidate), optional
        Row k marks what must be in where k is.

    The beams pass through subsets that break these two rules, but only others are found.
    """

    def __init__(
        self,
        gram: F64,
        right: F64,
        constant: float,
        penalty: F64,
        keep: Any,
        signs: Any = None,
        needs: Any = None,
    ) -> None:
        self.root = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        self.gram, self.right = gram / self.root[:, None] / self.root, right / self.root
        self.penalty, self.keep = penalty, np.asarray(keep, dtype=bool)
        self.empty = np.block([[self.gram, self.right[:, None]], [self.right, constant]])
        self.empty[np.diag_indices(penalty.size)] += RIDGE
        self.signs = np.zeros(penalty.size, dtype=int) if signs is None else np.asarray(signs)
        self.needs = np.zeros_like(self.gram, dtype=bool) if needs is None else np.asarray(needs, dtype=bool)
        self.ruled = bool(self.signs.any() or self.needs.any())
        self.found: dict[bytes, float] = {}
        self.barred: dict[bytes, float] = {}

    @cached_property
    def independent(self) -> Any:
        """A largest subset of columns that can be told apart: by pivots, those that stay first."""
        return self._swept(np.ones_like(self.keep))[0]

    def estimate(self, chosen: Any) -> F64:
        """Least squares of a subset; the other candidates are zero."""
        at = np.flatnonzero(chosen)
        theta = np.zeros(self.right.size)
        theta[at] = np.linalg.lstsq(self.gram[np.ix_(at, at)], self.right[at], rcond=RIDGE)[0]
        return np.asarray(theta / self.root)

    def covariance(self, chosen: Any) -> F64:
        """Covariance of the estimate of a subset, in units of the cost."""
        at = np.flatnonzero(chosen)
        found = np.zeros_like(self.gram)
        found[np.ix_(at, at)] = np.linalg.pinv(self.gram[np.ix_(at, at)], rcond=RIDGE, hermitian=True)
        return np.asarray(found / self.root[:, None] / self.root)

    def search(self, seeds: Iterable[Any] = ()) -> list[tuple[Any, float]]:
        """Every subset seen with its criterion, best first; `seeds` are tried for exchanges as well."""
        self._forward()
        self._backward()
        if self.ruled:
            for start in (*self._best(self.found, POLISHED), *self._best(self.barred, POLISHED), *seeds):
                self._obey(np.asarray(start) | self.keep)
        else:
            for start in (*self._best(self.found, POLISHED), *seeds):
                self._polish(np.asarray(start) | self.keep)
        for start in {one.tobytes(): one for one in (*self._best(self.found, 1), *seeds)}.values():
            self._exchange(np.asarray(start) | self.keep)
        return [(self._mask(key), value) for key, value in sorted(self.found.items(), key=lambda x: x[1])]

    def _best(self, subsets: dict[bytes, float], count: int) -> list[Any]:
        return [self._mask(key) for key in sorted(subsets, key=subsets.__getitem__)[:count]]

    def _obey(self, start: Any) -> None:
        """Changes of one candidate and exchanges, each made to obey the rules, until none is better."""
        mask, value = self._lawful(start)
        while True:
            near = np.repeat(mask[None], mask.size, axis=0) ^ np.eye(mask.size, dtype=bool)
            ins, outs = near[~mask], np.flatnonzero(mask & ~self.keep)
            swaps = np.repeat(ins, outs.size, axis=0)
            swaps[np.arange(len(swaps)), np.tile(outs, len(ins))] = False
            trials = {one.tobytes(): one for one in (*ins, *near[outs], *swaps)}
            best, lowest = min(map(self._lawful, trials.values()), key=lambda x: x[1], default=(mask, value))
            if not lowest < value - SAME * max(self.penalty.max(), 1e-300):
                return
            mask, value = best, lowest

    def _lawful(self, chosen: Any) -> tuple[Any, float]:
        """A subset with what it needs and without wrong signs, and its criterion, which is kept."""
        mask = chosen | self.needs[chosen].any(axis=0)
        while True:
            theta = self.estimate(mask)
            wrong = mask & (self.signs * theta < 0)
            if not np.any(wrong & ~self.keep):
                break
            mask = mask & (~wrong | self.keep)
            mask = mask & (self.keep | ~(self.needs & ~mask).any(axis=1))
        if np.any(wrong) or np.any(self.needs[mask].any(axis=0) & ~mask):  # of what always stays
            return mask, np.inf
        value = self.empty[-1, -1] - RIDGE - self.right @ (theta * self.root) + self.penalty[mask].sum()
        return mask, self.found.setdefault(mask.tobytes(), float(value))

    def _mask(self, key: bytes) -> Any:
        return np.frombuffer(key, dtype=bool)

    def _swept(self, chosen: Any) -> tuple[Any, F64]:
        """What of a subset can be told apart, with all that stays, and its table: largest pivots first."""
        mask, table = np.zeros_like(self.keep), self.empty
        for first, least in ((self.keep, 0.0), (chosen & ~self.keep, COLLINEAR)):
            while True:
                pivots = np.where(first & ~mask, np.diag(table)[:-1], 0.0)
                j = int(np.argmax(pivots))
                if pivots[j] <= least:
                    break
                mask[j] = True
                table = _sweep(table[None], np.array([j]), out=False)[0]
        return mask | self.keep, table

    def _forward(self) -> None:
        mask, table = self._swept(self.keep)
        masks, tables, best, since = mask[None], table[None], np.inf, 0
        self._record(masks, tables)
        while since < PATIENCE:
            masks, tables, values = self._next(masks, tables, ~masks)
            lowest = values.min(initial=np.inf)
            best, since = (lowest, 0) if lowest < best else (best, since + 1)

    def _backward(self) -> None:
        mask, table = self._swept(np.ones_like(self.keep))
        masks, tables = mask[None], table[None]
        self._record(masks, tables)
        while len(masks):
            masks, tables, _ = self._next(masks, tables, masks)

    def _polish(self, chosen: Any) -> None:
        """Exchanges, one candidate for another, until none lowers the criterion."""
        mask, table = self._swept(chosen)
        value, seen = self._values(mask[None], table[None])[0], {mask.tobytes()}
        while True:
            others = np.flatnonzero(mask & ~self.keep)
            masks = np.vstack([mask, np.repeat(mask[None], others.size, axis=0)])
            masks[1 + np.arange(others.size), others] = False
            without = _sweep(np.repeat(table[None], others.size, axis=0), others, out=True)
            tables = np.concatenate([table[None], without])
            self._record(masks, tables)
            may = ~masks
            may[0] = True
            masks, tables, values = self._next(masks, tables, may)
            if not values.size or values[0] >= value - SAME * max(self.penalty.max(), 1e-300):
                return
            # Falls at every step, also where rounding makes the new table's value another. Beside costs of
            # records without noise, 1e12 times the penalties, rounding alone may fall in circles.
            mask, table, value = masks[0], tables[0], values[0]
            if mask.tobytes() in seen:
                return
            seen.add(mask.tobytes())

    def _exchange(self, chosen: Any) -> None:
        """The best pair in place of each candidate, and the best single one in place of each pair.

        Single exchanges and beams pass them by, where one of a pair is of no use without the other.
        """
        mask, table = self._swept(chosen)
        others = np.flatnonzero(mask & ~self.keep)
        for k, one in enumerate(others):
            without = _sweep(table[None], np.array([one]), out=True)
            masks = mask[None] & (np.arange(mask.size) != one)
            may = ~mask & (np.diag(without[0])[:-1] > COLLINEAR)
            if (pair := _best_pair(without[0], may, self.penalty)) is not None:
                self._put_in(masks, without, pair)
            rest = others[k + 1 :]
            tables = _sweep(np.repeat(without, rest.size, axis=0), rest, out=True)
            own = np.diagonal(tables, axis1=1, axis2=2)[:, :-1]
            sound = ~mask & (own > COLLINEAR)
            gain = np.where(
                sound, tables[:, :-1, -1] ** 2 / np.where(sound, own, 1.0) - self.penalty, -np.inf
            )
            for place, best in enumerate(np.argmax(gain, axis=1)):
                if sound[place, best]:
                    fewer = masks & (np.arange(mask.size) != rest[place])
                    self._put_in(fewer, tables[place : place + 1], [best])

    def _put_in(self, masks: Any, tables: F64, which: Iterable[Any]) -> None:
        for j in which:
            masks, tables = masks.copy(), _sweep(tables, np.array([j]), out=False)
            masks[0, j] = True
        self._record(masks, tables)

    def _values(self, masks: Any, tables: F64) -> F64:
        """Criterion of subsets."""
        cost = tables[:, -1, -1]
        # A negative cost is one of rounding.
        return np.where(cost < 0, np.inf, cost + masks @ self.penalty)

    def _allowed(self, masks: Any, tables: F64) -> Any:
        """Which subsets break no rule; the last column of a table has the estimates of what is in."""
        right = ~np.any(masks & (self.signs * tables[:, :-1, -1] < 0), axis=1)
        return right & ~np.any((masks @ self.needs) & ~masks, axis=1)

    def _record(self, masks: Any, tables: F64) -> None:
        """Keep subsets with their criteria."""
        allowed = self._allowed(masks, tables) if self.ruled else np.ones(len(masks), dtype=bool)
        for mask, value, sound in zip(masks, self._values(masks, tables).tolist(), allowed, strict=True):
            (self.found if sound else self.barred)[mask.tobytes()] = value

    def _next(self, masks: Any, tables: F64, may: Any) -> tuple[Any, F64, F64]:
        """The best subsets that differ in one candidate of those that `may` change, with their tables."""
        own = np.diagonal(tables, axis1=1, axis2=2)[:, :-1]
        sound = may & ~self.keep & np.where(masks, own < 0, own > COLLINEAR)
        change = tables[:, :-1, -1] ** 2 / np.where(sound, own, 1.0)
        values = self._values(masks, tables)[:, None] - change + np.where(masks, -1, 1) * self.penalty
        values = np.where(sound, values, np.inf)
        new: dict[bytes, tuple[int, int]] = {}
        for place in np.argsort(values, axis=None)[: 4 * WIDTH]:
            row, column = divmod(int(place), masks.shape[1])
            if not np.isfinite(values[row, column]) or len(new) == WIDTH:
                break
            mask = masks[row].copy()
            mask[column] = not mask[column]
            new.setdefault(mask.tobytes(), (row, column))
        rows, columns = np.array(list(new.values()), dtype=int).reshape(-1, 2).T
        found = np.array([self._mask(key) for key in new], dtype=bool).reshape(-1, masks.shape[1])
        swept = _sweep(tables[rows], columns, out=masks[rows, columns])
        self._record(found, swept)
        return found, swept, values[rows, columns]


def _sweep(tables: F64, at: Any, out: Any) -> F64:
    """Tables with one candidate each put in, or taken out."""
    each = np.arange(len(tables))
    column = tables[each, at]
    pivot = column[each, at]
    scaled = column / pivot[:, None]
    tables = tables - scaled[:, :, None] * column[:, None, :]
    tables[each, at] = tables[each, :, at] = np.where(out, -1.0, 1.0)[..., None] * scaled
    tables[each, at, at] = -1.0 / pivot
    return np.asarray(tables)


def _best_pair(table: F64, may: Any, penalty: F64) -> tuple[int, int] | None:
    """The two candidates that together lower the criterion most; None where either does as well alone."""
    at = np.flatnonzero(may)
    gram, right = table[np.ix_(at, at)], table[at, -1]
    own = np.diag(gram)
    alone = right**2 / own - penalty[at]
    area = own[:, None] * own - gram**2
    # What a candidate leaves of another one is their area over its own.
    sound = np.triu(area > COLLINEAR * np.maximum(own[:, None], own), 1)
    if not sound.any():
        return None
    both = right[:, None] ** 2 * own + right**2 * own[:, None] - 2 * gram * np.outer(right, right)
    both = np.where(sound, both / np.where(sound, area, 1.0) - penalty[at, None] - penalty[at], -np.inf)
    a, b = np.unravel_index(int(np.argmax(both)), both.shape)
    return (int(at[a]), int(at[b])) if both[a, b] > max(alone[a], alone[b]) else None
