"""Other parameters that make the same equations, between which no record chooses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.names import listed
from .doubts import Doubt
from .estimates import Estimates

__all__ = ["nearer", "other_minimum", "other_signs", "twin"]

EXCHANGED = 2.0  # standard errors between two sets of parameters with the same equations


def twin(fit: Estimates) -> Doubt | None:
    """That other parameters make the same equations."""
    if fit.layout.rational:
        return None
    from ..equations.symbolic.mirrors import exponents, mirrors
    from ..equations.symbolic.twins import twins

    layout: Any = fit.layout  # that of equations
    compiled = layout.compiled
    found = twins(compiled, fit.params)
    if not found and (found := mirrors(compiled, fit.params)):
        return Doubt(_mirrored(fit, found[0], exponents(compiled)), sure=False)
    if not found:
        return None
    sets = []
    for other in found:
        moved = np.abs(other - fit.params) > 1e-3 * np.abs(fit.params)
        names = [f"{n} = {x:.4g}" for n, x, on in zip(fit.param_names, other, moved, strict=True) if on]
        sets.append(listed(names))
    k = int(np.argmax(np.abs(found[0] - fit.params) / np.abs(fit.params)))
    name, here, there = fit.param_names[k], fit.params[k], found[0][k]
    ways = ("min", "max") if here > there else ("max", "min")
    middle = (here + there) / 2
    keeps, takes = (
        f"mf.Free({x:.4g}, {way}={middle:.4g})" for x, way in zip((here, there), ways, strict=True)
    )
    more = f"; or measure {' or '.join(compiled.hidden)}" if compiled.hidden else ""
    return Doubt(
        f"With {'; or with '.join(sets)} the equations are the same: no record of {listed(fit.outputs)} "
        f"tells these parameters from the estimates. To choose, bound one: params={{{name!r}: {keeps}}} "
        f"keeps the estimates, {takes} takes {'those' if len(found) == 1 else 'the first of those'}{more}.",
        sure=any(_open(fit, other) for other in found),
    )


def other_signs(fit: Estimates) -> Doubt | None:
    """That parameters of other signs explain the records as well as estimates with those that are written."""
    other = getattr(fit, "other_signs", None)  # of equations
    if other is None:
        return None
    names = [f"{name} = {x:.4g}" for name, x in zip(fit.param_names, other, strict=True)]
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.where(other < 0, np.abs(other - fit.params) / fit.spread, -np.inf)
    told = f"{fit.param_names[int(np.argmax(np.nan_to_num(apart, nan=-np.inf)))]!r}: mf.Free(min=0)"
    return Doubt(
        f"With {listed(names)} the model explains the record as well: other signs of parameters make nearly "
        "the same curve over the range of its signals. The estimates are those with the signs as written. If "
        f"you know these, say so, params={{{told}}}; else take a record that moves more or has less noise."
    )


def other_minimum(fit: Estimates) -> Doubt | None:
    """That the response has another minimum, which is about as likely."""
    other = getattr(fit, "other_minimum", None)  # of equations
    if other is None:
        return None
    named = [*zip(fit.param_names, other.tolist(), strict=True)]
    starts = ", ".join([f"{name!r}: mf.Free({x:.4g})" for name, x in named])
    return Doubt(
        f"With {listed([f'{name} = {x:.4g}' for name, x in named])} the response explains the record about "
        "as well: its least squares have two minima, which BIC tells apart by less than strong evidence. If "
        f"you know that the parameters are near those, begin there, params={{{starts}}}; else take a record "
        "that moves more or has less noise.",
        sure=False,
    )


def _mirrored(fit: Estimates, other: NDArray[np.float64], exponents: Sequence[int]) -> str:
    """That the other sign of an exponent makes the same equations, in words."""
    moved = np.abs(other - fit.params) > 1e-9 * np.abs(fit.params)
    names = [f"{n} = {x:.4g}" for n, x, on in zip(fit.param_names, other, moved, strict=True) if on]
    k = next(k for k in exponents if moved[k])
    side = "max" if other[k] < 0 else "min"
    return (
        f"With {listed(names)} the equations are the same: the other sign of {fit.param_names[k]} changes no "
        f"more than factors. To choose it, params={{{fit.param_names[k]!r}: mf.Free({side}=0)}}."
    )


def _open(fit: Estimates, other: NDArray[np.float64]) -> bool:
    """Whether nothing that the user knows speaks against other parameters with the same equations."""
    apart = other - fit.params
    known = isinstance(fit.options.initial_state, str) and np.all(other * fit.params > 0)
    if not known or not np.any(np.abs(apart) > EXCHANGED * fit.spread):
        return False
    return nearer(fit, other) <= 0.0


def nearer(fit: Estimates, other: NDArray[np.float64]) -> float:
    """By how much the estimates are nearer to given starts than others are; 0 where no start tells."""
    layout: Any = fit.layout
    found = 0.0
    for name, own, by in zip(fit.param_names, fit.params, other - fit.params, strict=True):
        given = layout.compiled.free.get(name)
        if given is not None and given.start is not None and abs(by) > 1e-3 * abs(own):
            found += ((own + by - given.start) ** 2 - (own - given.start) ** 2) / by**2
    return found
