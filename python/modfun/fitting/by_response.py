"""Fits of nonlinear equations by their response, where sums over the records end in no or a false answer.

What the sums ask of products of noisy signals has a minimum only where these are large beside the noise: of
Bergman's minimal model of glucose, sampled every five minutes with 3 % of noise, 21 of 40 searches did not
settle, though the response had its least squares where they went about.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..base.cached import kept
from ..base.least_squares import damped_step, levenberg_marquardt
from ..base.named import Named
from ..base.words import TRENDS
from ..equations.nonlinear import model_of
from ..errors import ModfunError
from ..models.options import Options
from ..records.functions import drives
from ..records.record import Record
from ..results.cures import CLOSE, again, amplified
from ..results.diagnosis import high_band_df, level_p
from ..results.doubts import SURE
from ..results.fit import Fit
from ..results.initial_state import begins_in_zero, find_state, from_zero
from ..results.misfit import PLAUSIBLE, UNLIKELY
from ..results.of_equations import EquationFit, parts_with_values
from ..results.regression import trend_columns
from . import by_samples
from .by_samples import LOGS, deviance, is_few, levels_of, of_response, weights_of
from .near_singular import near_singular
from .restarts import SMALLER, compared
from .scales import sizes

__all__ = ["by_response", "sample_likelihood"]

BENT = 0.2  # `EquationFit.bend` from which on terms with noise inside have moved estimates by their errors
STEP = 1e-6  # of an unknown's size: the difference that stands for its derivative
ROUNDS, REWEIGHED = 60, 3
SETTLED = 1e-7  # of the sum of squares, which a step has to promise
APART = 1e4  # condition number beyond which unknowns are not told apart, or by errors of differences
MOVED = 0.5  # standard errors from sums next to a singular point: a response nearer than these tells no more
ENDLESS = 0.01  # of its value's effect in the noise: a parameter that went to where it changes nothing
RTOL = 1e-8  # relative error of integrations
WAYS = ("awls", "wls", "ls")  # of fits by sums, which noise biases or which weigh otherwise
SAME = 0.01  # of twice the log likelihood: ends that differ by less are one
SMALLEST = 1e-3  # of the largest sample: errors of samples about 0, for the first initial state
ENDS = 3  # from which steps are made, the nearest to the records


def by_response(fit: Fit) -> Fit:
    """The fit that its response asks for, where another explains the records better beyond doubt.

    Only where the search did not settle or what is known of the fit anyway speaks against it: its level, how
    far noise bends its terms, products that an elimination has left, or outputs that noise takes near to
    where a logarithm or quotient of theirs has no value. Then steps of Levenberg and Marquardt
    lead from several fits to least squares of the response, and a fit by sums from there stands, unless it
    leaves more. A wrong model has no such answer: what leaves more than noise is refused.

    Beside products there are several minima: 5 of 10 searches for two tanks, the upper level hidden, ended
    where time constants are nearly exchanged, and fits by other sums led to the better one. Where a user's
    start leads to one that is about as likely, it stands.
    """
    if not isinstance(fit, EquationFit) or not _is_asked(fit):
        return fit
    try:
        with np.errstate(all="ignore"):  # responses from far away overflow
            return _found(fit)
    except (ModfunError, np.linalg.LinAlgError):
        return fit


def sample_likelihood(fit: Fit) -> tuple[float, int, int] | None:
    """As that of `by_samples`; of equations as they are searched here, where records may begin in zero."""
    plain = fit.options.output_weights is None and fit.options.initial_state in ("unknown", "zero")
    if not (isinstance(fit, EquationFit) and plain) or fit.layout.free_delays:
        return by_samples.sample_likelihood(fit)
    try:
        with np.errstate(all="ignore"):
            search = _Search(fit)
            here = search.at(fit.params)
            there = search.lowest(here)[0] if here else None
    except (ModfunError, np.linalg.LinAlgError):
        return None
    found = [(point.deviance, point.x.size, search.count) for point in (here, there) if point]
    return min(found, default=None)


def _is_asked(fit: EquationFit) -> bool:
    options = fit.options
    few = _errs(fit)
    plain = options.noise in ("output", *[LOGS] * few) and options.method in ("ml", "awls")
    plain = plain and options.output_weights is None and not (options.robust or fit.layout.priors)
    plain = plain and options.initial_state in ("unknown", *["zero"] * few)
    if (
        not plain
        or (fit.structure.linear and not few)
        or not fit.records
        or not fit.params.size
        or fit.again is None
    ):
        return False
    if fit.layout.free_delays:
        return False
    return not fit.success or few or level_p(fit) < UNLIKELY or _is_biased(fit)


def _errs(fit: EquationFit) -> bool:
    """Whether sums over few samples err, as `by_samples` tells."""
    return fit.unsettled and (is_few(fit) or fit.options.noise == LOGS)


def _is_biased(fit: EquationFit) -> bool:
    """Whether noise moves the sums' estimates by several of their errors, whatever its level."""
    return fit.bend > BENT or amplified(fit) or near_singular(fit)


