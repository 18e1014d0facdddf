"""Fits by the samples that count alone: where many are masked, or few are too far apart for sums."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import log, nan, pi
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64, geometric_mean
from ..equations.written import Written
from ..errors import DataError, ModfunError
from ..models.free import priors_of
from ..models.options import Options
from ..records.mask import sample_weights
from ..records.record import Record
from ..records.uneven_rows import gaps
from ..results.cures import again
from ..results.diagnosis import fewest_samples, growth
from ..results.doubts import FEW_SAMPLES
from ..results.estimates import COVARIANCES
from ..results.fitted_samples import measured_lines
from ..results.following import following_p
from ..results.initial_state import begins_in_zero, from_zero, simulate_equations, slopes
from ..results.prediction import InitialState
from ..results.sample_levels import square_beside
from ..results.sparse import sparse
from ..results.unknown_past import from_known_inputs, lead

__all__ = [
    "by_samples", "deviance", "ends_at_samples", "has_gaps", "is_few", "levels_of", "lower_by_samples",
    "of_response", "sample_likelihood", "weights_of",
]  # fmt: skip

PART = 0.1  # of a standard error: steps of differences
ROUNDS, HALVED = 12, 5
NEARER = 3  # steps to an initial state by logarithms
LOGS = "log-normal"
STARTS = ("unknown", "zero", "rest")  # of which simulations begin as told
FAR = 12  # halvings from where sums over few samples end, as at a decay for a growth
MOVED = 1.0  # standard errors of the lines: estimates differ by half as much where sums are right
WIDER = 2.0  # times the errors of the samples: the few lines of sums lose that much, or err
LEAST = 1e-6  # of the level that lines show: records without noise
SETTLED = 0.02  # of a standard error: a move that ends the rounds
SMALL = 1e-6  # of the sum of squares: a gain so small that rounding hides it, and steps need not find it
ASTRAY = 10.0  # times the level of lines: what a wrong model, or chaos, leaves; minima leave below 4
OTHER = 3.0  # times the noise beside neighbouring samples: left by other models; right ones leave 1.0 to 1.2
SLOW = 0.7  # of the level before a step: no way to a minimum from so far; others halve it or more


AnyFit = TypeVar("AnyFit", bound=Any)


def lower_by_samples(fit: Any, other: Any) -> float:
    """By how much another fit, of this or another structure, lowers BIC of the samples that count.

    In white noise. What one structure has more than the other, parameters and free motion of poles, counts
    as much as where candidates are compared by lines: samples beyond the band tell nothing of it.

    Lines hold what was put in the place of masked samples, whose errors look like those of a wrong input.
    Beside an output of which every third to sixth sample counts, a measured motion was read as held: BIC of
    lines fell by up to 60, where that of the samples rises by 100 to 200. Samples decide nothing (nan) where
    noise drives the system, for then they are no responses with white noise.
    """
    if fit.options.drives:
        return nan
    spared = _unknowns(fit) - _unknowns(other)
    return _deviance(fit) - _deviance(other) + spared * log(fit.df_resid + fit.params.size)


def _unknowns(fit: Any) -> int:
    """Parameters, and the coefficients of the free motion of each record."""
    return int(fit.params.size + fit.order * len(fit.omega0))


def _deviance(fit: Any) -> float:
    """Twice the negative log likelihood, with a level of noise for each output of each record."""
    found = 0.0
    for k, rec in enumerate(from_known_inputs(fit)):
        own = _counted(fit, k)
        found += deviance((rec.y - fit.simulate(rec)[0]) * own, np.count_nonzero(own, axis=1))
    return found


def _counted(fit: Any, k: int) -> F64:
    """Weights of the k-th record's samples, 0 also where its inputs are not known."""
    own = weights_of(fit, fit.records[k])
    own[:, : lead(fit, k)] = 0.0
    return own


def weights_of(fit: Any, rec: Record) -> F64:
    """Weights of samples (output, time) in units of the fit's noise levels, 0 where masked.

    Levels of equations are those of the usual sample, whatever the scale of `sigma`.
    """
    sigma = rec.sigma
    if sigma is not None and not fit.layout.rational:
        sigma = sigma / np.median(sigma, axis=1, keepdims=True)
    return sample_weights(rec.mask, sigma, rec.y.shape)


