"""Inputs of a record that equations do not name, where these explain the residuals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ..base.cached import kept
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..records.record import Record
from .cures import Cure, again, bic_beside, convincing, on_band
from .diagnosis import level_p, level_ratio
from .doubts import Doubt
from .estimates import Estimates
from .misfit import LEVEL, suspicious

__all__ = ["missing_input"]

EXTRA = "extra_"  # names of the parameters of one input more


@kept
def missing_input(fit: Estimates) -> Doubt | None:
    """That an input which the record has explains residuals, once it enters each equation."""
    given = getattr(fit, "unnamed", ())
    if not given or fit.again is None:
        return None
    if not fit.usable:
        return _of_failure(fit, given)
    if not suspicious(fit):
        return None
    before, options = bic_beside(fit, fit), on_band(fit, fit.band)
    made = ((name, again(fit, given, own, options)) for name, own in _with_one_more(fit.structure, given[0]))
    cures = [
        Cure(name, before, bic_beside(other, fit), level_p(other))
        for name, other in made
        if other is not None and other.success
    ]
    cure = min((one for one in cures if convincing(fit, one)), key=lambda one: one.after, default=None)
    if cure is None:
        return None
    return Doubt(
        f"Input {cure.words!r} is in the record and not in the model, and explains most of the residuals: "
        f"with it in each equation, BIC falls from {cure.before:.4g} to {cure.after:.4g}. First write it "
        "into the model."
    )


def _of_failure(fit: Estimates, given: Any) -> Doubt | None:
    """The same where there is no estimate without it, and residuals at the noise level with it."""
    for name, own in _with_one_more(fit.structure, given[0]):
        other = again(fit, given, own, fit.options)
        if other is not None and other.success and level_ratio(other) < LEVEL:
            return Doubt(
                f"Input {name!r} is in the record and not in the model: without it the search ends without "
                "an estimate, and with it in each equation the residuals are those of noise. First write it "
                "into the model."
            )
    return None


def _with_one_more(model: Any, rec: Record) -> Iterator[tuple[str, Any]]:
    """The model with one more input of the record, with a coefficient of its own in each equation."""
    for name in rec.inputs:
        if name in model.inputs:
            continue
        try:
            if isinstance(model, StateSpace):
                b = [[*row, f"{EXTRA}{i}"] for i, row in enumerate(model.B)]
                d = [[*row, 0] for row in model.D]
                yield name, model._like(B=b, D=d, inputs=[*model.inputs, name], delay=[*model.delay, 0.0])
            elif isinstance(model, Equation):
                extra = {f"{EXTRA}{i}": Free() for i in range(len(model.texts))}
                params, inputs = {**dict(model.params), **extra}, [*model.inputs, name]
                for beside in _beside(model):
                    texts = [
                        f"{own} + {factor}*{name}{times}"
                        for own, factor, times in zip(model.texts, extra, beside, strict=True)
                    ]
                    yield name, model._like(text=texts, inputs=inputs, params=params)
        except ModfunError:  # a channel with the name of a parameter, say
            continue


def _beside(model: Equation) -> Iterator[list[str]]:
    """What an input may stand beside in each equation: nothing, or the output, as a harvest by its prey."""
    yield [""] * len(model.texts)
    if not model.linear and len(model.texts) == len(model.outputs):
        yield [f"*{y}" for y in model.outputs]
