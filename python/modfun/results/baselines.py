"""Laws that nothing drives, whose sensor has an offset: what a constant in their equations is taken for."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.cached import kept
from ..equations.equation import Equation
from ..errors import ModfunError
from ..models.free import Free
from .cures import CLOSE, WORTH, again, bic_beside, on_band
from .doubts import Doubt
from .estimates import Estimates
from .lags import EXTRA, unused
from .neighbours import with_offset

__all__ = ["apart", "as_written", "curved", "taken_for_constant", "undriven", "with_written"]

FAR = 5.0  # standard errors between estimates with an offset and with a constant, by the larger of their own


def undriven(fit: Estimates) -> bool:
    """Whether a law is nonlinear and nothing drives it: it has no trim, and its form is often a guess."""
    model = fit.structure
    return isinstance(model, Equation) and not (model.linear or model.inputs or model.hidden)


def constants(model: Equation) -> list[str]:
    """Names of parameters for a constant in each equation."""
    if len(model.texts) == 1:
        return [unused("m", model)]
    return [unused(f"m{k + 1}", model) for k in range(len(model.texts))]


def curved(fit: Estimates) -> bool:
    """Whether such a law is nonlinear in its outputs, where a constant is no offset of theirs."""
    layout: Any = fit.layout
    return undriven(fit) and not layout.compiled.is_linear


@kept
def with_written(fit: Estimates) -> Estimates | None:
    """The fit of an undriven law with a constant written into each equation, in the place of a trend.

    A trend is a constant beside what was fitted. An equation that was multiplied by its denominators has
    none there: of Michaelis and Menten's law with an inflow of 0.3, V was 26 errors too small in 9 of 10.
    """
    model, records = fit.structure, fit.records or ()
    if not isinstance(model, Equation) or fit.again is None or len(records) != 1:
        return None  # of several records each has a trend of its own
    names = constants(model)
    texts = [f"{own} + {name}" for own, name in zip(model.texts, names, strict=True)]
    try:
        other = model._like(text=texts, params={**dict(model.params), **{name: Free() for name in names}})
    except ModfunError:
        return None
    made = again(fit, records, other, on_band(fit, (0.0, fit.band[1])).replace(trend=None))
    return made if made is not None and made.success and {*names} <= {*made.param_names} else None


def apart(fit: Estimates, one: Estimates, other: Estimates) -> tuple[str, str, str, float]:
    """The parameter of a fit that two others have furthest apart: name, both values, errors between them."""
    rows = [[own.param_names.index(name) for name in fit.param_names] for own in (one, other)]
    values, errors = [
        [own[at] for own, at in zip(kind, rows, strict=True)]
        for kind in ((one.params, other.params), (one.spread, other.spread))
    ]
    far = np.abs(values[0] - values[1]) / np.where((larger := np.fmax(*errors)) > 0, larger, np.inf)
    at = int(np.argmax(far))
    shown = [f"{own[at]:.4g} ± {se[at]:.2g}" for own, se in zip(values, errors, strict=True)]
    return fit.param_names[at], shown[0], shown[1], float(far[at])


def as_written(fit: Estimates, other: Estimates) -> str:
    """How the constants of another fit are written: "+ m (m = 0.3)"."""
    names = [name for name in other.param_names if name not in fit.param_names]
    return " and ".join([f"+ {name} ({name} = {other[name]:.4g})" for name in names]) or 'trend="constant"'


@kept
def taken_for_constant(fit: Estimates) -> Doubt | None:
    """That a trend stands for the offset of an output that enters a law nonlinearly, with other estimates."""
    if fit.trend != "constant" or not fit.success or not curved(fit) or fit.again is None:
        return None
    before, options = bic_beside(fit, fit), on_band(fit, (0.0, fit.band[1])).replace(trend=None)
    offset, best, written = None, before + CLOSE, with_written(fit)
    for y, structure, _ in with_offset(fit.structure):
        other = again(fit, fit.records or (), structure, options)
        if other is None or not other.success or EXTRA not in other.param_names:
            continue
        if (after := bic_beside(other, fit)) < best:
            offset, best = (y, other), after
    if written is not None and not bic_beside(written, fit) < before + CLOSE:
        written = None
    others = [other for other in (offset and offset[1], written) if other is not None]
    if not any(apart(fit, fit, other)[-1] > FAR for other in others):
        return None
    # With 2 degrees of freedom 5 errors are little: the record has to contradict the law without both, too.
    without = again(fit, fit.records or (), fit.structure, options)
    least = min(bic_beside(other, fit) for other in others)
    if without is not None and without.success and not least < bic_beside(without, fit) - WORTH:
        return None
    told = 'trend="constant" is a constant in the equation as it is fitted'
    if offset is None:
        name, here, there, _ = apart(fit, fit, others[0])
        return Doubt(
            f"{told}, which was multiplied before, as explain() shows. Write the constant, "
            f"{as_written(fit, others[0])}, without a trend: {name} is {there}, here {here}."
        )
    (y, other), c = offset, unused("c", fit.structure)
    name, here, there, _ = apart(fit, fit, other)
    told += (
        f", and no offset of {y}, which does not enter linearly. If the sensor may have an offset, write "
        f'({y} - {c}) for {y}, params={{"{c}": mf.Free(0)}}, without a trend: {c} = {other[EXTRA]:.4g}, '
        f"{name} is {there}, here {here}, and BIC is {best:.4g}, here {before:.4g}."
    )
    if written is not None:
        name, there, inflow, _ = apart(fit, other, written)
        told += (
            f" If the process has a constant inflow, write it, {as_written(fit, written)}, which explains as "
            f"much: {name} is {inflow}, and {there} with the offset."
        )
    return Doubt(told)
