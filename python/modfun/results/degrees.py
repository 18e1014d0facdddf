"""Angles in degrees where equations take their sine: those whose unit says so, and those that seem to be."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..base.names import listed
from ..base.units import scale
from ..errors import SpecError
from ..language.parser import Node
from .cures import ENOUGH, again, on_band
from .diagnosis import level_p, level_ratio
from .doubts import SURE, Doubt, pieces
from .estimates import Estimates

__all__ = ["in_degrees"]

TURN = 2.0  # an angle in radians is seldom beyond, and one in degrees always
UNSEEN, CLEAR = 2.0, 10.0  # standard errors of a parameter from zero: of none, and without a doubt
MORE = 1.2  # times the residuals that a fit with clear parameters may leave


def in_degrees(fit: Estimates) -> Doubt | None:
    """That equations take sine, cosine or tangent of channels that are not in rad."""
    angles = _angles(fit)
    found = {name: call for name, call in angles.items() if _other_angle(fit, name)}
    if found:
        calls = [f"{call}() of {name}, which is in {fit.units[name]}" for name, call in found.items()]
        new = ", ".join(f"{name}='rad'" for name in found)
        return Doubt(f"The equations take {listed(calls)}. First try rec.convert({new}).")
    return _undeclared(fit, {name: call for name, call in angles.items() if name not in fit.units})


def _angles(fit: Estimates) -> dict[str, str]:
    """Channels that stand in a sine, cosine or tangent, with one of these."""
    found: dict[str, str] = {}
    for _, call in pieces(fit):
        if call.kind == "call" and call.value in ("sin", "cos", "tan"):
            found |= dict.fromkeys(_addends(call.parts[0]), call.value)
    return found


def _addends(node: Node) -> list[str]:
    """Names that are terms of a sum, without a factor that may turn degrees into radians."""
    if node.kind in ("sum", "negative"):
        return [name for part in node.parts for name in _addends(part)]
    return [node.value] if node.kind == "name" and not node.primes else []


def _other_angle(fit: Estimates, name: str) -> bool:
    """Whether a channel is an angle in another unit than rad."""
    try:
        return scale("fit", fit.units.get(name, ""), "rad").factor != 1
    except SpecError:  # no angle
        return False


def _undeclared(fit: Estimates, angles: dict[str, str]) -> Doubt | None:
    """That angles without a unit are large numbers, with which the fit goes wrong, and not as degrees.

    A sine of degrees goes round many times, and so does the search: it fails, or ends where the equation
    follows the noise.
    """
    records = fit.records or ()
    measured = [name for name in angles if records and all(name in rec for rec in records)]
    tops = {name: max(np.abs(rec[name]).max() for rec in records) for name in measured}
    names = [name for name, top in tops.items() if top > TURN]
    if not names or fit.again is None:
        return None
    options = (on_band(fit, fit.band) if fit.usable else fit.options).replace(trend=fit.trend)
    names += _rates(fit, names)
    turned = []
    for rec in records:
        rows: dict[str, Any] = {name: np.deg2rad(rec[name]) for name in names}
        turned.append(rec.assign(**rows))
    other = again(fit, tuple(turned), fit.structure, options)
    if other is None or not other.success:
        return None
    noise_alone = ENOUGH < level_p(other) < 1 - SURE
    if not (noise_alone or _comes_clear(fit, other)):
        return None
    if fit.success and ENOUGH < level_p(fit) < 1 - ENOUGH:
        return None
    left = "only the noise is left" if noise_alone else "every parameter is many standard errors from zero"
    code = ", ".join(f"{name}=np.deg2rad(rec[{name!r}])" for name in names)
    calls = [f"{angles[name]}() of {name}, which goes to {tops[name]:.4g}" for name in names if name in tops]
    return Doubt(
        f"The equations take {listed(calls)}: with {'these' if len(names) > 1 else 'this'} read as degrees "
        f"{left}. First give radians, rec.assign({code})."
    )


def _rates(fit: Estimates, names: list[str]) -> list[str]:
    """Outputs without a unit that equations say to be the rates of these, th' = w."""
    found = [
        match[1]
        for text in fit.structure.texts
        for name in names
        if (match := re.fullmatch(rf"\s*{re.escape(name)}'\s*=\s*(\w+)\s*", text))
    ]
    return [name for name in found if name in fit.outputs and name not in fit.units and name not in names]


def _comes_clear(fit: Estimates, other: Estimates) -> bool:
    """Whether all parameters are far from zero in another fit that leaves no more, where one here is not."""
    with np.errstate(all="ignore"):
        here, there = (float(np.min(np.abs(one.params / one.spread))) for one in (fit, other))
    return not here > UNSEEN and there > CLEAR and level_ratio(other) < MORE * level_ratio(fit)
