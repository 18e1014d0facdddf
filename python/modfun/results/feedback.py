"""Whether the noise of a fit's outputs is fed back to its inputs, and what bias that leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from .._core import unforeseen
from ..base.arrays import F64
from .derived import cancelling, stable
from .diagnosis import level_p
from .doubts import noise_free
from .estimates import Estimates
from .further import simulated, testable
from .gradients import response_gradients
from .line_residuals import line_residuals
from .misfit import too_large

__all__ = ["Feedback", "feedback"]

LAGS = 6  # samples after which an input may respond to a residual
PAST = 12  # of its own samples, from which it is predicted
SHORTEST = 5 * (LAGS + PAST)  # samples
LONGEST = 1 << 12  # samples of a record that are looked at
ASKED = 0.01  # p-value from which on residuals are looked at more closely
MOST = 1 << 16  # samples of a record whose residuals are laid out in time
CANCELS = 2.0  # standard errors between a pole and a zero, at most
NEW = 0.01  # of an input's rms: what its past does not predict is more, or it knows no noise


@dataclass(frozen=True)
class Feedback:
    """The likeliest way back from a residual to an input.

    Attributes
    ----------
    output, channel : str
        Whose residual moves which input.
    p_value : float
        Of an F test over all such pairs and records: small where the input responds.
    bias : float
        About how many standard errors the parameter with most bias is off.
    least : float
        The same less the standard error of that estimate.
    """

    output: str
    channel: str
    p_value: float
    bias: float
    least: float


def feedback(fit: Estimates) -> Feedback | None:
    """Whether later inputs follow residuals: a regression of each input on its past and on past residuals.

    C. W. J. Granger, Econometrica 37, 1969. An input that knows nothing of the noise has coefficients 0 at
    past residuals, whatever its form. With H(ω) its response to residuals of unit variance, lines have
    E Re(∂G* U* E) = Re(∂G H) E|E|², from which the bias of least squares on the lines follows. None where no
    input follows them with a p-value below 0.01, and where they are not noise.
    """
    led = _led(fit)
    if not led or too_large(level_p(fit)) or noise_free(fit) is not None:
        return None
    found = _found(fit, led, _residuals)
    if found is not None and not stable(fit) and _superfluous(fit):
        return None  # a pole beyond the axis that a zero cancels colours residuals by the input itself
    if found is not None and stable(fit):
        # Between the samples of a held input lines fold into others: a simulation has them all.
        found = _found(fit, led, _in_time)
    return found


def _superfluous(fit: Estimates) -> bool:
    """Whether a pole and a zero cancel, as far as anybody can tell."""
    one = fit.layout.rational and len(fit.outputs) == 1
    return one and cancelling(fit, fit.params, fit.cov_nonrobust) < CANCELS


def _led(fit: Estimates) -> dict[tuple[int, int], F64]:
    """Inputs (record, input) that are not known from their past, with it: what moves them may be noise."""
    if not testable(fit) or fit.options.reference or max(fit.intervals) > MOST:
        return {}
    pairs = product(range(len(fit.pieces)), range(len(fit.inputs)))
    found = {pair: _past(_window(fit, *pair)) for pair in pairs}
    return {pair: past for pair, past in found.items() if past is not None}


def _found(
    fit: Estimates, led: dict[tuple[int, int], F64], residuals: Callable[[Estimates, int], F64]
) -> Feedback | None:
    """The likeliest way back, by residuals (output, interval) of a record; None where none is likely."""
    left = {k: residuals(fit, k) for k in {k for k, _ in led}}
    tests = [
        (k, i, j, _granger(past, e, _lags(fit, j)))
        for (k, j), past in led.items()
        for i, e in enumerate(left[k])
    ]
    known = [(k, i, j, found) for k, i, j, found in tests if found is not None]
    p, i, j = min(((found.p_value, i, j) for _, i, j, found in known), default=(1.0, 0, 0))
    if not known or p * len(known) >= ASKED:
        return None
    size = fit.params.size
    pull, spread = np.zeros(size), np.zeros((size, size))
    for k, output, channel, found in known:
        own, slopes = _pull(fit, k, output, channel, found.coefficients)
        pull += own
        spread += slopes @ found.cov @ slopes.T
    moved = fit.cov_nonrobust
    with np.errstate(invalid="ignore", divide="ignore"):
        sizes = np.sqrt(np.diag(moved))
        most = np.abs(moved @ pull) / sizes
        least = most - np.sqrt(np.diag(moved @ spread @ moved)) / sizes
    at = int(np.argmax(np.nan_to_num(least, nan=-np.inf)))
    return Feedback(fit.outputs[i], fit.inputs[j], p * len(known), float(most[at]), float(least[at]))


def _in_time(fit: Estimates, k: int) -> F64:
    """Residuals of a record's window in time, (output, interval), by simulation; none where that fails."""
    assert fit.records is not None
    whole = simulated(fit, k)
    return np.zeros((0, 0)) if whole is None else (fit.records[k].y[:, -whole.shape[1] :] - whole)[:, :-1]


