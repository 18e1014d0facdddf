"""Whether the noise of a fit's outputs is fed back to its inputs, and what bias that leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64
from .derived import cancelling, stable
from .diagnosis import level_p
from .doubts import noise_free
from .estimates import Estimates
from .followers import (
    LAGS,
    PAST,
    Answer,
    follows,
    lags_of,
    led_inputs,
    likeliest,
    long_past,
    signals_of,
    triangular,
)
from .further import simulated, testable
from .gradients import response_gradients
from .innovations import Innovations, regressed
from .line_residuals import line_residuals
from .misfit import too_large

__all__ = ["Feedback", "feedback", "way_back"]

ALONE = 10.0  # of log likelihood: from there on residuals explain an input better than outputs do
CANCELS = 2.0  # standard errors between a pole and a zero, at most
ADDS = 1.0  # of the noise, by which a loop may add to it
ALL = 1e-4  # of an input's power: what outputs do not explain of one that does nothing but answer them
NOISE = 0.5  # of the residuals' power, at least, that the noise explains, or the model misses more


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
    back : float
        Mean over the lines of what comes back of the output's noise, over that noise: below 0 in a loop that
        counters it.
    regulates : bool
        Whether the input does nothing but answer the outputs: then the inverse of the controller explains
        the record, and no bias can be told.
    """

    output: str
    channel: str
    p_value: float
    bias: float
    least: float
    back: float = 0.0
    regulates: bool = False


def feedback(fit: Estimates) -> Feedback | None:
    """Whether later inputs follow residuals: a regression of each input on its past and on past residuals.

    C. W. J. Granger, Econometrica 37, 1969. An input that knows nothing of the noise has coefficients 0 at
    past residuals, whatever its form. Where it follows them, the loop is known far better from its outputs,
    signal and noise, than from residuals alone: a regression of the inputs on their past and on outputs. With
    H(ω) the response of the inputs to noise in that loop, lines have E Re(∂G* U* E) = Re(∂G H) E|E|², from
    which the bias of least squares on the lines follows. None where no input follows residuals with a p-value
    below 0.01. Residuals that are not the noise of the high band are coloured noise, or the model is wrong:
    of them innovations are looked at, which no model has made.
    """
    led = led_inputs(fit) if testable(fit) else {}
    if not led:
        return None
    if too_large(level_p(fit)) or noise_free(fit) is not None:
        return _of_innovations(fit, led)
    found = _found(fit, led, _residuals)
    if found is not None and not stable(fit) and _superfluous(fit):
        return None  # a pole beyond the axis that a zero cancels colours residuals by the input itself
    if found is not None and stable(fit):
        # Between the samples of a held input lines fold into others: a simulation has them all.
        found = _found(fit, led, _in_time)
    # What comes back of noise adds to it less than the noise itself; more comes of an input read too late.
    return None if found is not None and found.back > ADDS else found


def _superfluous(fit: Estimates) -> bool:
    """Whether a pole and a zero cancel, as far as anybody can tell."""
    one = fit.layout.rational and len(fit.outputs) == 1
    return one and cancelling(fit, fit.params, fit.cov_nonrobust) < CANCELS


def _found(
    fit: Estimates, led: dict[tuple[int, int], F64], residuals: Callable[[Estimates, int], F64]
) -> Feedback | None:
    """The likeliest way back, by residuals (output, interval) of a record; None where none is likely.

    A pole on a line makes the response infinite there: such a record has no residuals.
    """
    left = {k: residuals(fit, k) for k in {k for k, _ in led}}
    led = {(k, j): past for (k, j), past in led.items() if np.isfinite(left[k]).all()}
    found = likeliest(fit, led, left)
    return None if found is None else _biased(fit, led, found, [(k, e, None) for k, e in left.items()])


