"""Slow noise that drives a system inside a loop, such as wind on an aircraft with an autopilot."""

from __future__ import annotations

from math import log

from ..base.cached import kept
from ..base.names import series
from ..models.transfer_function import TransferFunction
from .coloured_load import coloured_load, in_coloured_noise
from .cures import WORTH, again, bic_beside, furthest, on_band
from .diagnosis import growth, level_p
from .doubts import Doubt, noise_free
from .estimates import Estimates
from .feedback import Feedback, way_back
from .fitted_samples import fitted, stationary
from .misfit import bends_in_loop, too_large
from .next_structures import best_cure

__all__ = ["COMMAND", "command_of", "driven_loop"]

# Standard errors of the likelier fit, by which it moves a parameter at least. In 100 altitude holds in gusts
# estimates were off by more in 98, and in 40 in coloured noise; in one open loop under little noise a smooth
# input looked like a loop, and estimates moved by between one and two.
FAR = 2.0
WORDS = {"output": "in white noise", "coloured": 'with noise="coloured"', "process": 'with noise="process"'}
COMMAND = "r"  # of a loop, as messages name it


@kept
def driven_loop(fit: Estimates) -> Doubt | None:
    """That an input counters noise which drives the system, by a fit with noise="process".

    White noise of the outputs has no slow part, and weights by the spectrum alone take what comes back
    through the loop for a response. With the noise through the poles of the system, estimates are those of
    prediction errors, which hold in a loop. Where they are the likelier on one band, and far from the fit's,
    the input that follows innovations is no smooth one that tells what comes.
    """
    noise = fit.options.noise
    if noise not in ("output", "coloured") or fit.options.reference or fit.options.output_weights is not None:
        return None
    if not isinstance(fit.structure, TransferFunction) or fit.again is None or not _even(fit):
        return None
    if noise == "output" and (not too_large(level_p(fit)) or noise_free(fit) is not None):
        return None
    loop = way_back(fit)
    if loop is None or (noise == "output" and bends_in_loop(fit)):
        return None
    fits = _on_one_band(fit)
    if noise not in fits or len(fits) == 1:
        return None
    best = min(fits, key=lambda word: _bic(fits[word]))
    other = fits[best]
    if simple := _too_simple(fit, fits, other, loop):
        return simple
    if _bic(other) > _bic(fits[noise]) - WORTH or not other.success or coloured_load(other):
        return None
    name, was, now, far = furthest(fit, other)
    if fit.success and far < FAR:
        return None
    told = (
        f"{loop.channel} follows earlier innovations of {loop.output} (p = {loop.p_value:.1g}): a loop feeds "
        "back a slow disturbance"
    )
    if turned := _turned(fit, other, loop):
        return Doubt(
            f'{told}, or what the structure lacks: noise="{best}" is likelier (BIC on one band is '
            f"{_listed(fits)}), but {turned}. First try another number of poles or a delay, "
            f"select_order.{_commanded(fit)}",
            sure=True,
        )
    low, high = other.band  # in fewer lines of coloured noise what comes back does not cancel
    over = f", band=({low:.4g}, {high:.4g})" if best == "coloured" else ""
    than = _listed({word: one for word, one in fits.items() if word != best})
    return Doubt(
        f'{told}, as that of wind on an aircraft with an autopilot. First try noise="{best}"{over}: BIC on '
        f"one band is {_bic(other):.5g}, against {than}, and {name} becomes "
        f"{now} (was {was}).{_commanded(fit)}",
        sure=True,
    )