@dataclass(frozen=True)
class _Granger:
    """A regression of an input on its own past and on residuals: the triangular factor of its rows.

    `factor` is that of the correlations of the columns, a constant, the input's past, the residuals, and of
    the input itself, last; `sizes` are their norms.
    """

    factor: F64
    sizes: F64
    p_value: float
    variance: float  # of what is left

    @property
    def _inverse(self) -> F64:
        return np.asarray(np.linalg.inv(self.factor[:-1, :-1].T) / self.sizes[:-1, None])

    @property
    def coefficients(self) -> F64:
        """Of the past and of the residuals."""
        return np.asarray(self._inverse @ self.factor[-1, :-1] * self.sizes[-1])[1:]

    @property
    def cov(self) -> F64:
        """Covariance of these."""
        return np.asarray(self._inverse @ self._inverse.T * self.variance)[1:, 1:]


def _granger(past: F64, e: F64, lags: range) -> _Granger | None:
    """Whether residuals say anything of an input that its past does not; None where nobody can tell."""
    from scipy.special import fdtrc

    size = past.shape[1]
    late = [e[PAST - lag :][:size] for lag in lags]
    factor, sizes = _factor(np.array([*past[:-1], *late, past[-1]]))
    if factor is None:
        return None
    part, left = factor[-1, len(past) - 1 : -1], float(factor[-1, -1] ** 2)
    freedom = size - len(factor) + 1
    p = float(fdtrc(part.size, freedom, float(part @ part) / part.size / (left / freedom)))
    return _Granger(factor, sizes, p, left * float(sizes[-1]) ** 2 / freedom)


def _past(u: F64) -> F64 | None:
    """A constant, the samples of an input before each one, and these, (column, time).

    None where these are known from those before, by cubics through four of them or by a regression on all.
    What that leaves of an input is left of each of its columns: of another none comes near rounding.
    """
    if u.size < SHORTEST or unforeseen(u) <= NEW:
        return None
    u, size = u - u.mean(), u.size - PAST
    past = np.array([np.ones(size), *(u[PAST - lag :][:size] for lag in range(1, PAST + 1)), u[PAST:]])
    factor, _ = _factor(past)
    return None if factor is None or factor[-1, -1] <= NEW else past


def _factor(columns: F64) -> tuple[F64 | None, F64]:
    """Triangular factor of the correlations of columns (column, time), None if they are dependent; norms."""
    products = columns @ columns.T
    sizes = np.sqrt(products.diagonal())
    try:
        return np.linalg.cholesky(products / (sizes * sizes[:, None])), sizes
    except np.linalg.LinAlgError:
        return None, sizes


def _window(fit: Estimates, k: int, j: int) -> F64:
    """Samples of an input that are looked at."""
    assert fit.records is not None
    rec = fit.records[k]
    return rec.u[j, rec.intervals - fit.intervals[k] : -1][:LONGEST]


def _lags(fit: Estimates, j: int) -> range:
    """Lags of residuals; a held input moves the output later only, so the same sample counts."""
    held = fit.intersample[j] == "zoh" and all(
        row[j] is None or row[j] < order  # type: ignore[operator]
        for row, order in zip(fit.layout.numerators, fit.layout.orders, strict=True)
    )
    return range(0 if held else 1, LAGS + 1)


def _pull(fit: Estimates, k: int, i: int, j: int, c: F64) -> tuple[F64, F64]:
    """What a record adds to the mean of the gradient, Re(slopes of the gain times H) over its lines.

    H = Σ g zˡ/(1 − Σ a zˡ), coefficients c = (a, g). Returns the sum and its slopes by c.
    """
    assert fit.records is not None
    rec, (lo, hi) = fit.records[k], fit.lines[k]
    omega: F64 = fit.omega0[k] * np.arange(max(lo, 1), hi + 1, dtype=np.float64)
    turn = 1j * omega * rec.dt  # type: ignore[operator]
    own = np.exp(-turn[:, None] * np.arange(1, PAST + 1))
    past = np.exp(-turn[:, None] * np.array(_lags(fit, j)))
    over = 1 / (1 - own @ c[:PAST])
    h = past @ c[PAST:] * over
    held = (1 - np.exp(-turn)) / turn if rec.intersample[j] == "zoh" else np.ones(omega.size)
    slopes = response_gradients(fit.layout, fit.params, omega)[1][:, i, j] * held
    by_c = np.hstack([own * (h * over)[:, None], past * over[:, None]])
    return np.asarray(2 * (slopes @ h).real), np.asarray(2 * (slopes @ by_c).real)


def _residuals(fit: Estimates, k: int) -> F64:
    """Residuals of a record's window in time, (output, interval), made of all lines but line 0."""
    return np.array([_residual(fit, k, i) for i in range(len(fit.outputs))])


def _residual(fit: Estimates, k: int, i: int) -> F64:
    assert fit.records is not None
    rec = fit.records[k]
    words = (fit.options.rule, rec.intersample, fit.intervals[k], fit.lines[k], fit.omega0[k])
    return line_residuals(
        fit.layout, np.asarray(fit.params)[None], i, rec.y[[i]], rec.u[None], *words
    ).ravel()
