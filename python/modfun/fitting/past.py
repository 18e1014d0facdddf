"""Fits of records whose past is known: samples of the steady state stand before their first one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from math import ceil, exp
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..equations.layout import layout_of
from ..errors import DataError, ModfunError, SpecError
from ..models.noise import Noise
from ..models.options import Options
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from ..records.steady import QUIET, standing
from ..results.cures import on_band
from ..results.diagnosis import growth
from ..results.estimates import COVARIANCES
from ..results.refits import starts_beside
from ..results.stability import deviance
from .from_states import fit_from_states
from .kinks import without_kinks
from .mirrored import SURELY, mirrored
from .of_equations import fit_equation
from .operating_point import OperatingPoint
from .wider import wider_edge

__all__ = ["fit_with_past"]

PART = 0.2  # of a record's intervals that stand before it
FEWEST = 8  # samples of a past
CERTAIN = 0.01  # noise of a sample of the past over that of the record's: certain next to these
# The same beside free delays. At 0.01 the past is surer than sums over samples are before what these fold is
# out, and delays ended far off, on bounds. It tells next to all at 0.1 already.
SURE = 0.1
SHORT = 12  # samples from which a level is first guessed in motion
STEP = 0.2  # of the noise: differences of levels
SETTLED = 0.1  # of its standard error: change of a level that ends the search
ROUNDS = 8
ENOUGH = 20  # degrees of freedom: fewer contradict no false start, and leave wide intervals
SLOWEST = 8  # samples per period of the highest line that is added for them
APART = 8.0  # −2 log likelihood that a step of the levels does not cost
LARGE = 100.0  # logarithm of a ratio that is no number
CLOSE = 4, 2  # steps of a search begun close to its end: before what sums fold is out, more lead astray,
MOVED, ROUNDING = 0.05, 1e-9  # of a standard error, and of values: as many again hardly move it there

Fits = Callable[..., Any]


def fit_with_past(
    records: tuple[Record, ...],
    structure: Any,
    options: Options,
    fit_once: Fits,
    start: F64 | None = None,
) -> Any:
    """The fit of records that begin at rest ("rest", "zero"), or in given states, by what they were before.

    The steady state before the first sample is known without noise, so it is a piece of record with next to
    none: samples of it are put before the first one with a small `sigma`, and the modulating functions cover
    both. Under "zero" the outputs' level is 0. Under "rest", or beside a constant in each equation, it is
    unknown: a nuisance with the lowest −2 log likelihood, whose covariance, twice the inverse of the second
    derivatives there, widens that of the parameters that follow it. Equations without a constant hold at it.
    A drift of the outputs of transfer functions begins at the first sample; its slope is a nuisance, too.
    `start`: parameters near which one of the searches for free delays begins.

    Raises
    ------
    DataError
        Inputs that would jump at the first sample although they are smooth.
    SpecError
        Options or a structure that do not go with a past.
    """
    if not isinstance(structure, TransferFunction) and not isinstance(options.initial_state, str):
        _refuse_kind(structure, options)

        def from_zero(beside: tuple[Record, ...], model: Any, zero: Options) -> Any:
            return fit_with_past(beside, model, zero, fit_once)

        return replace(fit_from_states(records, structure, options, from_zero), again=fit_once)
    _refuse(records, structure, options)
    equations = not isinstance(structure, TransferFunction)
    if equations:
        records = tuple([structure.own_channels(rec) for rec in records])
    # What kinks of held inputs do to an estimate is hardly another at other levels, and takes long to find.
    search = _Search(records, structure, options, fit_equation if equations else fit_once)
    fit = search.first(start)
    if not fit.usable:
        return replace(fit, records=records, options=options, again=fit_once)
    fit = search.on_enough_lines(fit)
    search.inner = on_band(fit, fit.band)
    wider: dict[str, F64] = {}
    if search.free:
        fit, wider = search.settled(fit)
    if equations and fit.usable:
        fit = without_kinks(fit, fit_equation)
    return replace(
        fit, **wider, params=fit.params + search.moved, options=options, records=records,
        with_past=search.extended(), again=fit_once,
    )  # fmt: skip


class _Search:
    """Fits under levels of the outputs before the first sample and, maybe, drifts: (record, output, 1 or 2).

    A drift begins at the first sample and is what it comes to over the whole record.
    """

    def __init__(self, records: tuple[Record, ...], structure: Any, options: Options, fit_once: Fits) -> None:
        self.records, self.structure, self.fit_once = records, structure, fit_once
        self.rest = options.initial_state == "rest"
        self.free = _trend(structure, options) is not None or (self.rest and _moved(records, structure))
        learnt = not isinstance(structure, TransferFunction) and options.noise == "output"
        self.several = learnt and len(records) * len(records[0].outputs) > 1
        self.late = _longest_delay(structure, records[0], options)
        self.seeks_delays = _seeks_delays(structure, records[0])
        self.certain = SURE if self.seeks_delays else CERTAIN
        more = {} if options.harmonics is None else {"harmonics": round(options.harmonics * (1 + PART))}
        drift = _trend(structure, options) == "linear"
        own = "constant" if drift else options.trend
        self.unknown = options.replace(initial_state="unknown")
        self.inner = self.unknown.replace(trend=own, **more)
        self.levels = np.zeros((len(records), len(records[0].outputs), 2 if drift else 1))
        self.moved: Any = 0.0  # what the operating point adds to the parameters
        self.point: OperatingPoint | None = None
        if self.free:
            if not isinstance(structure, TransferFunction) and _trend(structure, options) is None:
                self.point = OperatingPoint.of(records, structure)
            self.levels[..., 0] = [_first_level(rec, _past_inputs(rec, self.rest)) for rec in records]
            if drift:
                self.levels[..., 1] = _first_drifts(
                    fit_once(records, structure, self.inner.replace(trend="linear"))
                )

    def first(self, start: F64 | None) -> Any:
        """The fit under the first levels: with free delays the best of several ends.

        Beside the one from afar these are the ends of ways from a given start, from the fit with any start,
        which finds wrong delays less often, and from the stable twin of an unstable one.
        """
        fit = self.fit(self.levels)
        if not fit.usable or not self.seeks_delays:
            return fit
        starts = [start, mirrored(fit)]
        try:
            free = self.fit_once(self.records, self.structure, self.unknown)
            starts.append(free.params if free.usable else None)
        except ModfunError:  # such as an input that moves at an end only
            pass
        own, self.inner = self.inner, on_band(fit, fit.band)
        ends = [self._close(self.levels, one, fit) for one in starts if one is not None]
        self.inner = own
        for other in ends:
            if other is not None and _better(other, fit):
                fit = replace(other, options=own, band_rule=fit.band_rule)
        return fit

    def fit(self, levels: F64, near: Any = None) -> Any:
        """The fit under these levels; `near`: one under others, at whose estimates a search begins.

        Each search from afar of two delays took a second, for some twenty levels, and some ended in another
        minimum.
        """
        if near is not None and self.seeks_delays:
            close = self._close(levels, near.params, near)
            if close is not None:
                return close
        starts = {} if near is None else starts_beside(near, self.structure)
        found = self.fit_once(self.extended(levels), self.structure, self.inner, **starts)
        return found if found.usable or not starts else self.fit(levels)

    def _close(self, levels: F64, start: F64, near: Any) -> Any:
        """The end of a few steps on a given band; None if it is none, or on a bound that `near` is not on."""
        for steps in CLOSE:
            few, made = self.inner.replace(maxiter=min(steps, self.inner.maxiter)), start
            for _ in range(2):
                before = made
                fit = self.fit_once(self.extended(levels), self.structure, few, starts=before.tolist())
                made = np.asarray(fit.params)
                if not fit.usable:
                    break
            else:
                moved = np.abs(made - before) > MOVED * np.nan_to_num(fit.bse)
                moved &= ~np.isclose(made, before, rtol=ROUNDING)  # on a bound, or without noise
                if not np.any(moved) and {*fit.at_bound} <= {*near.at_bound}:
                    return replace(fit, status="ok", options=self.inner)
        return None

    def on_enough_lines(self, fit: Any) -> Any:
        """The fit on a default band that is wide enough for the noise level; itself where it is.

        A past says so much of the parameters that few lines reach their bound.
        """
        if fit.band_rule is None:
            return fit
        edge = wider_edge(fit, self.records, ENOUGH, SLOWEST)
        if edge == fit.band[1]:
            return fit
        other = self.fit_once(self.extended(self.levels), self.structure, on_band(fit, (fit.band[0], edge)))
        return replace(other, band_rule=fit.band_rule | {"widened": 1.0}) if other.success else fit

    def extended(self, levels: F64 | None = None) -> tuple[Record, ...]:
        """The records with their past at levels, by default those that were found."""
        both = zip(self.records, self.levels if levels is None else levels, strict=True)
        return tuple([extended(rec, own, self.rest, self.late, self.certain) for rec, own in both])

    def settled(self, fit: Any) -> tuple[Any, dict[str, F64]]:
        """The fit under the best levels, and its covariances with what the errors of these add.

        Residuals lack what the levels took from them, so covariances are means over fits with each level a
        standard error higher and lower (the mean square of such moves of several levels one by one is that of
        all at once if they are larger by the root of the number of levels). Status "maxiter" where the levels
        do not settle. Noise of several outputs or records is held in the search, since the rule by which fits
        of equations estimate its levels is not smooth.
        """
        own = self.inner
        if self.several:
            self.inner = own.replace(noise=Noise(y=list(np.mean(fit.levels[:, : len(fit.outputs)], axis=0))))
            fit = self.fit(self.levels, fit)
            if not fit.usable:
                return fit, {}
        rows = fit.df_resid + fit.params.size
        steps = STEP * np.broadcast_to(fit.noise_levels[..., None], self.levels.shape).ravel()
        for _ in range(ROUNDS):
            sides, slopes, gradient, curvature = self._differences(fit, steps, rows)
            found = not any([_elsewhere(one, fit) for one in sides]) and np.isfinite(curvature).all()
            if not found or not np.linalg.eigvalsh(curvature)[0] > 0:
                steps = steps / 2  # a fit fell into another minimum, or into none
                continue
            inverse = np.linalg.inv(curvature)
            move, errors = -inverse @ gradient, np.sqrt(2 / rows * np.diag(inverse))
            if np.all(np.abs(move) < SETTLED * errors):
                self.inner, ended = own, fit
                if self.several:
                    ended = self.fit(self.levels, fit)
                    ended = ended if ended.success else fit
                # A parameter has no error on a bound, and one beside it.
                alike = [one for one in sides if one.at_bound == fit.at_bound] or [fit]
                wider = {
                    name: np.mean([getattr(one, name) for one in alike], axis=0)
                    + (getattr(ended, name) - getattr(fit, name))
                    for name in COVARIANCES
                }
                return ended, self._tied(
                    ended, wider, slopes / steps, 2 / rows * inverse * np.outer(steps, steps)
                )
            self.levels = self.levels + (steps * move).reshape(self.levels.shape)
            fit = self.fit(self.levels, fit)
            if not fit.usable:
                return fit, {}
            steps = steps * errors * np.sqrt(errors.size)
        return replace(fit, status="maxiter"), {}

    def _tied(self, fit: Any, covs: dict[str, F64], slopes: F64, of_levels: F64) -> dict[str, F64]:
        """Covariances beside levels of this covariance, of parameters that hold at these where they must."""
        both = slopes @ of_levels
        joint = {
            name: np.block([[cov + both @ slopes.T, both], [both.T, of_levels]]) for name, cov in covs.items()
        }
        count = fit.params.size
        if self.point is not None:
            found = self.point.tied(np.concatenate([fit.params, self.levels.ravel()]), joint, "cov_nonrobust")
            if found is not None:
                x, joint = found
                self.moved = x[:count] - fit.params
                self.levels = x[count:].reshape(self.levels.shape)
        return {name: cov[:count, :count] for name, cov in joint.items()}

    def _differences(self, fit: Any, steps: F64, rows: int) -> tuple[list[Any], F64, F64, F64]:
        """Fits on both sides, slopes of the parameters, derivatives of the squares, by levels in steps.

        The sum, (exp of −2 log L)^(1/rows), is over that of the fit: of linear equations it is a parabola.
        """
        count = steps.size
        here, moves = deviance(fit), np.eye(count)

        def squares(beside: Any) -> float:
            return exp(min((deviance(beside) - here) / rows, LARGE))

        up, down = ([self._beside(fit, sign * move * steps) for move in moves] for sign in (1, -1))
        slopes = np.array([(a.params - b.params) / 2 for a, b in zip(up, down, strict=True)]).T
        high, low = (np.array([squares(one) for one in side]) for side in (up, down))
        curvature = np.diag(high + low - 2)
        for i, j in combinations(range(count), 2):
            both = squares(self._beside(fit, (moves[i] + moves[j]) * steps))
            curvature[i, j] = curvature[j, i] = both - high[i] - high[j] + 1
        return up + down, slopes, (high - low) / 2, curvature

    def _beside(self, fit: Any, moved: F64) -> Any:
        return self.fit(self.levels + moved.reshape(self.levels.shape), fit)


def _seeks_delays(structure: Any, rec: Record) -> bool:
    """Whether these are transfer functions with free delays, for which there are several minima."""
    if not isinstance(structure, TransferFunction):
        return False
    return bool(structure.layout(rec.outputs, rec.inputs).free_delays)


def _elsewhere(fit: Any, other: Any) -> bool:
    """Whether a fit under levels next to another's is none, or in another minimum on a bound."""
    if not fit.usable:
        return True
    return not {*fit.at_bound} <= {*other.at_bound} and deviance(fit) - deviance(other) > APART