def _biased(
    fit: Estimates,
    led: dict[tuple[int, int], F64],
    found: Answer,
    left: Iterable[tuple[int, F64, Innovations | None]],
) -> Feedback:
    """The bias of a way back, by residuals of records, or by innovations where the noise is coloured."""
    p, i, j = found
    if all(_regulates(fit, k, j) for k in {k for k, at in led if at == j}):
        return Feedback(fit.outputs[i], fit.inputs[j], p, np.inf, np.inf, regulates=True)
    size = fit.params.size
    pull, spread, back = np.zeros(size), np.zeros((size, size)), 0.0
    for k, e, made in left:
        own, cov, part = _pull(fit, k, [j for at, j in led if at == k], e, made)
        pull += own
        spread += cov
        back += float(part[i])
    moved = fit.cov_nonrobust
    with np.errstate(invalid="ignore", divide="ignore"):
        sizes = np.sqrt(np.diag(moved))
        most = np.abs(moved @ pull) / sizes
        least = most - 2 * np.sqrt(np.diag(moved @ spread @ moved)) / sizes
    at = int(np.argmax(np.nan_to_num(least, nan=-np.inf)))
    return Feedback(fit.outputs[i], fit.inputs[j], p, float(most[at]), float(least[at]), back)


def way_back(fit: Estimates) -> Feedback | None:
    """The likeliest way back from innovations, of any model and of inputs of any form, if they counter noise.

    Inputs that are smooth between samples may tell what comes, too: the answer is no proof of a loop.
    """
    led = led_inputs(fit) if fit.layout.rational else {}
    followed = follows(fit, led)
    if followed is None:
        return None
    led, found, made = followed
    answer = _biased(fit, led, found, [(k, np.zeros((0, 0)), one) for k, one in made.items()])
    return answer if not answer.regulates and answer.back < 0 else None


def _of_innovations(fit: Estimates, led: dict[tuple[int, int], F64]) -> Feedback | None:
    """The likeliest way back from innovations, if the noise that they make explains the residuals.

    Of held inputs and of straight lines: through those that are smooth between samples, later samples tell
    what the output does now.
    """
    assert fit.records is not None
    led = {(k, j): past for (k, j), past in led.items() if fit.records[k].intersample[j] != "smooth"}
    followed = follows(fit, led)
    if followed is None:
        return None
    led, found, longer = followed
    answer = _biased(fit, led, found, [(k, np.zeros((0, 0)), one) for k, one in longer.items()])
    i = found[1]
    noise = np.mean([np.mean(_power(fit, k, one)[i]) for k, one in longer.items()])
    whole = np.mean([np.mean(np.abs(fit.pieces[k][i]) ** 2) / 2 for k in longer])
    # An input that adds to the noise is rather one that was read too late.
    return answer if answer.regulates or (noise > NOISE * whole and answer.back < 0) else None


