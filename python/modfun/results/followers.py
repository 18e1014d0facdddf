"""Inputs that follow innovations of the outputs, as those of a loop do: they hold the noise."""

from __future__ import annotations

from itertools import product

import numpy as np

from .._core import unforeseen
from ..base.arrays import F64
from ..base.cached import kept
from .estimates import Estimates
from .innovations import Innovations, innovations, regressed

__all__ = [
    "LAGS", "PAST", "Answer", "follows", "granger", "in_loop", "lags_of", "led_inputs", "likeliest",
    "long_past", "signals_of", "triangular",
]  # fmt: skip

LAGS = 6  # samples after which an input may respond to a residual
PAST = 12  # of its own samples, from which it is predicted
SWEPT = 4  # of these, whose coefficients may be squares of the time, as of a sine whose frequency moves
LONG = 60  # of these, before innovations are said to move it: a delay or a clock may reach far back
SHORTEST = 5 * (LAGS + PAST)  # samples
LONGEST = 1 << 12  # samples of a record that are looked at
ASKED = 0.01  # p-value from which on residuals are looked at more closely
CERTAIN = 1e-4  # the same of innovations, whose model is a rough one
MOST = 1 << 16  # samples of a record whose residuals are laid out in time
NEW = 0.01  # of an input's rms: what its past does not predict is more, or it knows no noise
FINE = 1e-4  # of an output's rms: innovations below that are no noise, but what regressions leave
RESTS = 0.2  # of an input's runs of equal samples that are longer than the shortest: of none that noise moves


@kept
def in_loop(fit: Estimates) -> bool:
    """Whether an input follows innovations, so that it holds noise that residuals hold, too."""
    return bool(fit.layout.rational and fit.records and follows(fit, led_inputs(fit)))


def led_inputs(fit: Estimates) -> dict[tuple[int, int], F64]:
    """Inputs (record, input) that are not known from their past, with it: what moves them may be noise."""
    if fit.options.reference or max(fit.intervals) > MOST:
        return {}
    pairs = product(range(len(fit.pieces)), range(len(fit.inputs)))
    found = {pair: _past(_window(fit, *pair)) for pair in pairs}
    return {pair: past for pair, past in found.items() if past is not None}


Answer = tuple[float, int, int]  # p-value, output, input


def likeliest(
    fit: Estimates,
    led: dict[tuple[int, int], F64],
    left: dict[int, F64],
    asked: float = ASKED,
    *,
    swept: bool = False,
) -> Answer | None:
    """The likeliest way back, its p-value times the number of those that were tried; None above `asked`."""
    tests = [
        (granger(past, e, lags_of(fit, j), swept=swept), i, j)
        for (k, j), past in led.items()
        for i, e in enumerate(left[k])
    ]
    known = [(p, i, j) for p, i, j in tests if p is not None]
    p, i, j = min(known, default=(1.0, 0, 0))
    return (p * len(known), i, j) if known and p * len(known) < asked else None


Followed = tuple[dict[tuple[int, int], F64], Answer, dict[int, Innovations]]


def follows(fit: Estimates, led: dict[tuple[int, int], F64]) -> Followed | None:
    """Inputs that may follow innovations, the likeliest way back from these, and the innovations.

    Those that rest do not: outputs that were filtered forth and back, or read too early, go before their
    steps.
    """
    led = {at: past for at, past in led.items() if not _rests(past[-1])}
    if not led:
        return None
    made = {k: _innovations(fit, k, PAST) for k in {k for k, _ in led}}
    found = likeliest(fit, led, {k: one.e for k, one in made.items()}, CERTAIN)
    if found is None:
        return None
    # Of inputs that change at some samples only, and act late, what is long ago says when they do. A sweep is
    # known from its past by coefficients that go with the time, of which innovations of a bent system tell.
    longer = {k: _innovations(fit, k, long_past(fit, k)) for k in made}
    pasts = {(k, j): _past(_window(fit, k, j), long_past(fit, k)) for k, j in led}
    known = {pair: past for pair, past in pasts.items() if past is not None}
    found = likeliest(fit, known, {k: one.e for k, one in longer.items()}, CERTAIN, swept=True)
    return None if found is None else (led, found, longer)


def _rests(u: F64) -> bool:
    """Whether an input often stands still for longer than its clock, so that no noise moves it."""
    runs = np.diff(np.flatnonzero(np.diff(u)))
    return bool(runs.size == 0 or np.mean(runs > runs.min()) > RESTS)


def _innovations(fit: Estimates, k: int, past: int) -> Innovations:
    """Of the window of a record; none where they are as small as what regressions leave of no noise."""
    u, y = signals_of(fit, k)
    found = innovations(y, u, past, LAGS, [1 - lags_of(fit, j).start for j in range(len(u))])
    found.e[np.std(found.e, axis=1) < FINE * np.std(y, axis=1)] = 0.0
    return found


def long_past(fit: Estimates, k: int) -> int:
    return max(PAST, min(LONG, min(fit.intervals[k], LONGEST) // 8))


def granger(past: F64, e: F64, lags: range, *, swept: bool = False) -> float | None:
    """p-value of an F test that residuals say nothing of an input beside its past; None if nobody can tell.

    `past` are columns of `_past`, the last of them the input itself. `swept`: whether what it says of the
    input may change in time.
    """
    from scipy.special import fdtrc

    size, start = past.shape[1], len(past) - 2  # the samples before the first one
    late = np.array([e[start - lag :][:size] for lag in lags])
    known, time = past[:-1], np.linspace(-1.0, 1.0, size)
    if swept:
        known = np.concatenate([known, known[1 : 1 + SWEPT] * time, known[1 : 1 + SWEPT] * time**2])
    _, alone = regressed(known, past[-1])
    _, both = regressed(np.concatenate([known, late]), past[-1])
    left, freedom = float(both @ both), size - len(known) - len(late)
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
    factor, _ = triangular(rows)
    return None if factor is None or factor[-1, -1] <= NEW else rows


def triangular(columns: F64) -> tuple[F64 | None, F64]:
    """Triangular factor of the correlations of columns (column, time), None if they are dependent; norms."""
    products = columns @ columns.T
    sizes = np.sqrt(products.diagonal())
    try:
        return np.linalg.cholesky(products / (sizes * sizes[:, None])), sizes
    except np.linalg.LinAlgError:
        return None, sizes


def _window(fit: Estimates, k: int, j: int) -> F64:
    """Samples of an input that are looked at."""
    u: F64 = signals_of(fit, k)[0][j]
    return u


def signals_of(fit: Estimates, k: int) -> tuple[F64, F64]:
    """Samples of inputs and outputs of a record that are looked at."""
    assert fit.records is not None
    rec = fit.records[k]
    u, y = (part[:, rec.intervals - fit.intervals[k] : -1][:, :LONGEST] for part in (rec.u, rec.y))
    return u, y


def lags_of(fit: Estimates, j: int) -> range:
    """Lags of residuals; a held input moves the output later only, so the same sample counts."""
    held = fit.intersample[j] == "zoh" and all(
        row[j] is None or row[j] < order  # type: ignore[operator]
        for row, order in zip(fit.layout.numerators, fit.layout.orders, strict=True)
    )
    return range(0 if held else 1, LAGS + 1)
