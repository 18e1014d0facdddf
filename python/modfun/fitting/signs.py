"""Which of several sets of parameters with the same equations is meant: by signs, and by starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.arrays import F64
from ..equations.equation import Equation
from ..errors import DataError, ModfunError
from ..models.free import Free
from ..results.cures import CLOSE
from ..results.diagnosis import level_ratio
from ..results.estimates import COVARIANCES
from ..results.of_equations import EquationFit
from ..results.twins import nearer
from .restarts import compared

if TYPE_CHECKING:
    from ..equations.symbolic.compiled import Term

__all__ = ["as_begun", "as_written", "positive", "settled", "signed", "signs_open", "starts_choose", "untold"]

TURNED = 2  # parameters below 0, of which one may be a time constant; derivatives of an aircraft are more
EQUAL = 1.01  # ratio of residuals that tells no signs apart
MIRRORED = 1e-3  # relative difference of costs within which searches end at the same minimum


def positive(fit: EquationFit, sought: Callable[..., EquationFit]) -> EquationFit:
    """The fit with positive exponents and factors, where other signs make the same equations.

    `sought(starts, within)`: the fit from there. Exponents with a start keep the sign that it leads to.
    """
    words: Any = fit.layout.formulas.words
    if words["linear"] or not fit.usable:
        return fit
    if not words["signal_slopes"]:
        return _upright(fit, sought)
    from ..equations.symbolic.mirrors import exponents, mirrors

    at = [k for k in exponents(fit.layout.compiled) if words["starts"][k] is None]
    for other in mirrors(fit.layout.compiled, fit.params):
        if np.sum(other[at] < 0) < np.sum(fit.params[at] < 0):
            turned = np.isin(np.arange(other.size), at) & (other > 0)
            if found := _turned(fit, other, turned, sought):
                return found
    return _upright(fit, sought)


def _upright(fit: EquationFit, sought: Callable[..., EquationFit]) -> EquationFit:
    """The fit with fewer parameters below 0, where another set makes the same equations.

    g/L*sin(th - o) is the same with -L and o + pi: searches for the offset of an encoder ended at L < 0 in
    one of eight records, and friction c*tanh(w/v) at c and v below 0 in 7 of 12. Of such sets the one of
    least norm is taken, which has o within half a turn, as it is where no sign changes. A start above 0 tells
    the sign before all others.
    """
    words: Any = fit.layout.formulas.words
    free = untold(words)
    above = np.array([start is not None and start > 0 for start in words["starts"]], dtype=bool)

    def below(x: F64) -> tuple[int, int]:
        return int(np.sum(x[above] < 0)), int(np.sum(x[free] < 0))

    from ..equations.symbolic.mirrors import mirrors
    from ..equations.symbolic.twins import twins, unwound

    compiled = fit.layout.compiled
    if not any(below(fit.params)):
        least = unwound(compiled, fit.params) if words["signal_slopes"] else None
        return fit if least is None else _turned(fit, least, np.zeros(least.size, bool), sought) or fit
    inside = sorted({k for _, k, _ in words["signal_slopes"]})
    every = [*mirrors(compiled, fit.params, inside), *twins(compiled, fit.params)]
    others = [x for x in every if below(x) < below(fit.params)]
    size = np.where(fit.params == 0, 1.0, fit.params)
    for other in sorted(others, key=lambda x: (*below(x), np.linalg.norm(x / size)))[:1]:
        if found := _turned(fit, other, (free | above) & (fit.params < 0) & (other > 0), sought):
            return found
    return fit


def as_begun(fit: EquationFit, sought: Callable[..., EquationFit]) -> EquationFit:
    """The fit whose parameters are nearest to given starts, of those that make the same equations.

    Searches step across from one to the other: r*N*(1 - N/K)*(N/A - 1) begun at A = 20 and K = 100, where
    both are, ended at A = 100 and K = 20 for 4 of 20 records.
    """
    other = min(_twins(fit), key=lambda x: nearer(fit, x), default=fit.params)
    if not nearer(fit, other) < 0:
        return fit
    found = sought(other.tolist(), None, near=True)
    same = found.success and found.cost <= (1 + MIRRORED) * fit.cost
    return found if same and nearer(fit, found.params) < 0 else fit


def starts_choose(fit: EquationFit) -> bool:
    """Whether given starts alone tell the parameters from others that make the same equations."""
    return any([nearer(fit, other) > 0 for other in _twins(fit)])


def _twins(fit: EquationFit) -> list[F64]:
    """Other parameters with the same equations; none where no start is given."""
    words: Any = fit.layout.formulas.words
    if words["linear"] or not fit.usable or all([start is None for start in words["starts"]]):
        return []
    from ..equations.symbolic.twins import twins

    return twins(fit.layout.compiled, fit.params)


def _turned(
    fit: EquationFit, other: F64, turned: Any, sought: Callable[..., EquationFit]
) -> EquationFit | None:
    """The fit that a search from another set finds with some above 0, where it explains as much."""
    words: Any = fit.layout.formulas.words
    pairs = zip(turned, words["bounds"], strict=True)
    within = tuple([(max(low, 0.0) if up else low, high) for up, (low, high) in pairs])
    found = sought(other.tolist(), within)  # with bounds: the search has starts of its own
    return found if found.success and found.cost <= (1 + MIRRORED) * fit.cost else None


def untold(words: Any) -> Any:
    """Which parameters have neither a start nor a lower bound, and may be positive."""
    told = zip(words["starts"], words["bounds"], strict=True)
    return np.array([start is None and low == -inf and high > 0 for start, (low, high) in told], dtype=bool)


def as_written(fit: EquationFit, sought: Callable[..., EquationFit]) -> EquationFit:
    """The fit of saturating terms with positive parameters, where it explains the records about as well.

    Of x' = a + V*x**2/(K**2 + x**2) - d*x the curve of V and d below 0 looks like that of both above over the
    range of many records, and noise chooses. The signs that users write before parameters are then likelier;
    where they told a start or a lower bound, they have told more.
    """
    words: Any = fit.layout.formulas.words
    free = untold(words)
    if not (fit.usable and np.any(free & (fit.params < 0)) and compared(fit.layout.compiled)):
        return fit
    within = tuple(
        (0.0 if is_free else low, high) for is_free, (low, high) in zip(free, words["bounds"], strict=True)
    )
    try:
        found = sought([None] * fit.params.size, within)
    except DataError:  # a band with fewer equations than unknowns
        return fit
    settled = found.success and not found.at_bound and found.lines == fit.lines
    if not settled or not found.bic < fit.bic + CLOSE:
        return fit
    same = abs(found.cost - fit.cost) <= MIRRORED * fit.cost
    return found if same or not fit.bic < found.bic + CLOSE else replace(found, other_signs=fit.params)


def settled(fit: EquationFit, sought: Callable[[Any], EquationFit]) -> EquationFit:
    """The fit with positive parameters where one with a free delay has some below 0 and explains less.

    1/(1 - T s) later by 2T is nearly 1/(1 + T s): beside a free delay a search may end at a time constant
    below 0, as of 3 of 6 records of a heated tank, 25 standard errors off. `sought(structure)`: its fit.
    A gain below 0 is none of these: each search took two thirds of a fit with two delays.
    """
    model, words = fit.structure, fit.layout.formulas.words
    if words["linear"] or not fit.layout.free_delays or not fit.usable or not isinstance(model, Equation):
        return fit
    told = dict(model.params)
    free = [name for name in fit.param_names if name not in told or told[name] == Free()]
    below = [name for name in free if fit[name] < 0 and not _is_gain(name, fit.layout.compiled.terms)]
    for turned in below if len(below) <= TURNED else ():
        within = {n: Free(min=0.0) if n == turned or fit[n] > 0 else Free(max=0.0) for n in free}
        try:
            found = sought(model._like(params=told | within))
        except ModfunError:  # a band with fewer equations than unknowns
            continue
        if found.success and not found.at_bound and level_ratio(found) < level_ratio(fit):
            return replace(found, structure=model, layout=fit.layout)
    return fit


def _is_gain(name: str, terms: Sequence[Term]) -> bool:
    """Whether the other sign of a parameter turns responses over, and moves neither poles nor zeros."""
    import sympy

    own = sympy.Symbol(name, real=True)
    turned: dict[tuple[int, Any], list[tuple[Any, Any]]] = {}
    for term in terms:
        other = term.coefficient.subs(own, -own)
        turned.setdefault((term.equation, term.signal), []).append((term.coefficient, other))
    same = [all(sympy.expand(a - b) == 0 for a, b in both) for both in turned.values()]
    over = [all(sympy.expand(a + b) == 0 for a, b in both) for both in turned.values()]
    return all(a or b for a, b in zip(same, over, strict=True))


def signed(fit: EquationFit) -> EquationFit:
    """The fit with the signs by which its equations follow the first record best.

    A hidden signal under a root is eliminated by squares, which two signs of its factor have in common; with
    one of them the equations run off. Where none does better, as few as possible are negative.
    """
    if not fit.usable or not fit.records:
        return fit
    choices = _choices(fit.layout, fit.params)
    if len(choices) < 2:
        return fit
    choices.sort(key=lambda signs: int(np.sum(signs * fit.params < 0)))
    made = [_with(fit, signs) for signs in choices]
    costs = [_left(one) for one in made]
    if not min(costs) < inf:
        return fit
    return next(one for one, cost in zip(made, costs, strict=True) if cost <= EQUAL * min(costs))


def signs_open(structure: Any, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> bool:
    """Whether equations for these channels leave signs open, so that each record is asked for them."""
    compiled = structure.compiled(outputs, inputs)
    if not compiled.hidden:
        return False
    from ..equations.symbolic.twins import flips

    return bool(flips(compiled, np.sqrt(np.arange(2.0, 2.0 + len(compiled.parameters)))))


def _choices(layout: Any, params: F64) -> list[F64]:
    """Signs that make the same equations without hidden signals, those of the fit among them."""
    same = [np.ones(params.size)]
    if not layout.compiled.hidden:
        return same
    from ..equations.symbolic.twins import flips

    words = layout.formulas.words
    known = {k for k, _, _ in words["priors"]} | {
        k for k, start in enumerate(words["starts"]) if start is not None and start * params[k] > 0
    }
    for signs in flips(layout.compiled, params):
        moved = signs * params
        within = all(low <= x <= high for x, (low, high) in zip(moved, words["bounds"], strict=True))
        if within and not any(signs[k] < 0 for k in known):
            same.append(signs)
    return same


def _with(fit: EquationFit, signs: F64) -> EquationFit:
    """The fit with other signs of its parameters."""
    if np.all(signs > 0):
        return fit
    both = np.outer(signs, signs)
    turned: dict[str, Any] = {name: getattr(fit, name) * both for name in (*COVARIANCES, "gram")}
    return replace(fit, **turned | {"params": fit.params * signs})


def _left(fit: EquationFit) -> float:
    """Root mean square of what the simulated first record leaves, each output in its own size; inf: all."""
    rec = (fit.records or ())[0]
    try:
        simulated, _ = fit.simulate(rec)
    except DataError:
        return inf
    size = np.maximum(np.std(rec.y, axis=1), 1e-300)[:, None]
    return float(np.sqrt(np.nanmean(((rec.y - simulated) / size) ** 2)))
