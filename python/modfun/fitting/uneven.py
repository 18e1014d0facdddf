"""Records at uneven times: what sums over their samples have too much is taken out, as the estimate tells."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

from .._core import coefficients, quadrature_weights, simulate_uneven
from ..base.arrays import C128, F64
from ..errors import ModfunError
from ..models.options import Options
from ..records.record import Record
from ..results.cures import on_band
from ..results.estimates import COVARIANCES
from ..results.fit import Fit
from ..results.prediction import path_model
from ..systems.polynomials import companion, time_unit
from ..systems.propagate import spline

__all__ = ["without_excess"]

ROUNDS = 30
SETTLED = 0.02  # of a standard error: the last step
SAME = 1e-7  # of the parameters: the same without noise
NEARBY = 0.2  # standard errors: between estimates that show how one round follows from the one before
PARTS = 8  # of a sampling interval, between which a smooth input is taken as straight
LARGE = 1 << 21  # lines times samples, for which matrices of both take too long

Refit = Callable[[tuple[Record, ...], Options], Fit]


def without_excess(fit: Fit, refit: Refit) -> Fit:
    """The fit of outputs without what sums over uneven samples have more than integrals.

    An output bends at each sample where its input is held or straight between them, runs on unseen in long
    steps, and polynomials through uneven samples follow neither: estimates are many standard errors off, and
    alike on all lines, so that no residual shows it. The estimate's own response has integrals in closed form.
    What its samples' sums have more is taken out of the outputs, and the fit follows anew until it stands.

    A round's estimate follows the one before by some matrix S, which says how much of the response the sums
    see; errors of the estimate at which rounds end are those of a round times (1 - S)⁻¹.
    """
    records, o = fit.records or (), fit.options
    able = o.noise in ("output", "coloured") and o.method in ("ml", "awls") and not o.reference
    if not (able and fit.usable) or all([rec.dt is not None or rec.mask is not None for rec in records]):
        return fit
    tops = [_top(fit, k, rec) for k, rec in enumerate(records)]
    if _large(tops, records):
        o, tops = on_band(fit, fit.band), [last for _, last in fit.lines]
    if _large(tops, records):
        return fit
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            rounds = _Rounds(records, tops, o.rule, refit)
            found = rounds.settled(fit, o)
            found = found if found is None else rounds.with_errors(found)
    except (ArithmeticError, ModfunError, np.linalg.LinAlgError):  # a response beyond the range of numbers
        found = None
    if found is None:
        return replace(fit, status="maxiter" if fit.success else fit.status)
    return replace(found, records=records, options=fit.options, band_rule=found.band_rule or fit.band_rule)


def _top(fit: Fit, k: int, rec: Record) -> int:
    """The last line that a fit of the record may come to."""
    rule = fit.band_rule or {}
    return max(fit.lines[k][1], min(int(rule.get("k_max", 0)), rec.intervals // 3))


def _large(tops: list[int], records: tuple[Record, ...]) -> bool:
    return sum([top * rec.t.size for top, rec in zip(tops, records, strict=True)]) > LARGE


class _Rounds:
    """Fits, each of outputs less what the estimate before tells of their sums."""

    def __init__(self, records: tuple[Record, ...], tops: list[int], rule: str, refit: Refit) -> None:
        self.records, self.refit = records, refit
        both = zip(records, tops, strict=True)
        self.sums = [None if rec.dt or rec.mask is not None else _Sums(rec, top, rule) for rec, top in both]

    def after(self, fit: Fit, options: Options) -> Fit:
        """The fit that follows from what an estimate tells."""
        own = replace(fit, records=self.records)
        moved = [rec if of is None else of.moved(own) for rec, of in zip(self.records, self.sums, strict=True)]
        found = self.refit(tuple(moved), options)
        if not found.usable:
            raise ArithmeticError
        return found

    def settled(self, fit: Fit, options: Options) -> Fit | None:
        """The fit at which a round changes nothing; None where there is none."""
        for _ in range(ROUNDS):
            before, fit = fit, self.after(fit, options)
            move = np.abs(fit.params - before.params)
            still = move <= np.maximum(SETTLED * fit.bse, SAME * np.abs(fit.params))
            if fit.success and fit.lines == before.lines and still.all():
                return fit
        return None

    def with_errors(self, fit: Fit) -> Fit:
        """The settled fit with errors that count how it follows itself."""
        options, free = on_band(fit, fit.band), np.flatnonzero(fit.bse > 0)
        if np.any(fit.bse <= SAME * np.abs(fit.params)):  # steps of a part of it would be rounding
            return fit
        same, follows = self.after(fit, options).params, np.zeros((fit.params.size,) * 2)
        for k in free:
            near = fit.params.copy()
            near[k] += NEARBY * fit.bse[k]
            follows[:, k] = (self.after(replace(fit, params=near), options).params - same) / (near - fit.params)[k]
        grow = np.linalg.inv(np.eye(follows.shape[0]) - follows)
        return replace(fit, **{name: grow @ getattr(fit, name) @ grow.T for name in COVARIANCES})


class _Sums:
    """Sums over the samples of one record, and integrals of what runs between them."""

    def __init__(self, rec: Record, top: int, rule: str) -> None:
        self.rec, t = rec, np.ascontiguousarray(rec.t - rec.t[0])
        self.span = float(t[-1])
        self.s = 2j * pi / self.span * np.arange(top + 1)
        weights = quadrature_weights(rule, rec.intervals, t) / self.span
        self.rows = np.exp(-np.outer(self.s, t)) * weights
        # The smallest samples with given sums.
        self.q, self.r = np.linalg.qr(np.concatenate([self.rows.real, self.rows.imag[1:]]).T)
        self.parts = PARTS if "smooth" in rec.intersample else 1
        within = np.diff(t)[:, None] * (np.arange(self.parts) / self.parts)
        self.t = np.append((t[:-1, None] + within).ravel(), t[-1])
        at = np.append(np.arange(t.size - 1).repeat(self.parts), t.size - 1)
        run: dict[str, Callable[[F64], Any]] = {
            "zoh": lambda u: u[at],
            "foh": lambda u: np.interp(self.t, t, u),
            "smooth": lambda u: spline(t, u)(self.t),
        }
        each = zip(rec.intersample, rec.u, strict=True)
        self.u = np.array([run[kind](u) for kind, u in each]).reshape(len(rec.u), self.t.size)
        self.kinds = ["zoh" if kind == "zoh" else "foh" for kind in rec.intersample]
        self.lines = np.zeros((0, top + 1), complex)
        if len(self.u):
            self.lines = coefficients(self.u, top, self.kinds, [0.0] * len(self.u), 0, self.t)
        self.driving = rec.u.copy()
        for k, kind in enumerate(rec.intersample):
            if kind == "smooth":
                self.driving[k] -= self._samples(self.rows @ rec.u[k] - self.lines[k])

    def moved(self, fit: Fit) -> Record:
        """The record with outputs less what sums of the fit's response have too much."""
        layout, state = fit.layout, fit.simulate(self.rec)[1].state
        y, first = self.rec.y.copy(), 0
        for i, n in enumerate(layout.orders):
            a, b, c, d, _ = path_model(layout, fit.params, i).scaled()
            excess = self._excess(a, b, c, d, np.zeros(len(a)))
            # The free response beside it, whose state is that of another realization.
            den = layout.polynomials(fit.params, i)[0]
            rate = time_unit(den, 1.0 / self.span)
            none, start = np.zeros((n, len(self.u))), state[first : first + n] / rate ** np.arange(n)
            excess += self._excess(companion(den, rate), none, np.eye(n)[:1], none[:1], start)
            y[i] -= self._samples(excess)
            first += n
        if not np.isfinite(y).all():
            raise ArithmeticError
        return self.rec._like(y=y, u=self.driving)

    def _excess(self, a: F64, b: F64, c: F64, d: F64, start: F64) -> C128:
        """What the sums of a response have more than its integrals, of which s X = A X + B U + (x₀ - x₁)/T."""
        n = len(a)
        # The integral of the output is a state, too: line 0, where A may have no inverse.
        wide = np.block([[a, np.zeros((n, 1))], [c, np.zeros((1, 1))]])
        held = [kind == "zoh" for kind in self.kinds]
        none = np.zeros((n + 1, len(self.u)))
        x = simulate_uneven(
            wide, np.vstack([b, d]), np.eye(n + 1), none, np.append(start, 0.0), self.u, held, self.t
        ).reshape(n + 1, -1)
        y = c @ x[:n] + d @ self.u
        drive = (b @ self.lines).T + (x[:n, 0] - x[:n, -1]) / self.span
        states = np.linalg.solve(self.s[1:, None, None] * np.eye(n) - a, drive[1:, :, None])[..., 0]
        integrals = np.append(x[n, -1] / self.span, states @ c[0] + (d @ self.lines)[0, 1:])
        return np.asarray(self.rows @ y[0, :: self.parts] - integrals)

    def _samples(self, lines: C128) -> F64:
        """The smallest samples of which these are the sums."""
        both = np.concatenate([lines.real, lines.imag[1:]])
        return np.asarray(self.q @ np.linalg.solve(self.r.T, both))
