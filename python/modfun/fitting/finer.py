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
from .linear_response import linear_response

__all__ = ["BEFORE", "UnevenSums", "finer", "response"]

BEFORE = np.array([-1.0, 4.0, -6.0, 4.0])  # what a cubic through the last four says of the next
SIMPSON = np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12  # weights of the parts of a cell
SEEN = 30 / 4  # cells in a period of the highest line that is fitted: errors of Simpson's rule of 1e-5
SPREAD = 12  # neighbours on the grid of a Fourier transform at uneven times,
SHAPE = 2.3 * SPREAD  # and how their weights fall off
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
    exact = linear_response(fit, rec, fine, at)
    if exact is not None:
        return exact
    there, start = fit.simulate(rec)
    told = np.zeros((len(there), fine.t.size), bool)  # a trend is found from these samples again
    told[:, at] = True
    y = np.zeros(told.shape)
    y[:, at] = there
    return np.asarray(fit.simulate(fine._like(y=y, mask=told), start)[0])


class _Turns:
    """Sums of values times exp(-2jπkt/span) on lines k from 0 on: a Fourier transform at uneven times.

    Each value is spread over its neighbours on an even grid, whose fast transform is divided by the spread's
    own, as in Dutt and Rokhlin (1993); with Kaiser and Bessel's function the error is 1e-11.
    """

    def __init__(self, t: F64, top: int) -> None:
        from scipy.fft import next_fast_len
        from scipy.sparse import csr_array
        from scipy.special import i0

        self.top = top
        self.size = next_fast_len(4 * top + 4 * SPREAD, real=True)  # twice as fine as lines need
        at = t / (t[-1] - t[0]) * self.size
        near = np.floor(at).astype(np.int64)[:, None] + np.arange(1 - SPREAD // 2, 1 + SPREAD // 2)
        inside = np.sqrt(np.maximum(1 - ((near - at[:, None]) / (SPREAD / 2)) ** 2, 0.0))
        rows = np.arange(0, near.size + 1, SPREAD)
        self.spread = csr_array(
            (i0(SHAPE * inside).ravel(), (near % self.size).ravel(), rows), (t.size, self.size)
        )
        root = np.sqrt(SHAPE**2 - (np.pi * SPREAD * np.arange(top + 1) / self.size) ** 2)
        self.own = SPREAD * np.sinh(root) / root

    def sums(self, values: F64) -> C128:
        """Sums of values (…, time) on each line."""
        grid = np.asarray((self.spread.T @ values.T).T)
        return np.asarray(np.fft.rfft(grid)[..., : self.top + 1] / self.own)

    def adjoint(self, lines: C128) -> F64:
        """What at each time has these lines (line,) as its part of their real product with the sums."""
        half = lines / self.own * (self.size / 2)
        half[0] *= 2
        return np.asarray(self.spread @ np.fft.irfft(half, self.size))


class UnevenSums:
    """Sums over the samples of a record at uneven times, and integrals over its steps.

    Parameters
    ----------
    rec : Record
    top : int
        The highest line that is fitted. Sums on those beyond, which products bring back, are left as they
        are: samples changed by as much as they err put the coefficient of a cube 6 standard errors off.
    rule : str
    """

    def __init__(self, rec: Record, top: int, rule: str) -> None:
        t = rec.t - rec.t[0]
        steps, self.span = np.diff(t), float(t[-1])
        cells = np.ceil(steps * (SEEN * max(top, 1) / self.span) - 1e-9).astype(np.int64)
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