def _better(fit: Any, other: Any) -> bool:
    """Whether a fit is likelier than another on the same lines; an unstable one has to be surely so."""
    unstable = growth(fit) > 0, growth(other) > 0
    return deviance(fit) - deviance(other) < SURELY * (unstable[1] - unstable[0])


def extended(rec: Record, levels: F64, rest: bool, late: float, certain: float) -> Record:
    """A record with its past before it: outputs at `levels`, inputs at their first values or at zero.

    Behind the level of an output may be its drift over the record, which is taken away.
    """
    step = float(np.median(np.diff(rec.t))) if rec.dt is None else rec.dt
    count = max(ceil(PART * rec.intervals), FEWEST) + ceil(late / step - 1e-9)
    sigma = np.ones_like(rec.y) if rec.sigma is None else rec.sigma
    usual = certain * np.median(sigma, axis=1, keepdims=True)
    drift = levels[:, 1:] * ((rec.t - rec.t[0]) / rec.duration) if levels.shape[1] > 1 else 0.0

    def before(past: Any, samples: Any) -> Any:
        return np.hstack([np.repeat(past, count, axis=1), samples])

    return rec._like(
        y=before(levels[:, :1], rec.y - drift),
        u=before(_past_inputs(rec, rest), rec.u),
        t=np.concatenate([rec.t[0] - step * np.arange(count, 0, -1), rec.t]),
        sigma=before(usual, sigma),
        mask=None if rec.mask is None else before(np.ones((len(rec.y), 1), bool), rec.mask),
        _keep={},
        _lost=None,
    )


