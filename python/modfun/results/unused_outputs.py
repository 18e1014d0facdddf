"""Outputs of a record that linear equations do not use, where these explain the residuals: missing states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..base.cached import kept
from ..base.names import series
from ..equations.equation import Equation
from ..equations.state_space import StateSpace
from ..errors import ModfunError
from ..models.free import Free
from ..records.record import Record
from .cures import WORTH, Cure, again, bic_beside, convincing, furthest, on_band
from .diagnosis import level_p, level_ratio
from .doubts import SURE, Doubt
from .driven_equations import driven
from .estimates import Estimates

__all__ = ["unused_output"]

EXTRA = "extra_"  # names of the parameters of one channel more
MOST = 8  # channels that are tried together


@kept
def unused_output(fit: Estimates) -> Doubt | None:
    """That motions which the record has explain residuals beyond doubt, once they enter each equation.

    A roll rate and a bank angle move a dutch roll, whose equations of sideslip and yaw rate alone leave them
    out. As inputs they stand for whatever equations they have.
    """
    given, model = getattr(fit, "unnamed", ()), fit.structure
    linear = isinstance(model, StateSpace | Equation) and model.linear
    if not given or not linear or fit.again is None or not fit.usable or not level_p(fit) < SURE:
        return None
    if any(rec.mask is not None or rec.sigma is not None or rec.functions for rec in given):
        return None
    known = {*fit.outputs, *model.inputs, *model.all_parameters, *getattr(model, "states", ())}
    known |= {*getattr(model, "hidden", ())}
    motions = [name for name in given[0].outputs if name not in known]
    every = [*motions, *(name for name in given[0].inputs if name not in known)]
    if not motions or len(every) > MOST:
        return None
    before, options = bic_beside(fit, fit), on_band(fit, fit.band)
    cures: list[tuple[float, list[str], Cure]] = []
    # An input that moved has to pay beside the motions.
    for names, least in _groups(motions, every):
        records = tuple([_as_inputs(rec, fit.outputs, model.inputs, names) for rec in given])
        structure = _driven_by(model, names)
        other = again(fit, records, structure, options) if structure is not None else None
        if other is not None and other.success:
            cure = Cure("", before, bic_beside(other, fit), level_p(other), other)
            cures += [(cure.after + least, names, cure)] if convincing(fit, cure) else []
    if not cures:
        return None
    _, names, cure = min(cures, key=lambda own: own[0])
    if cure.fit is None:
        return None
    if set(names) <= set(motions) and driven(fit) is not None:
        return None  # an accelerometer holds the turbulence that moves it, and is no cause
    name, was, now, _ = furthest(fit, cure.fit)
    one = len(names) == 1
    they, them, inputs = ("it explains", "it", "an input") if one else ("they explain", "them", "inputs")
    return Doubt(
        f"The residuals are {level_ratio(fit):.3g} times the noise. The record has {series(names)}, "
        f"the model has not, and {they} most of that. As {inputs} of each equation, BIC falls from "
        f"{cure.before:.4g} to {cure.after:.4g}, and {name} becomes {now} (was {was}). First write {them} "
        f"into the model, as {'a state or an input' if one else 'states or inputs'}."
    )


def _groups(motions: list[str], every: list[str]) -> Iterator[tuple[list[str], float]]:
    """Channels that are tried together, and by how much more BIC has to fall with them."""
    for name in motions:
        yield [name], 0.0
    if len(motions) > 1:
        yield motions, 0.0
    if len(every) > len(motions):
        yield every, WORTH


def _as_inputs(rec: Record, outputs: Sequence[str], inputs: Sequence[str], names: Sequence[str]) -> Record:
    """The record with these outputs alone, and other channels behind its inputs; motions are smooth."""
    form = dict(zip(rec.inputs, rec.intersample, strict=True))
    channels = [*(name for name in rec.inputs if name in inputs), *names]
    return rec._like(
        y=np.array([rec[name] for name in outputs]),
        u=np.array([rec[name] for name in channels]),
        outputs=tuple(outputs),
        inputs=tuple(channels),
        intersample=tuple(form.get(name, "smooth") for name in channels),
    )


def _driven_by(model: Any, names: Sequence[str]) -> Any:
    """The model with these inputs more, each with a coefficient of its own in each equation."""
    count = len(names)
    try:
        if isinstance(model, StateSpace):
            b = [[*row, *(f"{EXTRA}{i}_{k}" for k in range(count))] for i, row in enumerate(model.B)]
            d = [[*row, *([0] * count)] for row in model.D]
            delay = [*model.delay, *([0.0] * count)]
            return model._like(B=b, D=d, inputs=[*model.inputs, *names], delay=delay)
        factors = [[f"{EXTRA}{i}_{k}" for k in range(count)] for i in range(len(model.texts))]
        texts = [
            " + ".join([own, *(f"{factor}*{name}" for factor, name in zip(row, names, strict=True))])
            for own, row in zip(model.texts, factors, strict=True)
        ]
        params = {**dict(model.params), **{factor: Free() for row in factors for factor in row}}
        return model._like(text=texts, inputs=[*model.inputs, *names], params=params)
    except ModfunError:  # a channel with the name of a function, say
        return None
