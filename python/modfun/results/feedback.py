"""Whether the noise of a fit's outputs is fed back to its inputs, and what bias that leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
from .innovations import Innovations, innovations, regressed
from .line_residuals import line_residuals
from .misfit import too_large

__all__ = ["Feedback", "feedback", "way_back"]

LAGS = 6  # samples after which an input may respond to a residual
PAST = 12  # of its own samples, from which it is predicted
LONG = 60  # of these, before innovations are said to move it: a delay or a clock may reach far back
SHORTEST = 5 * (LAGS + PAST)  # samples
LONGEST = 1 << 12  # samples of a record that are looked at
ASKED = 0.01  # p-value from which on residuals are looked at more closely
CERTAIN = 1e-4  # the same of innovations, whose model is a rough one
MOST = 1 << 16  # samples of a record whose residuals are laid out in time
ALONE = 10.0  # of log likelihood: from there on residuals explain an input better than outputs do
CANCELS = 2.0  # standard errors between a pole and a zero, at most
NEW = 0.01  # of an input's rms: what its past does not predict is more, or it knows no noise
ADDS = 1.0  # of the noise, by which a loop may add to it
FINE = 1e-4  # of an output's rms: innovations below that are no noise, but what regressions leave
RESTS = 0.2  # of an input's runs of equal samples that are longer than the shortest: of none that noise moves
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
    led = _led(fit) if testable(fit) else {}
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


def _led(fit: Estimates) -> dict[tuple[int, int], F64]:
    """Inputs (record, input) that are not known from their past, with it: what moves them may be noise."""
    if fit.options.reference or max(fit.intervals) > MOST:
        return {}
    pairs = product(range(len(fit.pieces)), range(len(fit.inputs)))
    found = {pair: _past(_window(fit, *pair)) for pair in pairs}
    return {pair: past for pair, past in found.items() if past is not None}


def _found(
    fit: Estimates, led: dict[tuple[int, int], F64], residuals: Callable[[Estimates, int], F64]
) -> Feedback | None:
    """The likeliest way back, by residuals (output, interval) of a record; None where none is likely.

    A pole on a line makes the response infinite there: such a record has no residuals.
    """
    left = {k: residuals(fit, k) for k in {k for k, _ in led}}
    led = {(k, j): past for (k, j), past in led.items() if np.isfinite(left[k]).all()}
    found = _likeliest(fit, led, left)
    return None if found is None else _biased(fit, led, found, [(k, e, None) for k, e in left.items()])


Answer = tuple[float, int, int]  # p-value, output, input


def _likeliest(
    fit: Estimates, led: dict[tuple[int, int], F64], left: dict[int, F64], asked: float = ASKED
) -> Answer | None:
    """The likeliest way back, its p-value times the number of those that were tried; None above `asked`."""
    tests = [
        (_granger(past, e, _lags(fit, j)), i, j)
        for (k, j), past in led.items()
        for i, e in enumerate(left[k])
    ]
    known = [(p, i, j) for p, i, j in tests if p is not None]
    p, i, j = min(known, default=(1.0, 0, 0))
    return (p * len(known), i, j) if known and p * len(known) < asked else None


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
    led = _led(fit) if fit.layout.rational else {}
    followed = _followed(fit, led)
    if followed is None:
        return None
    led, found, made = followed
    answer = _biased(fit, led, found, [(k, np.zeros((0, 0)), one) for k, one in made.items()])
    return answer if not answer.regulates and answer.back < 0 else None


Followed = tuple[dict[tuple[int, int], F64], Answer, dict[int, Innovations]]


def _followed(fit: Estimates, led: dict[tuple[int, int], F64]) -> Followed | None:
    """Inputs that may follow innovations, the likeliest way back from these, and the innovations.

    Those that rest do not: outputs that were filtered forth and back, or read too early, go before their
    steps.
    """
    led = {at: past for at, past in led.items() if not _rests(past[-1])}
    if not led:
        return None
    made = {k: _innovations(fit, k, PAST) for k in {k for k, _ in led}}
    found = _likeliest(fit, led, {k: one.e for k, one in made.items()}, CERTAIN)
    if found is None:
        return None
    # Of inputs that change at some samples only, and act late, what is long ago says when they do.
    longer = {k: _innovations(fit, k, _long(fit, k)) for k in made}
    pasts = {(k, j): _past(_window(fit, k, j), _long(fit, k)) for k, j in led}
    known = {pair: past for pair, past in pasts.items() if past is not None}
    found = _likeliest(fit, known, {k: one.e for k, one in longer.items()}, CERTAIN)
    return None if found is None else (led, found, longer)


def _of_innovations(fit: Estimates, led: dict[tuple[int, int], F64]) -> Feedback | None:
    """The likeliest way back from innovations, if the noise that they make explains the residuals.

    Of held inputs and of straight lines: through those that are smooth between samples, later samples tell
    what the output does now.
    """
    assert fit.records is not None
    led = {(k, j): past for (k, j), past in led.items() if fit.records[k].intersample[j] != "smooth"}
    followed = _followed(fit, led)
    if followed is None:
        return None
    led, found, longer = followed
    answer = _biased(fit, led, found, [(k, np.zeros((0, 0)), one) for k, one in longer.items()])
    i = found[1]
    noise = np.mean([np.mean(_power(fit, k, one)[i]) for k, one in longer.items()])
    whole = np.mean([np.mean(np.abs(fit.pieces[k][i]) ** 2) / 2 for k in longer])
    # An input that adds to the noise is rather one that was read too late.
    return answer if answer.regulates or (noise > NOISE * whole and answer.back < 0) else None


def _rests(u: F64) -> bool:
    """Whether an input often stands still for longer than its clock, so that no noise moves it."""
    runs = np.diff(np.flatnonzero(np.diff(u)))
    return bool(runs.size == 0 or np.mean(runs > runs.min()) > RESTS)


def _regulates(fit: Estimates, k: int, j: int) -> bool:
    """Whether the outputs, their past and their sums explain an input, as of a controller at one command."""
    u, y = _signals(fit, k)
    size, past = u.shape[1], _long(fit, k)
    y = y - y.mean(axis=1, keepdims=True)
    time = np.linspace(-1.0, 1.0, size)
    lags = range(_lags(fit, j).start, past // len(y) + 1)
    late = [row[past - lag : size - lag] for row in y for lag in lags]
    rows = [np.ones(size - past), time[past:], *y.cumsum(axis=1)[:, past:], *late]
    side = u[j, past:] - u[j, past:].mean()
    _, left = regressed(np.array(rows), side)
    return float(left @ left) < ALL * float(side @ side)


def _innovations(fit: Estimates, k: int, past: int) -> Innovations:
    """Of the window of a record; none where they are as small as what regressions leave of no noise."""
    u, y = _signals(fit, k)
    found = innovations(y, u, past, LAGS, [1 - _lags(fit, j).start for j in range(len(u))])
    found.e[np.std(found.e, axis=1) < FINE * np.std(y, axis=1)] = 0.0
    return found


def _power(fit: Estimates, k: int, made: Innovations) -> F64:
    """Power of the noise on the lines, over that of white noise at the level of the fit, (output, line)."""
    return np.asarray(made.power(_turn(fit, k)) / fit.noise_levels[k][:, None] ** 2)


def _long(fit: Estimates, k: int) -> int:
    return max(PAST, min(LONG, min(fit.intervals[k], LONGEST) // 8))


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

    size, start = past.shape[1], len(past) - 2  # the samples before the first one
    late = np.array([e[start - lag :][:size] for lag in lags])
    _, alone = regressed(past[:-1], past[-1])
    _, both = regressed(np.concatenate([past[:-1], late]), past[-1])
    left, freedom = float(both @ both), size - start - 1 - len(late)
    if freedom < 1 or not late.any():
        return None
    gained = max(float(alone @ alone) - left, 0.0)
    with np.errstate(divide="ignore"):
        return float(fdtrc(len(late), freedom, np.divide(gained / len(late), left / freedom)))


def _past(u: F64, past: int = PAST) -> F64 | None:
    """A constant, the samples of an input before each one, and these, (column, time).

    None where these are known from those before, by cubics through four of them or by a regression on all.
    What that leaves of an input is left of each of its columns: of another none comes near rounding.
    """
    if u.size < SHORTEST or unforeseen(u) <= NEW:
        return None
    u, size = u - u.mean(), u.size - past
    rows = np.array([np.ones(size), *(u[past - lag :][:size] for lag in range(1, past + 1)), u[past:]])
    factor, _ = _factor(rows)
    return None if factor is None or factor[-1, -1] <= NEW else rows


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
    u: F64 = _signals(fit, k)[0][j]
    return u


def _signals(fit: Estimates, k: int) -> tuple[F64, F64]:
    """Samples of inputs and outputs of a record that are looked at."""
    assert fit.records is not None
    rec = fit.records[k]
    u, y = (part[:, rec.intervals - fit.intervals[k] : -1][:, :LONGEST] for part in (rec.u, rec.y))
    return u, y


def _lags(fit: Estimates, j: int) -> range:
    """Lags of residuals; a held input moves the output later only, so the same sample counts."""
    held = fit.intersample[j] == "zoh" and all(
        row[j] is None or row[j] < order  # type: ignore[operator]
        for row, order in zip(fit.layout.numerators, fit.layout.orders, strict=True)
    )
    return range(0 if held else 1, LAGS + 1)


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
    u, y = _signals(fit, k)
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