def _past_inputs(rec: Record, rest: bool) -> F64:
    """Inputs before the first sample, (input, 1)."""
    return rec.u[:, :1] if rest else np.zeros((len(rec.u), 1))


def _moved(records: Sequence[Record], structure: Any) -> bool:
    """Whether the outputs may stand elsewhere than at zero under the inputs' first values."""
    if isinstance(structure, TransferFunction):
        return any(np.any(rec.u[:, 0] != 0) for rec in records)
    driven = any(np.any(structure.own_channels(rec).u[:, 0] != 0) for rec in records)
    return driven or not _rests_at_zero(structure)


def _rests_at_zero(structure: Any) -> bool:
    """Whether equations hold, at any time, while all their signals are zero."""
    import sympy

    from ..equations.symbolic.compiled import time

    compiled = structure.compiled()
    own = {sympy.Symbol(name, real=True) for name in compiled.parameters} | {time, *compiled.known}
    still = [e.subs({s: sympy.Integer(0) for s in e.free_symbols - own}) for e in compiled.source]
    return all(sympy.simplify(e) == 0 for e in still)


def _first_level(rec: Record, past: F64) -> F64:
    """Means of the outputs while the inputs stand as they did before, or where a parabola begins."""
    count = standing(rec, past)
    degree = 0 if count >= QUIET else 2
    count = min(max(count, QUIET if degree == 0 else SHORT), rec.t.size)
    good = np.ones((len(rec.y), count)) if rec.mask is None else rec.mask[:, :count] + 1e-9
    t = rec.t[:count] - rec.t[0]
    return np.array(
        [
            np.polynomial.Polynomial.fit(t, y[:count], degree, w=own)(0.0)
            for y, own in zip(rec.y, good, strict=True)
        ]
    )


