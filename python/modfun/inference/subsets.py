"""The best subsets of candidate terms from their Gram matrix: beams forward and backward, then exchange."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import F64

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
    """

    def __init__(self, gram: F64, right: F64, constant: float, penalty: F64, keep: Any) -> None:
        self.root = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        self.gram, self.right = gram / self.root[:, None] / self.root, right / self.root
        self.constant, self.penalty, self.keep = constant, penalty, np.asarray(keep, dtype=bool)
        self.found: dict[bytes, float] = {}

    @cached_property
    def independent(self) -> Any:
        """A largest subset of columns that can be told apart: by pivots, those that stay first."""
        left, factor = self.gram.copy(), np.zeros(self.right.size, dtype=bool)
        for first in (self.keep, ~self.keep):
            while True:
                pivots = np.where(first & ~factor, np.diag(left), 0.0)
                j = int(np.argmax(pivots))
                if pivots[j] <= COLLINEAR:
                    break
                factor[j] = True
                left = left - np.outer(left[:, j], left[j]) / left[j, j]
        return factor | self.keep

    def estimate(self, chosen: Any) -> F64:
        """Least squares of a subset; the other candidates are zero."""
        at = np.flatnonzero(chosen)
        theta = np.zeros(self.right.size)
        theta[at] = np.linalg.lstsq(self.gram[np.ix_(at, at)], self.right[at], rcond=RIDGE)[0]
        return np.asarray(theta / self.root)

    def search(self, seeds: Iterable[Any] = ()) -> list[tuple[Any, float]]:
        """Every subset seen with its criterion, best first; `seeds` are tried for exchanges as well."""
        self._judge(self.keep[None, :])
        self._forward()
        self._backward()
        best = sorted(self.found, key=self.found.__getitem__)[:POLISHED]
        for start in [*map(self._mask, best), *seeds]:
            self._polish(np.asarray(start) | self.keep)
        return [(self._mask(key), value) for key, value in sorted(self.found.items(), key=lambda x: x[1])]

    def _mask(self, key: bytes) -> Any:
        return np.frombuffer(key, dtype=bool)

    def _forward(self) -> None:
        level, best, since = self.keep[None, :], np.inf, 0
        while since < PATIENCE and level.shape[0] and not level[0].all():
            level, values = self._next(level, add=True)
            lowest = values.min(initial=np.inf)
            best, since = (lowest, 0) if lowest < best else (best, since + 1)

    def _backward(self) -> None:
        level = self.independent[None, :]
        while level.shape[0] and (level[0] & ~self.keep).any():
            level, _ = self._next(level, add=False)

    def _polish(self, chosen: Any) -> None:
        """Exchanges, one candidate for another, until none lowers the criterion."""
        value = self._judge(chosen[None, :])[0][0]
        while True:
            others = np.flatnonzero(chosen & ~self.keep)
            without = np.repeat(chosen[None, :], others.size, axis=0)
            without[np.arange(others.size), others] = False
            tried = [self._next(chosen[None, :], add=True), self._next(chosen[None, :], add=False)]
            if others.size:
                tried.append(self._next(without, add=True))
            masks = np.vstack([m for m, _ in tried])
            values = np.concatenate([v for _, v in tried])
            if not values.size or values.min() >= value - SAME * max(self.penalty.max(), 1e-300):
                return
            chosen, value = masks[values.argmin()], values.min()

    def _judge(self, masks: Any) -> tuple[F64, F64, F64]:
        """Criterion of subsets of one size, and that of each with one candidate more and one less."""
        at = np.nonzero(masks)[1].reshape(len(masks), -1)
        size = at.shape[1]
        inverse = np.linalg.inv(self.gram[at[:, :, None], at[:, None, :]] + RIDGE * np.eye(size))
        theta = np.einsum("bij,bj->bi", inverse, self.right[at])
        value = self.constant - np.einsum("bi,bi->b", self.right[at], theta) + self.penalty[at].sum(axis=1)
        cross = self.gram[:, at].transpose(1, 0, 2)
        left = 1.0 - np.einsum("bpi,bpi->bp", cross @ inverse, cross)
        slope = self.right - np.einsum("bpi,bi->bp", cross, theta)
        sound = ~masks & (left > COLLINEAR)
        gain = np.where(sound, slope**2 / np.where(sound, left, 1.0), -np.inf)
        rise = np.full(masks.shape, np.inf)
        lost = theta**2 / np.maximum(np.einsum("bii->bi", inverse), 1e-300)
        np.put_along_axis(rise, at, lost, axis=1)
        rise[:, self.keep] = np.inf
        # A negative cost is one of rounding.
        value = np.where(value < self.penalty[at].sum(axis=1), np.inf, value)
        for mask, own in zip(masks, value, strict=True):
            self.found[mask.tobytes()] = float(own)
        more = value[:, None] - gain + self.penalty
        return value, more, value[:, None] + rise - self.penalty

    def _next(self, masks: Any, *, add: bool) -> tuple[Any, F64]:
        """The best subsets with one candidate more, or less."""
        _, more, less = self._judge(masks)
        values = more if add else less
        order = np.argsort(values, axis=None)
        new: dict[bytes, float] = {}
        for place in order[: 4 * WIDTH]:
            row, column = divmod(int(place), masks.shape[1])
            if not np.isfinite(values[row, column]) or len(new) == WIDTH:
                break
            mask = masks[row].copy()
            mask[column] = add
            new.setdefault(mask.tobytes(), float(values[row, column]))
        for key, value in new.items():
            self.found.setdefault(key, value)
        if not new:
            return np.zeros((0, masks.shape[1]), dtype=bool), np.zeros(0)
        return np.array([self._mask(key) for key in new]), np.array(list(new.values()))