def levels_of(left: F64, counts: NDArray[np.intp]) -> F64:
    """Level of the noise of each output, of residuals (output, time) of which so many count."""
    return np.asarray(np.sqrt(np.sum(left**2, axis=1) / counts))


def deviance(left: F64, counts: NDArray[np.intp]) -> float:
    """Twice the negative log likelihood of one record's residuals, at the levels that suit them best."""
    with np.errstate(divide="ignore"):  # without noise nothing may be left
        return float(np.sum(2 * counts * np.log(levels_of(left, counts))))


def by_samples(fit: AnyFit) -> AnyFit:
    """The fit led to the least squares of the samples that count; itself where few of them are masked.

    Sums over a record need a value at every instant. What a polynomial or the model puts there is no
    measurement, and where most samples are so, standard errors from lines are too small and the rounds of
    filling end too early. Output error has no such values: from estimates near the truth a few steps of Gauss
    and Newton reach its minimum. Covariances keep what they tell of the colour of the noise, on the scale of
    that minimum.
    """
    options = fit.options
    white = options.noise in ("output", LOGS) and options.method in ("ml", "awls") and not fit.layout.priors
    if not white:
        return fit
    if measured_lines(fit) or has_gaps(fit):
        if not is_few(fit):
            return fit
        return _at_few(fit) if fit.success and not fit.at_bound else replace(fit, unsettled=True)
    return fit if not fit.usable or options.noise == LOGS or growth(fit) > 0 else _led(fit, HALVED)


def _led(fit: AnyFit, halved: int) -> AnyFit:
    try:
        with np.errstate(all="ignore"):  # steps too far away overflow, and are halved
            return _Descent(fit, halved).ended()  # type: ignore[no-any-return]
    except (ModfunError, np.linalg.LinAlgError):
        return fit


def ends_at_samples(structure: Any, options: Options) -> bool:
    """Whether fits of few samples of this structure end in least squares of its response."""
    priors = isinstance(structure, Written) and priors_of(structure)
    told = options.initial_state
    return (
        isinstance(structure, Written)
        and not (priors or options.robust or options.reference)
        and options.noise in ("output", LOGS)
        and options.method in ("ml", "awls")
        and isinstance(told, str)
        and told in STARTS
    )


def has_gaps(fit: Any) -> bool:
    """Whether a record has gaps that no sum bridges: `refuse_gap` leaves these to least squares."""
    return any([gaps(rec).size for rec in fit.records or ()])


def is_few(fit: Any) -> bool:
    """Whether lines of equations have few samples a period at uneven times, between which all is known.

    Transfer functions are told what their sums have too much, and so are equations under held inputs, but
    rounds of that lead nowhere from so few samples. Where noise goes with the level sums at even times err,
    too: weights of low samples are many times those of others.
    """
    if fit.layout.rational or not fit.params.size:
        return False
    o, logs = fit.options, fit.options.noise == LOGS
    uneven = [rec for rec in fit.records or () if logs or rec.dt is None]
    known = all([not (logs and rec.sigma is not None) and "smooth" not in rec.intersample for rec in uneven])
    plain = (o.robust, o.reference) == (False, ()) and o.initial_state in STARTS
    if not (uneven and known and plain):
        return False
    if has_gaps(fit):
        return True
    unstable = fit.usable and bool(fit.inputs) and growth(fit) > 0  # as in a loop, which simulations leave
    return not unstable and (fewest_samples(fit) < FEW_SAMPLES or _has_long_steps(fit))


def _has_long_steps(fit: Any) -> bool:
    """Whether the longest steps of uneven samples leave few a period, and the model is not another.

    Sums err by what runs in the longest steps: a few of random instants are five times as long as the mean.
    What a wrong model leaves is no such error, and to search for its least squares would take long.
    """
    longest = [float(np.diff(rec.t).max()) for rec in fit.records if rec.dt is None]
    few = any([FEW_SAMPLES * fit.band[1] * step > 2 * pi for step in longest])
    return few and not square_beside(fit) > OTHER**2