@kept
def _found(fit: EquationFit) -> EquationFit:
    from scipy.special import chdtri

    search = _Search(fit)
    here = search.at(fit.params) if fit.usable else None
    if _errs(fit):  # steps from its estimates have led nowhere, and no other sums are better
        found = search.minima(None, None, [*_sizes(fit)])
        better = found and not (here and here.deviance < found[0].deviance)
        return search.told(found[0], found[1:]) if better else fit
    best = search.least(here) if here else None
    found = []
    if best is None or amplified(fit) or not search.level_p(best) > PLAUSIBLE:  # it may be one of several
        found = search.minima(best, _told_start(fit), [*_ends(fit)])
        best = found[0] if found else None
    worth = float(chdtri(fit.params.size, PLAUSIBLE))  # of twice the log likelihood
    if best is None or not search.level_p(best) > SURE:
        return fit
    if fit.success and here and not amplified(fit) and not here.deviance - best.deviance > worth:
        moved = np.abs(best.params - fit.params) > MOVED * np.asarray(fit.bse)
        if not (near_singular(fit) and np.any(moved)):
            return fit
    other: Any = None  # the fit by sums that begins there
    if not _is_biased(fit):
        other = again(fit, fit.records, fit.structure, fit.options, starts=best.params.tolist())
    if other is not None and other.success and not other.at_bound and not other.bend > BENT:
        there = search.at(other.params)
        if there is not None and there.deviance < best.deviance + worth:
            return other  # type: ignore[no-any-return]
    return search.told(best, found[1:])


def _told_start(fit: EquationFit) -> F64 | None:
    """Parameters with the starts that a user gave; None where there are none."""
    told = fit.layout.formulas.words["starts"]
    if all([start is None for start in told]):
        return None
    return np.array([x if start is None else start for x, start in zip(fit.params, told, strict=True)])


def _ends(fit: EquationFit) -> Iterator[F64]:
    """Parameters of other fits by sums, also of the parts that have values, and sizes that they may have."""
    assert fit.records is not None
    ways: list[tuple[tuple[Record, ...], Options]] = []
    if parts := parts_with_values(fit):
        ways.append((parts, fit.options))
    ways += [(fit.records, fit.options.replace(method=word)) for word in WAYS]
    for records, options in ways:
        if made := again(fit, records, fit.structure, options):
            yield made.params
    yield sizes(fit.structure, fit.param_names, fit.records)


def _sizes(fit: EquationFit) -> Iterator[F64]:
    """Sizes that parameters may have, or their starts; then what signals are compared with is smaller."""
    words, found = fit.layout.formulas.words, sizes(fit.structure, fit.param_names, fit.records or ())
    inside = [k for k in compared(fit.layout.compiled) if words["starts"][k] is None]
    for k, (start, (_, high)) in enumerate(zip(words["starts"], words["bounds"], strict=True)):
        found[k] = start if start is not None else -found[k] if high <= 0 else found[k]
    yield found
    if inside:
        found = found.copy()
        found[inside] /= SMALLER
        yield found


