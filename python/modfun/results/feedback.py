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
ALONE = 10.0  # of log likelihood: from there on residuals explain an input better than outputs do
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
        The same less two standard errors of that estimate.
    """

    output: str
    channel: str
    p_value: float
    bias: float
    least: float


def feedback(fit: Estimates) -> Feedback | None:
    """Whether later inputs follow residuals: a regression of each input on its past and on past residuals.

    C. W. J. Granger, Econometrica 37, 1969. An input that knows nothing of the noise has coefficients 0 at
    past residuals, whatever its form. Where it follows them, the loop is known far better from its outputs,
    signal and noise, than from residuals alone: a regression of the inputs on their past and on outputs. With
    H(ω) the response of the inputs to noise in that loop, lines have E Re(∂G* U* E) = Re(∂G H) E|E|², from
    which the bias of least squares on the lines follows. None where no input follows residuals with a p-value
    below 0.01, and where they are not noise.
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
        (_granger(past, e, _lags(fit, j)), i, j)
        for (k, j), past in led.items()
        for i, e in enumerate(left[k])
    ]
    known = [(p, i, j) for p, i, j in tests if p is not None]
    p, i, j = min(known, default=(1.0, 0, 0))
    if not known or p * len(known) >= ASKED:
        return None
    size = fit.params.size
    pull, spread = np.zeros(size), np.zeros((size, size))
    for k in left:
        own, cov = _pull(fit, k, [j for at, j in led if at == k], left[k])
        pull += own
        spread += cov
    moved = fit.cov_nonrobust
    with np.errstate(invalid="ignore", divide="ignore"):
        sizes = np.sqrt(np.diag(moved))
        most = np.abs(moved @ pull) / sizes
        least = most - 2 * np.sqrt(np.diag(moved @ spread @ moved)) / sizes
    at = int(np.argmax(np.nan_to_num(least, nan=-np.inf)))
    return Feedback(fit.outputs[i], fit.inputs[j], p * len(known), float(most[at]), float(least[at]))


def _in_time(fit: Estimates, k: int) -> F64:
    """Residuals of a record's window in time, (output, interval), by simulation; none where that fails."""
    assert fit.records is not None
    whole = simulated(fit, k)
    return np.zeros((0, 0)) if whole is None else (fit.records[k].y[:, -whole.shape[1] :] - whole)[:, :-1]


def _granger(past: F64, e: F64, lags: range) -> float | None:
    """p-value of an F test that residuals say nothing of an input beside its past; None if nobody can tell.

    `past` are columns of `_past`, the last of them the input itself.
    """
    from scipy.special import fdtrc

    size = past.shape[1]
    late = [e[PAST - lag :][:size] for lag in lags]
    factor, _ = _factor(np.array([*past[:-1], *late, past[-1]]))
    if factor is None:
        return None
    part, left = factor[-1, len(past) - 1 : -1], float(factor[-1, -1] ** 2)
    freedom = size - len(factor) + 1
    return float(fdtrc(part.size, freedom, float(part @ part) / part.size / (left / freedom)))


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


def _pull(fit: Estimates, k: int, led: list[int], e: F64) -> tuple[F64, F64]:
    """What a record adds to the mean of the gradient, Re(slopes of the gain times H) over its lines.

    Inputs `led` obey P u = B y + D e + r, polynomials of one sample's delay. With u and y the responses to
    noise e of the outputs, y = G u + e, H = (P − B G)⁻¹ (B + D). Returns the sum and its covariance by P, B
    and D.
    """
    assert fit.records is not None
    rec, (lo, hi) = fit.records[k], fit.lines[k]
    omega: F64 = fit.omega0[k] * np.arange(max(lo, 1), hi + 1, dtype=np.float64)
    turn = 1j * omega * rec.dt  # type: ignore[operator]
    held = [(1 - np.exp(-turn)) / turn if kind == "zoh" else np.ones(turn.size) for kind in rec.intersample]
    g, slopes = (part * np.array(held) for part in response_gradients(fit.layout, fit.params, omega))
    outputs, inputs = g.shape[:2]
    loops = [(j, *found) for j in led if (found := _loop(fit, k, j, led, e)) is not None]
    p = np.zeros((omega.size, inputs, inputs), complex) + np.eye(inputs)
    b, d = np.zeros((2, omega.size, inputs, outputs), complex)
    for j, whose, c, _ in loops:
        for (kind, of, lag), slope in zip(whose, c.tolist(), strict=True):
            part = {"u": p, "y": b, "e": d}[kind][:, j, of]
            part += (-slope if kind == "u" else slope) * np.exp(-turn * lag)
    g = np.moveaxis(g, -1, 0)
    pull, spread = np.zeros(fit.params.size), np.zeros((fit.params.size,) * 2)
    if not np.all(np.isfinite(p - b @ g)):
        return pull, spread
    over = np.linalg.pinv(p - b @ g)
    h = over @ (b + d)
    by = {"u": h, "y": np.eye(outputs) + g @ h, "e": 0 * g @ h + np.eye(outputs)}  # of the outputs' noise
    pull += 2 * np.einsum("poif,fio->p", slopes, h).real
    for j, whose, _, cov in loops:
        into = np.einsum("poif,fi->pof", slopes, over[:, :, j])
        by_c = [
            2 * np.einsum("pof,fo,f->p", into, by[kind][:, of], np.exp(-turn * lag)).real
            for kind, of, lag in whose
        ]
        spread += np.array(by_c).T @ cov @ np.array(by_c)
    return pull, spread


Loop = tuple[list[tuple[str, int, int]], F64, F64]


def _loop(fit: Estimates, k: int, j: int, led: list[int], e: F64) -> Loop | None:
    """Regression of an input on its past, on that of the others of `led`, and on the outputs.

    On their residuals `e` instead where these explain it far better: there the noise alone comes back.
    Columns as (signal, which, lag), their coefficients and the covariance of these; None where the columns
    are dependent, or half as many as the samples.
    """
    assert fit.records is not None
    rec = fit.records[k]
    u, y = (part[:, rec.intervals - fit.intervals[k] : -1][:, :LONGEST] for part in (rec.u, rec.y))
    size = u.shape[1] - PAST
    own = [("u", i, lag) for i in led for lag in range(1, (PAST if i == j else LAGS) + 1)]
    best, found = np.inf, None
    for kind, seen in (("y", y), ("e", e)):
        whose = own + [(kind, i, lag) for i in range(len(seen)) for lag in _lags(fit, j)]
        columns = [(u if one == "u" else seen)[i, PAST - lag :][:size] for one, i, lag in whose]
        rows = np.array([*columns, u[j, PAST:]])
        factor, sizes = _factor(rows - rows.mean(axis=1, keepdims=True))
        freedom = size - len(rows)
        if factor is None or freedom < len(rows) or len(seen) < len(y):
            continue
        if factor[-1, -1] > best * np.exp(-ALONE / size):
            continue
        best = float(factor[-1, -1])
        inverse = np.linalg.inv(factor[:-1, :-1].T) / sizes[:-1, None]
        variance = (best * float(sizes[-1])) ** 2 / freedom
        found = whose, inverse @ factor[-1, :-1] * sizes[-1], variance * inverse @ inverse.T
    return found


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