def _regulates(fit: Estimates, k: int, j: int) -> bool:
    """Whether the outputs, their past and their sums explain an input, as of a controller at one command."""
    u, y = signals_of(fit, k)
    size, past = u.shape[1], long_past(fit, k)
    y = y - y.mean(axis=1, keepdims=True)
    time = np.linspace(-1.0, 1.0, size)
    lags = range(lags_of(fit, j).start, past // len(y) + 1)
    late = [row[past - lag : size - lag] for row in y for lag in lags]
    rows = [np.ones(size - past), time[past:], *y.cumsum(axis=1)[:, past:], *late]
    side = u[j, past:] - u[j, past:].mean()
    _, left = regressed(np.array(rows), side)
    return float(left @ left) < ALL * float(side @ side)


def _power(fit: Estimates, k: int, made: Innovations) -> F64:
    """Power of the noise on the lines, over that of white noise at the level of the fit, (output, line)."""
    return np.asarray(made.power(_turn(fit, k)) / fit.noise_levels[k][:, None] ** 2)


def _in_time(fit: Estimates, k: int) -> F64:
    """Residuals of a record's window in time, (output, interval), by simulation; none where that fails."""
    assert fit.records is not None
    whole = simulated(fit, k)
    return np.zeros((0, 0)) if whole is None else (fit.records[k].y[:, -whole.shape[1] :] - whole)[:, :-1]


Pull = tuple[F64, F64, F64]


def _pull(fit: Estimates, k: int, led: list[int], e: F64, made: Innovations | None = None) -> Pull:
    """What a record adds to the mean of the gradient, Re(slopes of the gain times H) over its lines.

    Innovations tell the power of noise that is not the same on all lines, and the gain, which such noise
    moves further than a bias of first order.

    Inputs `led` obey P u = B y + D e + r, polynomials of one sample's delay. With u and y the responses to
    noise e of the outputs, y = G u + e, H = (P − B G)⁻¹ (B + D). Returns the sum, its covariance by P, B and
    D, and the sum of Re(G H) times the power, by output.
    """
    assert fit.records is not None
    rec, real = fit.records[k], _turn(fit, k)
    turn = 1j * real
    held = [(1 - np.exp(-turn)) / turn if kind == "zoh" else np.ones(turn.size) for kind in rec.intersample]
    g, slopes = (part * np.array(held) for part in response_gradients(fit.layout, fit.params, _omega(fit, k)))
    power = np.ones((len(g), turn.size))
    if made is not None:
        g, power = made.gain(real), _power(fit, k, made)
        slopes = slopes * power[:, None]
    outputs, inputs = g.shape[:2]
    loops = [(j, *found) for j in led if (found := _loop(fit, k, j, led, e)) is not None]
    p = np.zeros((turn.size, inputs, inputs), complex) + np.eye(inputs)
    b, d = np.zeros((2, turn.size, inputs, outputs), complex)
    for j, whose, c, _ in loops:
        for (kind, of, lag), slope in zip(whose, c.tolist(), strict=True):
            part = {"u": p, "y": b, "e": d}[kind][:, j, of]
            part += (-slope if kind == "u" else slope) * np.exp(-turn * lag)
    g = np.moveaxis(g, -1, 0)
    pull, spread = np.zeros(fit.params.size), np.zeros((fit.params.size,) * 2)
    if not np.all(np.isfinite(p - b @ g)):
        return pull, spread, np.zeros(outputs)
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
    return pull, spread, np.einsum("fij,fji,if->i", g, h, power).real


def _omega(fit: Estimates, k: int) -> F64:
    """Frequencies of a record's lines but line 0."""
    lo, hi = fit.lines[k]
    omega: F64 = fit.omega0[k] * np.arange(max(lo, 1), hi + 1, dtype=np.float64)
    return omega


def _turn(fit: Estimates, k: int) -> F64:
    """The same in radians a sample."""
    assert fit.records is not None
    return _omega(fit, k) * fit.records[k].dt  # type: ignore[operator]


Loop = tuple[list[tuple[str, int, int]], F64, F64]


def _loop(fit: Estimates, k: int, j: int, led: list[int], e: F64) -> Loop | None:
    """Regression of an input on its past, on that of the others of `led`, and on the outputs.

    On their residuals `e` instead where these explain it far better: there the noise alone comes back.
    Columns as (signal, which, lag), their coefficients and the covariance of these; None where the columns
    are dependent, or half as many as the samples.
    """
    u, y = signals_of(fit, k)
    size = u.shape[1] - PAST
    own = [("u", i, lag) for i in led for lag in range(1, (PAST if i == j else LAGS) + 1)]
    best, found = np.inf, None
    for kind, seen in (("y", y), ("e", e)):
        whose = own + [(kind, i, lag) for i in range(len(seen)) for lag in lags_of(fit, j)]
        columns = [(u if one == "u" else seen)[i, PAST - lag :][:size] for one, i, lag in whose]
        rows = np.array([*columns, u[j, PAST:]])
        factor, sizes = triangular(rows - rows.mean(axis=1, keepdims=True))
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