@dataclass(frozen=True, eq=False)
class _Point:
    """Unknowns, and the residuals that they leave with the slopes of these, both over levels of the noise."""

    x: F64
    params: F64
    residual: F64
    jacobian: F64
    left: list[F64]  # (output, time) of each record, in the units of the outputs
    levels: list[F64]  # (output,) of each record
    deviance: float  # twice the negative log likelihood, with a level for each output of each record

    @property
    def cost(self) -> float:
        return float(self.residual @ self.residual)


class _Search:
    """Least squares of the responses over parameters, and initial states and trends of the records."""

    def __init__(self, fit: EquationFit) -> None:
        self.fit, self.records = fit, fit.records or ()
        self.compiled = fit.structure.compiled(fit.outputs, fit.inputs)
        self.wider = self.compiled
        self.terms = TRENDS.index(fit.trend)
        self.offsets = begins_in_zero(fit)
        if self.terms and not self.offsets:
            from ..equations.symbolic.ode import with_trend

            self.wider = with_trend(self.compiled, self.terms)
        low, high = np.array(fit.layout.formulas.words["bounds"], dtype=float).T
        self.low, self.high = low, high
        self.zero, self.logs = fit.options.initial_state == "zero", fit.options.noise == LOGS
        self.own = [weights_of(fit, rec) for rec in self.records]
        if self.logs and self.zero:  # the response is 0 where it begins, and its logarithm is none
            for own in self.own:
                own[:, 0] = 0.0
        self.ys = [self._as_told(rec.y, own) for rec, own in zip(self.records, self.own, strict=True)]
        self.counts = [np.count_nonzero(own, axis=1) for own in self.own]
        self.count = sum([int(counts.sum()) for counts in self.counts])
        self.levels = [y.std(axis=1) for y in self.ys]
        self.sizes: F64 = np.empty(0)

    def at(self, params: F64) -> _Point | None:
        """The point with these parameters and the initial states and trends that suit them best."""
        params = np.clip(params, self.low, self.high)
        x, sizes = [params], [np.where(params != 0, np.abs(params), 1.0)]
        try:
            model = model_of(self.compiled, params, self.fit.structure)
            for rec in self.records:
                if self.offsets:
                    here = replace(self.fit, params=Named(params, self.fit.param_names))
                    found = (from_zero(here, self._beside(rec))[1], np.zeros(0))
                else:
                    state = np.zeros(len(model.states)) if self.zero else None
                    _, start = find_state(model, self._beside(rec), self.fit.trend, state)
                    found = (start.trend, start.state[: 0 if self.zero else None])
                x += found
                scale = float(np.max(np.abs(rec.y)))
                sizes += [np.maximum(np.abs(own), 1e-3 * scale) for own in found]
        except ModfunError:
            return None
        self.sizes = np.concatenate(sizes)
        return self._point(np.concatenate(x))

    def _beside(self, rec: Record) -> Record:
        """The record whose least squares lie beside those of logarithms."""
        return rec._like(sigma=np.maximum(rec.y, SMALLEST * np.max(rec.y))) if self.logs else rec

    def _as_told(self, y: F64, own: F64) -> F64:
        """Samples or responses as the noise is of them, where they count; nan without a logarithm."""
        return np.log(np.where(own > 0, y, 1.0)) if self.logs else y

    def _point(self, x: F64) -> _Point | None:
        p = self.fit.params.size
        residual, rows, left, place, lack = [], [], [], p, 0.0
        steps = STEP * self.sizes
        try:
            every = zip(self.records, self.ys, self.own, self.counts, self.levels, strict=True)
            for rec, told, own, counts, level in every:
                inside = 0 if self.offsets else self._trends
                model = model_of(self.wider, np.append(x[:p], np.zeros(inside)), self.fit.structure)
                n = 0 if self.zero else len(model.states)
                mine = np.arange(place, place + self._trends + n)
                place = int(mine[-1]) + 1 if mine.size else place
                at = np.append(np.arange(p), mine)
                moved = x[at][:, None] + np.hstack([np.zeros((at.size, 1)), np.diag(steps[at])])
                starts = moved[at.size - n :] if n else np.zeros((len(model.states), moved.shape[1]))
                y, _ = model.family(
                    drives(rec, 0.0), rec.t, np.ascontiguousarray(starts), rec.intersample,
                    RTOL, None, np.ascontiguousarray(moved[: p + inside]),
                )  # fmt: skip
                if self.offsets:
                    trends = moved[p:].reshape(len(y), self.terms, -1)
                    y = y + np.einsum("itm,tk->imk", trends, trend_columns(rec.t, self.fit.trend))
                y = self._as_told(y, own[:, None])
                weights = own / level[:, None]
                slopes = np.zeros((x.size, rec.y.size))
                slopes[at] = (
                    (weights[:, None] * (y[:, 1:] - y[:, :1]) / steps[at][:, None])
                    .transpose(1, 0, 2)
                    .reshape(at.size, -1)
                )
                left.append(own * (told - y[:, 0]))
                residual.append((left[-1] / level[:, None]).ravel())
                rows.append(slopes.T)
                lack += deviance(left[-1], counts)
        except ModfunError:
            return None
        off, jacobian = np.concatenate(residual), np.concatenate(rows)
        if not np.isfinite(np.sum(jacobian**2) + off @ off):
            return None
        return _Point(x, x[:p], off, jacobian, left, self.levels, lack)

    @property
    def _trends(self) -> int:
        return self.terms * len(self.fit.outputs if self.offsets else self.compiled.source)

    def least(self, here: _Point) -> _Point | None:
        """Where steps from a point end at least squares; None where they do not."""
        there, settled = self.lowest(here)
        return there if there and settled and self._is_told(there) else None

    def lowest(self, here: _Point) -> tuple[_Point | None, bool]:
        """Where steps from a point end, and whether they settle there; None where a response has no value."""
        several, ended = sum([counts.size for counts in self.counts]) > 1, ""
        for _ in range(REWEIGHED if several else 1):
            self.levels = self._levels_of(here)
            again = self._point(here.x)
            if again is None:
                return None, False
            here, _, ended = levenberg_marquardt(
                again,
                self._slopes,
                damped_step,
                lambda at, move: self._point(self._within(at.x + move)),
                enough=0.0,
                tol=SETTLED,
                maxiter=ROUNDS,
            )
        return here, ended == "settled"

    def minima(self, own: _Point | None, told: F64 | None, ends: Sequence[F64]) -> list[_Point]:
        """Distinct ends of steps: the one to take, and others.

        `own`: that of the fit, if it has one; `told`: where a user begins; from the `ends` nearest to the
        records. Ends that leave the same to the response are those of other signs or names.
        """
        first = self.at(told) if told is not None else None
        meant = self.least(first) if first else None
        tried = sorted([one for one in map(self.at, ends) if one], key=lambda one: one.deviance)
        found: list[_Point] = []
        for end in (own, meant, *map(self.least, tried[:ENDS])):
            if end and all([abs(end.deviance - one.deviance) > SAME for one in found]):
                found.append(end)
        found.sort(key=lambda one: one.deviance)
        if meant and meant.deviance < found[0].deviance + CLOSE:
            found.sort(key=lambda one: abs(one.deviance - meant.deviance) > SAME)
        return found

    def _levels_of(self, here: _Point) -> list[F64]:
        pairs = zip(here.left, self.counts, self.ys, strict=True)
        return [np.maximum(levels_of(left, counts), 1e-9 * np.max(np.abs(y))) for left, counts, y in pairs]

    def _within(self, x: F64) -> F64:
        p = self.low.size
        return np.append(np.clip(x[:p], self.low, self.high), x[p:])

    def _slopes(self, here: _Point) -> F64:
        """Slopes, zero of what stands on a bound and would go beyond it."""
        p = self.low.size
        uphill = here.jacobian[:, :p].T @ here.residual
        held = np.where(uphill < 0, here.params <= self.low, here.params >= self.high)
        jacobian = here.jacobian.copy()
        jacobian[:, :p][:, held] = 0.0
        self.sizes = np.maximum(np.abs(here.x), 1e-3 * self.sizes)
        return jacobian

    def _projected(self, here: _Point) -> F64:
        """Slopes by the parameters beside initial states and trends, which are unknown, too."""
        p = self.low.size
        own, beside = here.jacobian[:, :p], here.jacobian[:, p:]
        return own - beside @ (np.linalg.pinv(beside) @ own) if beside.size else own

    def _is_told(self, here: _Point) -> bool:
        """Whether parameters stand inside bounds, none at infinity, and the response tells them apart."""
        inside = np.all((here.params > self.low) & (here.params < self.high))
        size = np.linalg.norm(here.jacobian, axis=0)
        if not (inside and np.all(size > 0) and np.linalg.cond(here.jacobian / size) < APART):
            return False
        effect = np.abs(here.params) * np.linalg.norm(self._projected(here), axis=0)
        return bool(np.all(effect > ENDLESS * np.sqrt(here.cost / self._freedom(here))))

    def level_p(self, here: _Point) -> float:
        """Probability of residuals as large beside the noise of the high band; 1 where that is not known."""
        from scipy.special import fdtrc

        seen = self.fit.seen[:, : len(self.fit.outputs)]
        if not np.all(np.isfinite(seen)) or not np.all(seen > 0):
            return 1.0
        freedom = self._freedom(here)
        over = np.array(self._levels_of(here)) / seen
        square = float(np.mean(over**2)) * self.count / freedom
        return float(fdtrc(freedom, high_band_df(self.fit) * len(self.fit.outputs), square))

    def _freedom(self, here: _Point) -> int:
        return max(self.count - here.x.size, 1)

    def told(self, here: _Point, others: Sequence[_Point]) -> EquationFit:
        """The fit with these parameters, and the errors and residuals of their response.

        `others`: minima beside it, of which the likeliest is kept where it is about as likely.
        """
        fit, freedom = self.fit, self._freedom(here)
        level = [own * np.sqrt(self.count / freedom) for own in self._levels_of(here)]
        steep = self._projected(here)
        size = np.linalg.norm(steep, axis=0)
        inverse = np.linalg.pinv(steep.T @ steep / np.outer(size, size)) / np.outer(size, size)
        plain = inverse * here.cost / freedom
        line, smooth = [
            _at_least(plain, inverse @ self._coloured(here, steep, width) @ inverse * (self.count / freedom))
            for width in (0, max(int(np.sqrt(self.count)), 8))
        ]
        return replace(
            fit,
            params=Named(here.params, fit.param_names),
            status="ok",
            at_bound=(),
            cov_nonrobust=plain,
            cov_spectral=smooth,
            cov_hc3=line,
            gram=steep.T @ steep / np.outer(size, size),
            condition_bound=inf,
            bend=0.0,
            unfolded=(),
            less=(),
            unsettled=False,
            other_minimum=next((one.params for one in others if one.deviance < here.deviance + CLOSE), None),
            **of_response(fit, here.left, level, self.counts, freedom),
        )

    def _coloured(self, here: _Point, steep: F64, width: int) -> F64:
        """Covariance of the slopes' sums of the residuals, whose spectrum is smoothed over so many lines."""
        found, place = np.zeros((steep.shape[1],) * 2), 0
        for left, level in zip(here.left, here.levels, strict=True):
            for row in left / level[:, None]:
                own = np.fft.fft(steep[place : place + row.size], axis=0)
                power = np.abs(np.fft.fft(row)) ** 2 / row.size
                if width:
                    span = 2 * min(width, row.size // 4) + 1
                    power = np.convolve(np.tile(power, 3), np.ones(span) / span, "same")
                    power = power[row.size : 2 * row.size]
                found += (own.conj().T @ (own * power[:, None])).real / row.size
                place += row.size
        return found


def _at_least(white: F64, coloured: F64) -> F64:
    """The covariance in white noise, with variances that coloured noise raises.

    Steps to least squares take from the residuals what the slopes show of them, on the few lines where slow
    responses move: spectra of these are too low there.
    """
    over = np.sqrt(np.maximum(coloured.diagonal() / white.diagonal(), 1.0))
    return np.asarray(white * np.outer(over, over))
