"""How a drift is written beside a constant: as a trend, or in the equation that has a free one of its own."""

from __future__ import annotations

from typing import Any

from ..equations.equation import Equation
from ..models.free import Free
from .estimates import Estimates
from .lags import EXTRA

__all__ = ["DRIFT", "drift_beside", "has_constant", "is_drift"]

DRIFT = 'trend="linear"'  # words of that cure
WRITTEN = "a drift of the constant"  # how those of an equation begin


def has_constant(fit: Estimates) -> bool:
    """Whether an equation has a free constant, beside which a trend is the same column twice."""
    model, layout = fit.structure, fit.layout
    if not isinstance(model, Equation) or fit.trend is not None or model.hidden or len(model.texts) != 1:
        return False
    return EXTRA not in fit.param_names and bool(getattr(layout, "constants", ()))


def drift_beside(fit: Estimates) -> tuple[str, Any, str | None]:
    """A drift in words with {} for its size, the structure that has it, and the trend beside it.

    A constant of an equation may be what a user asks for (trim, ambient temperature), so that it stays.
    """
    model = fit.structure
    if not has_constant(fit) or not isinstance(model, Equation):
        return DRIFT, model, "linear"
    name = next(name for name in ("drift", "drift_rate", "drift_of_constant") if name not in fit.param_names)
    text = f"{model.texts[0]} + {EXTRA}*t"
    shown = text.replace(f"{EXTRA}*t", f"{name}*t")
    more = f', outputs="{fit.outputs[0]}", inputs={list(fit.inputs)}'
    words = f'{WRITTEN}, mf.Equation("{shown}"{more}) ({name} = {{}})'
    return words, model._like(text=[text], params=dict(model.params) | {EXTRA: Free()}), None


def is_drift(words: str) -> bool:
    """Whether a cure in these words is a drift."""
    return words == DRIFT or words.startswith(WRITTEN)