def _at_few(fit: AnyFit) -> AnyFit:
    """The same where polynomials through few samples may not follow the signals; itself where they do.

    Of a decay at ten instants, the last of which are as far apart as its time constant, the rate was
    0.69±0.13, for 0.3, also without noise: no residual of the few lines shows that.
    """
    found = _led(fit, FAR)
    if (found is fit or not found.success) and fit.options.initial_state != "unknown":
        # Sums over a past and few samples may end where no way leads from.
        unknown = fit.options.replace(initial_state="unknown")
        if free := again(fit, fit.records, fit.structure, unknown):
            begun = replace(fit, params=free.params)
            led = _led(begun, FAR)
            found = fit if led is begun else led
    if found is fit or not found.success:
        return replace(fit, unsettled=True)
    error = np.sqrt(fit.cov_nonrobust.diagonal())
    if fit.options.noise == LOGS or has_gaps(fit):
        return found
    if sparse(replace(fit, params=found.params)) is not None:  # the lines are quieter: another model
        return fit
    move = np.abs(found.params - fit.params)[error > 0] / error[error > 0]
    wider = (error / np.sqrt(found.cov_nonrobust.diagonal()))[error > 0]
    astray = np.max(move, initial=0.0) > MOVED or np.max(wider, initial=0.0) > WIDER
    return replace(found, by_response=True) if astray else fit


def sample_likelihood(fit: Any) -> tuple[float, int, int] | None:
    """Likelihood of the samples that count, of a fit led to their least squares where a way leads there.

    Returns
    -------
    deviance : float
        Twice the negative log likelihood, with a level of noise for each output of each record; with one for
        all where `output_weights` say the others.
    unknowns : int
        Parameters, and initial states and trends that are fitted.
    count : int
        The samples.
    """
    found = [own for own in map(_likelihood, (fit, _led(fit, FAR))) if own is not None]
    return min(found, default=None)


def _likelihood(fit: Any) -> tuple[float, int, int] | None:
    try:
        with np.errstate(all="ignore"):
            descent = _Descent(fit)
            descent._weigh(fit.params)
            left, beyond = descent._off(fit.params)
    except (ModfunError, np.linalg.LinAlgError):
        return None
    counts = [np.count_nonzero(own, axis=1) for own in descent.own]
    count, known = int(np.sum(counts)), fit.options.output_weights
    found = sum([deviance(off, own) for off, own in zip(left, counts, strict=True)])
    if known is not None:
        weights = np.diag(known) if np.ndim(known) == 1 else np.array(known)
        found = count * log(sum([float(np.sum(off * (weights @ off))) for off in left]) / count)
    return found, fit.params.size + count - beyond, count


