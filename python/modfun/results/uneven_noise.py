"""Noise that changes over a record, or with what is read: tests, its level, and the errors that it makes."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import F64
from ..base.gamma_regression import smooth_level
from ..errors import ModfunError
from ..models.noise import Noise
from ..models.options import Options
from .doubts import Doubt
from .estimates import Estimates
from .fitted_samples import stationary
from .priors import shares
from .slopes import response_slopes

__all__ = [
    "SHORTEST",
    "UNEVEN",
    "Uneven",
    "allows",
    "changing",
    "covariance",
    "in_words",
    "level_in_time",
    "of_time",
    "p_values",
    "uneven",
    "unforeseen",
]

UNEVEN = 0.01  # p-value below which noise is taken to change
POWERS = 4  # polynomials of the test
READING = 2  # the same of the size of the reading: of a noise with a floor and a part in proportion
SPANS = 0.5  # of its largest size an output falls below, or noise cannot go with that
TERMS = 4  # polynomials of the level over that size; 3 miss a low floor, 6 and the true level change no error
SHORTEST = 64  # samples
ORDER = 8  # of the autoregression
SAME = 1e-9  # singular values below are rounding
SMOOTH = 0.05  # p-value below which neighbours among residuals are alike where these are large
ALIKE = 35 / 18  # times the variance of white noise: of sums of squared second differences of it
FURTHER = 3.0  # times the noise's level: errors of a simulation that are no noise
LEAST = 0.1  # of its noise that residuals show


class Uneven(NamedTuple):
    """How the noise of a fit's outputs changes over its records.

    Attributes
    ----------
    p_value : float
        Of the test that none does.
    output : int
        The one whose noise changes most plainly.
    errors : tuple of ndarray
        Residuals of each record, (output, time), without its last sample.
    new : tuple of ndarray
        What an autoregression does not foresee of them, (output, time), without the first `ORDER` samples;
        second differences where a simulation is off.
    readings : tuple of ndarray
        Sizes of the simulated outputs of each record, (output, time).
    goes : ndarray
        Whether the level of an output goes with these, (output,); others go with the time.
    """

    p_value: float
    output: int
    errors: tuple[F64, ...]
    new: tuple[F64, ...]
    readings: tuple[F64, ...]
    goes: NDArray[np.bool_]

    def levels(self) -> list[F64]:
        """Smooth standard deviation of what is new in each record, (output, time)."""
        rows = [
            _level([own[i] for own in self.new], [own[i] for own in self.readings], TERMS)
            if goes
            else [level_in_time(own[i]) for own in self.new]
            for i, goes in enumerate(self.goes)
        ]
        return [np.array(own) for own in zip(*rows, strict=True)]


def uneven(fit: Estimates) -> Uneven | None:
    """Whether the noise of an output changes; None where residuals in time cannot tell.

    Squares of what an autoregression does not foresee of the residuals are regressed on polynomials of the
    time, and on those of the size of the simulated output; their number times R² is chi-squared, whatever the
    tails of the noise (R. Koenker, J. Econometrics 17, 1981). The plainer of the two tells the level. Of
    nonlinear equations, errors of parameters put a steep peak a little off its time: such residuals are no
    noise of samples, and second differences of them are.
    """
    records = fit.records or ()
    short = min(fit.intervals, default=0) < SHORTEST or any(rec.dt is None for rec in records)
    if (
        not records
        or short
        or not fit.usable
        or not stationary(fit)
        or fit.process_levels is not None
        or fit.options.noise == "log-normal"
        or isfinite(fit.tail)
    ):
        return None
    try:
        with np.errstate(all="ignore"):
            both = list(zip(records, fit.intervals, strict=True))
            found = [fit.simulate(rec)[0][:, rec.intervals - count : -1] for rec, count in both]
        errors = [
            rec.y[:, rec.intervals - count : -1] - own for (rec, count), own in zip(both, found, strict=True)
        ]
    except (ModfunError, np.linalg.LinAlgError):  # a response that leaves the range of numbers
        return None
    if not all(np.all(np.isfinite(own)) and np.all(own.any(axis=1)) for own in errors):
        return None
    if any(
        np.any(np.ptp(own, axis=1) > 2 * np.ptp(rec.y, axis=1))
        for own, rec in zip(errors, records, strict=True)
    ):
        return None  # of a simulation that runs away
    nonlinear = not (fit.layout.rational or fit.structure.linear)
    if nonlinear and _leaves(fit, errors):
        return None  # of a chaotic system, whose errors are its own divergence
    new = tuple([unforeseen(own) for own in errors])
    sizes = tuple([np.abs(own) for own in found])
    in_time, over_sizes, chance = _chances(new, sizes)
    if nonlinear and np.any(chance < UNEVEN) and np.any(_chances(new, sizes, late=1)[2] < SMOOTH):
        new = tuple([np.diff(own, 2)[:, ORDER - 2 :] / np.sqrt(6) for own in errors])
        in_time, over_sizes, chance = _chances(new, sizes, alike=ALIKE)
    most = int(np.argmin(chance))
    goes = (over_sizes < in_time) & (chance < UNEVEN)
    return Uneven(min(1.0, float(chance[most])), most, tuple(errors), new, sizes, goes)


def _chances(new: Sequence[F64], sizes: Sequence[F64], **how: Any) -> tuple[F64, F64, F64]:
    """p-values of each output in time and over sizes, and of the lower, as one of all these, (output,)."""
    in_time, over_sizes = p_values(new, **how), p_values(new, sizes, **how)
    return in_time, over_sizes, 2 * in_time.size * np.minimum(in_time, over_sizes)


def _leaves(fit: Estimates, errors: Sequence[F64]) -> bool:
    """Whether simulations are far further from a record than the lines say that its noise is."""
    level = np.sqrt(np.diag(fit.noise_cov))
    return any(
        own.shape[0] == level.size and bool(np.any(np.std(own, axis=1) > FURTHER * ratio * level))
        for own, ratio in zip(errors, fit.level_ratios, strict=True)
    )


def changing(fit: Estimates) -> Uneven | None:
    """How the noise of an output changes; None where it does not, or where residuals cannot tell."""
    found = uneven(fit)
    return None if found is None or found.p_value > UNEVEN else found


def unforeseen(errors: F64) -> F64:
    """What an autoregression of each row does not foresee, (row, time), without the first `ORDER` samples."""
    windows = np.lib.stride_tricks.sliding_window_view(errors, ORDER + 1, axis=1)
    basis = np.linalg.qr(windows[:, :, :-1])[0]
    now = windows[:, :, -1]
    return np.asarray(now - np.einsum("rtk,rk->rt", basis, np.einsum("rtk,rt->rk", basis, now)))


def p_values(
    new: Sequence[F64], sizes: Sequence[F64] | None = None, *, late: int = 0, alike: float = 1.0
) -> F64:
    """Of the test that the squares of rows do not change, (row,); records follow one another.

    In time, or with the sizes of what is read, (row, time), in each record. `late`: of products with so many
    samples before instead; `alike`: by how much sums of squares scatter more than those of white noise.
    """
    from scipy.special import chdtrc

    total = np.zeros(len(new[0]))
    for k, rows in enumerate(new):
        size = np.abs(rows).max(axis=1, keepdims=True)  # squares of any unit stay numbers
        scaled = rows / np.where(size > 0, size, 1.0)
        squares = scaled[:, late:] * scaled[:, : rows.shape[1] - late]
        about = squares - squares.mean(axis=1, keepdims=True)
        power = np.sum(about**2, axis=1)
        if sizes is None:
            times = _times(rows.shape[1])[late:]
            basis = np.linalg.qr(np.polynomial.chebyshev.chebvander(times, POWERS))[0][:, 1:]
            explained = np.sum((about @ basis) ** 2, axis=1)
        else:
            explained = _explained(about, sizes[k][:, ORDER + late :])
        total += squares.shape[1] / alike * explained / np.where(power > 0, power, 1.0)
    return np.asarray(chdtrc((POWERS if sizes is None else READING) * len(new), total))


def _explained(about: F64, sizes: F64) -> F64:
    """What polynomials of sizes explain of rows about their means, (row,): nothing where sizes are alike.

    Residuals of a temperature from 94 to 98 degrees went with it as those of a model that lacks a bend.
    """
    found, left = np.zeros(len(about)), list[F64]()
    for power in range(1, READING + 1):
        own = (sizes / np.maximum(sizes.max(axis=1, keepdims=True), np.finfo(float).tiny)) ** power
        own -= own.mean(axis=1, keepdims=True)
        whole = np.sum(own**2, axis=1)
        for other in left:
            own -= np.sum(own * other, axis=1, keepdims=True) * other
        rest = np.sum(own**2, axis=1)
        some = rest > SAME * np.maximum(whole, SAME)
        own *= np.where(some, 1 / np.sqrt(np.where(some, rest, 1.0)), 0.0)[:, None]
        found += np.sum(own * about, axis=1) ** 2
        left.append(own)
    return np.where(sizes.min(axis=1) < SPANS * sizes.max(axis=1), found, 0.0)


def _times(count: int) -> F64:
    """Of the samples of a record, of which the first `ORDER` are left out, over its range: up to 1."""
    return np.linspace(-1.0, 1.0, count + ORDER)[ORDER:]


def level_in_time(new: F64) -> F64:
    """The smooth level of what `unforeseen` leaves of a row, also over the samples before it."""
    return _level([new], [np.linspace(-1.0, 1.0, new.size + ORDER)])[0]


def _level(new: Sequence[F64], x: Sequence[F64], *terms: int) -> list[F64]:
    """The smooth level of an output over x, such as the size of what is read, in each record."""
    largest = max(float(np.abs(own).max()) for own in new) or 1.0
    squares = np.concatenate([np.append(np.zeros(ORDER), (own / largest) ** 2) for own in new])
    counted = np.concatenate([np.append(np.zeros(ORDER), np.ones(own.size)) for own in new])
    level = largest * np.sqrt(smooth_level(squares, np.concatenate(x), counted, *terms))
    return np.split(level, np.cumsum([own.size for own in x])[:-1])


def covariance(fit: Estimates) -> F64 | None:
    """Covariance of the parameters where the noise of an output changes; None where it does not.

    To first order an estimate is off by the sum over the samples of k(t) σ(t) c(t), c stationary noise of
    smooth spectra: k are the slopes of the simulated outputs, on the lines of the fit and less what initial
    state and trend explain, under least squares with the covariance of the outputs' noise. The errors of an
    even level of the same power are the spectral ones: what turns the one into the other is applied to these.
    """
    found = changing(fit) if _allowed_for(fit) else None
    if found is None:
        return None
    try:
        with np.errstate(all="ignore"):
            cov = _of_samples(fit, found)
    except (ModfunError, np.linalg.LinAlgError):  # no response beside the estimate, or outputs that are one
        return None
    return cov if np.all(np.isfinite(cov)) else None


class _Filters(NamedTuple):
    """What the estimates of some parameters make of the noise.

    Attributes
    ----------
    samples : list of ndarray
        Filters of the samples of each record, (p, output, time).
    ends : list of ndarray
        The same of initial state and trend, made orthonormal.
    shared : ndarray, shape (output, output, p, p)
        Products of the slopes in two outputs, white and less what ends explain: of the trace 'information'.
    """

    samples: list[F64]
    ends: list[F64]
    shared: F64

    @property
    def information(self) -> F64:
        return np.asarray(np.einsum("iipq->pq", self.shared))


def _of_samples(fit: Estimates, found: Uneven) -> F64:
    spectral = np.diag(fit.cov_spectral)
    moving = np.flatnonzero(spectral > 0)  # others are on a bound
    changing, even = (np.zeros((moving.size, moving.size)) for _ in range(2))
    ends = np.zeros(2)  # what initial states and trends take of the noise: that which changes, an even one
    filters, levels = _filters(fit, moving), found.levels()
    for own, other, errors, level in zip(filters.samples, filters.ends, found.errors, levels, strict=True):
        noise = errors / level
        m = np.arange(errors.shape[1] // 2 + 1)
        freedom = np.where((m == 0) | (2 * m == errors.shape[1]), 1.0, 2.0)
        power = np.abs(np.fft.rfft(noise)) ** 2 / errors.shape[1]
        spectra = np.array([smooth_level(own, np.log1p(m), freedom) for own in power])
        alike = np.linalg.cholesky(np.corrcoef(noise)) if len(noise) > 1 else np.ones((1, 1))
        usual = np.sqrt(np.mean(level**2, axis=1, keepdims=True))
        for k, (total, sigma) in enumerate(((changing, level), (even, usual))):
            waves = np.fft.rfft(np.vstack([own, other]) * sigma) * np.sqrt(freedom * spectra)
            waves = np.einsum("poj,oi->pij", waves, alike).reshape(len(waves), -1)
            moved, rest = np.split(waves, [moving.size])
            total += (moved @ moved.conj().T).real
            ends[k] += np.sum(np.abs(rest) ** 2)
    # What turns errors of an even level into those of the level that changes, for the spectral ones.
    size = np.sqrt(np.diag(even))
    both = [np.linalg.cholesky(own / np.outer(size, size)) for own in (changing, even)]
    turn = size[:, None] * np.linalg.solve(both[1].T, both[0].T).T / size
    # Where noise is strong where the slopes are, the fit takes more of it, and residuals show less.
    columns = moving.size + sum([len(other) for other in filters.ends])
    taken, usually = (
        np.trace(filters.information @ own) + end for own, end in zip((changing, even), ends, strict=True)
    )
    rows = len(fit.outputs) * sum(fit.rows)
    shown = max((rows - columns * taken / usually) / (rows - columns), LEAST) if rows > columns else 1.0
    more = _of_weights(fit, filters, (rows - columns) / len(fit.outputs), levels)
    cov, free = np.zeros_like(fit.cov_spectral), np.ix_(moving, moving)
    part, told = (own[free] for own in shares(fit))
    # Of errors that the records alone would leave; what priors alone tell has none.
    back = size[:, None] * np.linalg.pinv(part * size / size[:, None], rcond=SAME) / size
    turn = part @ (turn * np.reshape(more, (-1, 1))) @ back
    cov[free] = turn @ (fit.cov_spectral[free] - told) @ turn.T / shown + told
    return cov


def _of_weights(fit: Estimates, filters: _Filters, freedom: float, levels: Sequence[F64]) -> F64 | float:
    """By how much more errors grow where the weights of the outputs were estimated from noise that changes.

    Those of the core have grown by what an even level costs (M. G. Kenward, J. H. Roger, Biometrics 53,
    1997); there are fewer degrees of freedom the more unequal the levels are.
    """
    outputs = len(fit.outputs)
    if outputs == 1 or not fit.layout.rational or isinstance(fit.options.noise, Noise) or freedom <= 0:
        return 1.0
    uneven = np.mean([np.mean(own**4, axis=1) / np.mean(own**2, axis=1) ** 2 for own in levels])
    each, inverse = filters.shared, _inverse(filters.information)
    turned = each @ inverse
    lost = (outputs + 1) * filters.information - np.einsum(
        "ijpq,ijqr->pr", turned, each + each.swapaxes(0, 1)
    )
    even = np.diag(inverse @ lost @ inverse) / np.diag(inverse) * 2 / max(freedom - outputs - 1, 1.0)
    return np.asarray(np.sqrt((1 + uneven * even) / (1 + even)))


def _inverse(information: F64) -> F64:
    root = np.sqrt(np.diag(information))
    scale = np.outer(root, root)
    return np.asarray(np.linalg.pinv(information / scale, hermitian=True) / scale)


def _filters(fit: Estimates, moving: NDArray[np.intp]) -> _Filters:
    pieces, outputs = [], len(fit.outputs)
    shared = np.zeros((outputs, outputs, moving.size, moving.size))
    for k, (rec, (low, high)) in enumerate(zip(fit.records or (), fit.lines, strict=True)):
        moved, columns, _ = response_slopes(fit, rec, fit.simulate(rec)[1])
        rows = np.concatenate([moved[moving], columns])[:, :, rec.intervals - fit.intervals[k] : -1]
        ratio = fit.level_ratios[k]
        inverse = np.linalg.inv(np.linalg.cholesky(fit.noise_cov * np.outer(ratio, ratio)))
        lines = np.einsum("io,uom->uim", inverse, np.fft.rfft(rows)[:, :, low : high + 1])
        if low == 0:
            lines[:, :, 0] /= np.sqrt(2)  # the line has one part, of twice the variance
        flat = np.concatenate([lines.real, lines.imag], axis=1).reshape(len(rows), -1)
        own, others = np.split(flat, [moving.size])
        size, whole = np.linalg.norm(others, axis=1), np.linalg.norm(rows[moving.size :], axis=(1, 2))
        some = size > SAME * whole  # line 0 alone has a constant
        fitted = np.linalg.svd((others[some] / size[some, None]).T, full_matrices=False)
        basis = fitted[0][:, fitted[1] > SAME]
        own = own - (own @ basis) @ basis.T
        parts = own.reshape(moving.size, 2, outputs, -1)
        shared += np.einsum("pcim,qcjm->ijpq", parts, parts, optimize=True)
        pieces.append((own, basis.T, low, inverse, rows.shape[2]))
    scaled = _inverse(np.einsum("iipq->pq", shared))
    both = [
        [_in_time(rows, low, inverse, count) for rows in (scaled @ own, basis)]
        for own, basis, low, inverse, count in pieces
    ]
    return _Filters([own for own, _ in both], [ends for _, ends in both], shared)


def _in_time(flat: F64, low: int, inverse: F64, count: int) -> F64:
    """Rows on whitened lines as filters of samples, (row, output, time)."""
    parts = 2 * len(inverse)  # no rows where there are no ends: their shape is said
    real, imag = np.split(flat.reshape(len(flat), parts, flat.shape[1] // parts), 2, axis=1)
    lines = np.einsum("io,pim->pom", inverse, real - 1j * imag)
    if low == 0:
        lines[:, :, 0] /= np.sqrt(2)
    full = np.zeros((len(flat), len(inverse), count), complex)
    full[:, :, low : low + lines.shape[2]] = lines
    return np.asarray(np.fft.fft(full).real)


def allows(options: Options) -> bool:
    """Whether errors of fits with such options can allow for noise that changes."""
    plain = options.noise == "output" or (isinstance(options.noise, Noise) and options.noise.u is None)
    plain = plain and options.initial_state == "unknown" and options.output_weights is None
    return plain and options.method in ("awls", "ml")


def _allowed_for(fit: Estimates) -> bool:
    """Whether errors of such a fit can."""
    own = fit.window_weights or isfinite(fit.stability_cost) or fit.instrumented
    return allows(fit.options) and not own


def in_words(fit: Estimates, found: Uneven) -> str:
    """That the noise changes, and by how much."""
    level, y = _level_of(found), fit.outputs[found.output]
    factor = f"by a factor of {level.max() / level.min():.2g} (p = {found.p_value:.2g})."
    if not found.goes[found.output]:
        return f"The noise of {y} changes over the record: its level in time varies {factor}"
    return (
        f"The noise of {y} changes with what is read: its level goes with the size of {y} and varies {factor}"
    )


def _level_of(found: Uneven) -> F64:
    """The level of the output whose noise changes most plainly, records after one another."""
    return np.concatenate([own[found.output] for own in found.levels()])


def of_time(fit: Estimates) -> Doubt | None:
    """That the noise changes over the record, and what the standard errors make of it."""
    found = changing(fit)
    if found is None:
        return None
    allowed = (
        "The standard errors allow for it"
        if fit.cov_type == "spectral" and _allowed_for(fit)
        else "The standard errors do not allow for it"
    )
    return Doubt(f"{in_words(fit, found)} {allowed}; {_weights(fit, found)}", sure=False)


def _weights(fit: Estimates, found: Uneven) -> str:
    """How samples are weighted by the level of their noise."""
    if not found.goes[0] or len(fit.outputs) > 1:
        return "Record(sigma=...) weights the samples by it, too."
    size = np.concatenate([own[0] for own in found.readings])
    level = _level_of(found)
    slope, floor = np.polyfit(size, level, 1)
    if not slope > 0:
        return "Record(sigma=...) weights the samples by it, too."
    floor = max(floor, level.min())  # a reading may be 0
    rec = "rec" if len(found.new) == 1 else "each record"
    return (
        f"to weight the samples by it, too, fit {rec}.weigh(sigma={floor:.3g} + {slope:.3g}*"
        "np.abs(fit.predict(rec).y))."
    )
