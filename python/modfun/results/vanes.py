"""Sensors of states that are measured directly: a vane off the reference point, or in the upwash."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

from ..base.cached import kept
from ..equations.matrices import state_of
from ..equations.state_space import StateSpace
from ..models.free import Free
from .cures import CLOSE, again, bic_beside, on_band
from .doubts import Doubt
from .estimates import Estimates
from .lags import EXTRA
from .neighbours import rates_of

__all__ = ["Vane", "of_sensors", "vane"]

SIGMAS = 4.0  # standard errors of a lever that is one
SHORTER = 0.8  # of a lever: up to there another one is looked for
EVEN = 2.0  # difference of BIC below which two are equally good (Kass and Raftery, 1995)


@dataclass(frozen=True)
class Vane:
    """An output that shows `lever` times a rate besides its state, with BIC so."""

    output: str
    rate: str
    lever: float
    error: float
    after: float

    @property
    def seen(self) -> str:
        """What was seen of it."""
        return f"{self.output} shows {self.lever:.3g} ± {self.error:.2g} times {self.rate} besides its state"

    @property
    def cure(self) -> str:
        """How that is written."""
        return (
            f"write a parameter in the row of {self.output} and the column of {self.rate} in C, of a vane x "
            "ahead it is x/U in size, and give the states other names than the outputs"
        )


@kept
def vane(fit: Estimates) -> Vane | None:
    """The lever of an angle's sensor that explains the records best, by a fit with each; None if none does.

    A vane ahead of the centre of gravity moves with the turning aircraft, and shows alpha - x*q/U.
    """
    model = fit.structure
    if not isinstance(model, StateSpace) or fit.again is None or EXTRA in model.all_parameters:
        return None
    shown = [state_of(c, d) for c, d in zip(model.C, model.D, strict=True)]
    rates, found = rates_of(model), list[Vane]()
    options = (on_band(fit, fit.band) if fit.usable else fit.options).replace(trend=fit.trend)
    # Angles that are no integral of one rate alone, as attitudes are, whose sensors feel no speed.
    angles = [i for i, j in enumerate(shown) if j is not None and j not in rates and _moves(model, j)]
    for i, j in ((i, j) for i in angles for j in rates if j in shown):
        most = inf
        # Often two levers explain the same: the shorter one is likelier.
        for _ in range(2):
            other = again(fit, fit.records, _with(model, i, j, most), options)
            if other is None or not other.success or EXTRA in other.at_bound:
                break
            lever, error = float(other[EXTRA]), float(other.bse[other.param_names.index(EXTRA)])
            if abs(lever) > SIGMAS * error > 0:
                rate = model.outputs[shown.index(j)]
                found.append(Vane(model.outputs[i], rate, lever, error, bic_beside(other, fit)))
            most = SHORTER * abs(lever)
    best = min([one.after for one in found], default=inf)
    return min(
        [one for one in found if one.after < best + EVEN], key=lambda one: abs(one.lever), default=None
    )


def _moves(model: StateSpace, j: int) -> bool:
    """Whether forces move a state: its equation has parameters."""
    return any(isinstance(own, str) for own in (*model.A[j], *model.B[j]))


def _with(model: StateSpace, i: int, j: int, most: float) -> StateSpace:
    """Output i with a part of state j, up to `most` times it; states take names of their own."""
    c: list[list[Any]] = [list(row) for row in model.C]
    c[i][j] = EXTRA
    states = [f"{x}_itself" if x in model.outputs else x for x in model.states]
    lever = Free(0.0, min=-most, max=most) if most < inf else Free(0.0)
    return model._like(C=c, states=states, params={**dict(model.params), EXTRA: lever})


def of_sensors(
    fit: Estimates, seen: str, output: str, factors: Sequence[tuple[str, float]], after: float, fallen: str
) -> Doubt | None:
    """That the sensor of an angle explains what a number in its equation seems to be off by, or more.

    `seen`: of the number; `factors`: of channels, which explain as much; `after`: BIC with a parameter for
    the number; `fallen`: that in words. All have derivatives of their own, so that what the record does not
    tell apart is named together.
    """
    found = vane(fit)
    if found is not None and found.after < after - CLOSE:
        return Doubt(
            f"A sensor seems to be off the reference point: {found.seen}, as a vane does. First {found.cure}"
            f": BIC falls from {bic_beside(fit, fit):.4g} to {found.after:.4g}. A parameter in the place of "
            f"the number ({after:.4g}) would give other derivatives."
        )
    ways = [
        f"a factor of {size:.4g} in {name}{', as of a vane in the upwash' if name == output else ''}, "
        f"rec.assign({name}=rec[{name!r}]/{size:.4g})"
        for name, size in factors
    ]
    if found is not None and found.after < after + CLOSE:
        ways.append(f"{found.seen}, as a vane off the reference point: {found.cure}")
    if not ways:
        return None
    return Doubt(
        f"A number in the equations contradicts the record, or a sensor is off: {seen}. The record does not "
        f"tell these apart, whose derivatives differ: {'; '.join(ways)}; a parameter in the place of the "
        f"number. First see where the sensor of {output} is and how the channels are calibrated.{fallen}"
    )
