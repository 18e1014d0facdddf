"""Responses between the samples, and what sums over uneven samples have more than their integrals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._core import quadrature_weights
from ..base.arrays import C128, F64, I64
from ..records.record import Record
from ..systems.propagate import spline

__all__ = ["BEFORE", "UnevenSums", "finer", "response"]

BEFORE = np.array([-1.0, 4.0, -6.0, 4.0])  # what a cubic through the last four says of the next
SIMPSON = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12  # weights of the parts of a cell
SEEN = 30 / 4  # cells in a period of the highest line that is fitted: errors of Simpson's rule of 1e-5
BLOCK = 64  # lines whose turns are kept
CLOSE, MOST = 1e-5, 100  # relative error of samples with given sums, and steps that find them


def finer(rec: Record, parts: ArrayLike) -> Record:
    """Inputs in equal parts of each step, as each runs between its samples; outputs are zero.

    `parts`: one number, or one for each of uneven steps.
    """
    parts = np.broadcast_to(parts, rec.intervals)
    own, first = np.arange(rec.intervals + 1), np.cumsum(parts) - parts
    at = np.append(np.repeat(own[:-1], parts), rec.intervals)
    part = np.arange(at.size - 1) - np.repeat(first, parts)
    places = at + np.append(part / np.repeat(parts, parts), 0.0)
    t = np.interp(places, own, rec.t)
    run: dict[str, Callable[[F64], Any]] = {
        "zoh": lambda u: u[at],
        "foh": lambda u: np.interp(places, own, u),
        "smooth": lambda u: spline(own.astype(float), u)(places) if rec.dt else spline(rec.t, u)(t),
    }
    times: dict[str, Any] = {"t": t} if rec.dt is None else {"dt": rec.dt / parts[0], "t0": float(t[0])}
    made = Record(
        y=np.zeros((len(rec.outputs), t.size)),
        u=np.array([run[kind](u) for kind, u in zip(rec.intersample, rec.u, strict=True)]),
        outputs=rec.outputs, inputs=rec.inputs, intersample=rec.intersample, **times,
    )  # fmt: skip
    return made._like(_functions=rec._functions)


def response(fit: Any, rec: Record, fine: Record, at: I64) -> F64:
    """The response of a fit to a record, at the times of one from `finer`; `at`: the samples among these."""
    there, start = fit.simulate(rec)
    told = np.zeros((len(there), fine.t.size), bool)  # a trend is found from these samples again
    told[:, at] = True
    y = np.zeros(told.shape)
    y[:, at] = there
    return np.asarray(fit.simulate(fine._like(y=y, mask=told), start)[0])


class _Turns:
    """exp(-2jπkt/span) of all lines k up to the highest, without a number for each line and time."""

    def __init__(self, t: F64, top: int) -> None:
        turn = -2j * np.pi * t / (t[-1] - t[0])
        self.block = np.exp(np.outer(np.arange(BLOCK), turn))
        self.ahead = np.exp(BLOCK * turn)
        self.count, self.blocks = top + 1, -(-(top + 1) // BLOCK)

    def sums(self, values: F64) -> C128:
        """Sums of values (…, time) on each line."""
        turned, found = values.astype(complex), []
        for _ in range(self.blocks):
            found.append(turned @ self.block.T)
            turned *= self.ahead
        return np.concatenate(found, axis=-1)[..., : self.count]

    def adjoint(self, lines: C128) -> F64:
        """What at each time has these lines (line,) as its part of their real product with the sums."""
        whole = np.zeros(self.blocks * BLOCK, complex)
        whole[: self.count] = lines
        found = np.zeros(self.ahead.size, complex)
        for block in whole.reshape(-1, BLOCK)[::-1]:
            found = found * self.ahead.conj() + block @ self.block.conj()
        return found.real


class UnevenSums:
    """Sums over the samples of a record at uneven times, and integrals over its steps.

    Parameters
    ----------
    rec : Record
    seen : int
        The highest line that is fitted.
    top : int
        The highest line whose sums are set right.
    rule : str
    """

    def __init__(self, rec: Record, seen: int, top: int, rule: str) -> None:
        t = rec.t - rec.t[0]
        steps, self.span = np.diff(t), float(t[-1])
        cells = np.ceil(steps * (SEEN * max(seen, 1) / self.span) - 1e-9).astype(np.int64)
        self.rec, self.fine = rec, finer(rec, 4 * cells)
        self.at = np.append(0, np.cumsum(4 * cells))
        self.weights = quadrature_weights(rule, rec.intervals, np.ascontiguousarray(t)) / self.span
        self.turns = _Turns(t, top)
        corners = self.fine.t[::4] - rec.t[0]
        self.sizes = np.diff(corners) / self.span
        between = corners[:-1, None] + np.diff(corners)[:, None] * np.arange(5) / 4
        self.within = _Turns(between.ravel(), top)

    def excess(self, fit: Any) -> F64:
        """Nearly the smallest samples that sum to what sums of the fit's response have too much."""
        y = response(fit, self.rec, self.fine, self.at)
        cells = y[:, :-1].reshape(len(y), -1, 4)
        # A jump may end each step: the value there is what the ones before lead to.
        cells = np.concatenate([cells, (cells @ BEFORE)[..., None]], axis=2) * SIMPSON
        integrals = self.within.sums((cells * self.sizes[:, None]).reshape(len(y), -1))
        lines = self.turns.sums(y[:, self.at] * self.weights) - integrals
        return np.array([self._smallest(row) for row in lines])

    def _smallest(self, lines: C128) -> F64:
        from scipy.sparse.linalg import LinearOperator, lsqr

        def parted(lines: C128) -> F64:
            return np.concatenate([lines.real, lines.imag[1:]])

        def there(samples: F64) -> F64:
            return parted(self.turns.sums(samples * self.weights))

        def back(parts: F64) -> F64:
            both = parts[: lines.size] + 1j * np.append(0.0, parts[lines.size :])
            return self.turns.adjoint(both) * self.weights

        wanted = parted(lines)
        sums = LinearOperator((wanted.size, self.weights.size), matvec=there, rmatvec=back, dtype=float)
        return np.asarray(lsqr(sums, wanted, atol=CLOSE, btol=CLOSE, iter_lim=MOST)[0])
