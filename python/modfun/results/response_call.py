"""The call that fits the response of equations itself, with the options of a fit that change it."""

from __future__ import annotations

from typing import Any

from .estimates import Estimates

__all__ = ["output_error_call"]


def output_error_call(fit: Estimates, model: str = "model", start: str = "dict(fit.params)") -> str:
    """Python text of an output error that begins and drifts as the fit was told, without its record.

    From a free state in the place of no drug, or without the offset, it ends elsewhere. What inputs do
    between samples the record holds. A constant in nonlinear equations is no offset of the outputs.
    """
    structure: Any = fit.structure
    words = [model]
    if start:
        words.append(f"start={start}")
    told = fit.options.initial_state
    if isinstance(told, str) and told == "zero":
        words.append('initial_state="zero"')
    if fit.trend and (fit.layout.rational or structure.compiled(fit.outputs, fit.inputs).is_linear):
        words.append(f'trend="{fit.trend}"')
    return f"mf.rivals.output_error({', '.join(words)})"
