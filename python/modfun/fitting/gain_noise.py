"""The noise of gains that came without standard errors, as their residuals show it."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, log, nan
from typing import NamedTuple

import numpy as np

from ..base.arrays import C128, F64
from ..reduction.rational import RationalFit

__all__ = ["GainNoise", "gain_noise"]

CLEARLY = 4.0  # by which −2 log L has to fall for noise in proportion to the gains, and for a floor under it
FLOORS = (
    3.0,
    1.0,
    0.3,
    0.1,
    0.03,
    0.01,
    0.003,
)  # of the root mean square gain, below which noise falls no more
ROUNDS, SETTLED = 8, 1e-4  # of weights by the last model, and relative change of the cost that ends them
LEAST = 1e-6  # of the largest gain: a model that is 0 somewhere knows nothing better there
EXACT = 1e-9  # of the gains: residuals of that size are rounding, not noise
LEVERAGE = 0.9  # of a gain, above which its residual tells nothing


Fit = Callable[[F64, RationalFit | None], RationalFit]


class GainNoise(NamedTuple):
    """The fit with weights that suit its residuals.

    Noise is a level times √(floor² + |G|²), or 1 with an infinite floor. `uneven_p`: probability that sizes
    of residuals go with |G|, the frequency or the path as much beyond that by chance.
    """

    found: RationalFit
    floor: float
    uneven_p: float


def gain_noise(fit: Fit, omega: F64, own: F64, free: int) -> GainNoise:
    """Noise of one size, in proportion to the gains, or in between: whichever is likelier.

    In proportion to those of the model: measured ones would get the more weight the smaller noise made them.

    Parameters
    ----------
    fit : callable
        The fit with noise of these sizes, (omega, path), that begins where another one ended.
    omega : ndarray, shape (omega,)
    own : ndarray, shape (omega,)
        The part of each gain that no other holds.
    free : int
        Degrees of freedom.
    """
    equal = fit(np.ones((omega.size, 1)), None)
    whole = float(np.sqrt(np.mean(np.abs(equal.response) ** 2)))
    best, floor = equal, inf
    if not equal.success or np.sqrt(equal.cost / free) < EXACT * whole:
        return GainNoise(best, floor, nan)
    least = _doubled(equal, np.ones((omega.size, 1)), own, free)
    floors = [share * whole for share in FLOORS]
    found, size = _weighted(fit, equal, 0.0)
    value = _doubled(found, size, own, free)
    if found.success and value < least - CLEARLY:
        best, floor, least = found, 0.0, value
        floors.reverse()
    for other in floors:
        found, size = _weighted(fit, best, other)
        value = _doubled(found, size, own, free)
        if found.success and value < least - (CLEARLY if floor in (0.0, inf) else 0.0):
            best, floor, least = found, other, value
        elif value > least:
            break
    return GainNoise(best, floor, _uneven(best, omega, free))


def _doubled(found: RationalFit, size: F64, own: F64, free: int) -> float:
    """−2 log L of the residuals at their own level, restricted: parameters took some of them."""
    paths = found.residuals.size // (2 * own.size)
    logs = np.broadcast_to(np.log(size), (own.size, paths)).sum(axis=1)
    known = np.linalg.slogdet(found.jacobian.T @ found.jacobian)[1]
    return free * log(max(found.cost, 1e-300)) + 4 * float(own @ logs) + float(known)


def _sizes(response: C128, floor: float) -> F64:
    """Sizes of noise beside each other, (omega, path)."""
    gains = np.abs(response).reshape(-1, response.shape[-1]).T
    if floor == inf:
        return np.ones_like(gains)
    return np.asarray(np.hypot(np.maximum(gains, LEAST * gains.max()), floor))


def _weighted(fit: Fit, found: RationalFit, floor: float) -> tuple[RationalFit, F64]:
    """The fit whose weights are those of its own gains, and the sizes that it had."""
    cost, start = inf, found if floor else None  # small gains may want other poles than equal weights
    for _ in range(ROUNDS):
        size = _sizes(found.response, floor)
        found = start = fit(size, start)
        if not found.success or abs(found.cost - cost) <= SETTLED * found.cost:
            break
        cost = found.cost
    return found, size


def _uneven(found: RationalFit, omega: F64, free: int) -> float:
    """p-value of log sizes of the residuals that go with |G|, the frequency or the path.

    Logarithms have the same variance whatever the sizes are, and outliers weigh little in them.
    """
    from scipy.special import fdtrc

    rows, lines = found.residuals.reshape(2, omega.size, -1), omega.size
    paths = rows.shape[2]
    basis = np.linalg.svd(found.jacobian / np.maximum(np.linalg.norm(found.jacobian, axis=0), 1e-300), False)
    held = np.sum(basis[0][:, basis[1] > 1e-12 * basis[1][0]] ** 2, axis=1).reshape(rows.shape).mean(axis=0)
    power = np.sum(rows**2, axis=0) / np.maximum(1 - held, 1e-3)
    gains = np.abs(found.response).reshape(paths, lines).T
    use = (held < LEVERAGE) & (power > 0) & (gains > 0)
    where = np.maximum(omega, np.min(omega[omega > 0], initial=inf))
    with np.errstate(divide="ignore"):
        columns = [np.log(gains)[use], np.broadcast_to(np.log(where)[:, None], gains.shape)[use]]
    columns += [np.broadcast_to(np.arange(paths) == one, gains.shape)[use] for one in range(paths)]
    x, y = np.column_stack(columns).astype(float), np.log(power[use])
    if not np.all(np.isfinite(x)):
        return 1.0
    total = np.sum((y - y.mean()) ** 2) if y.size else 0.0
    coefficients, _, rank, _ = np.linalg.lstsq(x, y, rcond=1e-9)
    left, steps = np.sum((y - x @ coefficients) ** 2), int(rank) - 1
    rest = min(y.size - int(rank), free)
    if steps < 1 or rest < 1 or not left > 0:
        return 1.0
    return float(fdtrc(steps, rest, (total - left) / steps / (left / rest)))
