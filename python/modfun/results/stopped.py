"""Why searches stopped without settling, or on a bound: too many poles, actuators that saturate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any

import numpy as np

from ..base.cached import kept
from ..base.names import listed
from ..models.transfer_function import TransferFunction
from .cures import ENOUGH, again, rewritten
from .diagnosis import growth, level_p, level_ratio
from .doubts import SURE, Doubt, still_held
from .estimates import Estimates
from .offsets import mean

__all__ = ["limited_input", "too_many_poles"]

PLACES = (0.3, 0.45, 0.6, 0.7, 0.8, 0.9)  # of the range of an input: limits tried first,
NEAR = (0.75, 1.25)  # and around the best of them
TRIED = 25  # fits for that


@kept
def too_many_poles(fit: Estimates) -> Doubt | None:
    """That the search did not settle, and does with one pole less, which leaves only the noise."""
    structure, layout = fit.structure, fit.layout
    if fit.success or fit.again is None or not isinstance(structure, TransferFunction):
        return None
    if structure.denominator is not None or structure.params or len(fit.outputs) != 1 or layout.orders[0] < 2:
        return None
    poles = layout.orders[0] - 1
    degrees = [[None if d is None else min(d, poles) for d in row] for row in layout.numerators]
    other = again(fit, fit.records, rewritten(fit, poles=poles, zeros=degrees), fit.options)
    if other is None or not _answers(other):
        return None
    held = f" and still held {still_held(fit)[0]}" if still_held(fit) else ""
    return Doubt(
        f"The search stopped after {fit.nit} iterations without settling{held}: there are too many poles. "
        f"First try poles={poles}, with which it settles and only the noise is left."
    )


@kept
def limited_input(fit: Estimates) -> Doubt | None:
    """That an actuator saturates: where an input is limited, nothing ends on a bound, and noise is left."""
    stuck = fit.at_bound and not still_held(fit) and fit.again is not None and fit.records
    if not stuck or not level_p(fit) < SURE or mean(fit):  # limits at the mean do what a constant does
        return None
    each = [limit for name in fit.inputs for limit in _limits(fit, name)]
    first = min(each, key=lambda limit: limit.left(fit), default=None)
    if first is None:
        return None
    limit = first.best(fit)
    other = limit.fitted(fit)
    if other is None or not _answers(other) or other.at_bound or growth(other) > 0:
        return None
    u, low, high = limit.channel, limit.low, limit.high
    if isfinite(low) and isfinite(high):
        where, call = f"from {low:.4g} to {high:.4g}", f"np.clip(rec[{u!r}], {low:.4g}, {high:.4g})"
    elif isfinite(high):
        where, call = f"up to {high:.4g}", f"np.minimum(rec[{u!r}], {high:.4g})"
    else:
        where, call = f"down to {low:.4g}", f"np.maximum(rec[{u!r}], {low:.4g})"
    ends = "ends" if len(fit.at_bound) == 1 else "end"
    return Doubt(
        f"The actuator saturates: {u} acts {where} only, or so it seems, as with it limited there only the "
        f"noise is left, and {listed(fit.at_bound)} {ends} on no bound. First try rec.assign({u}={call})."
    )


@dataclass(frozen=True)
class _Limit:
    """An input that acts between two values only."""

    channel: str
    middle: float
    low: float
    high: float

    def at(self, part: float) -> _Limit:
        """The same with that part of the distance from the middle."""
        low, high = (self.middle + part * (end - self.middle) for end in (self.low, self.high))
        return replace(self, low=low, high=high)

    def fitted(self, fit: Estimates) -> Estimates | None:
        """The fit of records with the input so limited."""
        u = self.channel
        each: list[dict[str, Any]] = [{u: np.clip(rec[u], self.low, self.high)} for rec in fit.records or ()]
        cut = tuple([rec.assign(**own) for rec, own in zip(fit.records or (), each, strict=True)])
        return again(fit, cut, fit.structure, fit.options)

    def left(self, fit: Estimates) -> float:
        """Residuals over the noise level after it."""
        other = self.fitted(fit)
        return level_ratio(other) if other is not None and other.success else inf

    def best(self, fit: Estimates) -> _Limit:
        """The limit near it that leaves least."""
        from scipy.optimize import minimize_scalar

        found = minimize_scalar(
            lambda part: self.at(part).left(fit), bounds=NEAR, method="bounded", options={"maxiter": TRIED}
        )
        return self.at(float(found.x))


def _limits(fit: Estimates, name: str) -> Iterator[_Limit]:
    """Limits above, below and on both sides of the middle of an input."""
    values = np.concatenate([rec[name] for rec in fit.records or ()])
    low, high = float(values.min()), float(values.max())
    middle = 0.5 * (low + high)
    for part in PLACES:
        up, down = middle + part * (high - middle), middle + part * (low - middle)
        yield _Limit(name, low, -inf, low + part * (high - low))
        yield _Limit(name, high, high + part * (low - high), inf)
        yield _Limit(name, middle, down, up)


def _answers(fit: Estimates) -> bool:
    """Whether a fit settles and leaves only the noise."""
    return fit.usable and fit.success and level_p(fit) > ENOUGH