class _Descent:
    """Steps of Gauss and Newton for output error, with initial states and trends at their best in each.

    Outputs are weighed by what the samples that count leave of them: levels of lines hold the errors of what
    was put between, up to twice the noise.

    Residuals of log-normal noise are those of logarithms. Initial states are then at least squares beside a
    response m near by: log(y/m) is the residual of a sample m(1 + log(y/m)) in units of m.
    """

    def __init__(self, fit: Any, halved: int = HALVED) -> None:
        self.fit, self.halved = fit, halved
        self.moving = np.flatnonzero(fit.cov_nonrobust.diagonal() > 0)  # not on a bound
        self.steps = PART * np.sqrt(fit.cov_nonrobust.diagonal())
        self.records = from_known_inputs(fit)
        self.own = [_counted(fit, k) for k in range(len(self.records))]
        self.levels: list[F64] = list(fit.noise_levels)
        self.logs = fit.options.noise == LOGS
        self.near: list[F64] = [rec.y for rec in self.records]
        self.starts: list[InitialState | None] = [None] * len(self.records)
        self.offsets = begins_in_zero(fit)
        self.begins = fit.options.initial_state not in ("unknown", "periodic")  # as it was told

    def ended(self) -> Any:
        """At least squares; as it came where no way leads there, "maxiter" where steps do not end."""
        params = self.fit.params.copy()
        for k in range(ROUNDS):
            before = self.levels
            self._weigh(params)
            if k and self._astray(before):
                return self.fit
            left, count = self._left(params)
            if left @ left < SMALL * count:  # nothing but rounding is left of records without noise
                break
            steep = self._slopes(params, left)
            move = np.zeros(params.size)
            move[self.moving] = np.linalg.lstsq(steep.T, left, rcond=None)[0]
            whole, toward = np.abs(move[self.moving]), move[self.moving] @ steep
            for _ in range(self.halved):
                beside, _ = self._left(params + move)
                if beside @ beside <= left @ left:
                    break
                move = move / 2
            else:
                beside = left - toward
                if left @ left - beside @ beside > SMALL * (left @ left):
                    return self.fit
                break
            params = params + move
            cov = np.linalg.inv(steep @ steep.T) * (left @ left) / max(count - params.size, 1)
            if np.all(whole < SETTLED * np.sqrt(cov.diagonal())):  # halved ones are small anywhere
                break
        else:
            return replace(self.fit, params=params, status="maxiter")
        return self._told(params)

    def _weigh(self, params: F64) -> None:
        if self.fit.options.output_weights is not None:
            return
        if self.logs:
            for _ in range(NEARER):
                self.near = self._responses(params)
        self.levels = list(self.levels)
        for k, (off, own) in enumerate(zip(self._off(params)[0], self.own, strict=True)):
            level = levels_of(off, np.count_nonzero(own, axis=1))
            self.levels[k] = np.maximum(level, LEAST * self.fit.noise_levels[k])

    def _astray(self, before: list[F64]) -> bool:
        """Whether a response far from the samples hardly comes nearer: rounds would be for nothing."""
        # Of all records: lines of one that is short may show hardly a level.
        own, last, lines = [
            np.sqrt(np.mean(np.square(of), axis=0)) for of in (self.levels, before, self.fit.noise_levels)
        ]
        return bool(np.any((own > ASTRAY * lines) & (own > SLOW * last)))

    def _off(self, params: F64) -> tuple[list[F64], int]:
        """Residuals of each record, and how many samples beyond the unknowns of each they have."""
        fit = replace(self.fit, params=params)
        found, count = [], 0
        for k, (rec, own) in enumerate(zip(self.records, self.own, strict=True)):
            simulated, initial = self._simulated(fit, k)
            left = np.log(rec.y / np.where(own > 0, simulated, rec.y)) if self.logs else rec.y - simulated
            found.append(left * own)
            unknown = (0 if self.begins else initial.state.size) + np.size(initial.trend)
            count += int(np.count_nonzero(own)) - unknown
        return found, count

    def _simulated(self, fit: Any, k: int) -> tuple[F64, InitialState]:
        """The response of a fit beside the last one to the k-th record."""
        rec = self._beside(self.records[k], self.near[k])
        if self.offsets:
            simulated, trend = from_zero(fit, rec)
            return simulated, InitialState(np.zeros(0), np.zeros((0, 0)), trend)
        if self.begins or fit.layout.rational or fit.structure.linear:
            return fit.simulate(rec)  # type: ignore[no-any-return]
        found = simulate_equations(fit, rec, None, self.starts[k])
        self.starts[k] = found[1]
        return found

    def _beside(self, rec: Any, near: F64) -> Any:
        """The record whose least squares are those of the noise."""
        if not self.logs:
            return rec
        over = near if rec.sigma is None else near * rec.sigma
        return rec._like(y=near * (1 + np.log(rec.y / near)), sigma=over)

    def _responses(self, params: F64) -> list[F64]:
        """Of each record, positive as its samples."""
        fit = replace(self.fit, params=params)
        found = [
            np.where(own > 0, self._simulated(fit, k)[0], rec.y)
            for k, (rec, own) in enumerate(zip(self.records, self.own, strict=True))
        ]
        if not all([np.all(y > 0) for y in found]):
            raise DataError("log-normal noise: a response is not positive")
        return found

    def _left(self, params: F64) -> tuple[F64, int]:
        """The same in units of the noise, of all records."""
        off, count = self._off(params)
        rows = [(own / level[:, None]).ravel() for own, level in zip(off, self.levels, strict=True)]
        return np.concatenate(rows), count

    def _slopes(self, params: F64, left: F64) -> F64:
        if not (self.offsets or self.fit.layout.rational or self.fit.structure.linear):
            return self._of_integrations(replace(self.fit, params=params))
        found = []
        for k in self.moving:
            beside = params.copy()
            beside[k] += self.steps[k]
            found.append((left - self._left(beside)[0]) / self.steps[k])
        return np.array(found)

    def _of_integrations(self, fit: Any) -> F64:
        """The same with unknown initial states and trends beside the parameters: to find them takes long."""
        found = []
        for k, (rec, counts, level) in enumerate(zip(self.records, self.own, self.levels, strict=True)):
            weights = counts / level[:, None] / (self.near[k] if self.logs else 1.0)
            start = self._simulated(fit, k)[1]
            each = (slopes(fit, rec, start) * weights).reshape(-1, weights.size)
            known = start.state.size if self.begins else 0
            own, beside = each[self.moving], each[fit.params.size + known :]
            found.append(own - own @ np.linalg.pinv(beside) @ beside)
        return np.concatenate(found, axis=1)

    def _told(self, params: F64) -> Any:
        """The fit with these parameters, and covariances on the scale of those of least squares."""
        left, count = self._left(params)
        steep, fit = self._slopes(params, left), self.fit
        if self.logs or is_few(fit):
            return self._in_white_noise(params, steep, max(count - params.size, 1))
        square = float(left @ left) / max(count - params.size, 1)
        scale = np.zeros(params.size)
        errors = np.sqrt(np.linalg.inv(steep @ steep.T).diagonal() * square)
        scale[self.moving] = errors / np.sqrt(fit.cov_nonrobust.diagonal()[self.moving])
        covs = {name: getattr(fit, name) * np.outer(scale, scale) for name in COVARIANCES}
        over = np.exp(np.mean(np.log(np.array(self.levels) / fit.noise_levels), axis=0))
        return replace(
            fit, params=params, noise_cov=fit.noise_cov * np.outer(over, over) * square, status="ok", **covs
        )

    def _in_white_noise(self, params: F64, steep: F64, freedom: int) -> Any:
        """The same where few lines, whose sums err, tell nothing of the noise's colour."""
        off, fit = self._off(params)[0], self.fit
        counts = np.array([np.count_nonzero(own, axis=1) for own in self.own])
        square = np.sum(counts) / freedom
        level = np.sqrt(square) * np.array([levels_of(*each) for each in zip(off, counts, strict=True)])
        cov = np.zeros((params.size, params.size))
        cov[np.ix_(self.moving, self.moving)] = np.linalg.inv(steep @ steep.T) * square
        covs = dict.fromkeys(COVARIANCES, cov)
        return replace(fit, params=params, **covs, **of_response(fit, off, level, counts, freedom))


