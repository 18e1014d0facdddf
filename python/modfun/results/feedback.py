"""Whether the noise of a fit's outputs is fed back to its inputs, and what bias that leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._core import coefficients
from ..base.arrays import C128, F64
from .derived import stable
from .estimates import Estimates
from .further import simulated, testable
from .gradients import response_gradients

__all__ = ["Feedback", "feedback"]

LAGS = 6  # samples after which an input may respond to a residual
PAST = 12  # of its own samples, from which it is predicted
SHORTEST = 5 * (LAGS + PAST)  # samples
LONGEST = 1 << 12  # samples of a record that are looked at
ASKED = 0.01  # p-value from which on residuals are looked at more closely
MOST = 1 << 16  # samples of a record whose residuals are laid out in time
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
    E Re(∂G* U* E) = Re(∂G H) E|E|², from which the bias of least squares on the lines follows.
    """
    if not testable(fit) or fit.options.reference or max(fit.intervals) > MOST:
        return None
    if all(_foreseen(_window(fit, k, j)) for k in range(len(fit.pieces)) for j in range(len(fit.inputs))):
        return None
    found = _found(fit, [_residuals(fit, k) for k in range(len(fit.pieces))])
    if found is not None and found.p_value < ASKED and stable(fit):
        # Between the samples of a held input lines fold into others: a simulation has them all.
        found = _found(fit, [_in_time(fit, k) for k in range(len(fit.pieces))])
    return found


def _found(fit: Estimates, residuals: list[F64]) -> Feedback | None:
    """The likeliest way back from residuals of records, (output, interval) each."""
    best: tuple[float, int, int] | None = None
    size = fit.params.size
    pull, spread, tests = np.zeros(size), np.zeros((size, size)), 0
    for k, left in enumerate(residuals):
        for i, e in enumerate(left):
            for j in range(len(fit.inputs)):
                found = _granger(fit, k, j, e)
                if found is None:
                    continue
                tests += 1
                p, coefficients, cov = found
                if best is None or p < best[0]:
                    best = p, i, j
                own, slopes = _pull(fit, k, i, j, coefficients)
                pull += own
                spread += slopes @ cov @ slopes.T
    if best is None:
        return None
    moved = fit.cov_nonrobust
    with np.errstate(invalid="ignore", divide="ignore"):
        sizes = np.sqrt(np.diag(moved))
        most = np.abs(moved @ pull) / sizes
        least = most - np.sqrt(np.diag(moved @ spread @ moved)) / sizes
    p, i, j = best
    at = int(np.argmax(np.nan_to_num(least, nan=-np.inf)))
    return Feedback(fit.outputs[i], fit.inputs[j], min(1.0, p * tests), float(most[at]), float(least[at]))


def _in_time(fit: Estimates, k: int) -> F64:
    """Residuals of a record's window in time, (output, interval), by simulation; none where that fails."""
    assert fit.records is not None
    whole = simulated(fit, k)
    return np.zeros((0, 0)) if whole is None else (fit.records[k].y[:, -whole.shape[1] :] - whole)[:, :-1]


def _granger(fit: Estimates, k: int, j: int, e: F64) -> tuple[float, F64, F64] | None:
    """p-value that residuals say nothing of the input; coefficients of its past and of theirs; covariance."""
    from scipy.special import fdtrc

    u = _window(fit, k, j)
    e = e[: u.size]
    if u.size < SHORTEST or np.ptp(u) == 0 or _foreseen(u):
        return None
    u = u - u.mean()
    rows = [np.ones(u.size - PAST)]
    rows += [u[PAST - lag : u.size - lag] for lag in range(1, PAST + 1)]
    known = len(rows)
    rows += [e[PAST - lag : u.size - lag] for lag in _lags(fit, j)]
    columns, side = np.array(rows).T, u[PAST:]
    size = np.linalg.norm(columns, axis=0)
    if not np.all(np.isfinite(size) & (size > 0)):
        return None
    q, r = np.linalg.qr(columns / size)
    part = q.T @ side
    new = float(side @ side - part[:known] @ part[:known])
    freedom = side.size - columns.shape[1]
    gained = float(part[known:] @ part[known:])
    if not new > NEW**2 * float(side @ side) or new <= gained:
        return None
    p = float(
        fdtrc(
            columns.shape[1] - known,
            freedom,
            gained / (columns.shape[1] - known) / ((new - gained) / freedom),
        )
    )
    inverse = np.linalg.pinv(r) / size[:, None]
    cov = inverse @ inverse.T * ((new - gained) / freedom)
    return p, (inverse @ part)[1:], cov[1:, 1:]


def _window(fit: Estimates, k: int, j: int) -> F64:
    """Samples of an input that are looked at."""
    assert fit.records is not None
    rec = fit.records[k]
    return rec.u[j, rec.intervals - fit.intervals[k] : -1][:LONGEST]


def _foreseen(u: F64) -> bool:
    """Whether cubics through four past samples foresee an input: a regression would leave no more."""
    change = np.diff(u[PAST - 4 :], 4)
    side = u[PAST:] - u.mean()
    return bool(change @ change <= NEW**2 * float(side @ side))


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
    rec, n = fit.records[k], fit.intervals[k]
    start, top = rec.intervals - n, (n - 1) // 2
    s = 1j * fit.omega0[k] * np.arange(1, top + 1)
    late = [delay / rec.dt for delay in fit.layout.delays(fit.params, i)]  # type: ignore[operator]
    rules = [fit.options.rule if kind == "smooth" else kind for kind in rec.intersample]
    y = coefficients(np.ascontiguousarray(rec.y[[i]]), top, [fit.options.rule], [0.0], start, None)[0, 1:]
    u = coefficients(np.ascontiguousarray(rec.u), top, rules, late, start, None)[:, 1:]
    den, nums = fit.polynomials(i)
    with np.errstate(all="ignore"):
        over = 1 / np.polyval(den, s)
        left = y - sum(np.polyval(num, s) * row for num, row in zip(nums, u, strict=True)) * over
        ends: C128 = np.array([(s / abs(s[-1])) ** power * over for power in range(den.size - 1)])
    used = slice(max(fit.lines[k][0], 1) - 1, fit.lines[k][1])
    rows = np.concatenate([ends[:, used].real, ends[:, used].imag], axis=1)
    c = np.linalg.lstsq(rows.T, np.concatenate([left[used].real, left[used].imag]), rcond=None)[0]
    lines = np.concatenate([[0.0], left - c @ ends, np.zeros(n // 2 - top)])
    return np.asarray(np.fft.irfft(lines, n) * n)
