"""Where fits of equations like a fitted one begin, and whether they take long."""

from __future__ import annotations

from typing import Any

from ..equations.equation import Equation
from ..equations.layout import layout_of
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..records.forms import forms_of
from .diagnosis import level_ratio
from .estimates import Estimates
from .lags import EXTRA
from .sample_levels import beside_samples

__all__ = ["AWAY", "has_model", "lengthy", "ran_away", "starts_beside"]

AWAY = 3.0  # times the noise level of the high band: a level of noise that ran away, or another model
LENGTHY = 1000  # operations per sample, of formulas that take half a second to fit


def lengthy(fit: Estimates) -> bool:
    """Whether fits of equations like the fit's take so long that dozens are made only where one is missed."""
    formulas = getattr(fit.layout, "formulas", None)  # of equations
    return formulas is not None and len(formulas.words["formulas"][0]) > LENGTHY


def has_model(fit: Estimates) -> bool:
    """Whether a state space has matrices at its estimates: 1/lag has no value at 0."""
    try:
        return not isinstance(fit.structure, StateSpace) or fit.model is not None
    except ModfunError:
        return False


def ran_away(fit: Estimates) -> bool:
    """Whether a fit leaves so much more than the high band's noise that its search is none to begin from.

    Noise beside uneven neighbours says nothing of a search: sums over few such samples leave many times it.
    """
    return not beside_samples(fit) and level_ratio(fit) > AWAY


def starts_beside(fit: Estimates, structure: Any) -> dict[str, Any]:
    """The estimates as `starts` of equations that need a search; none of a delay, whose minima are many.

    A search from afar took up to a hundred times as long, for each of some thirty terms. `near` besides:
    whether no other starts are tried, as beside estimates of the same equations that leave little but noise.
    """
    if not hasattr(fit.layout, "formulas") or not isinstance(structure, Equation):
        return {}
    if not fit.usable:
        return {}
    if any([f"(t - {EXTRA})" in text for text in structure.texts]):
        return {}
    layout = layout_of(structure, fit.options, fit.outputs, fit.inputs, forms_of(fit.records or ()))
    if layout.formulas.words["linear"]:
        return {}
    own, told = dict(zip(fit.param_names, fit.params.tolist(), strict=True)), dict(structure.params)
    names = structure.param_names(fit.inputs, fit.outputs)
    starts = [own.get(name, _first(told.get(name))) for name in names]
    same = isinstance(fit.structure, Equation) and structure.texts == fit.structure.texts
    near = same and {*names} <= {*own} and fit.success and not fit.at_bound and not ran_away(fit)
    return {"starts": starts, "near": near}


def _first(told: Any) -> float:
    """Where the search of a parameter begins that the fit has not: at its start, or as near 0 as may be."""
    return min(max(told.start or 0.0, told.min), told.max) if isinstance(told, Free) else 0.0