def of_response(
    fit: Any, left: Sequence[F64], level: Sequence[F64], counts: Any, freedom: int
) -> dict[str, Any]:
    """Fields of a fit whose residuals are those of its response.

    Parameters
    ----------
    left : sequence of (output, time) arrays
        The residuals of each record.
    level : sequence of (output,) arrays
        Their noise levels.
    counts : (record, output) array_like
        How many samples count.
    freedom : int
    """
    levels = fit.levels.copy()
    levels[:, : len(fit.outputs)] = level
    known = geometric_mean(np.array(level), fit.rows)
    correlation = np.mean([np.corrcoef(np.atleast_2d(own)) for own in left], axis=0)
    weights = [weights_of(fit, rec) for rec in fit.records]
    follow_p = nan if fit.options.noise == LOGS else following_p(fit.records, left, weights)
    over = fit.df_resid if levels.shape[1] > 1 else fit.df_resid * float(known[0]) ** 2
    return {
        "df_spectral": np.full(fit.params.size, float(freedom)),
        "df_hc3": np.full(fit.params.size, float(freedom)),
        "cost": float(over),
        "noise_cov": np.outer(known, known) * np.atleast_2d(correlation),
        "record_levels": np.array(level) / known,
        "noise_scale": 1.0 if np.isfinite(fit.seen).all() else fit.noise_scale,
        "levels": levels,
        "pieces": tuple(_lines(fit, left, level, counts)),
        "by_response": True,
        "follow_p": follow_p,
    }


def _lines(fit: Any, left: Sequence[F64], levels: Sequence[F64], counts: Any) -> Iterator[Any]:
    """The residuals of the response on the lines of the fit, white with unit variance."""
    for own, level, count, (low, high) in zip(left, levels, counts, fit.lines, strict=True):
        size = level * np.sqrt(count / 2)  # masked samples leave nothing
        lines = np.fft.rfft(own, axis=1)[:, low : high + 1] / size[:, None]
        if low == 0:
            lines[:, 0] /= np.sqrt(2)
        yield lines
