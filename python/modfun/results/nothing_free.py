"""Equations of which every parameter is held at a number, as if it were a start value."""

from __future__ import annotations

from ..base.names import listed
from ..models.free import Free
from .diagnosis import level_p
from .doubts import Doubt
from .estimates import Estimates
from .misfit import too_large

__all__ = ["nothing_free"]


def nothing_free(fit: Estimates) -> Doubt | None:
    """That nothing was estimated, since numbers hold all parameters, and the record contradicts these."""
    if fit.layout.rational or fit.param_names or not too_large(level_p(fit)):
        return None
    given = dict(fit.structure.params)
    held = {name: value for name, value in given.items() if not isinstance(value, Free)}
    if not held:
        return None
    starts = ", ".join(f'"{name}": mf.Free({value:.15g})' for name, value in held.items())
    return Doubt(
        f"Nothing was estimated: params= fixes every parameter ({listed(list(held))}), and the record "
        f"contradicts these values (p = {level_p(fit):.2g}). A number in params= fixes a parameter; write a "
        f"start value as mf.Free(...). If these are start values, give params={{{starts}}}."
    )