def _too_simple(fit: Estimates, fits: dict[str, Estimates], other: Estimates, loop: Feedback) -> Doubt | None:
    """That a structure next to the fitted one does better in white noise than this one in any noise.

    In a loop what a pole or a delay would explain comes back, too, as a slow disturbance does. Noise of any
    spectrum then takes the response for its own: of roll rates without the lag of the motors it turned the
    sign of the gain. Structures are compared in white noise, as in coloured noise zeros enough explain a
    record by the inverse of the controller.
    """
    white = fit.options.replace(noise="output")
    plain = fit if fit.options.noise == "output" else again(fit, fit.records, fit.structure, white)
    cure = best_cure(plain, plain.outputs.index(loop.output), loop.channel) if plain else None
    if cure is None or cure.fit is None or "output" not in fits:
        return None
    on_lines = on_band(fit, other.band).replace(noise="output", trend=cure.fit.trend)
    wider = again(fit, cure.fit.records, cure.fit.structure, on_lines)
    if wider is None or not (after := bic_beside(wider, fits["output"])) < _bic(other) - WORTH:
        return None
    return Doubt(
        f"Part of the response of {loop.output} to {loop.channel} is missing, and a loop feeds it back (p = "
        f"{loop.p_value:.1g}). First try {cure.words}: BIC on one band is {after:.5g} in white noise, and "
        f"without it {_listed(fits)}.",
        sure=True,
    )


def _listed(fits: dict[str, Estimates]) -> str:
    """BIC of fits of one structure, with their noise."""
    return series([f"{_bic(one):.5g} {WORDS[word]}" for word, one in fits.items()])


def _turned(fit: Estimates, other: Estimates, loop: Feedback) -> str:
    """What another noise does to a response that it should only weigh otherwise, in words; "" if nothing."""
    if growth(other) > 0 >= growth(fit):
        return "makes a pole unstable"
    i, j = fit.outputs.index(loop.output), fit.inputs.index(loop.channel)
    (own, error), (now, spread) = (_at_rest(one, i, j) for one in (fit, other))
    if not abs(own) > FAR * error:
        return ""
    if own * now < 0:
        return f"turns the sign of the gain of {loop.channel}"
    return "" if abs(now) > FAR * spread else f"leaves next to nothing of the gain of {loop.channel}"


def _at_rest(fit: Estimates, i: int, j: int) -> tuple[float, float]:
    """The coefficient with the sign of a path's gain at rest, or of what it integrates; its error."""
    layout = fit.layout
    at = layout.places[1][i][j] + (layout.numerators[i][j] or 0)
    place = layout.positions[at]
    error = 0.0 if place is None else float(fit.spread[place])
    return float(layout.coefficients(fit.params)[at]), error


def _on_one_band(fit: Estimates) -> dict[str, Estimates]:
    """Fits by their noise, on the band of that in process noise, or where that is refused, in coloured noise.

    What is refused is left out: noise drives transfer functions of one output without free delays only.
    """
    records, fits = fit.records or (), {}
    driven = again(fit, records, fit.structure, fit.options.replace(noise="process", method="ml"))
    if driven is not None and driven.success:
        fits["process"] = driven
    base = fits.get("process") or in_coloured_noise(fit)
    if base is None:
        return {}
    for word in ("output", "coloured"):
        options = on_band(fit, base.band).replace(noise=word)
        if (other := again(fit, records, fit.structure, options)) is not None:
            fits[word] = other
    return fits


def _bic(fit: Estimates) -> float:
    """BIC, in process noise with its second level."""
    return fit.bic + log(fit.df_resid) * (fit.options.noise == "process")


def command_of(fit: Estimates) -> str:
    """The channel that a record keeps as the command of its loop; "" where none is that for sure."""
    commands = fit.records[0].kept if fit.records else ()
    return COMMAND if COMMAND in commands else commands[0] if len(commands) == 1 else ""


def _commanded(fit: Estimates) -> str:
    """That the command of the loop is a reference in coloured noise, where such a fit settles."""
    name = command_of(fit)
    if not name:
        return ""
    options = fit.options.replace(reference=(name,), noise="coloured", initial_state="unknown")
    other = again(fit, fit.records or (), fit.structure, options)
    if other is None or not other.success:
        return ""
    return f' Or take the command of the loop, reference="{name}" with noise="coloured", whatever the noise.'


def _even(fit: Estimates) -> bool:
    return stationary(fit) and all(rec.dt is not None for rec in fitted(fit))
