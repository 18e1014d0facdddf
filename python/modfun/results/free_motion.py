"""Whether free motion is that of an equation which is not linear: periods that change with the amplitude."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import exp, expm1, isfinite, log, pi

import numpy as np

from ..base.cached import kept
from ..base.student import student_p
from ..equations.equation import Equation
from ..errors import ModfunError
from ..models.free import Free
from ..models.transfer_function import TransferFunction
from .cures import CLOSE, ENOUGH, WORTH, Cure, again, bic_beside, on_band, with_drift
from .diagnosis import level_p
from .doubts import SURE, Doubt
from .drifting import has_constant
from .estimates import Estimates
from .lags import EXTRA
from .next_structures import best_cure

__all__ = ["bent", "settled_motion"]


SAID = 1e-3  # p-value below which `check` speaks
SOFTEST, HARDEST = -0.8, 3.0  # cube times the square of the amplitude over the stiffness of the linear fit


@dataclass(frozen=True)
class _Bent:
    """An equation which is not linear, as a cure, and the p-value of what it explains more."""

    cure: Cure
    p_value: float


def bent(fit: Estimates) -> Doubt | None:
    """That a linear equation does not hold for the amplitudes of a free motion, and which one does.

    Tests of residual lines miss it: those of a motion that gets out of step are no powers of the fitted one.
    """
    found = _nonlinear(fit)
    if found is None or not found.p_value < SAID:
        return None
    cure, y = found.cure, fit.outputs[0]
    # Other modes, and a drift, look alike in a short record.
    rivals = [best_cure(fit, 0, None), with_drift(fit) if fit.trend != "linear" else None]
    drift = rivals[1] if has_constant(fit) else None
    if drift is not None and drift.after < min(cure.after + CLOSE, drift.before - WORTH):
        # The offset of an equation moves more often than its stiffness bends.
        text = (
            f"The constant of the equation of {y} drifts over the record. First try {drift.words}: BIC falls"
        )
        settled = drift.level_p > ENOUGH
        return Doubt(
            f"{text} from {drift.before:.4g} to {drift.after:.4g}.", sure=found.p_value < SURE and settled
        )
    if any(one is not None and one.after < cure.after - CLOSE for one in rivals):
        return None
    # Where the motion is, coloured noise may be stronger than elsewhere.
    halved = cure.before - cure.after > (fit.df_resid + fit.params.size) * log(2)
    return Doubt(
        f"The motion of {y} is not that of a linear equation at these amplitudes (p = {found.p_value:.1g}). "
        f"First try {cure.words}: BIC falls from {cure.before:.4g} to {cure.after:.4g}.",
        sure=found.p_value < SURE and (cure.level_p > ENOUGH or halved),
    )


def settled_motion(fit: Estimates) -> float:
    """The probability of the residuals that the sine of the output or a cube leaves; 0 without either."""
    found = _nonlinear(fit)
    return found.cure.level_p if found else 0.0


@kept
def _nonlinear(fit: Estimates) -> _Bent | None:
    """The sine of the output or a cube beside it, whichever lowers BIC more."""
    alone = len(fit.outputs) == len(fit.row_names) == 1 and not fit.inputs
    if fit.again is None or not fit.records or not alone or fit.df_resid < 3 or fit.layout.orders[0] < 2:
        return None
    before, rows, found = bic_beside(fit, fit), fit.df_resid + fit.params.size, list[_Bent]()
    for text in _texts(fit):
        other = _fitted(fit, text)
        if other is None:
            continue
        after = bic_beside(other, fit)
        if EXTRA in other.param_names:
            if _of_noise(fit, other[EXTRA]):
                continue
            p = max(_cost_p(before - after + log(rows), rows, fit.df_resid - 1), _of_estimate(other))
        else:
            p = exp(min(after - before, 0.0) / 2)  # as many parameters: the odds
        found.append(_Bent(_cure(fit, text, other, before, after), p))
    best = min(found, key=lambda one: one.cure.after, default=None)
    # Of two that fit about as well the first, the sine, which has a parameter less.
    return next((one for one in found if one.cure.after < best.cure.after + CLOSE), None) if best else None


def _texts(fit: Estimates) -> Iterator[str]:
    """The equation that was fitted with a sine, and with a cube."""
    y, model = fit.outputs[0], fit.structure
    if isinstance(model, TransferFunction):
        n = fit.layout.orders[0]
        terms = [f"{name}*{y}" + "'" * (n - k) for k, name in enumerate(fit.param_names, 1)]
        text = " + ".join([y + "'" * n, *terms]) + " = 0"
        if len(terms) != n or model.params:
            return
    elif isinstance(model, Equation) and len(model.texts) == 1 and not model.hidden:
        text = model.texts[0]
    else:
        return
    left, _, right = text.partition("=")
    records = fit.records or ()
    plain = re.search(r"\w\(|\*\*|\^", text) is None
    angle = all(rec.units.get(y, "rad") in ("", "rad") and np.max(np.abs(rec[y])) < pi for rec in records)
    if plain and angle:
        yield re.sub(rf"(?<![\w.]){re.escape(y)}(?![\w'])", f"sin({y})", text)
    yield f"{left.strip()} + {EXTRA}*{y}**3 = {right.strip()}"


def _fitted(fit: Estimates, text: str) -> Estimates | None:
    """The fit of an equation to the same lines; None where it has no answer."""
    model = fit.structure
    params = dict(model.params) | ({EXTRA: Free()} if EXTRA in text else {})
    try:
        if isinstance(model, Equation):
            structure = model._like(text=[text], params=params)
        else:
            structure = Equation(text, outputs=fit.outputs[0], params=params)
    except ModfunError:  # an output whose name is none in equations, say
        return None
    other = again(fit, fit.records, structure, on_band(fit, fit.band))
    return other if other is not None and isfinite(bic_beside(other, fit)) else None


def _of_noise(fit: Estimates, cube: float) -> bool:
    """Whether a cube is one that noise makes, not a spring.

    Of y = A cos(wt) + n with slow noise n the cube holds 3/2 A² n, so that -2/3 k/A² cancels the noise.
    """
    if not fit.has_poles:
        return False
    stiffness = float(np.prod(np.abs(fit.model.poles())))
    most = max(float(np.max(np.abs(rec.y - rec.y.mean()))) for rec in fit.records or ())
    return not SOFTEST < cube * most**2 / stiffness < HARDEST


def _cure(fit: Estimates, text: str, other: Estimates, before: float, after: float) -> Cure:
    """That equation, in words."""
    if EXTRA not in text:
        words = f'mf.Equation("{text}", outputs="{fit.outputs[0]}")'
    else:
        words = f'a cube, mf.Equation("{text.replace(EXTRA, "cube")}", outputs="{fit.outputs[0]}") '
        words += f"(cube = {other[EXTRA]:.3g})"
    return Cure(words, before, after, level_p(other))


def _cost_p(fall: float, rows: int, left: int) -> float:
    """The p-value by F of one parameter that lowers rows*log(cost) by so much."""
    from scipy.special import fdtrc

    return float(fdtrc(1, left, left * expm1(max(fall, 0.0) / rows)))


def _of_estimate(fit: Estimates) -> float:
    """The same of its estimate and error, which allows for noise that is stronger where the motion is."""
    error = float(fit.bse[fit.param_names.index(EXTRA)])
    return float(student_p(fit[EXTRA] / error, fit.df_resid)) if error > 0 else 1.0