def _first_drifts(fit: Any) -> Any:
    """Drifts of the outputs of each record by a fit from any start; 0 where there is none."""
    if not fit.usable:
        return 0.0
    return [fit.simulate(rec)[1].trend.reshape(len(rec.y), -1)[:, 1] for rec in fit.records]


def _trend(structure: Any, options: Options) -> str | None:
    if options.trend == "auto" and not isinstance(structure, TransferFunction):
        return structure.trend  # type: ignore[no-any-return]
    return options.fitted_trend


def _longest_delay(structure: Any, rec: Record, options: Options) -> float:
    if isinstance(structure, TransferFunction):
        return structure.layout(rec.outputs, rec.inputs).longest_delay
    own = structure.own_channels(rec)
    return layout_of(structure, options, own.outputs, own.inputs, (own.intersample,)).longest_delay


def _refuse(records: Sequence[Record], structure: Any, options: Options) -> None:
    told = f"fit: initial_state={options.initial_state!r}"
    if options.initial_state not in ("rest", "zero"):
        raise SpecError(
            f"{told} is for transfer functions of one output in white noise, without free delays, masks and "
            'sigma, and numbers also for an Equation or StateSpace: write the model as one, or take "rest", '
            '"zero" or "unknown"'
        )
    _refuse_kind(structure, options)
    if not isinstance(structure, TransferFunction) and structure.compiled().is_driven_by_time:
        constant = options.initial_state == "rest" or _trend(structure, options) is not None
        if constant or not _rests_at_zero(structure):
            raise SpecError(
                f"{told}: the equations change with time, so they can rest only at zero, and only if nothing "
                'else drives them; take initial_state="zero" without a trend if they did, else "unknown"'
            )
    if options.initial_state == "rest":
        return
    for k, rec in enumerate(records):
        for name, kind, row in zip(rec.inputs, rec.intersample, rec.u, strict=True):
            if kind != "zoh" and abs(row[0]) > 1e-9 * np.max(np.abs(row)):
                raise DataError(
                    f"{told}: input {name!r} of record {k} is {row[0]:.4g} at the first sample and not held "
                    f"(intersample={kind!r}), so it would jump from zero there; if it does, declare it held, "
                    'intersample="zoh"; else begin the record before the input moves, or take "rest"'
                )


def _refuse_kind(structure: Any, options: Options) -> None:
    told = f"fit: initial_state={options.initial_state!r}"
    plain = options.noise == "output" or (isinstance(options.noise, Noise) and options.noise.u is None)
    if not plain or options.method not in ("ml", "awls"):
        raise SpecError(
            f'{told} goes with noise of the outputs, noise="output" or mf.Noise(y=...), by "ml" or "awls"; '
            'leave the other option out, or take initial_state="unknown"'
        )
    if _trend(structure, options) == "linear" and not isinstance(structure, TransferFunction):
        raise SpecError(
            f'{told}: a drift in equations, trend="linear", has no beginning, so nothing rests before it; '
            'take trend="constant"'
        )
