"""Doubts about where a sensor stands: an output that shows parts of rates' derivatives besides its own."""

from __future__ import annotations

from ..equations.matrices import state_of
from ..equations.state_space import StateSpace
from .cures import CLOSE, ENOUGH, WORTH, again, bic_beside, on_band
from .diagnosis import level_p
from .doubts import SURE, Doubt, noise_free
from .estimates import Estimates
from .held_numbers import factor_beside
from .lags import EXTRA
from .misfit import UNLIKELY
from .neighbours import FARTHEST, of_levers, rates_of, with_levers
from .shifts import Lever, likeliest_lever, likeliest_shift

__all__ = ["off_centre"]

ACROSS = 10.0  # times the likeliest lever: how long may be another one of the same sensor, at right angles


def off_centre(fit: Estimates) -> Doubt | None:
    """That an accelerometer seems to stand away from the centre of gravity, by a score test of each lever."""
    model = fit.structure
    felt = _felt(model) if isinstance(model, StateSpace) else {}
    lever = likeliest_lever(fit, [(y, rate) for y, rates in felt.items() for rate in rates])
    if lever is None or lever.p_value > UNLIKELY or noise_free(fit) is not None or fit.again is None:
        return None
    told = (
        f"{lever.output} shows {lever.length:.3g} ± {lever.error:.2g} times {lever.rate}' besides what the "
        f"equations say, as an accelerometer does that is away from the centre of gravity "
        f"(p = {lever.p_value:.1g})."
    )
    if not lever.p_value < SURE:
        return Doubt(f"{told} First look where it is mounted.", sure=False)
    shift = likeliest_shift(fit)
    if shift and (shift.late / shift.error) ** 2 > (lever.length / lever.error) ** 2 + CLOSE:
        return None
    others = [rate for rate in felt[lever.output] if rate != lever.rate]
    for rates in ([lever.rate], [lever.rate, *others])[: 1 + bool(others)]:
        found = _with(fit, lever, rates)
        if found is not None:
            return Doubt(f"{told} First try {found}")
    return None


def _with(fit: Estimates, lever: Lever, rates: list[str]) -> str | None:
    """What levers of these rates do, where they leave the noise alone and nothing that is simpler does."""
    model, y = fit.structure, lever.output
    rows = [fit.outputs.index(rate) for rate in rates]
    states = [j for k in rows if (j := state_of(model.C[k], model.D[k])) is not None]
    bounds = [abs(lever.length) * (FARTHEST if rate == lever.rate else ACROSS) for rate in rates]
    changed = with_levers(model, model.outputs.index(y), states, bounds)
    other = again(fit, fit.records, changed, on_band(fit, fit.band))
    names = [name for name in other.param_names if name.startswith(EXTRA)] if other else []
    if other is None or not {*names}.isdisjoint(other.at_bound) or not level_p(other) > ENOUGH:
        return None
    before, after, factor = bic_beside(fit, fit), bic_beside(other, fit), factor_beside(fit)
    if not after < before - WORTH or (factor is not None and factor.after < after - CLOSE):
        return None
    words = of_levers(y, rates, [f"{other[name]:.3g}" for name in names], bounds)
    return f"{words}: BIC falls from {before:.4g} to {after:.4g}."


def _felt(model: StateSpace) -> dict[str, list[str]]:
    """Outputs that are no states, each with the rates that are measured."""
    states = [state_of(c, d) for c, d in zip(model.C, model.D, strict=True)]
    rates = [y for y, j in zip(model.outputs, states, strict=True) if j in rates_of(model)]
    return {y: rates for y, j in zip(model.outputs, states, strict=True) if j is None}
