"""Records at uneven times: what sums over their samples have too much is taken out, as the estimate tells."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from math import pi

import numpy as np

from .._core import coefficients, quadrature_weights, simulate_uneven
from ..base.arrays import C128, F64
from ..errors import ModfunError
from ..models.options import Options
from ..records.record import Record
from ..results.cures import on_band
from ..results.estimates import COVARIANCES
from ..results.fit import Fit
from ..results.of_equations import EquationFit
from ..results.prediction import misses, path_model
from ..results.regression import trend_columns
from ..systems.polynomials import companion, roots, time_unit
from .wider import ENOUGH

__all__ = ["equations_on_fewer_lines", "from_response", "without_excess"]

ROUNDS = 30
SETTLED = 0.02  # of a standard error: the last step
SAME = 1e-7  # of the parameters: the same without noise
NEARBY = 0.2  # standard errors: between estimates that show how one round follows from the one before
SLOWEST = 6  # samples per period of the last line of a wider band, by the mean step
ABOVE = 1.5  # times the level of the high band: residuals where sums over samples err, or the search
ASTRAY = 0.25  # of the noise level: eight to thirteen times less was left by fits that went right
FINE = 8  # samples per period of the last line that the rule takes of more than 128 even samples
FEWER = (0.75, 0.6, 0.5)  # of the default band
LARGE = 1 << 21  # lines times samples, for which matrices of both take too long

Refit = Callable[[tuple[Record, ...], Options], Fit]
Equations = Callable[..., EquationFit]


def without_excess(fit: Fit, refit: Refit) -> Fit:
    """The fit of outputs without what sums over uneven samples have more than integrals.

    An output bends at each sample where its input is held or straight between them, runs on unseen in long
    steps, and polynomials through uneven samples follow neither: estimates are many standard errors off, and
    alike on all lines, so that no residual shows it. The estimate's own response has integrals in closed
    form. What its samples' sums have more is taken out of the outputs, and the fit follows anew until it
    stands.

    A round's estimate follows the one before by some matrix S, which says how much of the response the sums
    see; errors of the estimate at which rounds end are those of a round times (1 - S)⁻¹.
    """
    records, o = fit.records or (), fit.options
    able = o.noise in ("output", "coloured") and o.method in ("ml", "awls") and not o.reference
    if not (able and fit.usable and any([_counts(rec) for rec in records])):
        return fit
    found = _settled(fit, o, refit)
    top = min([rec.intervals / SLOWEST / rec.duration for rec in records]) * 2 * pi
    if fit.band_rule is not None and top > fit.band[1] and (found is None or _has_beyond(found)):
        # The core's rule ends where integrals over these steps do; what is known of them reaches further.
        wider = _settled(found or fit, o.replace(band=(0.0, top)), refit)
        if wider is not None and (found is None or misses(wider) < misses(found)):
            found = wider
    if found is None:
        return replace(fit, status="maxiter" if fit.success else fit.status)
    return replace(found, options=o, band_rule=found.band_rule or fit.band_rule)


def from_response(fit: Fit, options: Options, refit: Refit) -> Fit | None:
    """The fit by other options, or of another structure, whose rounds begin with what an estimate tells.

    None where they do not end, or where no sums have too much.
    """
    if not (fit.usable and any([_counts(rec) for rec in fit.records or ()])):
        return None
    found = _settled(fit, options, refit)
    return None if found is fit else found


def equations_on_fewer_lines(fit: EquationFit, refit: Equations) -> EquationFit:
    """The fit on part of the default band, where its response leaves less of the samples.

    Polynomials through uneven samples err the more the higher the line is, and nonlinear signals carry that
    into all equations. The default band cannot see where, as the noise level is unknown at uneven times.
    Of few even samples it ends where noise prevails, and a search over all its lines may end where the
    equations have no sense, as S' = -V*S/(K + S) at K = -3.
    """
    records, rule = fit.records or (), fit.band_rule
    if rule is None or not fit.usable:
        return fit
    uneven = any([rec.dt is None for rec in records])
    pairs = zip(records, fit.lines, strict=True)
    if not uneven and all([last <= rec.intervals / FINE for rec, (_, last) in pairs]):
        return fit
    with np.errstate(divide="ignore", invalid="ignore"):
        above = np.sqrt(np.diag(fit.noise_cov)) / np.mean(fit.seen[:, : len(fit.outputs)], axis=0)
    if not np.any(above > ABOVE):
        return fit
    # To integrate equations where a search has gone astray takes seconds.
    measure, least = (misses, misses(fit)) if uneven else (_level, ASTRAY * _level(fit))
    best = fit
    for part in FEWER:
        try:
            other = refit(records, fit.structure, on_band(fit, (fit.band[0], part * fit.band[1])), fit.again)
        except ModfunError:  # fewer lines than unknowns
            continue
        if other.success and other.df_resid >= ENOUGH and (left := measure(other)) < least:
            least, best = left, other
    if best is fit:
        return fit
    return replace(best, options=fit.options, band_rule=rule | {"narrowed": 1.0})


def _level(fit: Fit) -> float:
    """Noise level of the outputs, their geometric mean."""
    return float(np.exp(np.mean(np.log(np.diag(fit.noise_cov))) / 2))


def _settled(fit: Fit, options: Options, refit: Refit) -> Fit | None:
    """The fit at which rounds end, with its errors; None where they do not."""
    records: tuple[Record, ...] = fit.records or ()
    given = options.band is not None and options.band != fit.options.band
    edge = (options.band or (0.0, 0.0))[1] / (2 * pi) + 1e-9
    tops = [int(edge * rec.duration) if given else _top(fit, k, rec) for k, rec in enumerate(records)]
    if _large(tops, records) and not given:
        options, tops = on_band(fit, fit.band), [last for _, last in fit.lines]
    if _large(tops, records):
        return fit if not given else None
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            rounds = _Rounds(fit, tops, refit)
            found = rounds.settled(fit, options)
            return found and replace(rounds.with_errors(found), records=records)
    except (ArithmeticError, ModfunError, np.linalg.LinAlgError):  # a response beyond the range of numbers
        return None


def _has_beyond(fit: Fit) -> bool:
    """Whether a pole lies beyond the lines."""
    each = range(len(fit.outputs))
    return any([np.max(np.abs(roots(fit.polynomials(i)[0])), initial=0.0) > fit.band[1] for i in each])


def _counts(rec: Record) -> bool:
    """Whether samples are uneven, and inputs known between them: a spline through close ones may swing."""
    return rec.dt is None and rec.mask is None and "smooth" not in rec.intersample


def _levelled(rows: F64) -> F64:
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))


def _top(fit: Fit, k: int, rec: Record) -> int:
    """The last line that a fit of the record may come to."""
    rule = fit.band_rule or {}
    return max(fit.lines[k][1], min(int(rule.get("k_max", 0)), rec.intervals // 3))


def _large(tops: list[int], records: tuple[Record, ...]) -> bool:
    return sum([top * rec.t.size for top, rec in zip(tops, records, strict=True)]) > LARGE


class _Rounds:
    """Fits, each of outputs less what the estimate before tells of their sums."""

    def __init__(self, fit: Fit, tops: list[int], refit: Refit) -> None:
        self.records, self.refit = fit.records or (), refit
        both = zip(self.records, tops, strict=True)
        self.sums = [
            _Sums(rec, top, fit.options.rule, fit.trend) if _counts(rec) else None for rec, top in both
        ]

    def after(self, fit: Fit, options: Options) -> Fit:
        """The fit that follows from what an estimate tells."""
        own = replace(fit, records=self.records)
        moved = [
            rec if of is None else of.moved(own) for rec, of in zip(self.records, self.sums, strict=True)
        ]
        found = self.refit(tuple(moved), options)
        if not found.usable:
            raise ArithmeticError
        return found

    def settled(self, fit: Fit, options: Options) -> Fit | None:
        """The fit at which a round changes nothing; None where there is none."""
        for _ in range(ROUNDS):
            before, fit = fit, self.after(fit, options)
            if fit.param_names != before.param_names:
                continue
            move = np.abs(fit.params - before.params)
            still = move <= np.maximum(SETTLED * fit.spread, SAME * np.abs(fit.params))
            if fit.success and fit.lines == before.lines and still.all():
                return fit
        return None

    def with_errors(self, fit: Fit) -> Fit:
        """The settled fit with errors that count how it follows itself."""
        options, free = on_band(fit, fit.band), np.flatnonzero(fit.bse > 0)
        if np.any(fit.spread <= SAME * np.abs(fit.params)):  # steps of a part of it would be rounding
            return fit
        same = self.after(fit, options).params
        # Along the axes of the errors: a step of one parameter alone may be far outside of them.
        size, axes = np.linalg.eigh(fit.cov_nonrobust[np.ix_(free, free)] / np.outer(*[fit.bse[free]] * 2))
        follows, steps = np.zeros_like(axes), NEARBY * fit.bse[free][:, None] * axes * np.sqrt(size)
        for k, step in enumerate(steps.T):
            near = fit.params.copy()
            near[free] += step
            follows[:, k] = (self.after(replace(fit, params=near), options).params - same)[free]
        grow = np.eye(fit.params.size)
        grow[np.ix_(free, free)] = steps @ np.linalg.inv(steps - follows)
        return replace(fit, **{name: grow @ getattr(fit, name) @ grow.T for name in COVARIANCES})


class _Sums:
    """Sums over the samples of one record, and integrals of what runs between them."""

    def __init__(self, rec: Record, top: int, rule: str, trend: str | None) -> None:
        self.t = t = np.ascontiguousarray(rec.t - rec.t[0])
        # Beside a trend levels say nothing, and sums over uneven samples spread them over all lines.
        self.rec = rec if trend is None else rec._like(y=_levelled(rec.y), u=_levelled(rec.u))
        self.span, self.drift = float(t[-1]), trend_columns(t, trend)
        self.s = 2j * pi / self.span * np.arange(top + 1)
        weights = quadrature_weights(rule, rec.intervals, t) / self.span
        self.rows = np.exp(-np.outer(self.s, t)) * weights
        # The smallest samples with given sums.
        self.q, self.r = np.linalg.qr(np.concatenate([self.rows.real, self.rows.imag[1:]]).T)
        self.held = [kind == "zoh" for kind in rec.intersample]
        self.lines = self._integrals(self.rec.u, list(rec.intersample))
        self.of_drift = self.drift @ self.rows.T - self._integrals(self.drift, ["foh"] * len(self.drift))

    def _integrals(self, rows: F64, kinds: list[str]) -> C128:
        if not len(rows):
            return np.zeros((0, self.s.size), complex)
        return coefficients(np.ascontiguousarray(rows), self.s.size - 1, kinds, [0.0] * len(rows), 0, self.t)

    def moved(self, fit: Fit) -> Record:
        """The record with outputs less what sums of the fit's response have too much."""
        layout, start = fit.layout, fit.simulate(self.rec)[1]
        y, first, u = self.rec.y.copy(), 0, self.rec.u
        trends = start.trend.reshape(len(y), -1)
        for i, n in enumerate(layout.orders):
            a, b, c, d, _ = path_model(layout, fit.params, i).scaled()
            excess = self._excess(a, b, c, d, np.zeros(len(a)))
            # The free response beside it, whose state is that of another realization.
            den = layout.polynomials(fit.params, i)[0]
            rate = time_unit(den, 1.0 / self.span)
            none, free = np.zeros((n, len(u))), start.state[first : first + n] / rate ** np.arange(n)
            excess += self._excess(companion(den, rate), none, np.eye(n)[:1], none[:1], free)
            excess += trends[i] @ self.of_drift
            y[i] -= self._samples(excess)
            first += n
        if not np.isfinite(y).all():
            raise ArithmeticError
        return self.rec._like(y=y)

    def _excess(self, a: F64, b: F64, c: F64, d: F64, start: F64) -> C128:
        """What sums of a response have more than its integrals, of which s X = A X + B U + (x₀ - x₁)/T."""
        n = len(a)
        # The integral of the output is a state, too: line 0, where A may have no inverse.
        wide = np.block([[a, np.zeros((n, 1))], [c, np.zeros((1, 1))]])
        u, none = self.rec.u, np.zeros((n + 1, len(b.T)))
        system = wide, np.vstack([b, d]), np.eye(n + 1), none, np.append(start, 0.0)
        x = simulate_uneven(*system, u, self.held, self.t).reshape(n + 1, -1)
        y = c @ x[:n] + d @ u
        drive = (b @ self.lines).T + (x[:n, 0] - x[:n, -1]) / self.span
        states = np.linalg.solve(self.s[1:, None, None] * np.eye(n) - a, drive[1:, :, None])[..., 0]
        integrals = np.append(x[n, -1] / self.span, states @ c[0] + (d @ self.lines)[0, 1:])
        return np.asarray(self.rows @ y[0] - integrals)

    def _samples(self, lines: C128) -> F64:
        """The smallest samples of which these are the sums."""
        both = np.concatenate([lines.real, lines.imag[1:]])
        return np.asarray(self.q @ np.linalg.solve(self.r.T, both))
