"""What a reduction minimises, and how far a model is from what was reduced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arguments import reals
from ..base.arrays import C128, F64
from ..base.names import nearest
from ..base.samples import band_edges
from ..errors import SpecError
from .gramians import Realisation
from .norms import Grid, Response, grid_for, h2_norm, hinf_norm, largest_gain

__all__ = ["Criterion", "Target", "Weight", "criterion_of", "lines_criterion", "measured"]

Weight = str | Callable[[F64], Any] | Any

# Relative errors are looked at where the response is at least this part of its largest (80 dB).
SHOWN = 1e-4
WORDS = ("h2", "flat", "relative")


@dataclass(frozen=True, eq=False)
class Target:
    """What a model shall be near to.

    Attributes
    ----------
    response : callable
        omega → (omega, output, input).
    range : (float, float)
        Where something happens, rad/s.
    system : Realisation or None
        The same with states, where it has and is stable.
    """

    response: Response
    range: tuple[float, float]
    system: Realisation | None


@dataclass(frozen=True, eq=False)
class Criterion:
    """Σ weight ‖G − Ĝ‖² over the lines of a grid, or (minimax) the largest ‖G − Ĝ‖.

    Attributes
    ----------
    weight : ndarray, shape (omega,) or (omega, output, input)
        Of squares; for minimax what the first fit takes.
    kind : {"h2", "flat", "relative", "given"}
    whole : bool
        Whether the grid stands for all frequencies.
    """

    grid: Grid
    weight: F64
    kind: str
    whole: bool

    @property
    def minimax(self) -> bool:
        """Whether the largest error counts."""
        return self.kind == "flat"

    def cost(self, gains: C128) -> float:
        """The criterion of a model's response on the lines, rooted."""
        error = self.grid.response - gains
        if self.minimax:
            return float(np.max(largest_gain(error)))
        weight = self.weight[:, None, None] if self.weight.ndim == 1 else self.weight
        return float(np.sqrt(np.sum(weight * np.abs(error) ** 2)))


def criterion_of(target: Target, weight: Weight, band: Any) -> Criterion:
    """The criterion of a system, on a grid made for it."""
    low, high = target.range
    if band is None:
        grid = grid_for(target.response, low, high)
    else:
        first, last = band_edges("reduce", band)
        start = first or min(low, last / 30)
        grid = grid_for(target.response, start, last, below=first == 0, above=False)
    if isinstance(weight, list | np.ndarray):
        raise SpecError("reduce: an array of weights goes with a frequency response; give f(omega)")
    return Criterion(grid, *_weights(weight, grid), whole=band is None)


def lines_criterion(omega: F64, data: C128, weight: Weight, band: Any) -> Criterion:
    """The criterion of a frequency response on its own lines within the band."""
    first, last = (0.0, float("inf")) if band is None else band_edges("reduce", band)
    inside = (omega >= first) & (omega <= last)
    if np.sum(inside) < 2:
        raise SpecError(f"reduce: {np.sum(inside)} line(s) lie within the band {band!r} rad/s; widen it")
    share = np.gradient(omega[inside])
    grid = Grid(omega[inside], share, data[inside])
    if isinstance(weight, list | np.ndarray):
        given = reals("reduce", "weight", weight)
        if not np.all(np.isfinite(given)) or not np.any(given):
            raise SpecError("reduce: weight= must hold finite numbers, not all of them 0")
        if given.shape == (omega.size,):
            return Criterion(grid, given[inside] ** 2, "given", False)
        if given.shape == (*data.shape[1:], omega.size):
            return Criterion(grid, given.transpose(2, 0, 1)[inside] ** 2, "given", False)
        raise SpecError(
            f"reduce: weights of shape {given.shape} for {omega.size} lines; give (omega,) or "
            "(output, input, omega)"
        )
    return Criterion(grid, *_weights(weight, grid), whole=False)


def _weights(weight: Weight, grid: Grid) -> tuple[F64, str]:
    by_decade = grid.share / np.where(grid.omega > 0, grid.omega, np.inf)
    if callable(weight):
        factor = np.abs(np.asarray(weight(grid.omega)))
        if factor.shape not in ((), grid.omega.shape) or not np.all(np.isfinite(factor)):
            raise SpecError(
                f"reduce: weight(omega) of {grid.omega.size} frequencies returns shape {factor.shape} "
                "or nan or inf; it must return one finite number a frequency"
            )
        if not np.any(factor):
            raise SpecError("reduce: weight(omega) is 0 at all frequencies")
        return grid.share / np.pi * factor**2, "given"
    if weight == "h2":
        return grid.share / np.pi, weight
    if weight == "flat":
        return by_decade, weight
    if weight == "relative":
        size = np.sum(np.abs(grid.response) ** 2, axis=(1, 2))
        return by_decade / np.maximum(size, 1e-24 * np.max(size)), "relative"
    raise SpecError(f"reduce: weight={weight!r} is not available; {nearest(weight, WORDS)}, or f(omega)")


def measured(
    target: Target, criterion: Criterion, gains: Response, model: Realisation | None
) -> dict[str, float]:
    """Norms of the difference, as a row of `Reduction.errors`.

    Parameters
    ----------
    gains : callable
        The model's response.
    model : Realisation or None
        The same with states, where the difference has norms over all frequencies.
    """
    grid = criterion.grid
    if model is not None and target.system is not None and not criterion.whole:
        grid = grid_for(target.response, *target.range)
    error = grid.response - gains(grid.omega)
    sizes, whole = largest_gain(error), largest_gain(grid.response)
    h2, own = (_root_mean(grid, one) for one in (error, grid.response))
    if criterion.whole and target.system is not None and np.any(target.system.d):
        own = float("nan")  # with a feedthrough the system has no finite H2 norm to compare with
    if model is not None and target.system is not None:
        exact = h2_norm(target.system.minus(model))
        # Far below the size of the system a Gramian holds rounding, the integral still the difference.
        h2 = h2 if exact < 1e-5 * own else exact
    if criterion.whole or model is not None:
        # A light pole of the model may stand between two lines.
        own_poles = np.abs(model.poles.imag) if model is not None else np.zeros(0)
        hinf = hinf_norm(lambda omega: target.response(omega) - gains(omega), grid.omega, error, own_poles)[0]
    else:
        hinf = float(np.max(sizes))
    return {
        "h2": h2,
        "h2_relative": h2 / own if own > 0 else float("nan"),
        "hinf": hinf,
        "hinf_relative": hinf / float(np.max(whole)) if np.any(whole) else float("nan"),
        "largest_relative": float(
            np.max((sizes / np.maximum(whole, 1e-300))[whole >= SHOWN * np.max(whole)])
        ),
        "cost": criterion.cost(gains(criterion.grid.omega)),
    }


def _root_mean(grid: Grid, gains: C128) -> float:
    return float(np.sqrt(grid.share @ np.sum(np.abs(gains) ** 2, axis=(1, 2)) / np.pi))
