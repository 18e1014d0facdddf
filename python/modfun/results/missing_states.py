"""States that linear equations lack, where a linear system of more poles leaves only the noise."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.cached import kept
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..models.transfer_function import TransferFunction
from ..records.record import Record
from .cures import ENOUGH, again, bic_beside, on_band
from .diagnosis import level_p, level_ratio
from .doubts import SURE, Doubt
from .estimates import Estimates
from .misfit import misfit

__all__ = ["missing_states"]

MORE = (1, 2)  # states: a roll rate, and a bank angle
LEAST = 3.0  # times the noise, from which one looks


@kept
def missing_states(fit: Estimates) -> Doubt | None:
    """That one or two poles more explain all but the noise, which nothing next to the equations does.

    Noise that was filtered, or drives the system, is left by any number of poles.
    """
    model = fit.structure
    plain = fit.options.noise == "output" and fit.options.initial_state == "unknown"
    linear = isinstance(model, StateSpace | Equation) and model.linear
    if not linear or not plain or fit.again is None or not fit.records or not fit.inputs:
        return None
    if not (level_p(fit) < SURE and level_ratio(fit) > LEAST):
        return None
    if (found := misfit(fit)) and found.sure:
        return None
    records = _with_inputs(fit)
    poles = len(model.states) if isinstance(model, StateSpace) else sum(fit.layout.orders)
    through = isinstance(model, StateSpace) and any(d != 0 for row in model.D for d in row)
    shared = {"denominator": "common"} if len(fit.outputs) > 1 else {}
    for k in MORE:
        count, zeros = poles + k, poles + k - (not through)
        words: dict[str, Any] = {"poles": count, "zeros": zeros, **shared}
        structure = TransferFunction(**words)
        other = again(fit, records, structure, on_band(fit, fit.band))
        if other is None or not other.success or not level_p(other) > ENOUGH:
            continue
        before, after = bic_beside(fit, fit), bic_beside(other, fit)
        if not after < before:
            continue
        told = ", ".join(f"{name}={value!r}" for name, value in words.items())
        return Doubt(
            f"The residuals are {level_ratio(fit):.3g} times the noise, and a linear system of {count} poles "
            f"from {' and '.join(records[0].inputs)} leaves the noise alone, where the equations have "
            f"{poles}: they lack a state, such as a roll rate or a bank angle, or an actuator. First add it; "
            f"compare mf.TransferFunction({told}), with which BIC falls from {before:.4g} to {after:.4g}."
        )
    return None


def _with_inputs(fit: Estimates) -> tuple[Record, ...]:
    """The records with the outputs of the fit, and all inputs that move."""
    given = getattr(fit, "unnamed", ()) or fit.records or ()
    moving = [
        name for name in given[0].inputs if name in fit.inputs or all(np.ptp(rec[name]) > 0 for rec in given)
    ]
    return tuple([rec.select(outputs=list(fit.outputs), inputs=moving) for rec in given])
