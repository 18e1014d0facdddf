"""Parameters of equations that ran off: the record determines no more than a limit without them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.cached import kept
from ..equations.equation import Equation
from ..errors import ModfunError
from .cures import again, bic_beside, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .estimates import Estimates

if TYPE_CHECKING:
    from ..equations.symbolic.limits import Limit

__all__ = ["runaway"]

VAGUE = 0.4  # standard error over estimate, from which a parameter may be anything beyond it


@kept
def runaway(fit: Estimates) -> Doubt | None:
    """That a parameter inside a function ran off, and the limit without it fits as well."""
    model = fit.structure
    if not isinstance(model, Equation) or fit.again is None or fit.records is None:
        return None
    with np.errstate(all="ignore"):
        # The classical errors, which cost nothing: those that count uneven noise simulate the record.
        vague = np.sqrt(np.diag(fit.cov_nonrobust)) > VAGUE * np.abs(fit.params)
    if not np.all(np.isfinite(fit.params)) or not (np.any(vague) or not fit.success):
        return None
    return _found(fit, model, [name for name, on in zip(fit.param_names, vague, strict=True) if on])


def _found(fit: Estimates, model: Equation, vague: Sequence[str]) -> Doubt | None:
    from ..equations.symbolic.limits import bends, limits

    layout: Any = fit.layout
    names = [name for name in (vague if fit.success else fit.param_names) if bends(layout.compiled, name)]
    best, found = bic_beside(fit, fit), None
    for name in names:
        for limit in limits(layout.compiled, name, -1 if fit[name] < 0 else 1):
            held = {own: given for own, given in model.params if own not in limit.lost}
            try:
                made = model._like(text=limit.texts, params=held, outputs=model.outputs, inputs=model.inputs)
            except ModfunError:  # a signal is in the limit no more
                continue
            other = again(fit, fit.records, made, on_band(fit, fit.band))
            if other is None or not other.success or bic_beside(other, fit) > best:
                continue
            # Beside a search that failed any limit looks well: that it fits the record is asked of it.
            if fit.success or not level_p(other) < SURE:
                best, found = bic_beside(other, fit), (name, limit, other)
    if found is not None:
        return _told(fit, *found)
    open_ended = [name for name in names if name in vague]
    return (
        None
        if fit.success or not open_ended
        else Doubt(
            f"The record does not determine {_values(fit, open_ended)}: the search for its minimum ran off. "
            f"First hold {open_ended[0]}, params={{{open_ended[0]!r}: ...}}, leave its term out, or record "
            "larger amplitudes.",
            sure=not level_p(fit) < SURE,
        )
    )


def _told(fit: Estimates, name: str, limit: Limit, other: Estimates) -> Doubt:
    """What the record determines, and the limit as the first cure."""
    gone = [name, *(one for one in limit.lost if one != name)]
    ratios = " and ".join(f"{what} = {_values(other, [q], bare=True)}" for q, what in limit.ratios.items())
    seen = f"only determines {ratios}" if ratios else "only determines the limit"
    text = repr(limit.texts[0] if len(limit.texts) == 1 else list(limit.texts))
    where = "".join(f", {q} for {what}" for q, what in limit.ratios.items())
    more = "larger amplitudes" if limit.large else "more samples where its term changes"
    return Doubt(
        f"{name} {'grows beyond all bounds' if limit.to == 'infinity' else 'goes to 0'} "
        f"({_values(fit, gone)}): the record {seen}, and without {name} the equation fits as well (BIC "
        f"{bic_beside(other, fit):.4g} against {bic_beside(fit, fit):.4g}). First fit the limit, "
        f"mf.Equation({text}){where}; or hold {name}, or record {more}.",
        sure=not level_p(other) < SURE,
    )


def _values(fit: Estimates, names: Sequence[str], *, bare: bool = False) -> str:
    """Estimates with their standard errors."""
    at = [fit.param_names.index(name) for name in names]
    texts = [f"{fit.params[k]:.4g} ± {fit.bse[k]:.2g}" for k in at]
    return ", ".join(texts if bare else [f"{n} = {text}" for n, text in zip(names, texts, strict=True)])
