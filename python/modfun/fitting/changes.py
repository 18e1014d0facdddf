"""Noise that changes over the records of a batch: which ones, and the errors that allow for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.progress import Progress
from ..equations.layout import EquationLayout
from ..errors import ModfunError
from ..models.layout import Layout
from ..models.options import Options
from ..records.batches import Batch
from ..records.record import Record
from ..results.fit import Fit
from ..results.line_residuals import line_residuals
from ..results.many import FitMany
from ..results.uneven_noise import SHORTEST, UNEVEN, allows, p_values, unforeseen

__all__ = ["Alone", "Changes", "may_change"]

AT_ONCE = 1 << 17  # samples, about, that are looked at together
ENDS = 5  # degree of the polynomial that takes what the ends of a record put above its band
LEAST = 4  # of all lines one in so many lies above the band, or every record is fitted alone


def may_change(layout: Layout | EquationLayout, options: Options, intervals: int) -> bool:
    """Whether fits of such a batch have a test, and errors that follow from it."""
    special = layout.free_delays or layout.priors if isinstance(layout, Layout) else False
    return options.cov_type == "spectral" and allows(options) and not special and intervals >= SHORTEST


@dataclass(frozen=True, eq=False)
class Alone:
    """Fits one record of a batch by itself over the band of all, when it is called."""

    data: Batch | tuple[Record, ...]
    structure: Any
    options: Options
    lines: tuple[int, int]
    omega0: float
    fit_one: Callable[[tuple[Record, ...], Any, Options], Fit]

    def __call__(self, r: int) -> Fit:
        low, high = (line * self.omega0 for line in self.lines)
        return self.fit_one(
            (self.data[r],), self.structure, self.options.replace(harmonics=None, band=(low, high))
        )


@dataclass(frozen=True, eq=False)
class Changes:
    """Looks for noise that changes over the records of a batch, when it is called.

    The test is that of single fits, with residuals made of lines for transfer functions, and for equations,
    which would have to be integrated, with what the outputs have above the band. A single fit decides where
    it rejects.
    """

    alone: Alone
    layout: Layout | EquationLayout
    intervals: int
    progress: str | bool = "auto"

    def __call__(self, many: FitMany) -> tuple[NDArray[np.bool_], F64]:
        """Which records have such noise, (replicate,), and the standard errors of all, (replicate, p)."""
        bse, changing = many.bse_even.copy(), np.zeros(len(many), bool)
        suspects = np.flatnonzero(self._suspects(many)).tolist()
        with Progress(self.progress, "standard errors where noise changes", "records") as bar:
            for done, r in enumerate(suspects):
                bar(done, len(suspects))
                try:
                    fit = self.alone(r)
                except ModfunError:  # what a single fit refuses, such as an input that hardly moves
                    continue
                if fit.changing:
                    changing[r], bse[r] = True, fit.bse
        return changing, bse

    def _suspects(self, many: FitMany) -> NDArray[np.bool_]:
        found, good = np.zeros(len(many), bool), np.flatnonzero(many.usable)
        lines = self.intervals // 2
        if not isinstance(self.layout, Layout) and LEAST * (lines - self.alone.lines[1]) < lines:
            return many.usable
        at_once = max(1, AT_ONCE // self.intervals)
        for first in range(0, good.size, at_once):
            these = good[first : first + at_once]
            with np.errstate(all="ignore"):  # of estimates far off
                found[these] = self._p_values(many, these) < UNEVEN
        return found

    def _p_values(self, many: FitMany, these: NDArray[np.intp]) -> F64:
        each = self._residuals(many, these)
        found = []
        for own, read in each:
            good: Any = np.isfinite(own).all(axis=1, keepdims=True)
            new = [unforeseen(np.where(good, own, 0.0))]
            sizes = [np.abs(np.where(good, read - own, 0.0))]
            found += [np.where(good.ravel(), p, 1.0) for p in (p_values(new), p_values(new, sizes))]
        return np.asarray(len(found) * np.min(found, axis=0))

    def _residuals(self, many: FitMany, these: NDArray[np.intp]) -> list[tuple[F64, F64]]:
        """Of each output, (record, time), and what was read."""
        data, lines = self.alone.data, self.alone.lines
        if isinstance(data, Batch):
            y, u = data.y[these], data.u if len(data.u) == 1 else data.u[these]
        else:
            y, u = (np.array([getattr(data[r], name) for r in these]) for name in "yu")
        read = [y[:, i, -1 - self.intervals : -1] for i in range(y.shape[1])]
        if not isinstance(self.layout, Layout):
            return [(above(own, lines[1]), own) for own in read]
        kinds = (data if isinstance(data, Batch) else data[0]).intersample
        words = (many.options.rule, kinds, self.intervals, lines, self.alone.omega0)
        made = [
            line_residuals(self.layout, many.params[these], i, y[:, i], u, *words) for i in range(len(read))
        ]
        return list(zip(made, read, strict=True))


def above(y: F64, line: int) -> F64:
    """What rows of samples have above a line, (row, time), less a polynomial that joins their ends."""
    x = np.linspace(-1.0, 1.0, y.shape[1])
    both = np.vstack([y, np.polynomial.chebyshev.chebvander(x, ENDS)[:, 1:].T])
    waves = np.fft.rfft(both)
    waves[:, : line + 1] = 0
    high = np.fft.irfft(waves, y.shape[1])
    ends = np.linalg.qr(high[len(y) :].T)[0]
    left = high[: len(y)]
    return np.asarray(left - (left @ ends) @ ends.T)
